// One picture as identification and reconstruction see it.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "vss/camera/camera.h"
#include "vss/feature/line_image.h"
#include "vss/image/grey_image.h"

namespace vss {

struct View {
  int image = 0;  // index into the survey's pictures
  const Camera* camera = nullptr;
  RigidTransform cam_from_world;  // of this exposure
  int stop = -1;  // pictures with the same number were taken with the carriage (and its lamps) at one place;
                  // -1: none
  const LineImage* lines = nullptr;
  GreyView picture{};  // grey values proportional to light; without data where only the lines are known
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();

  // The picture's frame in `ideal` px: what lies in the first box is surely inside the picture, what lies out
  // of the second surely not. Between them the lens decides.
  Eigen::AlignedBox2d surely_inside, maybe_inside;

  // World point (mm) to `ideal` px (no distortion); empty behind the camera.
  std::optional<Eigen::Vector2d> ProjectIdeal(const Eigen::Vector3d& point_in_world) const {
    constexpr double kMinDepthMm = 1.0;
    const Eigen::Vector3d p = cam_from_world * point_in_world;
    if (p.z() < kMinDepthMm) return std::nullopt;
    return camera->intrinsics.IdealFromNormalized({p.x() / p.z(), p.y() / p.z()});
  }
  // World point to `img` px; empty behind the camera, beyond the lens or outside the picture.
  std::optional<Eigen::Vector2d> ProjectInside(const Eigen::Vector3d& point_in_world) const;
  // Whether ProjectInside() gives a point; faster.
  bool Shows(const Eigen::Vector3d& point_in_world) const {
    const auto ideal = ProjectIdeal(point_in_world);
    if (!ideal || !maybe_inside.contains(*ideal)) return false;
    return surely_inside.contains(*ideal) || ProjectInside(point_in_world).has_value();
  }
  // Whether it surely shows no point between two; where it says false, some may be in the picture.
  bool SurelyMisses(const Eigen::Vector3d& a_in_world, const Eigen::Vector3d& b_in_world) const {
    constexpr double kMarginPx = 1;  // more than projections are rounded by
    const auto a = ProjectIdeal(a_in_world), b = ProjectIdeal(b_in_world);
    if (!a || !b) return false;
    const Eigen::Array2d lo = a->cwiseMin(*b), hi = a->cwiseMax(*b);
    return (hi < maybe_inside.min().array() - kMarginPx).any() ||
           (lo > maybe_inside.max().array() + kMarginPx).any();
  }
  // Whether it may show some of a ball (world, mm), or of what lies a little beside its frame.
  bool MayShowBall(const Eigen::Vector3d& center_of_ball, double radius_mm) const;
  // Unit direction in the world of an `ideal` px.
  Eigen::Vector3d RayOfIdeal(const Eigen::Vector2d& ideal) const;
};

View MakeView(int image, const Camera& camera, const RigidTransform& cam_from_world, int stop,
              const LineImage* lines);

}  // namespace vss
