#include "vss/calibrate/calibration_file.h"

#include <fnmatch.h>

#include <Eigen/LU>
#include <algorithm>
#include <set>

#include "vss/base/toml_file.h"

namespace vss {
namespace fs = std::filesystem;
namespace {

constexpr int kMaxMarksASide = 1000;

Result<double> PositiveAt(const TomlValue& table, const char* name, const char* example) {
  VSS_ASSIGN(const TomlValue* value, table.Get(name, example));
  VSS_ASSIGN(const double number, value->AsNumber());
  if (number <= 0) return value->Complain(fmt::format("is {}, but must be above 0 (mm)", number));
  return number;
}

Result<int> CountAt(const TomlValue& table, const char* name, const char* example) {
  VSS_ASSIGN(const TomlValue* value, table.Get(name, example));
  return value->AsInteger(3, kMaxMarksASide);
}

// An id names a file, so it is kept to what every file system takes.
Result<std::string> CameraAt(const TomlValue& table) {
  VSS_ASSIGN(const TomlValue* value, table.Get("camera", "camera = \"cam1\""));
  VSS_ASSIGN(const std::string id, value->AsText());
  const auto plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '.';
  };
  if (!std::all_of(id.begin(), id.end(), plain) || id[0] == '.')
    return value->Complain(
        fmt::format("is \"{}\"; use letters, digits, - and _, since the camera's file is named so", id));
  return id;
}

Status ReadDistinguished(const TomlValue& table, TargetSpec& target) {
  const TomlValue* list = table.Find("distinguished");
  if (!list) return {};
  VSS_ASSIGN(const TomlValue::Array* items, list->AsArray());
  for (const TomlValue& item : *items) {
    VSS_ASSIGN(const Eigen::VectorXd place, item.AsVector(2));
    const std::array<int, 2> label{static_cast<int>(place.x()), static_cast<int>(place.y())};
    if (label[0] != place.x() || label[1] != place.y() || label[0] < 0 || label[1] < 0 ||
        label[0] >= target.columns || label[1] >= target.rows)
      return item.Complain(fmt::format("must be [column, row] of a disc, from 0 to {} and 0 to {}",
                                       target.columns - 1, target.rows - 1));
    target.distinguished.push_back(label);
  }
  if (target.distinguished.size() != 3)
    return list->Complain(
        fmt::format("lists {} discs, but three are needed to tell every side", target.distinguished.size()));
  VSS_ASSIGN(target.distinguished_diameter_mm,
             PositiveAt(table, "distinguished_diameter", "distinguished_diameter = 50.0"));
  if (std::abs(target.distinguished_diameter_mm / target.diameter_mm - 1) < 0.15 ||
      target.distinguished_diameter_mm >= target.pitch_mm)
    return table.Find("distinguished_diameter")
        ->Complain(fmt::format(
            "is {}, but must differ from the diameter {} by 15 % at least and be below the pitch {}",
            target.distinguished_diameter_mm, target.diameter_mm, target.pitch_mm));
  return {};
}

Status ReadDiscs(const TomlValue& table, TargetSpec& target) {
  if (const TomlValue* diameter = table.Find("diameter")) {
    VSS_ASSIGN(target.diameter_mm, PositiveAt(table, "diameter", "diameter = 36.0"));
    if (target.diameter_mm >= target.pitch_mm)
      return diameter->Complain(fmt::format("is {}, but discs {} mm apart must be smaller than that",
                                            target.diameter_mm, target.pitch_mm));
  }
  if (table.Find("distinguished") && target.diameter_mm <= 0)
    return table.Find("distinguished")->Complain("needs the discs' own `diameter` beside it");
  return ReadDistinguished(table, target);
}

Status ReadCharuco(const TomlValue& table, TargetSpec& target) {
  VSS_ASSIGN(target.marker_mm, PositiveAt(table, "marker", "marker = 50.0"));
  if (target.marker_mm >= target.pitch_mm)
    return table.Find("marker")->Complain(fmt::format(
        "is {}, but a marker must be smaller than its square of {} mm", target.marker_mm, target.pitch_mm));
  if (const TomlValue* dictionary = table.Find("dictionary")) {
    VSS_ASSIGN(target.dictionary, dictionary->AsText());
    static const std::set<std::string> known = [] {
      std::set<std::string> names{"original"};
      for (const char* bits : {"4x4", "5x5", "6x6", "7x7"})
        for (const char* size : {"50", "100", "250", "1000"}) names.insert(std::string(bits) + "_" + size);
      return names;
    }();
    if (!known.count(target.dictionary))
      return dictionary->Complain(fmt::format(
          "is \"{}\"; known are 4x4_50 to 7x7_1000 (50, 100, 250, 1000) and original", target.dictionary));
  }
  if (const TomlValue* white = table.Find("first_square_white")) {
    VSS_ASSIGN(const double value, white->AsNumberOrBool());
    target.first_square_white = value != 0;
  }
  return {};
}

Result<TargetSpec> ReadTarget(const TomlValue& table) {
  TargetSpec target;
  VSS_ASSIGN(const TomlValue* pattern, table.Get("pattern", "pattern = \"discs\""));
  VSS_ASSIGN(const std::string name, pattern->AsText());
  const auto known = PatternNamed(name);
  if (!known) return pattern->Complain(known.error().message);
  target.pattern = *known;
  VSS_ASSIGN(target.columns, CountAt(table, "columns", "columns = 13"));
  VSS_ASSIGN(target.rows, CountAt(table, "rows", "rows = 11"));
  VSS_ASSIGN(target.pitch_mm, PositiveAt(table, "pitch", "pitch = 70.0"));
  if (target.pattern == TargetPattern::kDiscs) {
    VSS_RETURN_IF_ERROR(ReadDiscs(table, target));
  } else if (target.pattern == TargetPattern::kCharuco) {
    VSS_RETURN_IF_ERROR(ReadCharuco(table, target));
  }
  return target;
}

// The files that match, in the order of their names.
Result<std::vector<BoardFile>> Expand(const TomlValue& item, const std::string& name,
                                      const fs::path& folder) {
  const fs::path pattern = folder / name;
  std::error_code ec;
  if (name.find_first_of("*?[") == std::string::npos) {
    if (!fs::is_regular_file(pattern, ec))
      return item.Complain(fmt::format("names {}, which is no file; correct the name", pattern.string()));
    return std::vector<BoardFile>{{name, pattern, std::nullopt}};
  }
  if (pattern.parent_path().string().find_first_of("*?[") != std::string::npos)
    return item.Complain("may have * and ? in the file's name only, not in a folder's");
  std::vector<BoardFile> files;
  for (const auto& entry : fs::directory_iterator(pattern.parent_path(), ec))
    if (entry.is_regular_file() &&
        fnmatch(pattern.filename().c_str(), entry.path().filename().c_str(), FNM_PERIOD) == 0)
      files.push_back(
          {(fs::path(name).parent_path() / entry.path().filename()).string(), entry.path(), std::nullopt});
  if (ec)
    return item.Complain(fmt::format("looks in {}, which is no folder that can be read ({})",
                                     pattern.parent_path().string(), ec.message()));
  if (files.empty())
    return item.Complain(
        fmt::format("matches no file in {}; correct the pattern", pattern.parent_path().string()));
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return files;
}

Result<std::vector<BoardFile>> ReadImages(const TomlValue& table, const fs::path& folder, bool with_gantry) {
  VSS_ASSIGN(
      const TomlValue* value,
      table.Get("images", with_gantry ? "images = [ { file = \"cube/cam1.png\", gantry = [0.0, 0.0, 0.0] } ]"
                                      : "images = [\"board_cam1/*.png\"]"));
  VSS_ASSIGN(const TomlValue::Array* items, value->AsArray());
  std::vector<BoardFile> images;
  std::set<fs::path> known;
  for (const TomlValue& item : *items) {
    std::string name;
    std::optional<Eigen::Vector3d> gantry;
    if (item.IsTable()) {
      VSS_ASSIGN(const TomlValue* file,
                 item.Get("file", "{ file = \"cube/cam1.png\", gantry = [0.0, 0.0, 0.0] }"));
      VSS_ASSIGN(name, file->AsText());
      if (const TomlValue* place = item.Find("gantry")) {
        VSS_ASSIGN(const Eigen::VectorXd g, place->AsVector(3));
        gantry = Eigen::Vector3d(g);
      }
    } else {
      VSS_ASSIGN(name, item.AsText());
    }
    VSS_ASSIGN(auto files, Expand(item, name, folder));
    for (BoardFile& f : files) {
      if (!known.insert(f.path.lexically_normal()).second)
        return item.Complain(fmt::format("names {} a second time; name every picture once", f.name));
      f.gantry_mm = gantry;
      if (with_gantry && !gantry) f.gantry_mm = Eigen::Vector3d::Zero();
      images.push_back(std::move(f));
    }
  }
  return images;
}

Result<IntrinsicJob> ReadIntrinsic(const TomlValue& table, const fs::path& folder) {
  IntrinsicJob job;
  VSS_ASSIGN(job.camera, CameraAt(table));
  if (const TomlValue* pitch = table.Find("pixel_pitch")) {
    VSS_ASSIGN(const Eigen::VectorXd p, pitch->AsVector(2));
    if (p.minCoeff() <= 0) return pitch->Complain("must have two numbers above 0 (mm)");
    job.pixel_pitch_mm = p;
  }
  VSS_ASSIGN(
      const TomlValue* target,
      table.Get("target",
                "target = { pattern = \"discs\", columns = 13, rows = 11, pitch = 70.0, diameter = 36.0 }"));
  VSS_ASSIGN(job.target, ReadTarget(*target));
  if (const TomlValue* bow = table.Find("bow")) {
    VSS_ASSIGN(const double value, bow->AsNumberOrBool());
    job.bow = value != 0;
  }
  if (const TomlValue* response = table.Find("response")) {
    VSS_ASSIGN(const std::string name, response->AsText());
    if (name != "linear" && name != "srgb")
      return response->Complain(fmt::format("is \"{}\"; known are \"linear\" and \"srgb\"", name));
    job.response = name == "srgb" ? Response::kSrgb : Response::kLinear;
  }
  for (const char* name : {"date", "serial", "lens", "aperture"})
    if (const TomlValue* value = table.Find(name)) {
      VSS_ASSIGN(job.about[name], value->AsText());
    }
  VSS_ASSIGN(job.images, ReadImages(table, folder, false));
  return job;
}

Result<ExtrinsicJob> ReadExtrinsic(const TomlValue& table, const fs::path& folder) {
  ExtrinsicJob job;
  job.where = table.Where();
  VSS_ASSIGN(job.camera, CameraAt(table));
  VSS_ASSIGN(const TomlValue* cube,
             table.Get("cube", "cube = { size = 800.0, position = [3000.0, 1500.0, 0.0], yaw = 18.0 }"));
  VSS_ASSIGN(job.cube.size_mm, PositiveAt(*cube, "size", "size = 800.0"));
  VSS_ASSIGN(const TomlValue* position, cube->Get("position", "position = [3000.0, 1500.0, 0.0]"));
  VSS_ASSIGN(job.cube.position_mm, position->AsVector(3));
  if (const TomlValue* yaw = cube->Find("yaw")) {
    VSS_ASSIGN(const double yaw_deg, yaw->AsNumber());
    job.cube.yaw_rad = RadFromDeg(yaw_deg);
  }
  if (const TomlValue* near = table.Find("camera_near")) {
    VSS_ASSIGN(const Eigen::VectorXd place, near->AsVector(3));
    job.camera_near_mm = Eigen::Vector3d(place);
  }
  if (const TomlValue* file = table.Find("camera_file")) {
    VSS_ASSIGN(const std::string name, file->AsText());
    job.camera_file = folder / name;
    std::error_code ec;
    if (!fs::is_regular_file(*job.camera_file, ec))
      return file->Complain(
          fmt::format("names {}, which is no file; correct the name", job.camera_file->string()));
  }
  VSS_ASSIGN(job.images, ReadImages(table, folder, true));
  return job;
}

Status ReadGantry(const TomlValue& table, CalibrationJob& job) {
  if (const TomlValue* axes = table.Find("axes")) {
    VSS_ASSIGN(const Eigen::MatrixXd matrix, axes->AsMatrix(3, 3));
    if (std::abs(matrix.determinant() - 1) > 0.2)
      return axes->Complain(
          "is no set of axes: three nearly perpendicular directions, about as long as 1, are needed");
    job.gantry.axes = matrix;
  }
  if (const TomlValue* calibrate = table.Find("calibrate")) {
    VSS_ASSIGN(const double value, calibrate->AsNumberOrBool());
    job.calibrate_axes = value != 0;
  }
  return {};
}

template <class Job, class Read>
Status ReadJobs(const TomlValue& file, const char* name, const fs::path& folder, const Read& read,
                std::vector<Job>& jobs) {
  const TomlValue* list = file.Find(name);
  if (!list) return {};
  VSS_ASSIGN(const TomlValue::Array* items, list->AsArray());
  for (const TomlValue& item : *items) {
    VSS_ASSIGN(Job job, read(item, folder));
    for (const Job& other : jobs)
      if (other.camera == job.camera)
        return item.Find("camera")->Complain(fmt::format(
            "\"{}\" has a [[{}]] of its own already; put all its pictures into one", job.camera, name));
    jobs.push_back(std::move(job));
  }
  return {};
}

}  // namespace

