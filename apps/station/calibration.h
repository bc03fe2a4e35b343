// Calibration from the page: which jobs there are, what came out, and the survey with the cameras that came
// out.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "part_json.h"
#include "vss/calibrate/calibrate.h"
#include "vss/survey/survey.h"

namespace vss::station {

struct CalibrationJobFile {
  std::string name;  // relative to the survey's folder: "rig/calibration.toml", "../rig-1/calibration.toml"
  std::filesystem::path path;
};

// The calibration.toml files in the survey's folder, in the folders in it, and in those beside it; by name. A
// link that leads elsewhere is left out.
std::vector<CalibrationJobFile> FindCalibrationJobs(const std::filesystem::path& survey_folder);

// What is kept of a calibration: {"job", "model", "findings", "warnings", "cameras": [{"id", "residual_px",
// "views", "placed"}], "files": {id: camera file}, "report": HTML, "json": calibration.json}.
Json JsonOf(const Calibration& calibration, const std::string& job, const std::string& model);
// The same without what is only taken along: for the page.
Json WithoutFiles(Json calibration);

// The survey of `folder` with the camera files `files` ({id: text}) in the place of those of the same id; the
// others stay. Errors: none of them is a camera of the survey; what ReadSurvey says of them.
Result<Survey> SurveyWithCameras(const Survey& present, const Json& files);

}  // namespace vss::station
