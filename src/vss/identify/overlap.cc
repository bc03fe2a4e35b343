#include "vss/identify/overlap.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace vss {

using Eigen::Vector3d;

namespace {

// Of the ray upwards: a little off the vertical, so that it runs along no wall.
Vector3d Upward() { return Vector3d(0.0123, 0.0071, 1).normalized(); }

// A point as seen along that ray.
Eigen::Vector2d AlongRay(const Vector3d& p, const Vector3d& d) {
  return {p.x() - d.x() / d.z() * p.z(), p.y() - d.y() / d.z() * p.z()};
}

std::optional<Volume::Crossing> CrossingOf(const std::array<Vector3d, 3>& t) {
  constexpr double kSlack = 1e-6;  // mm and share of the coordinates: more than they are rounded by
  const Vector3d d = Upward();
  Volume::Crossing c;
  c.corner = t[0];
  c.edge1 = t[1] - t[0];
  c.edge2 = t[2] - t[0];
  c.across = d.cross(c.edge2);
  c.det = c.edge1.dot(c.across);
  if (std::abs(c.det) < 1e-12) return std::nullopt;
  const Eigen::Vector2d p = AlongRay(t[0], d), q = AlongRay(t[1], d), r = AlongRay(t[2], d);
  c.lo = p.cwiseMin(q).cwiseMin(r);
  c.hi = p.cwiseMax(q).cwiseMax(r);
  const double slack = kSlack * (1 + std::max(c.lo.cwiseAbs().maxCoeff(), c.hi.cwiseAbs().maxCoeff()));
  c.lo.array() -= slack;
  c.hi.array() += slack;
  return c;
}

}  // namespace

bool Volume::Contains(const Vector3d& p) const {
  static const Vector3d d = Upward();
  if (!box.contains(p)) return false;
  const Eigen::Vector2d seen = AlongRay(p, d);
  int num = 0;
  for (const auto& c : crossings) {
    if (seen.x() < c.lo.x() || seen.x() > c.hi.x() || seen.y() < c.lo.y() || seen.y() > c.hi.y()) continue;
    const Vector3d s = p - c.corner;
    const double u = s.dot(c.across) / c.det;
    if (u < 0 || u > 1) continue;
    const Vector3d q = s.cross(c.edge1);
    const double v = d.dot(q) / c.det;
    if (v < 0 || u + v > 1) continue;
    if (c.edge2.dot(q) / c.det > 0) ++num;
  }
  return num % 2 == 1;
}

Volume MakeVolume(const WorldSolid& solid) {
  Volume volume;
  double area = 0;
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles) {
      volume.triangles.push_back(t);
      if (const auto crossing = CrossingOf(t)) volume.crossings.push_back(*crossing);
      for (const auto& v : t) volume.box.extend(v);
      volume.mm3 += t[0].dot(t[1].cross(t[2])) / 6;
      area += (t[1] - t[0]).cross(t[2] - t[0]).norm() / 2;
    }
  volume.mm3 = std::abs(volume.mm3);
  volume.wall_mm = area > 0 ? 2 * volume.mm3 / area : 0;
  return volume;
}

namespace {

// As SharedVolume(); where it exceeds `enough` some number that does too.
double SharedVolumeUpTo(const Volume& a, const Volume& b, double touch_mm, double enough) {
  // Two bodies of one frame are one, though their walls be too thin to be met by sample points.
  constexpr double kOneFrame = 0.7;
  if (a.triangles.empty() || b.triangles.empty()) return 0;
  // Thin walls must not be eaten by what counts as touching.
  constexpr double kShareOfWall = 0.25;
  touch_mm = std::min({touch_mm, kShareOfWall * a.wall_mm, kShareOfWall * b.wall_mm});
  const Eigen::AlignedBox3d common = a.box.intersection(b.box);
  if (!common.isEmpty() && common.volume() > kOneFrame * a.box.merged(b.box).volume()) return 1;
  if (common.isEmpty() || (common.sizes().array() < touch_mm).any()) return 0;
  // Halton's points (1960) fill the room evenly, whatever lies parallel in it.
  constexpr int kPoints = 500;
  auto halton = [](int i, int base) {
    double share = 0, step = 1;
    for (; i > 0; i /= base) {
      step /= base;
      share += step * (i % base);
    }
    return share;
  };
  static const std::vector<Vector3d> shares = [&] {
    std::vector<Vector3d> points;
    for (int i = 1; i <= kPoints; ++i) points.emplace_back(halton(i, 2), halton(i, 3), halton(i, 5));
    return points;
  }();
  const auto share_of = [&](int points) {
    return common.volume() * points / double(kPoints) / std::max(1.0, std::min(a.mm3, b.mm3));
  };
  int inside = 0;
  for (const Vector3d& share : shares) {
    const Vector3d p = common.min() + common.sizes().cwiseProduct(share);
    // Eroded by the touch: a point counts where its neighbours on both sides are inside too.
    auto deep = [&](const Volume& v) {
      return v.Contains(p) && v.Contains(p + Vector3d(touch_mm / 2, touch_mm / 2, 0)) &&
             v.Contains(p - Vector3d(touch_mm / 2, touch_mm / 2, 0)) &&
             v.Contains(p + Vector3d(touch_mm / 2, -touch_mm / 2, 0)) &&
             v.Contains(p - Vector3d(touch_mm / 2, -touch_mm / 2, 0)) &&
             v.Contains(p + Vector3d(0, 0, touch_mm / 2)) && v.Contains(p - Vector3d(0, 0, touch_mm / 2));
    };
    if (!a.Contains(p) || !b.Contains(p) || !deep(a) || !deep(b)) continue;
    ++inside;
    if (share_of(inside) > enough) break;
  }
  return share_of(inside);
}

}  // namespace

double SharedVolume(const Volume& a, const Volume& b, double touch_mm) {
  return SharedVolumeUpTo(a, b, touch_mm, INFINITY);
}

bool SharesMoreThan(const Volume& a, const Volume& b, double touch_mm, double share) {
  return SharedVolumeUpTo(a, b, touch_mm, share) > share;
}

}  // namespace vss
