#include "vss/identify/world_circle.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "vss/identify/box_grid.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Two cones of rays that say less of the height than this (sine) say nothing.
constexpr double kMinConeAngle = 0.03;

// A horizontal circle as one picture sees it: at height z its centre is eye + center_per_mm * (eye.z - z),
// its radius radius_per_mm * (eye.z - z).
struct FlatCircle {
  LineRef ref;
  Vector3d eye;
  Vector2d center_per_mm;
  double radius_per_mm = 0;
  double mm_per_px_per_mm = 0;  // size of a pixel there, per mm of depth

  Vector2d CenterAt(double z) const { return eye.head<2>() + center_per_mm * (eye.z() - z); }
  double RadiusAt(double z) const { return radius_per_mm * (eye.z() - z); }
};

// The arc's rays met with a horizontal plane; empty where that is no circle to within the tolerance.
std::optional<FlatCircle> Flatten(const View& view, int v, int arc, double tolerance_px) {
  constexpr int kPoints = 24;
  constexpr double kMinSlope = 0.1;  // rays nearer to the horizon say nothing
  const auto& a = view.lines->arcs[std::size_t(arc)];
  const Eigen::Rotation2Dd turn(a.ideal_angle_rad);
  Eigen::MatrixXd m(kPoints, 3);
  Eigen::VectorXd rhs(kPoints);
  std::vector<Vector2d> points;
  for (int k = 0; k < kPoints; ++k) {
    const double t = a.ideal_from_rad + (a.ideal_to_rad - a.ideal_from_rad) * (k + 0.5) / kPoints;
    const Vector2d p =
        a.ideal_center + turn * Vector2d(a.ideal_axes.x() * std::cos(t), a.ideal_axes.y() * std::sin(t));
    const Vector3d ray = view.RayOfIdeal(p);
    if (ray.z() > -kMinSlope) return std::nullopt;
    points.push_back(ray.head<2>() / -ray.z());
    m.row(k) << points.back().x(), points.back().y(), 1;
    rhs[k] = points.back().squaredNorm();
  }
  const Vector3d x = m.colPivHouseholderQr().solve(rhs);
  const Vector2d center = x.head<2>() / 2;
  const double squared = x[2] + center.squaredNorm();
  if (!(squared > 0)) return std::nullopt;
  FlatCircle c{{v, arc}, view.center_in_world, center, std::sqrt(squared), 0};
  c.mm_per_px_per_mm = std::sqrt(1 + center.squaredNorm()) / view.camera->intrinsics.fx_px;
  for (const auto& p : points)
    if (std::abs((p - center).norm() - c.radius_per_mm) > tolerance_px * c.mm_per_px_per_mm)
      return std::nullopt;
  return c;
}

// Do two circles agree at height z, to within the tolerance?
bool Agree(const FlatCircle& a, const FlatCircle& b, double z, double tolerance_px) {
  const double mm =
      tolerance_px * (a.mm_per_px_per_mm * (a.eye.z() - z) + b.mm_per_px_per_mm * (b.eye.z() - z));
  return (a.CenterAt(z) - b.CenterAt(z)).norm() < mm && std::abs(a.RadiusAt(z) - b.RadiusAt(z)) < mm;
}

// The height at which two circles agree best: least squares of centre and radius, both linear in it.
std::optional<double> HeightOf(const FlatCircle& a, const FlatCircle& b) {
  const Vector3d slope(b.center_per_mm.x() - a.center_per_mm.x(), b.center_per_mm.y() - a.center_per_mm.y(),
                       b.radius_per_mm - a.radius_per_mm);
  const Vector2d c0 = a.CenterAt(0) - b.CenterAt(0);
  const Vector3d at0(c0.x(), c0.y(), a.RadiusAt(0) - b.RadiusAt(0));
  if (slope.squaredNorm() < kMinConeAngle * kMinConeAngle) return std::nullopt;
  return -at0.dot(slope) / slope.squaredNorm();
}

