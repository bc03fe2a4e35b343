#include "vss/survey/survey.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vss/base/toml_file.h"
#include "vss/image/grey_image.h"
#include "vss/survey/parameters.h"

namespace vss {
namespace fs = std::filesystem;
namespace {

// A camera and the place in the survey (or the file) that names it.
struct NamedCamera {
  Camera camera;
  fs::path path;
};

std::string ListOfIds(const std::vector<NamedCamera>& cameras) {
  std::string list;
  for (const auto& c : cameras) list += (list.empty() ? "" : ", ") + c.camera.id;
  return list;
}

const NamedCamera* FindById(const std::vector<NamedCamera>& cameras, const std::string& id) {
  const auto found =
      std::find_if(cameras.begin(), cameras.end(), [&](const auto& c) { return c.camera.id == id; });
  return found == cameras.end() ? nullptr : &*found;
}

Result<std::vector<NamedCamera>> CamerasOfSurvey(const TomlValue& file, const fs::path& folder) {
  VSS_ASSIGN(const TomlValue* list, file.Get("cameras", "cameras = [\"cameras/cam1.toml\"]"));
  VSS_ASSIGN(const TomlValue::Array* items, list->AsArray());
  std::vector<NamedCamera> cameras;
  for (const auto& item : *items) {
    VSS_ASSIGN(const std::string name, item.AsText());
    const fs::path path = folder / name;
    std::error_code ec;
    if (!fs::exists(path, ec))
      return item.Complain(fmt::format(
          "names {}, which does not exist; correct the name or copy the camera file there", path.string()));
    VSS_ASSIGN(Camera camera, ReadCamera(path));
    if (const auto* twin = FindById(cameras, camera.id))
      return item.Complain(
          fmt::format("names {}, whose id \"{}\" is that of {} too; give every camera an id of its own",
                      path.string(), camera.id, twin->path.string()));
    cameras.push_back({std::move(camera), path});
  }
  return cameras;
}

// Every camera file of the folder, or of its subfolder `cameras`; other .toml files are passed over.
Result<std::vector<NamedCamera>> CamerasOfFolder(const fs::path& folder) {
  std::error_code ec;
  if (!fs::is_directory(folder, ec))
    return InputError("{}: there is no such folder of cameras; check --cameras", folder.string());
  std::vector<fs::path> paths;
  for (const fs::path& place : {folder, folder / "cameras"})
    for (const auto& entry : fs::directory_iterator(place, ec))
      if (entry.path().extension() == ".toml") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<NamedCamera> cameras;
  for (const auto& path : paths) {
    if (path.filename() == "survey.toml" || path.filename() == "calibration.toml") continue;
    VSS_ASSIGN(Camera camera, ReadCamera(path));
    if (const auto* twin = FindById(cameras, camera.id))
      return InputError("{}: its id \"{}\" is that of {} too; give every camera an id of its own",
                        path.string(), camera.id, twin->path.string());
    cameras.push_back({std::move(camera), path});
  }
  if (cameras.empty())
    return InputError("{}: no camera file (*.toml, format vss-camera/1) lies there; check --cameras",
                      folder.string());
  return cameras;
}

Result<Gantry> ReadGantry(const TomlValue& table) {
  Gantry gantry;
  const TomlValue* axes = table.Find("axes");
  if (!axes) return gantry;
  VSS_ASSIGN(gantry.axes, axes->AsMatrix(3, 3));
  constexpr double kFlat = 1e-3;  // a carriage whose three axes span less than this has no third direction
  if (std::abs(gantry.axes.determinant()) < kFlat)
    return axes->Complain("are three axes in one plane; calibrate the gantry again or leave `axes` out");
  return gantry;
}

// The axes that the cameras' places were calibrated with. Where survey.toml gives its own, those count.
Status TakeAxesOfCameras(const std::vector<NamedCamera>& cameras, bool own_axes, Survey& survey) {
  constexpr double kSame = 1e-9, kNear = 1e-4;  // kNear: 0.1 mm a metre, about what a calibration knows
  const NamedCamera* first = nullptr;
  for (const auto& c : cameras) {
    if (!c.camera.gantry_axes) continue;
    const auto& axes = *c.camera.gantry_axes;
    if (own_axes) {
      if ((axes - survey.gantry.axes).cwiseAbs().maxCoeff() > kNear)
        survey.warnings.push_back(
            fmt::format("camera {}: {} was calibrated with other gantry axes than survey.toml gives; those "
                        "of survey.toml "
                        "are used, so take them out where the camera files are newer",
                        c.camera.id, c.path.filename().string()));
      continue;
    }
    if (first && (axes - *first->camera.gantry_axes).cwiseAbs().maxCoeff() > kSame)
      return InputError(
          "{}: its gantry axes are not those of {}; take cameras of one calibration, or write the axes into "
          "survey.toml under [gantry]",
          c.path.string(), first->path.string());
    if (!first) first = &c, survey.gantry.axes = axes;
  }
  return {};
}

// [parameters]: quoted names ("lines.min_length_px" = 20) and dotted ones alike.
Status ReadParameters(const TomlValue& table, const std::string& prefix, std::map<std::string, double>& out) {
  VSS_ASSIGN(const TomlValue::Table* rows, table.AsTable());
  for (const auto& [key, value] : *rows) {
    if (value.IsTable()) {
      VSS_RETURN_IF_ERROR(ReadParameters(value, prefix + key + ".", out));
      continue;
    }
    VSS_ASSIGN(const double number, value.AsNumberOrBool());
    SurveyOptions scratch;
    if (const Status set = SetSurveyParameter(prefix + key, number, scratch); !set)
      return InputError("{}: {}", value.Where(), set.error().message);
    out[prefix + key] = number;
  }
  return {};
}

// Where the camera stood at this exposure: the picture's own pose, or the camera's moved by the gantry.
Status ReadPlace(const TomlValue& entry, const Gantry& gantry, const NamedCamera& camera,
                 SurveyImage& image) {
  const TomlValue* displacement = entry.Find("gantry");
  if (entry.Find("rotation") || entry.Find("translation")) {
    if (displacement)
      return displacement->Complain(
          "stands beside a `rotation` and `translation` of the picture's own; leave one of them out");
    VSS_ASSIGN(image.cam_from_world, ReadRigidTransform(entry));
    return {};
  }
  if (!camera.camera.cam_from_world) {
    const std::string remedy = fmt::format(
        "add `rotation` and `translation` to the picture, or a [pose] to {}", camera.path.string());
    if (displacement)
      return displacement->Complain(
          fmt::format("moves camera \"{}\", which has no place of its own; {}", camera.camera.id, remedy));
    return entry.Complain(
        fmt::format("does not say where camera \"{}\" stood; {}", camera.camera.id, remedy));
  }
  image.gantry_mm = camera.camera.gantry_mm;  // a fixed camera stays where it was calibrated
  if (displacement) {
    VSS_ASSIGN(image.gantry_mm, displacement->AsVector(3));
  }
  image.cam_from_world = gantry.CamFromWorld(camera.camera, *image.gantry_mm);
  return {};
}

Status CheckSize(const TomlValue& file_name, const SurveyImage& image, const NamedCamera& camera) {
  const auto size = ReadImageSize(image.path);
  if (!size) return InputError("{}: {}", file_name.Where(), size.error().message);
  if (size->width == camera.camera.width_px && size->height == camera.camera.height_px) return {};
  return InputError(
      "{}: {} has {} x {} pixels, but camera \"{}\" ({}) has {} x {}; name the camera that took it",
      file_name.Where(), image.path.string(), size->width, size->height, camera.camera.id,
      camera.path.string(), camera.camera.width_px, camera.camera.height_px);
}

Result<SurveyImage> ReadSurveyImage(const TomlValue& entry, const fs::path& folder, const Gantry& gantry,
                                    const std::vector<NamedCamera>& cameras) {
  SurveyImage image;
  VSS_ASSIGN(const TomlValue* file, entry.Get("file", "file = \"images/x00000_y00600_cam1.png\""));
  VSS_ASSIGN(image.file, file->AsText());
  image.path = folder / image.file;
  VSS_ASSIGN(const TomlValue* camera_id, entry.Get("camera", "camera = \"cam1\""));
  VSS_ASSIGN(const std::string id, camera_id->AsText());
  const NamedCamera* camera = FindById(cameras, id);
  if (!camera)
    return camera_id->Complain(fmt::format(
        "is \"{}\", but the cameras are: {}; correct it or add that camera", id, ListOfIds(cameras)));
  image.camera = static_cast<int>(camera - cameras.data());
  VSS_RETURN_IF_ERROR(ReadPlace(entry, gantry, *camera, image));
  VSS_RETURN_IF_ERROR(CheckSize(*file, image, *camera));
  return image;
}

Status ReadImages(const TomlValue& file, const std::vector<NamedCamera>& cameras, Survey& survey) {
  VSS_ASSIGN(const TomlValue* list, file.Get("image", "[[image]] with file, camera and gantry"));
  VSS_ASSIGN(const TomlValue::Array* entries, list->AsArray());
  std::map<fs::path, std::string> seen;
  for (const auto& entry : *entries) {
    VSS_ASSIGN(SurveyImage image, ReadSurveyImage(entry, survey.folder, survey.gantry, cameras));
    const std::string where = entry.Find("file")->Where();
    const auto [twin, is_new] = seen.emplace(image.path.lexically_normal(), where);
    if (!is_new)
      return InputError("{}: picture {} stands in the survey twice, at {} too; take one of them out", where,
                        image.file, twin->second);
    survey.images.push_back(std::move(image));
  }
  return {};
}

// Cameras that no picture uses are left out, so that neither their warnings nor their errors bear on the
// survey.
void KeepCameras(const std::vector<NamedCamera>& cameras, Survey& survey) {
  std::vector<int> place(cameras.size(), -1);
  for (auto& image : survey.images) {
    int& at = place[static_cast<std::size_t>(image.camera)];
    if (at < 0) {
      at = static_cast<int>(survey.cameras.size());
      survey.cameras.push_back(cameras[static_cast<std::size_t>(image.camera)].camera);
    }
    image.camera = at;
  }
  for (const auto& camera : survey.cameras) {
    if (!camera.quality) continue;
    const std::string name = fmt::format("camera {}: ", camera.id);
    for (const auto& warning : camera.quality->warnings)
      survey.warnings.push_back(warning.starts_with(name) ? warning : name + warning);
  }
}

}  // namespace

Result<Survey> ReadSurvey(const fs::path& folder_or_file, const std::optional<fs::path>& cameras_folder) {
  std::error_code ec;
  if (!fs::exists(folder_or_file, ec))
    return InputError("{}: there is no such survey; name a folder with a survey.toml",
                      folder_or_file.string());
  const bool is_folder = fs::is_directory(folder_or_file, ec);
  const fs::path path = is_folder ? folder_or_file / "survey.toml" : folder_or_file;
  if (!fs::exists(path, ec))
    return InputError("{}: there is no survey.toml in this folder; name the folder of a survey",
                      folder_or_file.string());
  VSS_ASSIGN(const TomlValue file, ReadToml(path, "vss-survey/1"));
  Survey survey;
  survey.folder = path.parent_path();
  survey.name =
      fs::weakly_canonical(survey.folder.empty() ? fs::path(".") : survey.folder, ec).filename().string();
  if (const TomlValue* name = file.Find("name")) {
    VSS_ASSIGN(survey.name, name->AsText());
  }
  VSS_ASSIGN(const std::vector<NamedCamera> cameras,
             cameras_folder ? CamerasOfFolder(*cameras_folder) : CamerasOfSurvey(file, survey.folder));
  if (const TomlValue* knowledge = file.Find("knowledge")) {
    VSS_ASSIGN(survey.knowledge, knowledge->AsTexts());
  }
  bool own_axes = false;
  if (const TomlValue* gantry = file.Find("gantry")) {
    VSS_ASSIGN(survey.gantry, ReadGantry(*gantry));
    own_axes = gantry->Find("axes");
  }
  VSS_RETURN_IF_ERROR(TakeAxesOfCameras(cameras, own_axes, survey));
  if (const TomlValue* parameters = file.Find("parameters")) {
    VSS_RETURN_IF_ERROR(ReadParameters(*parameters, "", survey.parameters));
  }
  VSS_RETURN_IF_ERROR(ReadImages(file, cameras, survey));
  KeepCameras(cameras, survey);
  return survey;
}

}  // namespace vss
