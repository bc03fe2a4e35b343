// vss station DIR: the operator's page on a survey.
#include <atomic>
#include <csignal>
#include <cstdio>

#include "command.h"
#include "station/station.h"

namespace vss::cli {
namespace {

std::atomic<bool> stop{false};
void OnSignal(int) { stop = true; }

void AddStation(CLI::App& app, Common& common) {
  static station::StationOptions options;
  static std::string folder, product;
  auto* command = app.add_subcommand("station", "Open the operator's page on a survey: check, correct and finish it in a browser");
  command->add_option("DIR", folder, "The survey's folder")->required();
  command->add_option("--listen", options.listen, "Address to listen on; anything but loopback demands --token-file")->capture_default_str();
  command->add_option("--port", options.port, "Port; 0: a free one")->check(CLI::Range(0, 65535))->capture_default_str();
  command->add_option("--token-file", options.token_file, "File with the token that the page's address must carry (chmod 600)");
  command->add_option("--product", product, "product.json of `vss survey` to begin with");
  command->callback([&common] {
    options.folder = folder;
    options.product = product;
    options.threads = common.threads;
    std::signal(SIGINT, OnSignal);
    std::signal(SIGTERM, OnSignal);
    Finish(station::RunStation(options, [](const std::string& url) {
      std::printf("The station is open: %s%s\nStop it with Ctrl+C; every edit is saved already.\n", url.c_str(), options.token_file.empty() ? "" : "?token=(the token)");
      std::fflush(stdout);
    }, stop));
  });
}

const Registration registration(AddStation);

}  // namespace
}  // namespace vss::cli
