// vss calibrate: boards and cubes in, camera files and a report out.
#include <cstdio>

#include "command.h"
#include "vss/calibrate/calibrate.h"

namespace vss::cli {
namespace {

struct Arguments {
  std::string job, out, model = "weng";
};

void PrintSummary(const Calibration& calibration, const std::string& out) {
  for (const auto& c : calibration.cameras) {
    if (c.lens)
      for (const auto& sentence : c.lens->findings) std::printf("%s\n", sentence.c_str());
    if (c.lens && !c.lens->next_view.empty())
      std::printf("Camera %s: %s\n", c.camera.id.c_str(), c.lens->next_view.c_str());
    if (c.place)
      for (const auto& sentence : c.place->findings) std::printf("%s\n", sentence.c_str());
  }
  if (calibration.axes) {
    for (const auto& sentence : calibration.axes->findings) std::printf("%s\n", sentence.c_str());
    std::printf("The axes stand in the camera files, and surveys with these cameras use them.\n");
  }
  for (const auto& warning : calibration.warnings) std::fprintf(stderr, "warning: %s\n", warning.c_str());
  std::printf("Written: %s\n", out.c_str());
}

Status RunCalibrate(const Arguments& arguments, const Common& common) {
  CalibrationOptions options;
  options.opencv = arguments.model == "opencv";
  VSS_ASSIGN(const auto settings, ParseSettings(common.set));
  for (const auto& [name, value] : settings) {
    VSS_ASSIGN(const bool known, SetParameter(CalibrationParameters(), name, value, options));
    if (!known) return UsageError("--set {}: calibration has no such parameter; see vss parameters", name);
  }
  VSS_ASSIGN(const CalibrationJob job, ReadCalibrationJob(arguments.job));
  VSS_ASSIGN(OutputFolder out, OutputFolder::Open(arguments.out));
  VSS_ASSIGN(const Calibration calibration, Calibrate(job, options, common.threads, MakeProgress(common)));
  AddCalibration(calibration, out);
  VSS_RETURN_IF_ERROR(out.Commit());
  if (common.json)
    std::printf("%s", CalibrationToJson(calibration).c_str());
  else
    PrintSummary(calibration, arguments.out);
  return {};
}

void AddCalibrate(CLI::App& app, Common& common) {
  auto* command = app.add_subcommand(
      "calibrate", "Calibrates the cameras of a rig from pictures of a board and of a cube");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("DIR", arguments->job, "Folder with calibration.toml, or the file")->required();
  command
      ->add_option("-o,--out", arguments->out, "Folder for cameras/*.toml, calibration.json and report.html")
      ->required();
  command->add_option("--model", arguments->model, "Lens model of the camera files")
      ->check(CLI::IsMember({"weng", "opencv"}))
      ->capture_default_str();
  command->add_option("--set", common.set,
                      "NAME=VALUE: a parameter of calibration, e.g. calibrate.outlier_sigmas=5");
  command->callback([arguments, &common] { Finish(RunCalibrate(*arguments, common)); });
}

const Registration registration(AddCalibrate);

}  // namespace
}  // namespace vss::cli
