// One calibration job, format vss-calibration/1.
#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vss/calibrate/cube.h"
#include "vss/camera/camera.h"
#include "vss/feature/marks.h"

namespace vss {

// A board picture; the gantry's place where the job gives it (a board that stands still while the gantry
// moves).
struct BoardFile {
  std::string name;  // as the job names it
  std::filesystem::path path;
  std::optional<Eigen::Vector3d> gantry_mm;
};

struct IntrinsicJob {
  std::string camera;
  Eigen::Vector2d pixel_pitch_mm = Eigen::Vector2d::Zero();  // zero: not given
  TargetSpec target;
  bool bow = false;  // the board is known not to be flat
  Response response = Response::kLinear;
  std::vector<BoardFile> images;
  std::map<std::string, std::string> about;  // date, serial, lens, aperture, where given
};

struct ExtrinsicJob {
  std::string camera;
  CubeSpec cube;
  std::optional<Eigen::Vector3d> camera_near_mm;
  std::optional<std::filesystem::path> camera_file;  // a lens that is calibrated already
  std::vector<BoardFile> images;                     // each with its gantry_mm
  std::string where;                                 // FILE:LINE, for messages
};

struct CalibrationJob {
  std::string name;
  std::vector<IntrinsicJob> intrinsic;
  std::vector<ExtrinsicJob> extrinsic;
  Gantry gantry;
  bool calibrate_axes = false;
};

// `folder`/calibration.toml, or the file itself. Errors name file, line and remedy; every picture named
// exists.
Result<CalibrationJob> ReadCalibrationJob(const std::filesystem::path& folder_or_file);

// "discs", "checkerboard", "charuco"
Result<TargetPattern> PatternNamed(const std::string& name);

}  // namespace vss
