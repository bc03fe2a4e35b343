#include "command.h"

#include <cstdio>
#include <vector>

namespace vss::cli {
namespace {
std::vector<void (*)(CLI::App&, Common&)>& Commands() {
  static std::vector<void (*)(CLI::App&, Common&)> commands;
  return commands;
}
int exit_code = 0;
}  // namespace

Registration::Registration(void (*add)(CLI::App&, Common&)) { Commands().push_back(add); }

void Finish(const Status& status) {
  if (status) return;
  std::fprintf(stderr, "vss: %s\n", status.error().message.c_str());
  exit_code = status.error().code == ErrorCode::kUsage ? 2 : status.error().code == ErrorCode::kInternal ? 3 : 1;
}

int Run(CLI::App& app, int argc, char** argv) {
  static Common common;
  app.add_option("--threads", common.threads, "Threads to use; 0: as many as the machine has")->check(CLI::Range(0, 1024));
  app.add_flag("--json", common.json, "Machine-readable output");
  app.fallthrough();
  for (auto add : Commands()) add(app, common);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "vss: internal error: %s\n", e.what());
    return 3;
  }
  return exit_code;
}

}  // namespace vss::cli
