#include "vss/identify/view.h"

namespace vss {

View MakeView(int image, const Camera& camera, const RigidTransform& cam_from_world, int stop,
              const LineImage* lines) {
  return {image, &camera, cam_from_world, stop, lines, cam_from_world.Inverse().translation};
}

std::optional<Eigen::Vector2d> View::ProjectIdeal(const Eigen::Vector3d& point_in_world) const {
  constexpr double kMinDepthMm = 1.0;
  const Eigen::Vector3d p = cam_from_world * point_in_world;
  if (p.z() < kMinDepthMm) return std::nullopt;
  return camera->intrinsics.IdealFromNormalized({p.x() / p.z(), p.y() / p.z()});
}

std::optional<Eigen::Vector2d> View::ProjectInside(const Eigen::Vector3d& point_in_world) const {
  const auto img = camera->intrinsics.Project(cam_from_world * point_in_world);
  if (!img || img->x() < 0 || img->y() < 0 || img->x() > camera->width_px - 1 ||
      img->y() > camera->height_px - 1)
    return std::nullopt;
  return img;
}

Eigen::Vector3d View::RayOfIdeal(const Eigen::Vector2d& ideal) const {
  const Eigen::Vector2d n = camera->intrinsics.NormalizedFromIdeal(ideal);
  return (cam_from_world.rotation.transpose() * Eigen::Vector3d(n.x(), n.y(), 1)).normalized();
}

}  // namespace vss
