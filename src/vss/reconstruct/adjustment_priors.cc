// Cameras and stops as unknowns, with what was known of them beforehand.
#include "vss/reconstruct/adjustment.h"

namespace vss {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The calibration's covariance (fx fy cx cy, distortion, rotation, translation of cam_from_world) as one of
// (rotation, centre in world, intrinsics): exp(w) (R X + t) = exp(w) R (X - C), so that dC = R^T (w x t -
// dt).
MatrixXd FromCalibration(const Camera& camera, int num_intrinsics, const MatrixXd& place_prior) {
  const MatrixXd& q = camera.quality->covariance;
  const bool has_place = q.rows() == num_intrinsics + kCameraPlaceSize && camera.cam_from_world;
  MatrixXd map = MatrixXd::Zero(kCameraPlaceSize + num_intrinsics, q.rows());
  map.bottomLeftCorner(num_intrinsics, num_intrinsics).setIdentity();
  if (has_place) {
    const Matrix3d& r = camera.cam_from_world->rotation;
    map.block<3, 3>(0, num_intrinsics).setIdentity();
    map.block<3, 3>(3, num_intrinsics) = -r.transpose() * CrossMatrix(camera.cam_from_world->translation);
    map.block<3, 3>(3, num_intrinsics + 3) = -r.transpose();
  }
  MatrixXd out = map * q * map.transpose();
  if (!has_place) out.topLeftCorner(kCameraPlaceSize, kCameraPlaceSize) = place_prior;
  // So that what the calibration held fixed stays (nearly) fixed.
  VectorXd least = VectorXd::Constant(out.rows(), 1e-7);
  least.head<3>().setConstant(1e-7);
  least.segment<3>(3).setConstant(1e-4);
  least.segment<4>(kCameraPlaceSize).setConstant(1e-4);
  out.diagonal() += least.cwiseAbs2();
  return out;
}

}  // namespace

std::vector<AdjustedCamera> MakeCameras(std::span<const View> views, const PriorOptions& o) {
  std::vector<AdjustedCamera> cameras;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const bool carried = views[v].stop >= 0;
    AdjustedCamera* mine = nullptr;
    if (carried)
      for (auto& c : cameras)
        if (c.camera == views[v].camera && views[static_cast<std::size_t>(c.views[0])].stop >= 0) mine = &c;
    if (!mine) {
      AdjustedCamera c;
      c.camera = views[v].camera;
      MatrixXd place = MatrixXd::Zero(kCameraPlaceSize, kCameraPlaceSize);
      const double r = carried ? o.camera_rotation_sigma_rad : o.picture_rotation_sigma_rad;
      const double t = carried ? o.camera_position_sigma_mm : o.picture_position_sigma_mm;
      place.diagonal() << r * r, r * r, r * r, t * t, t * t, t * t;
      c.prior_covariance = place;
      const auto& quality = c.camera->quality;
      const int intrinsics = 4 + c.camera->intrinsics.num_distortion;
      // A hand-held camera's lens belongs to all its pictures: adjusted with the first of them alone it would
      // be another lens in each, so it stays as calibrated.
      if (carried && quality && quality->covariance.rows() >= intrinsics) {
        c.num_intrinsics = intrinsics;
        c.prior_covariance = FromCalibration(*c.camera, intrinsics, place);
        c.prior_from_calibration = quality->covariance.rows() == intrinsics + kCameraPlaceSize;
      }
      c.value = VectorXd::Zero(kCameraPlaceSize + c.num_intrinsics);
      cameras.push_back(std::move(c));
      mine = &cameras.back();
    }
    mine->views.push_back(static_cast<int>(v));
  }
  return cameras;
}

std::vector<AdjustedStop> MakeStops(std::span<const View> views) {
  std::map<int, AdjustedStop> stops;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].stop < 0) continue;
    stops[views[v].stop].stop = views[v].stop;
    stops[views[v].stop].views.push_back(static_cast<int>(v));
  }
  std::vector<AdjustedStop> out;
  for (auto& [stop, block] : stops) out.push_back(std::move(block));
  return out;
}

}  // namespace vss
