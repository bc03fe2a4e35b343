#include <CLI/CLI.hpp>

#include "command.h"

int main(int argc, char** argv) {
  CLI::App app{"VSS, the Vision Survey System: from pictures of a steel workpiece to product definition data."};
  app.set_version_flag("--version", VSS_VERSION);
  app.require_subcommand(1);
  return vss::cli::Run(app, argc, argv);
}