// Circles that are one at height z, the one that was asked for first; of each picture one.
struct Group {
  double z = 0;
  std::vector<std::size_t> members;
};

// Where a circle's centre may lie, at any height that is asked for, with all that it may be off by: circles
// that Agree() meet there.
Eigen::AlignedBox2d ReachOf(const FlatCircle& c, const WorldLineOptions& options) {
  const double low = options.min_height_mm, high = std::min(options.max_height_mm, c.eye.z());
  const double slack = options.tolerance_px * c.mm_per_px_per_mm * std::max(0.0, c.eye.z() - low);
  Eigen::AlignedBox2d box(c.CenterAt(low));
  box.extend(c.CenterAt(high));
  return {box.min().array() - slack, box.max().array() + slack};
}

// The largest group around circle `i`; `near`: those that it may agree with, ascending.
Group BestGroup(std::span<const FlatCircle> flat, std::size_t i, std::span<const int> near,
                const WorldLineOptions& options) {
  Group best;
  for (const int other : near) {
    const auto j = std::size_t(other);
    if (flat[i].ref.view == flat[j].ref.view) continue;
    const auto z = HeightOf(flat[i], flat[j]);
    if (!z || *z < options.min_height_mm || *z > options.max_height_mm ||
        !Agree(flat[i], flat[j], *z, options.tolerance_px))
      continue;
    Group g{*z, {i}};
    std::set<int> seen{flat[i].ref.view};
    for (const int third : near) {
      const auto k = std::size_t(third);
      if (seen.contains(flat[k].ref.view) || !Agree(flat[i], flat[k], *z, options.tolerance_px)) continue;
      seen.insert(flat[k].ref.view);
      g.members.push_back(k);
    }
    if (g.members.size() > best.members.size()) best = std::move(g);
  }
  return best;
}

}  // namespace

std::vector<WorldCircle> FindWorldCircles(std::span<const View> views, const WorldLineOptions& options) {
  std::vector<FlatCircle> flat;
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t k = 0; k < views[v].lines->arcs.size(); ++k)
      if (const auto c = Flatten(views[v], int(v), int(k), options.tolerance_px)) flat.push_back(*c);
  constexpr double kCellMm = 500;
  BoxGrid reaches(kCellMm);
  for (const auto& c : flat) reaches.Add(ReachOf(c, options));
  std::vector<Group> groups;
  std::vector<int> near;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    reaches.Find(ReachOf(flat[i], options), near);
    Group best = BestGroup(flat, i, near, options);
    if (best.members.size() >= 2) groups.push_back(std::move(best));
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.members.size() > b.members.size(); });
  std::vector<WorldCircle> out;
  std::vector<bool> claimed(flat.size());
  for (const Group& g : groups) {
    if (claimed[g.members[0]]) continue;
    WorldCircle c;
    Vector2d center = Vector2d::Zero();
    for (std::size_t k : g.members) {
      if (claimed[k]) continue;
      claimed[k] = true;
      center += flat[k].CenterAt(g.z);
      c.radius_mm += flat[k].RadiusAt(g.z);
      c.arcs.push_back(flat[k].ref);
    }
    c.num_views = int(c.arcs.size());
    if (c.num_views < 2) continue;
    center /= c.num_views;
    c.radius_mm /= c.num_views;
    c.center = {center.x(), center.y(), g.z};
    out.push_back(std::move(c));
  }
  return out;
}

std::vector<WorldCircle> LevelCircles(const View& view, double z_mm, double tolerance_px) {
  std::vector<WorldCircle> out;
  for (std::size_t k = 0; k < view.lines->arcs.size(); ++k) {
    const auto c = Flatten(view, 0, int(k), tolerance_px);
    if (!c || z_mm >= c->eye.z()) continue;
    const Vector2d center = c->CenterAt(z_mm);
    out.push_back({{center.x(), center.y(), z_mm}, c->RadiusAt(z_mm), {c->ref}, 1});
  }
  return out;
}

}  // namespace vss
