#include "vss/identify/scene_items.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector3d;

// Two parts may sink into each other by this before they are said to fill the same room.
constexpr double kTouchMm = 6;
constexpr double kMaxSharedVolume = 0.005;
// Two parts that lie against each other, parallel and both ends flush, do so to within this.
constexpr double kFlushPx = 5, kFlushRad = 2 * kPi / 180;

bool RestsOn(const PlacedObject& object, const Volume& volume, const Volume& below) {
  const Vector3d foot(object.placement[0], object.placement[1], volume.box.min().z() - kTouchMm);
  return below.Contains(foot);
}

}  // namespace

bool SameFrame(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b) {
  constexpr double kSameFrame = 0.7;
  const auto common = a.intersection(b);
  return !common.isEmpty() && common.volume() > kSameFrame * a.merged(b).volume();
}

Eigen::AlignedBox2d Footprint(const Eigen::AlignedBox3d& box, double overhang_mm) {
  return {box.min().head<2>().array() - overhang_mm, box.max().head<2>().array() + overhang_mm};
}

std::pair<double, double> Extent(const SceneItem& item, const Vector3d& direction) {
  std::pair<double, double> e{INFINITY, -INFINITY};
  for (const auto& t : item.volume.triangles)
    for (const auto& p : t) e = {std::min(e.first, direction.dot(p)), std::max(e.second, direction.dot(p))};
  return e;
}

void SceneItems::Keep(Hypothesis h, int support) {
  SceneItem item;
  WorldSolid solid = PlaceSolid(h.object, false);
  item.volume = MakeVolume(solid);
  item.has_edges = !solid.edges.empty();
  item.circles = std::move(solid.circles);
  item.serial = num_kept_++;
  item.kind = h.object.model->kind();
  item.top_mm = item.volume.box.max().z();
  item.support_item = support;
  h.support = support;
  item.h = std::move(h);
  if (support >= 0 &&
      (!RestsOn(item.h.object, item.volume, (*this)[support].volume) || OfOneOutline(item, (*this)[support])))
    return;
  // The same object found from another seed: keep the better.
  for (auto& other : items_) {
    if (other.kind != item.kind || other.support_item != support ||
        other.h.object.resting_pose != item.h.object.resting_pose ||
        (other.volume.box.center() - item.volume.box.center()).norm() > mm_per_px_ ||
        (other.volume.box.sizes() - item.volume.box.sizes()).norm() > mm_per_px_)
      continue;
    if (item.h.log_odds > other.h.log_odds) Replace(other, std::move(item));
    return;
  }
  changed_ = true;
  items_.push_back(std::move(item));
}

void SceneItems::Replace(SceneItem& old, SceneItem item) {
  changed_ = true;
  old = std::move(item);
}

bool SceneItems::Conflicts(int a, int b) {
  if (a > b) std::swap(a, b);
  if (!(*this)[a].volume.box.intersects((*this)[b].volume.box)) return false;  // no need to remember
  const auto key = std::pair((*this)[a].serial, (*this)[b].serial);
  const auto it = conflicts_.find(key);
  if (it != conflicts_.end()) return it->second;
  const bool is =
      SharesMoreThan((*this)[a].volume, (*this)[b].volume, kTouchMm, kMaxSharedVolume) || ShareRim(a, b);
  conflicts_[key] = is;
  return is;
}

// Have both the same round edge? The rim of a hole is no pipe's that stands in it, nor a pipe's foot a
// hole's rim. And of one kind, side by side around one middle, they are readings of one part.
bool SceneItems::ShareRim(int a, int b) const {
  constexpr double kSamePx = 1.5, kOfOnePartPx = 5;
  if (!(*this)[a].volume.box.intersects((*this)[b].volume.box)) return false;
  const bool one_kind = (*this)[a].kind == (*this)[b].kind;
  for (const auto& c : (*this)[a].circles)
    for (const auto& d : (*this)[b].circles)
      if ((c.center.point - d.center.point).norm() + std::abs(c.radius_mm - d.radius_mm) <
          (one_kind ? kOfOnePartPx : kSamePx) * mm_per_px_)
        return true;
  return false;
}

