// vss camera check: is a camera file sound; what it says; another lens model; whether the camera still hangs
// where it did.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "command.h"
#include "vss/base/files.h"
#include "vss/calibrate/calibration_file.h"
#include "vss/calibrate/intrinsic.h"
#include "vss/calibrate/maps.h"

namespace vss::cli {
namespace {

struct Arguments {
  std::string file, to, out, cube;
  std::vector<double> at;  // displacement, mm
};

const char* NameOf(LensModel model) {
  return model == LensModel::kWeng ? "weng" : model == LensModel::kOpenCv ? "opencv" : "pinhole";
}

std::vector<std::string> Describe(const Camera& c) {
  const Intrinsics& k = c.intrinsics;
  std::vector<std::string> lines;
  const auto left = k.NormalizedFromImg({0, 0.5 * c.height_px}),
             right = k.NormalizedFromImg({c.width_px - 1.0, 0.5 * c.height_px});
  const double view = left && right ? DegFromRad(std::atan(right->x()) - std::atan(left->x())) : 0;
  lines.push_back(
      fmt::format("Camera {}: {} x {} px, {} model, f = {:.3f} and {:.3f} px, principal point ({:.3f}, "
                  "{:.3f}), {:.1f} degrees wide.",
                  c.id, c.width_px, c.height_px, NameOf(k.model), k.fx_px, k.fy_px, k.cx_px, k.cy_px, view));
  if (c.cam_from_world) {
    const Eigen::Vector3d axis = c.cam_from_world->rotation.row(2);
    lines.push_back(fmt::format("It looks along ({:.4f}, {:.4f}, {:.4f}).", axis.x(), axis.y(), axis.z()));
    if (c.gantry_axes) lines.push_back("Its gantry's axes are calibrated; surveys use them.");
  }
  if (!c.quality) {
    lines.push_back("It says nothing of its quality; a calibration by vss does.");
    return lines;
  }
  lines.push_back(fmt::format("It was calibrated from {} views with a residual of {:.4f} px.",
                              c.quality->num_views, c.quality->residual_px));
  for (const auto& [name, text] : c.quality->about) lines.push_back(fmt::format("{}: {}", name, text));
  const int n = 4 + k.num_distortion;
  if (c.quality->covariance.rows() >= n) {
    const auto map = UncertaintyMap(k, c.quality->covariance.topLeftCorner(n, n), c.width_px, c.height_px);
    lines.push_back(fmt::format("A ray is known to {:.4f} px RMS over the picture, {:.4f} px at worst.",
                                map.rms, map.max));
  }
  for (const auto& w : c.quality->warnings) lines.push_back("warning: " + w);
  return lines;
}

// Where the camera is at a displacement of the gantry, and how well that is known.
void DescribePlace(const Camera& c, const Eigen::Vector3d& g, std::vector<std::string>& lines) {
  Gantry gantry;
  if (c.gantry_axes) gantry.axes = *c.gantry_axes;
  const RigidTransform place = gantry.CamFromWorld(c, g);
  const Eigen::Vector3d centre = place.Inverse().translation;
  std::string line = fmt::format("At gantry ({}, {}, {}) it is at ({:.2f}, {:.2f}, {:.2f}) mm", g.x(), g.y(),
                                 g.z(), centre.x(), centre.y(), centre.z());
  if (const auto covariance = PlaceCovariance(c, gantry, g)) {
    // C = -R^T t, so dC = R^T (w x t - dt).
    Eigen::Matrix<double, 3, 6> map;
    map << -place.rotation.transpose() * CrossMatrix(place.translation), -place.rotation.transpose();
    const Eigen::Vector3d sigma = (map * *covariance * map.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
    line += fmt::format(" (sigma {:.2f}, {:.2f}, {:.2f} mm; turned by {:.3f} mrad)", sigma.x(), sigma.y(),
                        sigma.z(), 1e3 * std::sqrt(covariance->topLeftCorner<3, 3>().trace()));
  }
  lines.push_back(line + ".");
}

Status Convert(const Arguments& arguments, Camera camera, std::vector<std::string>& lines) {
  const LensModel model = arguments.to == "weng" ? LensModel::kWeng : LensModel::kOpenCv;
  VSS_ASSIGN(const ConvertedLens converted,
             ConvertLens(camera.intrinsics, model, camera.width_px, camera.height_px));
  const int n = 4 + camera.intrinsics.num_distortion, m = 4 + converted.intrinsics.num_distortion;
  if (camera.quality && camera.quality->covariance.rows() >= n) {
    const int rest = static_cast<int>(camera.quality->covariance.rows()) - n;
    Eigen::MatrixXd map = Eigen::MatrixXd::Zero(m + rest, n + rest);
    map.topLeftCorner(m, n) = converted.by_source;
    map.bottomRightCorner(rest, rest).setIdentity();
    const Eigen::MatrixXd covariance = map * camera.quality->covariance * map.transpose();
    camera.quality->covariance = 0.5 * (covariance + covariance.transpose());
  }
  camera.intrinsics = converted.intrinsics;
  if (model == LensModel::kWeng && camera.intrinsics.pixel_pitch_v_mm <= 0)
    camera.intrinsics.pixel_pitch_v_mm = 0.01;  // only the unit of image_distance
  const std::string text = CameraToToml(camera);
  lines.push_back(fmt::format("As {} its pixels differ by {:.5f} px RMS and {:.5f} px at most.", arguments.to,
                              converted.rms_px, converted.max_px));
  if (arguments.out.empty()) {
    lines.push_back(text);
    return {};
  }
  VSS_RETURN_IF_ERROR(WriteFileAtomically(arguments.out, text));
  lines.push_back("Written: " + arguments.out);
  return {};
}

Status CheckCube(const Arguments& arguments, const Camera& camera, std::vector<std::string>& lines) {
  constexpr double kSigmas = 5;   // beyond: moved
  constexpr double kMinPx = 0.3;  // and visible: half of what edges may be off for other reasons
  VSS_ASSIGN(const CalibrationJob job, ReadCalibrationJob(arguments.cube));
  for (const ExtrinsicJob& e : job.extrinsic) {
    if (e.camera != camera.id) continue;
    std::vector<CubePicture> pictures;
    for (const BoardFile& f : e.images) {
      VSS_ASSIGN(GreyImage image, ReadImage(f.path));
      if (camera.response == Response::kSrgb) image = LinearFromSrgb(image.view());
      if (image.width() != camera.width_px || image.height() != camera.height_px)
        return InputError("{}: has {} x {} px, but camera {} has {} x {}", f.path.string(), image.width(),
                          image.height(), camera.id, camera.width_px, camera.height_px);
      pictures.push_back({f.name, std::move(image), *f.gantry_mm});
    }
    Gantry gantry = job.gantry;
    if (camera.gantry_axes) gantry.axes = *camera.gantry_axes;
    VSS_ASSIGN(const CubeCheck check, CheckAgainstCube(camera, e.cube, pictures, gantry));
    const bool moved = check.rms_px > kMinPx && (check.turned_mrad > kSigmas * check.sigma_mrad ||
                                                 check.moved_mm > kSigmas * check.sigma_mm);
    const std::string words = fmt::format(
        "the cube's edges are {:.3f} px RMS from where the file has them; the best fit is turned by {:.3f} "
        "mrad (sigma {:.3f}) and moved by {:.2f} mm (sigma {:.2f})",
        check.rms_px, check.turned_mrad, check.sigma_mrad, check.moved_mm, check.sigma_mm);
    if (moved) return InputError("camera {} has moved: {}; calibrate its place again", camera.id, words);
    lines.push_back(fmt::format("Camera {} hangs where its file says: {}.", camera.id, words));
    return {};
  }
  return InputError("{}: there is no [[extrinsic]] for camera {}; name a calibration job that has its cube",
                    arguments.cube, camera.id);
}

Status RunCheck(const Arguments& arguments, const Common& common) {
  VSS_ASSIGN(const Camera camera, ReadCamera(arguments.file));
  if (const Status sound = CheckLens(camera.intrinsics, camera.width_px, camera.height_px); !sound)
    return InputError("{}: {}", arguments.file, sound.error().message);
  std::vector<std::string> lines = Describe(camera);
  if (camera.cam_from_world) {
    DescribePlace(camera, arguments.at.empty() ? camera.gantry_mm : Eigen::Vector3d(arguments.at.data()),
                  lines);
  } else if (!arguments.at.empty()) {
    return InputError("{}: has no [pose], so it is not known where the camera is; calibrate its place first",
                      arguments.file);
  }
  if (!arguments.to.empty()) VSS_RETURN_IF_ERROR(Convert(arguments, camera, lines));
  if (!arguments.cube.empty()) VSS_RETURN_IF_ERROR(CheckCube(arguments, camera, lines));
  if (common.json) {
    std::printf("%s\n",
                nlohmann::json{{"id", camera.id}, {"sound", true}, {"findings", lines}}.dump(1).c_str());
  } else {
    for (const auto& line : lines) std::printf("%s\n", line.c_str());
    std::printf("%s is sound.\n", arguments.file.c_str());
  }
  return {};
}

void AddCamera(CLI::App& app, Common& common) {
  auto* camera = app.add_subcommand("camera", "Camera files");
  camera->require_subcommand(1);
  auto* check = camera->add_subcommand(
      "check", "Says whether a camera file is sound, converts it, or holds it against a cube");
  auto arguments = std::make_shared<Arguments>();
  check->add_option("CAM.toml", arguments->file, "Camera file")->required();
  check->add_option("--to", arguments->to, "Convert the lens to this model")
      ->check(CLI::IsMember({"opencv", "weng"}));
  check->add_option("-o,--out", arguments->out, "File for the converted camera; left out: printed");
  check
      ->add_option("--at", arguments->at,
                   "Say where the camera is at this displacement of the gantry, X Y Z in mm")
      ->expected(3);
  check->add_option("--cube", arguments->cube,
                    "Calibration job whose cube pictures tell whether the camera has moved");
  check->callback([arguments, &common] { Finish(RunCheck(*arguments, common)); });
}

const Registration registration(AddCamera);

}  // namespace
}  // namespace vss::cli
