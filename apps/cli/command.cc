#include "command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <nlohmann/json.hpp>

namespace vss::cli {
namespace {

std::vector<void (*)(CLI::App&, Common&)>& Commands() {
  static std::vector<void (*)(CLI::App&, Common&)> commands;
  return commands;
}

int exit_code = 0;
bool json_errors = false;
std::atomic<bool> interrupted = false;

int ExitCode(ErrorCode code) { return code == ErrorCode::kUsage ? 2 : code == ErrorCode::kInternal ? 3 : 1; }

// The first Ctrl-C asks the work to stop; the second one ends the program at once.
void OnInterrupt(int signal) {
  if (interrupted.exchange(true)) _exit(128 + signal);
}

// Prints progress: `kind` is "bar", "plain" or "json". Calls may come from any thread.
class ProgressPrinter {
 public:
  explicit ProgressPrinter(std::string kind) : kind_(std::move(kind)) {}

  void Report(std::string_view step, int done, int total) {
    const std::lock_guard lock(mutex_);
    if (kind_ == "json")
      PrintJson(step, done, total);
    else if (kind_ == "bar")
      PrintBar(step, done, total);
    else
      PrintPlain(step, done, total);
  }

 private:
  static void PrintJson(std::string_view step, int done, int total) {
    const nlohmann::ordered_json line = {{"step", step}, {"done", done}, {"total", total}};
    std::fprintf(stderr, "%s\n", line.dump().c_str());
  }

  static void PrintBar(std::string_view step, int done, int total) {
    constexpr int kWidth = 32;
    const int filled = total > 0 ? kWidth * done / total : kWidth;
    std::string bar(static_cast<std::size_t>(filled), '#');
    bar.resize(kWidth, '.');
    const std::string line =
        fmt::format("\r{:<12} [{}] {}/{}\x1b[K{}", step, bar, done, total, done >= total ? "\n" : "");
    std::fputs(line.c_str(), stderr);
    std::fflush(stderr);
  }

  // A line a step begun, at each tenth, and at its end.
  void PrintPlain(std::string_view step, int done, int total) {
    const int tenth = total > 0 ? 10 * done / total : 10;
    if (step == step_ && tenth == tenth_) return;
    step_ = step;
    tenth_ = tenth;
    std::fprintf(stderr, "%s\n", fmt::format("{}: {} of {}", step, done, total).c_str());
  }

  std::mutex mutex_;
  std::string kind_, step_;
  int tenth_ = -1;
};

}  // namespace

Registration::Registration(void (*add)(CLI::App&, Common&)) { Commands().push_back(add); }

void Finish(const Status& status) {
  if (status) return;
  exit_code = ExitCode(status.error().code);
  std::fprintf(stderr, "vss: %s\n", status.error().message.c_str());
  if (!json_errors) return;
  const nlohmann::ordered_json line = {{"error", status.error().message}, {"exit_code", exit_code}};
  std::printf("%s\n", line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

Progress MakeProgress(const Common& common) {
  std::signal(SIGINT, OnInterrupt);
  std::signal(SIGTERM, OnInterrupt);
  Progress progress;
  progress.cancel = &interrupted;
  if (common.progress == "none") return progress;
  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  const std::string kind = common.progress == "auto" ? (terminal ? "bar" : "plain") : common.progress;
  auto printer = std::make_shared<ProgressPrinter>(kind);
  progress.report = [printer](std::string_view step, int done, int total) {
    printer->Report(step, done, total);
  };
  return progress;
}

Result<std::vector<std::pair<std::string, double>>> ParseSettings(const std::vector<std::string>& settings) {
  std::vector<std::pair<std::string, double>> out;
  for (const auto& setting : settings) {
    const auto equals = setting.find('=');
    if (equals == std::string::npos || equals == 0)
      return UsageError("--set {}: write it as NAME=VALUE, such as lines.min_length_px=20", setting);
    const std::string text = setting.substr(equals + 1);
    char* end = nullptr;
    double value = std::strtod(text.c_str(), &end);
    if (text == "true" || text == "false")
      value = text == "true";
    else if (text.empty() || *end != '\0' || !std::isfinite(value))
      return UsageError("--set {}: \"{}\" is not a number", setting, text);
    out.emplace_back(setting.substr(0, equals), value);
  }
  return out;
}

int Run(CLI::App& app, int argc, char** argv) {
  static Common common;
  app.add_option("--threads", common.threads, "Threads to use; 0: as many as the machine has")
      ->check(CLI::Range(0, 1024));
  app.add_flag("--json", common.json, "Machine-readable output");
  app.add_option("--progress", common.progress,
                 "How to tell of progress: auto (a bar on a terminal, lines elsewhere), plain, json or none")
      ->check(CLI::IsMember({"auto", "plain", "json", "none"}));
  app.fallthrough();
  app.footer("Exit codes: 0 done, 1 the input's fault or stopped, 2 wrong usage, 3 a fault of the program.");
  for (auto add : Commands()) add(app, common);
  app.parse_complete_callback([] { json_errors = common.json; });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "vss: out of memory; give it smaller pictures, fewer of them, or more memory\n");
    return 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "vss: internal error: %s\n", e.what());
    return 3;
  }
  return exit_code;
}

}  // namespace vss::cli