bool SceneItems::Flush(int a, int b) {
  if (a > b) std::swap(a, b);
  const auto key = std::pair((*this)[a].serial, (*this)[b].serial);
  const auto it = flush_.find(key);
  if (it != flush_.end()) return it->second;
  return flush_[key] = AreFlush((*this)[a], (*this)[b]);
}

bool SceneItems::AreFlush(const SceneItem& a, const SceneItem& b) const {
  const double near = kFlushPx * mm_per_px_;
  if (a.support_item != b.support_item || !a.has_edges || !b.has_edges) return false;
  const double turn = std::remainder(a.h.object.placement[3] - b.h.object.placement[3], kPi / 2);
  if (std::abs(turn) > kFlushRad) return false;
  const double yaw = a.h.object.placement[3];
  const Vector3d u(std::cos(yaw), std::sin(yaw), 0), w(-std::sin(yaw), std::cos(yaw), 0);
  for (const auto& [along, across] : {std::pair{u, w}, std::pair{w, u}}) {
    const auto ends = Extent(a, along), other_ends = Extent(b, along), sides = Extent(a, across),
               other_sides = Extent(b, across);
    const double gap = std::max(sides.first, other_sides.first) - std::min(sides.second, other_sides.second);
    if (std::abs(ends.first - other_ends.first) < near && std::abs(ends.second - other_ends.second) < near &&
        std::abs(gap) < near)
      return true;
  }
  return false;
}

// A plate that stands out under a part by no more than shadows do, all around or on three sides, cannot be
// told from them: the foot of a plate and the shadows beside it are one, its top and its foot are not two.
// However fine the pictures: a ledge narrower than the leg of a fillet weld is not left around a plate.
bool SceneItems::OfOneOutline(const SceneItem& above, const SceneItem& below) const {
  constexpr double kShadowPx = 5, kWeldLegMm = 12;
  constexpr int kSides = 3;
  const double yaw = above.h.object.placement[3], near = std::max(kShadowPx * mm_per_px_, kWeldLegMm);
  int flush = 0;
  bool all_around = true;
  for (const Vector3d& axis :
       {Vector3d(std::cos(yaw), std::sin(yaw), 0), Vector3d(-std::sin(yaw), std::cos(yaw), 0)}) {
    const auto upper = Extent(above, axis), lower = Extent(below, axis);
    flush += std::abs(lower.first - upper.first) < near;
    flush += std::abs(lower.second - upper.second) < near;
    all_around = all_around && lower.second - lower.first - (upper.second - upper.first) < 2 * near;
  }
  return all_around || flush >= kSides;
}

// Is there no better item of its kind and nearly the same frame?
bool SceneItems::BestOfItsPlace(int i) const {
  for (int k = 0; k < size(); ++k) {
    if (k == i || (*this)[k].kind != (*this)[i].kind ||
        !SameFrame((*this)[i].volume.box, (*this)[k].volume.box))
      continue;
    if ((*this)[k].h.log_odds > (*this)[i].h.log_odds ||
        ((*this)[k].h.log_odds == (*this)[i].h.log_odds && k < i))
      return false;
  }
  return true;
}

// The item of the same kind at the same place that stands on `support`; -1: none.
int SceneItems::TwinOn(int i, int support) const {
  const SceneItem& item = (*this)[i];
  int best = -1;
  for (int k = 0; k < size(); ++k) {
    const SceneItem& other = (*this)[k];
    if (other.support_item != support || other.kind != item.kind ||
        !SameFrame(item.volume.box, other.volume.box))
      continue;
    if (best < 0 || other.alone > (*this)[best].alone) best = k;
  }
  return best;
}

int SceneItems::Level(int i) const {
  int level = 0;
  for (int k = (*this)[i].support_item; k >= 0; k = (*this)[k].support_item) ++level;
  return level;
}

}  // namespace vss
