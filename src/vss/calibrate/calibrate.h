// A whole calibration job: from calibration.toml to camera files, calibration.json and report.html.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/output_folder.h"
#include "vss/base/progress.h"
#include "vss/calibrate/calibration_file.h"
#include "vss/calibrate/intrinsic.h"

namespace vss {

struct CameraCalibration {
  Camera camera;  // with its quality
  std::optional<IntrinsicResult> lens;
  TargetSpec target;
  std::optional<CubeResult> place;
};

struct Calibration {
  std::string name;
  std::vector<CameraCalibration> cameras;
  std::optional<GantryAxes> axes;
  Gantry gantry;
  std::vector<std::string> warnings;  // of all cameras
};

// Reads every picture of the job and calibrates. The first thing that cannot work is the error.
Result<Calibration> Calibrate(const CalibrationJob& job, const CalibrationOptions& options, int threads,
                              const Progress& progress);

std::string CalibrationToJson(const Calibration& calibration);
std::string CalibrationToHtml(const Calibration& calibration);

// cameras/ID.toml, calibration.json and report.html.
void AddCalibration(const Calibration& calibration, OutputFolder& out);
// The same, written to `folder`: all of it or, where the disk fails, nothing.
Status WriteCalibration(const Calibration& calibration, const std::filesystem::path& folder);

}  // namespace vss
