#include "vss/identify/overlap.h"

#include <cmath>

namespace vss {

using Eigen::Vector3d;

bool Volume::Contains(const Vector3d& p) const {
  if (!box.contains(p)) return false;
  // Crossings of the ray upwards (a direction a little off the vertical, so that it runs along no wall).
  const Vector3d d = Vector3d(0.0123, 0.0071, 1).normalized();
  int crossings = 0;
  for (const auto& t : triangles) {
    const Vector3d e1 = t[1] - t[0], e2 = t[2] - t[0], h = d.cross(e2);
    const double det = e1.dot(h);
    if (std::abs(det) < 1e-12) continue;
    const Vector3d s = p - t[0];
    const double u = s.dot(h) / det;
    if (u < 0 || u > 1) continue;
    const Vector3d q = s.cross(e1);
    const double v = d.dot(q) / det;
    if (v < 0 || u + v > 1) continue;
    if (e2.dot(q) / det > 0) ++crossings;
  }
  return crossings % 2 == 1;
}

Volume MakeVolume(const WorldSolid& solid) {
  Volume volume;
  double area = 0;
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles) {
      volume.triangles.push_back(t);
      for (const auto& v : t) volume.box.extend(v);
      volume.mm3 += t[0].dot(t[1].cross(t[2])) / 6;
      area += (t[1] - t[0]).cross(t[2] - t[0]).norm() / 2;
    }
  volume.mm3 = std::abs(volume.mm3);
  volume.wall_mm = area > 0 ? 2 * volume.mm3 / area : 0;
  return volume;
}

double SharedVolume(const Volume& a, const Volume& b, double touch_mm) {
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
  int inside = 0;
  for (int i = 1; i <= kPoints; ++i) {
    const Vector3d share(halton(i, 2), halton(i, 3), halton(i, 5));
    const Vector3d p = common.min() + common.sizes().cwiseProduct(share);
    // Eroded by the touch: a point counts where its neighbours on both sides are inside too.
    auto deep = [&](const Volume& v) {
      return v.Contains(p) && v.Contains(p + Vector3d(touch_mm / 2, touch_mm / 2, 0)) &&
             v.Contains(p - Vector3d(touch_mm / 2, touch_mm / 2, 0)) &&
             v.Contains(p + Vector3d(touch_mm / 2, -touch_mm / 2, 0)) &&
             v.Contains(p - Vector3d(touch_mm / 2, -touch_mm / 2, 0)) &&
             v.Contains(p + Vector3d(0, 0, touch_mm / 2)) && v.Contains(p - Vector3d(0, 0, touch_mm / 2));
    };
    if (a.Contains(p) && b.Contains(p) && deep(a) && deep(b)) ++inside;
  }
  const double shared = common.volume() * inside / double(kPoints);
  return shared / std::max(1.0, std::min(a.mm3, b.mm3));
}

}  // namespace vss
