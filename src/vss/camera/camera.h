// One camera: lens, picture size, where it hangs, and how well all that is known.
#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/toml_file.h"
#include "vss/camera/lens.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {

enum class Response { kLinear, kSrgb };  // how grey values follow light

// What a calibration knows of its own quality. Order of the parameters: fx, fy, cx, cy (px), the given
// distortion coefficients, then, where the camera has a place, rotation (rad, cam_from_world <- exp(w)
// cam_from_world) and translation of cam_from_world (mm).
struct CalibrationQuality {
  double residual_px = 0;
  int num_views = 0;
  Eigen::MatrixXd covariance;         // square over the parameters above; empty where unknown
  std::vector<std::string> warnings;  // sentences that every later step repeats
  std::map<std::string, std::string> about =
      {};  // date, serial, lens, aperture: what the calibration holds for
};

struct Camera {
  std::string id;
  int width_px = 0, height_px = 0;
  Response response = Response::kLinear;
  Intrinsics intrinsics;
  std::optional<RigidTransform> cam_from_world;  // at gantry displacement `gantry_mm`
  Eigen::Vector3d gantry_mm = Eigen::Vector3d::Zero();
  std::optional<CalibrationQuality> quality;
  // The gantry's axes that the place was calibrated with; empty: as they are called. Their standard
  // deviations, and the displacement about which the place was calibrated: away from it the axes' errors
  // count.
  std::optional<Eigen::Matrix3d> gantry_axes;
  Eigen::Matrix3d gantry_axes_sigma = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gantry_middle_mm = Eigen::Vector3d::Zero();
};

// The camera that takes pictures smaller by a whole factor, each pixel the mean of factor x factor (image's Reduced());
// what its calibration knows of its quality is left out.
Camera Reduced(const Camera& camera, int factor);

// The carriage: at displacement g every camera has moved by axes * g in the world.
struct Gantry {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();

  // cam_from_world at displacement `g` of a camera that has a place of its own.
  RigidTransform CamFromWorld(const Camera& camera, const Eigen::Vector3d& g_mm) const {
    RigidTransform moved = *camera.cam_from_world;
    moved.translation -= moved.rotation * (axes * (g_mm - camera.gantry_mm));
    return moved;
  }
};

// Covariance of rotation (rad, R <- exp(w) R) and translation (mm) of cam_from_world at displacement `g`,
// from the camera's own and that of the axes. Empty where the camera's file says nothing of its place's.
std::optional<Eigen::Matrix<double, 6, 6>> PlaceCovariance(const Camera& camera, const Gantry& gantry,
                                                           const Eigen::Vector3d& g_mm);

// Format vss-camera/1. Errors name the file, the line and the remedy.
Result<Camera> ReadCamera(const std::filesystem::path& path);
std::string CameraToToml(const Camera& camera);

// `rotation` and `translation` (mm) of a table, as cameras and pictures give them. The rotation may be off
// orthonormal by 1e-3 and is made so; more is an error.
Result<RigidTransform> ReadRigidTransform(const TomlValue& table);

}  // namespace vss
