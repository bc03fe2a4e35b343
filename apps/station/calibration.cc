#include "calibration.h"

#include <algorithm>
#include <cstdlib>
#include <set>

#include "vss/base/files.h"

namespace vss::station {
namespace {
namespace fs = std::filesystem;

constexpr const char* kJobFile = "calibration.toml";

std::vector<fs::path> FoldersIn(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code ec;
  for (auto at = fs::directory_iterator(folder, fs::directory_options::skip_permission_denied, ec);
       !ec && at != fs::directory_iterator(); at.increment(ec))
    if (std::error_code not_there; at->is_directory(not_there)) folders.push_back(at->path());
  return folders;
}

bool Below(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end();
}

// A folder of its own that goes with the object.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "vss-station-XXXXXX").string();
    if (const char* made = ::mkdtemp(name.data())) path_ = made;
  }
  ~ScratchFolder() {
    std::error_code ec;
    if (!path_.empty()) fs::remove_all(path_, ec);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

std::string Replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = text.find(what); at != text.npos; at = text.find(what, at + with.size()))
    text.replace(at, what.size(), with);
  return text;
}

std::string ListOf(const std::set<std::string>& ids) {
  std::string list;
  for (const auto& id : ids) list += (list.empty() ? "" : ", ") + id;
  return list;
}

}  // namespace

std::vector<CalibrationJobFile> FindCalibrationJobs(const fs::path& survey_folder) {
  std::error_code ec;
  const fs::path folder = fs::canonical(survey_folder, ec);
  if (ec) return {};
  std::vector<fs::path> places = FoldersIn(folder);
  places.push_back(folder);
  for (auto& beside : FoldersIn(folder.parent_path())) places.push_back(std::move(beside));
  std::vector<CalibrationJobFile> jobs;
  for (const auto& place : places) {
    const fs::path file = fs::canonical(place / kJobFile, ec);
    if (ec || !fs::is_regular_file(file, ec) || !Below(file, folder.parent_path())) continue;
    const std::string name = (place / kJobFile).lexically_relative(folder).string();
    if (std::none_of(jobs.begin(), jobs.end(), [&](const auto& j) { return j.path == file; }))
      jobs.push_back({name, file});
  }
  // The survey's own jobs before those beside it.
  auto order = [](const CalibrationJobFile& job) { return std::pair(job.name.starts_with("../"), job.name); };
  std::sort(jobs.begin(), jobs.end(), [&](const auto& a, const auto& b) { return order(a) < order(b); });
  return jobs;
}

Json JsonOf(const Calibration& calibration, const std::string& job, const std::string& model) {
  Json findings = Json::array(), cameras = Json::array(), files = Json::object();
  for (const auto& c : calibration.cameras) {
    const std::string& id = c.camera.id;
    if (c.lens)
      for (const auto& sentence : c.lens->findings) findings.push_back(sentence);
    if (c.lens && !c.lens->next_view.empty())
      findings.push_back(fmt::format("Camera {}: {}", id, c.lens->next_view));
    if (c.place)
      for (const auto& sentence : c.place->findings) findings.push_back(sentence);
    const auto& q = c.camera.quality;
    cameras.push_back({{"id", id},
                       {"residual_px", q ? Json(q->residual_px) : Json()},
                       {"views", q ? Json(q->num_views) : Json()},
                       {"placed", c.place.has_value()}});
    files[id] = CameraToToml(c.camera);
  }
  if (calibration.axes)
    for (const auto& sentence : calibration.axes->findings) findings.push_back(sentence);
  return {{"job", job},
          {"model", model},
          {"findings", findings},
          {"warnings", calibration.warnings},
          {"cameras", cameras},
          {"files", files},
          {"report", CalibrationToHtml(calibration)},
          {"json", CalibrationToJson(calibration)}};
}

Json WithoutFiles(Json calibration) {
  for (const char* name : {"files", "report", "json"}) calibration.erase(name);
  return calibration;
}

Result<Survey> SurveyWithCameras(const Survey& present, const Json& files) {
  std::set<std::string> mine, calibrated;
  for (const auto& camera : present.cameras) mine.insert(camera.id);
  for (const auto& [id, text] : files.items()) calibrated.insert(id);
  if (std::none_of(calibrated.begin(), calibrated.end(), [&](const auto& id) { return mine.contains(id); }))
    return InputError(
        "the calibration is of {}, and the survey's cameras are {}; give them the same names in "
        "calibration.toml",
        ListOf(calibrated), ListOf(mine));
  const ScratchFolder scratch;
  if (scratch.path().empty())
    return InputError("no folder can be made in {}; make room there", fs::temp_directory_path().string());
  int number = 0;
  auto write = [&](const std::string& text) {
    return WriteFileAtomically(scratch.path() / fmt::format("camera-file-{}.toml", ++number), text);
  };
  for (const auto& [id, text] : files.items()) VSS_RETURN_IF_ERROR(write(text.get<std::string>()));
  for (const auto& camera : present.cameras)
    if (!calibrated.contains(camera.id)) VSS_RETURN_IF_ERROR(write(CameraToToml(camera)));
  auto survey = ReadSurvey(present.folder, scratch.path());
  if (!survey)
    return tl::unexpected<Error>(
        {survey.error().code, Replaced(survey.error().message, scratch.path().string() + "/", "")});
  return survey;
}

}  // namespace vss::station
