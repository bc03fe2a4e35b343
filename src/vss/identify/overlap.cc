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
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles) {
      volume.triangles.push_back(t);
      for (const auto& v : t) volume.box.extend(v);
      volume.mm3 += t[0].dot(t[1].cross(t[2])) / 6;
    }
  volume.mm3 = std::abs(volume.mm3);
  return volume;
}

double SharedVolume(const Volume& a, const Volume& b, double touch_mm) {
  if (a.triangles.empty() || b.triangles.empty()) return 0;
  const Eigen::AlignedBox3d common = a.box.intersection(b.box);
  if (common.isEmpty() || (common.sizes().array() < touch_mm).any()) return 0;
  constexpr int kSteps = 10;
  int inside = 0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j)
      for (int k = 0; k < kSteps; ++k) {
        const Vector3d share((i + 0.5) / kSteps, (j + 0.5) / kSteps, (k + 0.5) / kSteps);
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
  const double shared = common.volume() * inside / double(kSteps * kSteps * kSteps);
  return shared / std::max(1.0, std::min(a.mm3, b.mm3));
}

}  // namespace vss
