// How a command joins the program: each file of this folder defines one and registers it with a Registration.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>

#include "vss/base/result.h"

namespace vss::cli {

// What every command shares.
struct Common {
  int threads = 0;     // 0: as many as the machine has
  bool json = false;
  std::vector<std::string> set;  // NAME=VALUE
};

// Adds the command to `app`; returns nothing. Its callback stores the outcome with Finish.
struct Registration {
  explicit Registration(void (*add)(CLI::App& app, Common& common));
};

// Called by a command's callback: how it went. An error is printed as one sentence and decides the exit code.
void Finish(const Status& status);

// Parses and runs; returns the exit code: 0 done, 1 the input's fault, 2 usage, 3 our fault.
int Run(CLI::App& app, int argc, char** argv);

}  // namespace vss::cli