Result<TargetPattern> PatternNamed(const std::string& name) {
  if (name == "discs") return TargetPattern::kDiscs;
  if (name == "checkerboard") return TargetPattern::kCheckerboard;
  if (name == "charuco") return TargetPattern::kCharuco;
  return UsageError("is \"{}\"; known are \"discs\", \"checkerboard\" and \"charuco\"", name);
}

Result<CalibrationJob> ReadCalibrationJob(const fs::path& folder_or_file) {
  std::error_code ec;
  if (!fs::exists(folder_or_file, ec))
    return InputError("{}: there is no such folder or file; name the folder with calibration.toml",
                      folder_or_file.string());
  const fs::path path =
      fs::is_directory(folder_or_file, ec) ? folder_or_file / "calibration.toml" : folder_or_file;
  VSS_ASSIGN(const TomlValue file, ReadToml(path, "vss-calibration/1"));
  const fs::path folder = path.parent_path();
  CalibrationJob job;
  job.name = path.parent_path().filename().string();
  if (const TomlValue* name = file.Find("name")) {
    VSS_ASSIGN(job.name, name->AsText());
  }
  if (const TomlValue* gantry = file.Find("gantry")) {
    VSS_RETURN_IF_ERROR(ReadGantry(*gantry, job));
  }
  VSS_RETURN_IF_ERROR(ReadJobs(file, "intrinsic", folder, ReadIntrinsic, job.intrinsic));
  VSS_RETURN_IF_ERROR(ReadJobs(file, "extrinsic", folder, ReadExtrinsic, job.extrinsic));
  if (job.intrinsic.empty() && job.extrinsic.empty())
    return InputError("{}: there is nothing to calibrate; add an [[intrinsic]] with a target and its images",
                      path.string());
  if (job.calibrate_axes && job.extrinsic.empty())
    return file.Find("gantry")->Complain(
        "is to be calibrated, which takes the cube at many stops; add an [[extrinsic]]");
  for (const ExtrinsicJob& e : job.extrinsic) {
    const bool has_lens = e.camera_file || std::any_of(job.intrinsic.begin(), job.intrinsic.end(),
                                                       [&](const auto& i) { return i.camera == e.camera; });
    if (e.camera_file && std::any_of(job.intrinsic.begin(), job.intrinsic.end(),
                                     [&](const auto& i) { return i.camera == e.camera; }))
      return InputError(
          "{}: camera \"{}\" has a camera_file and an [[intrinsic]] of its own, so its lens would be known "
          "twice; "
          "take one of them out",
          e.where, e.camera);
    if (!has_lens)
      return InputError(
          "{}: camera \"{}\" has no [[intrinsic]] in this file; add one, or name its calibrated lens with "
          "camera_file = \"...\"",
          e.where, e.camera);
  }
  return job;
}

}  // namespace vss
