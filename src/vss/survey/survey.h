// A survey: pictures, cameras, gantry, knowledge; and the steps from it to product definition data, in their
// order.
#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/progress.h"
#include "vss/camera/camera.h"
#include "vss/feature/line_image.h"
#include "vss/knowledge/object_model.h"
#include "vss/product/product.h"

namespace vss {

struct SurveyImage {
  std::string file;  // as the survey file names it
  std::filesystem::path path;
  int camera = 0;                            // index into Survey::cameras
  RigidTransform cam_from_world;             // of this exposure
  std::optional<Eigen::Vector3d> gantry_mm;  // where the carriage stood; empty for a hand-held picture
};

struct Survey {
  std::string name;
  std::filesystem::path folder;
  std::vector<Camera> cameras;
  Gantry gantry;
  std::vector<SurveyImage> images;
  std::vector<std::string> knowledge;        // names and files; empty: everything shipped
  std::map<std::string, double> parameters;  // [parameters]
  std::vector<std::string> warnings;         // of the cameras' calibrations
};

// Format vss-survey/1: `folder`/survey.toml (or the file itself). `cameras_folder`: take the cameras from
// there by id. Checks everything that can be checked without decoding pixels, the pictures' sizes included.
Result<Survey> ReadSurvey(const std::filesystem::path& folder_or_file,
                          const std::optional<std::filesystem::path>& cameras_folder = std::nullopt);

}  // namespace vss
