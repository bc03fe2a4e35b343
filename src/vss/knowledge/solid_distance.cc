#include "vss/knowledge/solid_distance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

namespace vss {
namespace {

using Eigen::Vector3d;

double SegmentSquared(const Vector3d& p1, const Vector3d& q1, const Vector3d& p2, const Vector3d& q2) {
  const Vector3d d1 = q1 - p1, d2 = q2 - p2, r = p1 - p2;
  const double a = d1.squaredNorm(), e = d2.squaredNorm(), f = d2.dot(r), c = d1.dot(r), b = d1.dot(d2);
  constexpr double kPoint = 1e-18;
  double s = 0, t = 0;
  if (a <= kPoint && e <= kPoint) return r.squaredNorm();
  if (a <= kPoint) {
    t = std::clamp(f / e, 0.0, 1.0);
  } else if (e <= kPoint) {
    s = std::clamp(-c / a, 0.0, 1.0);
  } else {
    const double denominator = a * e - b * b;
    s = denominator > 1e-12 * a * e ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0;
    t = (b * s + f) / e;
    if (t < 0) {
      t = 0;
      s = std::clamp(-c / a, 0.0, 1.0);
    } else if (t > 1) {
      t = 1;
      s = std::clamp((b - c) / a, 0.0, 1.0);
    }
  }
  return (p1 + s * d1 - p2 - t * d2).squaredNorm();
}

// Where the perpendicular from `p` meets the triangle, the square of its length; else infinity: the nearest
// point then lies on an edge, which SegmentSquared sees.
double PerpendicularSquared(const Vector3d& p, const Triangle3& t) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
  const double n2 = n.squaredNorm();
  if (n2 <= 0) return INFINITY;
  for (int i = 0; i < 3; ++i)
    if (n.dot((t[(i + 1) % 3] - t[i]).cross(p - t[i])) < 0) return INFINITY;
  const double d = n.dot(p - t[0]);
  return d * d / n2;
}

// Does the segment run through the triangle?
bool Pierces(const Vector3d& p, const Vector3d& q, const Triangle3& t) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
  const double dp = n.dot(p - t[0]), dq = n.dot(q - t[0]);
  if (dp * dq > 0 || dp == dq) return false;
  return std::isfinite(PerpendicularSquared(p + dp / (dp - dq) * (q - p), t));
}

double TriangleSquared(const Triangle3& a, const Triangle3& b) {
  double best = INFINITY;
  for (int i = 0; i < 3; ++i) {
    const Vector3d &pa = a[i], &qa = a[(i + 1) % 3], &pb = b[i], &qb = b[(i + 1) % 3];
    if (Pierces(pa, qa, b) || Pierces(pb, qb, a)) return 0;
    best = std::min({best, PerpendicularSquared(pa, b), PerpendicularSquared(pb, a)});
    for (int k = 0; k < 3; ++k) best = std::min(best, SegmentSquared(pa, qa, b[k], b[(k + 1) % 3]));
  }
  return best;
}

Eigen::AlignedBox3d BoxOf(std::span<const Triangle3> triangles) {
  Eigen::AlignedBox3d box;
  for (const Triangle3& t : triangles)
    for (const Vector3d& p : t) box.extend(p);
  return box;
}

}  // namespace

double DistanceOf(std::span<const Triangle3> a, std::span<const Triangle3> b, double beyond_mm) {
  double best = beyond_mm * beyond_mm;
  const Eigen::AlignedBox3d box_b = BoxOf(b);
  std::vector<Eigen::AlignedBox3d> boxes;
  for (const Triangle3& t : b) boxes.push_back(BoxOf({&t, 1}));
  for (const Triangle3& ta : a) {
    const Eigen::AlignedBox3d box = BoxOf({&ta, 1});
    if (box.squaredExteriorDistance(box_b) >= best) continue;
    for (std::size_t k = 0; k < b.size(); ++k)
      if (box.squaredExteriorDistance(boxes[k]) < best) best = std::min(best, TriangleSquared(ta, b[k]));
  }
  return std::sqrt(best);
}

}  // namespace vss
