#include "vss/identify/view.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

// The picture's border in ideal px, side by side; the boxes stay unknown where the lens cannot be inverted.
void SetFrame(View& view) {
  constexpr int kSteps = 48;
  constexpr double kMarginPx = 0.5;  // between two steps a smooth lens bends the border by less
  constexpr double kFar = 1e9;
  view.surely_inside.setEmpty();
  view.maybe_inside = {Eigen::Vector2d::Constant(-kFar), Eigen::Vector2d::Constant(kFar)};
  const double w = view.camera->width_px - 1, h = view.camera->height_px - 1;
  Eigen::AlignedBox2d all;
  Eigen::Vector2d lo = Eigen::Vector2d::Constant(-kFar), hi = Eigen::Vector2d::Constant(kFar);
  for (int k = 0; k <= kSteps; ++k) {
    const double t = double(k) / kSteps;
    for (int side = 0; side < 4; ++side) {
      const Eigen::Vector2d img = side == 0   ? Eigen::Vector2d(0, t * h)
                                  : side == 1 ? Eigen::Vector2d(w, t * h)
                                  : side == 2 ? Eigen::Vector2d(t * w, 0)
                                              : Eigen::Vector2d(t * w, h);
      const auto normalized = view.camera->intrinsics.NormalizedFromImg(img);
      if (!normalized) return;
      const Eigen::Vector2d ideal = view.camera->intrinsics.IdealFromNormalized(*normalized);
      all.extend(ideal);
      if (side == 0) lo.x() = std::max(lo.x(), ideal.x());
      if (side == 1) hi.x() = std::min(hi.x(), ideal.x());
      if (side == 2) lo.y() = std::max(lo.y(), ideal.y());
      if (side == 3) hi.y() = std::min(hi.y(), ideal.y());
    }
  }
  const auto margin = Eigen::Vector2d::Constant(kMarginPx);
  view.maybe_inside = {all.min() - margin, all.max() + margin};
  if ((hi - lo).minCoeff() > 2 * kMarginPx) view.surely_inside = {lo + margin, hi - margin};
}

}  // namespace

View MakeView(int image, const Camera& camera, const RigidTransform& cam_from_world, int stop,
              const LineImage* lines) {
  View view;
  view.image = image;
  view.camera = &camera;
  view.cam_from_world = cam_from_world;
  view.stop = stop;
  view.lines = lines;
  view.center_in_world = cam_from_world.Inverse().translation;
  SetFrame(view);
  return view;
}

std::optional<Eigen::Vector2d> View::ProjectInside(const Eigen::Vector3d& point_in_world) const {
  const auto img = camera->intrinsics.Project(cam_from_world * point_in_world);
  if (!img || img->x() < 0 || img->y() < 0 || img->x() > camera->width_px - 1 ||
      img->y() > camera->height_px - 1)
    return std::nullopt;
  return img;
}

bool View::MayShowBall(const Eigen::Vector3d& center_of_ball, double radius_mm) const {
  constexpr double kBeside = 0.25;  // of the frame
  const Eigen::Vector3d c = cam_from_world * center_of_ball;
  if (c.z() <= -radius_mm) return false;
  // Outside of one of the four planes through the camera's centre and a side of the frame?
  const Eigen::Vector2d margin = kBeside * maybe_inside.sizes();
  const Eigen::Vector2d lo = camera->intrinsics.NormalizedFromIdeal(maybe_inside.min() - margin),
                        hi = camera->intrinsics.NormalizedFromIdeal(maybe_inside.max() + margin);
  for (int axis = 0; axis < 2; ++axis) {
    if ((lo[axis] * c.z() - c[axis]) / std::hypot(1, lo[axis]) > radius_mm) return false;
    if ((c[axis] - hi[axis] * c.z()) / std::hypot(1, hi[axis]) > radius_mm) return false;
  }
  return true;
}

Eigen::Vector3d View::RayOfIdeal(const Eigen::Vector2d& ideal) const {
  const Eigen::Vector2d n = camera->intrinsics.NormalizedFromIdeal(ideal);
  return (cam_from_world.rotation.transpose() * Eigen::Vector3d(n.x(), n.y(), 1)).normalized();
}

}  // namespace vss
