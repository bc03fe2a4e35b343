// How a command joins the program: each file of this folder defines one and registers it with a Registration.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vss/base/progress.h"
#include "vss/base/result.h"

namespace vss::cli {

// What every command shares.
struct Common {
  int threads = 0;  // 0: as many as the machine has
  bool json = false;
  std::string progress = "auto";  // "auto", "plain", "json" or "none"
  std::vector<std::string> set;   // NAME=VALUE
};

// Adds the command to `app`; returns nothing. Its callback stores the outcome with Finish.
struct Registration {
  explicit Registration(void (*add)(CLI::App& app, Common& common));
};

// Called by a command's callback: how it went. An error is printed as one sentence and decides the exit code.
void Finish(const Status& status);

// Tells of progress on stderr, as `common.progress` says: a bar on a terminal, plain lines elsewhere; Ctrl-C
// cancels.
Progress MakeProgress(const Common& common);

// The NAME=VALUE pairs of --set. true and false count as 1 and 0.
Result<std::vector<std::pair<std::string, double>>> ParseSettings(const std::vector<std::string>& settings);

// Parses and runs; returns the exit code: 0 done, 1 the input's fault, 2 usage, 3 our fault.
int Run(CLI::App& app, int argc, char** argv);

}  // namespace vss::cli
