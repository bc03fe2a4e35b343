// Pictures of the reference cube from geometry alone, for tests: a matte cube on a floor, every face of its
// own grey.
#pragma once
#include <array>
#include <cmath>

#include "vss/calibrate/cube.h"
#include "vss/feature/marks_synthetic.h"

namespace vss::synthetic {

// Light: floor, top, then the sides from -y round to -x of the unturned cube.
struct CubeLights {
  double floor = 0.12, top = 0.85;
  std::array<double, 4> side{0.55, 0.38, 0.27, 0.62};
  double shadow = 0;      // share of its light that the floor loses at the cube's foot
  double shadow_mm = 30;  // how far that reaches
};

inline GreyImage RenderCube(const Scene& s, const CubeSpec& cube, const CubeLights& lights,
                            const RigidTransform& cam_from_world) {
  const Eigen::Matrix3d world_from_cube = RotationFromVector(cube.yaw_rad * Eigen::Vector3d::UnitZ());
  const RigidTransform world_from_cam = cam_from_world.Inverse();
  const Eigen::Vector3d from = world_from_cube.transpose() * (world_from_cam.translation - cube.position_mm);
  const Eigen::Matrix3d cube_from_cam = world_from_cube.transpose() * world_from_cam.rotation;
  const double h = 0.5 * cube.size_mm;
  const Eigen::Vector3d low(-h, -h, 0), high(h, h, cube.size_mm);
  return Expose(s, [&](const Eigen::Vector3d& in_cam) {
    const Eigen::Vector3d d = cube_from_cam * in_cam;
    // The slabs of the box (Kay and Kajiya 1986): it is hit where the last entry lies before the first exit.
    double enter = -1e18, leave = 1e18;
    int axis = 0;
    for (int i = 0; i < 3; ++i) {
      double a = (low[i] - from[i]) / d[i], b = (high[i] - from[i]) / d[i];
      if (a > b) std::swap(a, b);
      if (a > enter) enter = a, axis = i;
      leave = std::min(leave, b);
    }
    if (enter < leave && enter > 0)
      return axis == 2 ? lights.top : lights.side[axis == 1 ? (d.y() > 0 ? 0 : 2) : (d.x() > 0 ? 3 : 1)];
    const double along = -from.z() / d.z();
    if (!(along > 0)) return lights.floor;
    const Eigen::Vector3d p = from + along * d;
    const double gap = std::hypot(std::max(0.0, std::abs(p.x()) - h), std::max(0.0, std::abs(p.y()) - h));
    return lights.floor * (1 - lights.shadow * std::exp(-gap / lights.shadow_mm));
  });
}

// A camera at `centre_mm` that looks at `at_mm`, turned about its axis by `turn_rad`.
inline RigidTransform LookAt(const Eigen::Vector3d& centre_mm, const Eigen::Vector3d& at_mm,
                             double turn_rad) {
  const Eigen::Vector3d
      z = (at_mm - centre_mm).normalized(),
      x = z.cross(std::abs(z.z()) > 0.999 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d world_from_cam;
  world_from_cam << x, z.cross(x), z;
  const Eigen::Matrix3d rotation =
      RotationFromVector(turn_rad * Eigen::Vector3d::UnitZ()) * world_from_cam.transpose();
  return {rotation, -rotation * centre_mm};
}

}  // namespace vss::synthetic
