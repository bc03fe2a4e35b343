#include "vss/identify/screen.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace vss {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Moeller, Trumbore 1997.
bool Meets(const Vector3d& eye, const Vector3d& d, double limit, const Triangle3d& t) {
  const Vector3d e1 = t[1] - t[0], e2 = t[2] - t[0], h = d.cross(e2);
  const double det = e1.dot(h);
  if (std::abs(det) < 1e-12) return false;
  const Vector3d s = eye - t[0];
  const double u = s.dot(h) / det;
  if (u < 0 || u > 1) return false;
  const Vector3d q = s.cross(e1);
  const double v = d.dot(q) / det;
  if (v < 0 || u + v > 1) return false;
  const double along = e2.dot(q) / det;
  return along > 0 && along < limit;
}

bool Toward(const Triangle3d& t, const Vector3d& eye) {
  return (t[1] - t[0]).cross(t[2] - t[0]).dot(eye - t[0]) > 0;
}

void Screen::Add(const View& view, std::span<const Triangle3d> triangles, int owner) {
  Body body{Vector2d::Constant(INFINITY), Vector2d::Constant(-INFINITY), owner, 0, 0};
  const std::size_t before = triangles_.size() + near_.size();
  for (const auto& t : triangles)
    if (Toward(t, view.center_in_world)) AddTriangle(view, t, body);
  if (triangles_.size() + near_.size() == before) return;
  body.end = triangles_.size();
  body.near_end = near_.size();
  bodies_.push_back(body);
}

void Screen::AddTriangle(const View& view, const Triangle3d& triangle, Body& body) {
  constexpr double kMinDepthMm = 1.0;
  const auto& k = view.camera->intrinsics;
  Vector3d c[3];
  double deepest = -INFINITY, least = INFINITY;
  for (int i = 0; i < 3; ++i) {
    c[i] = view.cam_from_world * triangle[std::size_t(i)];
    deepest = std::max(deepest, c[i].z());
    least = std::min(least, c[i].z());
  }
  if (deepest <= 0) return;  // no ray to what the picture shows comes there
  if (least < kMinDepthMm) {
    near_.push_back(triangle);
    return;
  }
  Triangle t;
  Vector2d p[3];
  double inverse[3];
  for (int i = 0; i < 3; ++i) {
    p[i] = {k.fx_px * c[i].x() / c[i].z() + k.cx_px, k.fy_px * c[i].y() / c[i].z() + k.cy_px};
    inverse[i] = 1 / c[i].z();
  }
  const double area = (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
  if (std::abs(area) < 1e-9) return;
  t.lo = p[0].cwiseMin(p[1]).cwiseMin(p[2]);
  t.hi = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
  for (int i = 0; i < 3; ++i) {
    const Vector2d &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
    t.share[i] = Vector3d(a.y() - b.y(), b.x() - a.x(), a.x() * b.y() - a.y() * b.x()) / area;
  }
  t.inverse_depth = inverse[0] * t.share[0] + inverse[1] * t.share[1] + inverse[2] * t.share[2];
  triangles_.push_back(t);
  body.lo = body.lo.cwiseMin(t.lo);
  body.hi = body.hi.cwiseMax(t.hi);
}

bool Screen::Hides(const Vector2d& ideal, double depth, double margin, const Vector3d& eye,
                   const Vector3d& point, int except) const {
  const double least = 1 / (depth * (1 - margin));
  const Vector3d at(ideal.x(), ideal.y(), 1);
  std::size_t k = 0, n = 0;
  for (const Body& body : bodies_) {
    const std::size_t first = std::exchange(k, body.end), first_near = std::exchange(n, body.near_end);
    if (body.owner == except && except != kNobody) continue;
    for (std::size_t i = first_near; i < body.near_end; ++i)
      if (Meets(eye, point - eye, 1 - margin, near_[i])) return true;
    if (ideal.x() < body.lo.x() || ideal.x() > body.hi.x() || ideal.y() < body.lo.y() ||
        ideal.y() > body.hi.y())
      continue;
    for (std::size_t i = first; i < body.end; ++i) {
      const Triangle& t = triangles_[i];
      if (ideal.x() < t.lo.x() || ideal.x() > t.hi.x() || ideal.y() < t.lo.y() || ideal.y() > t.hi.y())
        continue;
      if (t.inverse_depth.dot(at) <= least) continue;
      if (t.share[0].dot(at) >= 0 && t.share[1].dot(at) >= 0 && t.share[2].dot(at) >= 0) return true;
    }
  }
  return false;
}

}  // namespace vss
