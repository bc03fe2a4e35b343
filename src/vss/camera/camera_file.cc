// Camera files, format vss-camera/1.
#include <Eigen/LU>
#include <algorithm>

#include "vss/base/toml_file.h"
#include "vss/camera/camera.h"

namespace vss {
namespace {

constexpr int kMaxSide_px = 65535;                                        // no sensor is larger
constexpr const char* kAbout[] = {"date", "serial", "lens", "aperture"};  // what a calibration holds for
constexpr double kRotationTolerance = 1e-3;  // the contract's, for matrices rounded by hand

Result<double> PositiveAt(const TomlValue& table, const char* name, const char* example) {
  VSS_ASSIGN(const TomlValue* value, table.Get(name, example));
  VSS_ASSIGN(const double number, value->AsNumber());
  if (number <= 0) return value->Complain(fmt::format("is {}, but must be above 0", number));
  return number;
}

Result<Eigen::Vector2d> PairAt(const TomlValue& table, const char* name, const char* example) {
  VSS_ASSIGN(const TomlValue* value, table.Get(name, example));
  VSS_ASSIGN(const Eigen::VectorXd pair, value->AsVector(2));
  return Eigen::Vector2d(pair);
}

Result<Eigen::Vector2d> PositivePairAt(const TomlValue& table, const char* name, const char* example) {
  VSS_ASSIGN(const Eigen::Vector2d pair, PairAt(table, name, example));
  if (pair.minCoeff() <= 0) return table.Find(name)->Complain("must have two numbers above 0");
  return pair;
}

Status ReadDistortion(const TomlValue& table, std::initializer_list<int> counts, const char* what,
                      Intrinsics& k) {
  const TomlValue* value = table.Find("distortion");
  if (!value) return {};
  VSS_ASSIGN(const std::vector<double> numbers, value->AsNumbers());
  k.num_distortion = static_cast<int>(numbers.size());
  if (std::find(counts.begin(), counts.end(), k.num_distortion) == counts.end())
    return value->Complain(fmt::format("has {} coefficients; {}", numbers.size(), what));
  std::copy(numbers.begin(), numbers.end(), k.distortion.begin());
  return {};
}

Result<Intrinsics> ReadWeng(const TomlValue& table) {
  VSS_ASSIGN(const double image_distance_mm, PositiveAt(table, "image_distance", "image_distance = 8.4"));
  VSS_ASSIGN(const Eigen::Vector2d pitch_mm,
             PositivePairAt(table, "pixel_pitch", "pixel_pitch = [0.0160, 0.0157]"));
  Intrinsics k;
  k.model = LensModel::kWeng;
  k.fx_px = image_distance_mm / pitch_mm.x();
  k.fy_px = image_distance_mm / pitch_mm.y();
  k.pixel_pitch_v_mm = pitch_mm.y();
  VSS_RETURN_IF_ERROR(
      ReadDistortion(table, {0, 5, 6}, "model \"weng\" needs k1, g1, g2, g3, g4 and, if wanted, k2", k));
  return k;
}

Result<Intrinsics> ReadOpenCv(const TomlValue& table, bool with_distortion) {
  VSS_ASSIGN(const Eigen::Vector2d focal_px,
             PositivePairAt(table, "focal_length", "focal_length = [525.1, 533.0]"));
  Intrinsics k;
  k.model = with_distortion ? LensModel::kOpenCv : LensModel::kPinhole;
  k.fx_px = focal_px.x();
  k.fy_px = focal_px.y();
  if (with_distortion) {
    VSS_RETURN_IF_ERROR(
        ReadDistortion(table, {0, 4, 5, 8, 12}, "model \"opencv\" needs 4, 5, 8 or 12 in OpenCV's order", k));
  } else {
    VSS_RETURN_IF_ERROR(
        ReadDistortion(table, {0}, "model \"pinhole\" has none; write model = \"opencv\"", k));
  }
  return k;
}

Result<Intrinsics> ReadIntrinsics(const TomlValue& table) {
  VSS_ASSIGN(const TomlValue* model, table.Get("model", "model = \"opencv\""));
  VSS_ASSIGN(const std::string name, model->AsText());
  if (name != "weng" && name != "opencv" && name != "pinhole")
    return model->Complain(fmt::format("is \"{}\"; known are \"weng\", \"opencv\" and \"pinhole\"", name));
  VSS_ASSIGN(Intrinsics k, name == "weng" ? ReadWeng(table) : ReadOpenCv(table, name == "opencv"));
  VSS_ASSIGN(const Eigen::Vector2d centre_px,
             PairAt(table, "principal_point", "principal_point = [257.1, 251.9]"));
  k.cx_px = centre_px.x();
  k.cy_px = centre_px.y();
  return k;
}

Status ReadPose(const TomlValue& table, Camera& camera) {
  VSS_ASSIGN(camera.cam_from_world, ReadRigidTransform(table));
  if (const TomlValue* gantry = table.Find("gantry")) {
    VSS_ASSIGN(camera.gantry_mm, gantry->AsVector(3));
  }
  return {};
}

Status ReadAxes(const TomlValue& table, Camera& camera) {
  constexpr double kFlat = 1e-3;  // axes that span less have no third direction
  if (const TomlValue* axes = table.Find("axes")) {
    VSS_ASSIGN(camera.gantry_axes, axes->AsMatrix(3, 3));
    if (std::abs(camera.gantry_axes->determinant()) < kFlat)
      return axes->Complain("are three axes in one plane; calibrate the gantry again or leave `axes` out");
  }
  if (const TomlValue* middle = table.Find("middle")) {
    VSS_ASSIGN(camera.gantry_middle_mm, middle->AsVector(3));
  }
  if (const TomlValue* sigma = table.Find("axes_sigma")) {
    VSS_ASSIGN(camera.gantry_axes_sigma, sigma->AsMatrix(3, 3));
    if (camera.gantry_axes_sigma.minCoeff() < 0) return sigma->Complain("must have no number below 0");
  }
  return {};
}

Result<Response> ReadResponse(const TomlValue& value) {
  VSS_ASSIGN(const std::string name, value.AsText());
  if (name == "linear") return Response::kLinear;
  if (name == "srgb") return Response::kSrgb;
  return value.Complain(fmt::format("is \"{}\"; known are \"linear\" and \"srgb\"", name));
}

// The covariance, or the standard deviations alone as a diagonal one.
Result<Eigen::MatrixXd> ReadCovariance(const TomlValue& table, int size) {
  if (const TomlValue* value = table.Find("covariance")) {
    VSS_ASSIGN(Eigen::MatrixXd covariance, value->AsMatrix(size, size));
    const double scale = covariance.cwiseAbs().maxCoeff();
    if (!covariance.isApprox(covariance.transpose(), 1e-6) || covariance.diagonal().minCoeff() < 0 ||
        scale <= 0)
      return value->Complain("is no covariance: it must be symmetric with a diagonal that is not negative");
    return covariance;
  }
  if (const TomlValue* value = table.Find("sigma")) {
    VSS_ASSIGN(const Eigen::VectorXd sigma, value->AsVector(size));
    return Eigen::MatrixXd(sigma.cwiseAbs2().asDiagonal());
  }
  return Eigen::MatrixXd();
}

Result<CalibrationQuality> ReadQuality(const TomlValue& table, int num_parameters) {
  CalibrationQuality quality;
  if (const TomlValue* value = table.Find("residual_px")) {
    VSS_ASSIGN(quality.residual_px, value->AsNumber());
  }
  if (const TomlValue* value = table.Find("views")) {
    VSS_ASSIGN(quality.num_views, value->AsInteger(0, 1000000));
  }
  VSS_ASSIGN(quality.covariance, ReadCovariance(table, num_parameters));
  if (const TomlValue* value = table.Find("warnings")) {
    VSS_ASSIGN(quality.warnings, value->AsTexts());
  }
  for (const char* name : kAbout)
    if (const TomlValue* value = table.Find(name)) {
      VSS_ASSIGN(quality.about[name], value->AsText());
    }
  return quality;
}

int NumParameters(const Camera& camera) {
  return 4 + camera.intrinsics.num_distortion + (camera.cam_from_world ? 6 : 0);
}

}  // namespace

Result<RigidTransform> ReadRigidTransform(const TomlValue& table) {
  VSS_ASSIGN(const TomlValue* rotation,
             table.Get("rotation", "rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"));
  VSS_ASSIGN(const TomlValue* translation, table.Get("translation", "translation = [0.0, 0.0, 3000.0]"));
  VSS_ASSIGN(const Eigen::MatrixXd matrix, rotation->AsMatrix(3, 3));
  const auto nearest = NearestRotation(matrix, kRotationTolerance);
  if (!nearest)
    return rotation->Complain("is " + nearest.error().message + "; copy the matrix again with more digits");
  VSS_ASSIGN(const Eigen::VectorXd moved_mm, translation->AsVector(3));
  return RigidTransform{*nearest, moved_mm};
}

Result<Camera> ReadCamera(const std::filesystem::path& path) {
  VSS_ASSIGN(const TomlValue file, ReadToml(path, "vss-camera/1"));
  Camera camera;
  VSS_ASSIGN(const TomlValue* id, file.Get("id", "id = \"cam1\""));
  VSS_ASSIGN(camera.id, id->AsText());
  VSS_ASSIGN(const TomlValue* width, file.Get("width", "width = 512"));
  VSS_ASSIGN(camera.width_px, width->AsInteger(1, kMaxSide_px));
  VSS_ASSIGN(const TomlValue* height, file.Get("height", "height = 512"));
  VSS_ASSIGN(camera.height_px, height->AsInteger(1, kMaxSide_px));
  if (const TomlValue* response = file.Find("response")) {
    VSS_ASSIGN(camera.response, ReadResponse(*response));
  }
  VSS_ASSIGN(const TomlValue* intrinsics, file.Get("intrinsics", "[intrinsics]"));
  VSS_ASSIGN(camera.intrinsics, ReadIntrinsics(*intrinsics));
  if (const TomlValue* pose = file.Find("pose")) {
    VSS_RETURN_IF_ERROR(ReadPose(*pose, camera));
  }
  if (const TomlValue* gantry = file.Find("gantry"); gantry && gantry->IsTable()) {
    VSS_RETURN_IF_ERROR(ReadAxes(*gantry, camera));
  }
  if (const TomlValue* quality = file.Find("quality"); quality && quality->IsTable()) {
    VSS_ASSIGN(camera.quality, ReadQuality(*quality, NumParameters(camera)));
  }
  return camera;
}

namespace {

const char* NameOf(LensModel model) {
  return model == LensModel::kWeng ? "weng" : model == LensModel::kOpenCv ? "opencv" : "pinhole";
}

std::string IntrinsicsToToml(const Intrinsics& k) {
  std::string out = fmt::format("\n[intrinsics]\nmodel = \"{}\"\n", NameOf(k.model));
  if (k.model == LensModel::kWeng) {
    const double image_distance_mm = k.fy_px * k.pixel_pitch_v_mm;
    out += fmt::format("image_distance = {}  # mm\n", TomlNumber(image_distance_mm));
    out += fmt::format("pixel_pitch = {}  # mm\n",
                       TomlArray(Eigen::Vector2d(image_distance_mm / k.fx_px, k.pixel_pitch_v_mm)));
  } else {
    out += fmt::format("focal_length = {}  # px\n", TomlArray(Eigen::Vector2d(k.fx_px, k.fy_px)));
  }
  out += fmt::format("principal_point = {}  # px\n", TomlArray(Eigen::Vector2d(k.cx_px, k.cy_px)));
  if (k.num_distortion > 0)
    out += fmt::format("distortion = {}\n",
                       TomlArray(Eigen::Map<const Eigen::VectorXd>(k.distortion.data(), k.num_distortion)));
  return out;
}

std::string PoseToToml(const Camera& camera) {
  return fmt::format(
      "\n[pose]  # camera_from_world at gantry displacement `gantry`, mm\ngantry = {}\nrotation = "
      "{}\ntranslation = {}\n",
      TomlArray(camera.gantry_mm), TomlMatrix(camera.cam_from_world->rotation),
      TomlArray(camera.cam_from_world->translation));
}

std::string AxesToToml(const Camera& camera) {
  std::string out =
      fmt::format("\n[gantry]  # world = axes * displacement\naxes = {}\n", TomlMatrix(*camera.gantry_axes));
  if (camera.gantry_axes_sigma.maxCoeff() > 0)
    out +=
        fmt::format("axes_sigma = {}\nmiddle = {}  # displacement about which the place was calibrated, mm\n",
                    TomlMatrix(camera.gantry_axes_sigma), TomlArray(camera.gantry_middle_mm));
  return out;
}

std::string QualityToToml(const CalibrationQuality& quality) {
  std::string out = fmt::format("\n[quality]\nresidual_px = {}\nviews = {}\n",
                                TomlNumber(quality.residual_px), quality.num_views);
  if (quality.covariance.size() > 0) {
    out +=
        "# fx, fy, cx, cy (px), distortion; with a pose: rotation vector in the camera frame (rad), "
        "translation (mm)\n";
    out += fmt::format("sigma = {}\n", TomlArray(quality.covariance.diagonal().cwiseMax(0).cwiseSqrt()));
    out += fmt::format("covariance = {}\n", TomlMatrix(quality.covariance));
  }
  for (const auto& [name, text] : quality.about) out += fmt::format("{} = {}\n", name, TomlText(text));
  if (!quality.warnings.empty()) {
    std::string list;
    for (const auto& warning : quality.warnings) list += (list.empty() ? "" : ", ") + TomlText(warning);
    out += fmt::format("warnings = [{}]\n", list);
  }
  return out;
}

}  // namespace

Camera Reduced(const Camera& camera, int factor) {
  Camera out = camera;
  out.width_px /= factor;
  out.height_px /= factor;
  Intrinsics& k = out.intrinsics;
  k.fx_px /= factor;
  k.fy_px /= factor;
  k.cx_px = (k.cx_px + 0.5) / factor - 0.5;
  k.cy_px = (k.cy_px + 0.5) / factor - 0.5;
  k.pixel_pitch_v_mm *= factor;
  out.quality.reset();
  return out;
}

std::optional<Eigen::Matrix<double, 6, 6>> PlaceCovariance(const Camera& camera, const Gantry& gantry,
                                                           const Eigen::Vector3d& g_mm) {
  const int lens = 4 + camera.intrinsics.num_distortion;
  if (!camera.cam_from_world || !camera.quality || camera.quality->covariance.rows() != lens + 6)
    return std::nullopt;
  // t(g) = t - R A (g - g0), so that dt(g) = dt - w x (R A (g - g0)), and an
  // error of the axes moves the camera by dA (g - middle).
  const Eigen::Vector3d travel = g_mm - camera.gantry_mm;
  const Eigen::Matrix3d& r = camera.cam_from_world->rotation;
  Eigen::Matrix<double, 6, 6> move = Eigen::Matrix<double, 6, 6>::Identity();
  move.bottomLeftCorner<3, 3>() = CrossMatrix(r * gantry.axes * travel);
  Eigen::Matrix<double, 6, 6> covariance =
      move * camera.quality->covariance.bottomRightCorner<6, 6>() * move.transpose();
  const Eigen::Vector3d variance =
      camera.gantry_axes_sigma.cwiseAbs2() * (g_mm - camera.gantry_middle_mm).cwiseAbs2();
  covariance.bottomRightCorner<3, 3>() += r * variance.asDiagonal() * r.transpose();
  return covariance;
}

std::string CameraToToml(const Camera& camera) {
  std::string out = fmt::format(
      "format = \"vss-camera/1\"\nid = {}\nwidth = {}\nheight = {}\nresponse = \"{}\"\n", TomlText(camera.id),
      camera.width_px, camera.height_px, camera.response == Response::kSrgb ? "srgb" : "linear");
  out += IntrinsicsToToml(camera.intrinsics);
  if (camera.cam_from_world) out += PoseToToml(camera);
  if (camera.gantry_axes) out += AxesToToml(camera);
  if (camera.quality) out += QualityToToml(*camera.quality);
  return out;
}

}  // namespace vss
