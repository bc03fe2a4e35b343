#include "vss/identify/prior_log_odds.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "vss/identify/scene_index.h"

namespace vss {

using Eigen::Vector3d;

double PriorLogOdds(const PlacedObject& object, double mm_per_px) {
  constexpr double kPerDimension = 4;  // half the logarithm of some 3000 px of contour (BIC)
  constexpr double kUnseenDimension =
      30;                            // at most a pixel: the pictures cannot show it; from two on they do
  constexpr double kOtherPose = 30;  // parts mostly lie as their knowledge base says first
  constexpr double kFlatPx = 4,
                   kFlat =
                       10;  // a pixel: what is hardly higher than a pixel may be paint, a shadow or a cable
  constexpr double kBarPx = 10, kBar = 20;  // a pixel: a bar as thin as that both ways may be a cable
  double prior = object.resting_pose > 0 ? -kOtherPose : 0;
  const auto defs = object.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    const bool is_size = defs[i].min_mm >= 0;  // else a place, which may well be 0
    const double px = object.dimensions_mm[i] / mm_per_px;
    prior -= kPerDimension + (is_size ? kUnseenDimension * std::clamp(2 - px, 0.0, 1.0) : 0);
  }
  const Solid solid = object.model->InstantiateUnchecked(object.dimensions_mm);
  const Eigen::Matrix3d& rested_from_part =
      object.model->resting_poses()[static_cast<std::size_t>(object.resting_pose)].rested_from_part;
  Eigen::AlignedBox3d box;
  for (const auto& v : solid.vertices) box.extend(Vector3d(rested_from_part * v.point_in_part));
  for (const auto& c : solid.circles) {
    const Vector3d center = rested_from_part * c.center.point_in_part;
    const Vector3d spread = Vector3d(c.radius_mm, c.radius_mm, 0);
    box.extend(Vector3d(center + spread));
    box.extend(Vector3d(center - spread));
  }
  Vector3d extent_px = box.sizes() / ClutterPixelMm(mm_per_px);
  if (extent_px.z() < kFlatPx) prior -= kFlat * (kFlatPx - extent_px.z());
  std::sort(extent_px.data(), extent_px.data() + 3);
  if (extent_px[1] < kBarPx) prior -= kBar * (kBarPx - extent_px[1]);
  return prior;
}

}  // namespace vss
