#include "pick_residuals.h"

#include <cmath>
#include <optional>

namespace vss::station {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Jac2 = Eigen::Matrix2Xd;

constexpr double kBiasPx = 0.15;  // what a line is off beyond its noise: contact shadows, lens, chamfers
constexpr double kNearestDepthMm = 100;  // an edge is cut off where it comes closer to the camera
constexpr double kOvershootPx = 3;       // a segment may reach so far beyond the end of its edge

struct Projected {
  Vector2d ideal;
  Jac2 by_state;
};

// A material point of the object in the picture; empty behind the camera.
std::optional<Projected> ProjectPoint(const View& view, const WorldPoint& p) {
  const Vector3d c = view.cam_from_world * p.point;
  if (c.z() < kNearestDepthMm) return std::nullopt;
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix<double, 2, 3> d;
  d << k.fx_px / c.z(), 0, -k.fx_px * c.x() / (c.z() * c.z()), 0, k.fy_px / c.z(),
      -k.fy_px * c.y() / (c.z() * c.z());
  return Projected{k.IdealFromNormalized({c.x() / c.z(), c.y() / c.z()}),
                   d * view.cam_from_world.rotation * p.by_state};
}

WorldPoint Between(const WorldPoint& a, const WorldPoint& b, double t) {
  return {(1 - t) * a.point + t * b.point, (1 - t) * a.by_state + t * b.by_state};
}

// The two ends of an edge, cut off in front of the camera.
bool ClippedEdge(const WorldSolid& solid, int edge, const View& view, WorldPoint* a, WorldPoint* b) {
  const auto& e = solid.edges[std::size_t(edge)];
  const WorldPoint &p = solid.vertices[std::size_t(e.start)], &q = solid.vertices[std::size_t(e.end)];
  const double zp = (view.cam_from_world * p.point).z(), zq = (view.cam_from_world * q.point).z(),
               z0 = 2 * kNearestDepthMm;
  if (zp < z0 && zq < z0) return false;
  *a = zp < z0 ? Between(p, q, (z0 - zp) / (zq - zp)) : p;
  *b = zq < z0 ? Between(p, q, (z0 - zp) / (zq - zp)) : q;
  return true;
}

WorldPoint OnCircle(const WorldSolid::Circle& c, double t) {
  const Vector3d out = c.axis_u * std::cos(t) + c.axis_v * std::sin(t);
  return {c.center.point + c.radius_mm * out, c.center.by_state + out * c.radius_by_state};
}

// Signed distance of `m` from the line through a and b, its derivative, and where along it (0 at a, 1 at b).
struct LineDistance {
  double distance = 0, along = 0;
  Eigen::RowVectorXd by_state;
};
std::optional<LineDistance> DistanceFromEdge(const Vector2d& m, const Projected& a, const Projected& b) {
  const Vector2d d = b.ideal - a.ideal;
  const double length2 = d.squaredNorm();
  if (length2 < 1e-6) return std::nullopt;
  const Vector2d n = Vector2d(-d.y(), d.x()) / std::sqrt(length2);
  LineDistance out;
  out.distance = n.dot(m - a.ideal);
  out.along = (m - a.ideal).dot(d) / length2;
  out.by_state = -n.transpose() * ((1 - out.along) * a.by_state + out.along * b.by_state);
  return out;
}

// Distance of `m` from the projected rim, by search on its angle.
std::optional<LineDistance> DistanceFromCircle(const Vector2d& m, const WorldSolid::Circle& c,
                                               const View& view) {
  auto distance2 = [&](double t) {
    const auto p = view.ProjectIdeal(OnCircle(c, t).point);
    return p ? (*p - m).squaredNorm() : INFINITY;
  };
  double best = 0, least = INFINITY;
  constexpr int kSteps = 48;
  for (int k = 0; k < kSteps; ++k)
    if (const double d = distance2(2 * kPi * k / kSteps); d < least) {
      least = d;
      best = 2 * kPi * k / kSteps;
    }
  for (double step = kPi / kSteps; step > 1e-6; step /= 2)
    for (double t : {best - step, best + step})
      if (const double d = distance2(t); d < least) {
        least = d;
        best = t;
      }
  const auto p = ProjectPoint(view, OnCircle(c, best)), q = ProjectPoint(view, OnCircle(c, best + 1e-4));
  if (!p || !q) return std::nullopt;
  const Vector2d tangent = (q->ideal - p->ideal).normalized(), n(-tangent.y(), tangent.x());
  return LineDistance{n.dot(m - p->ideal), best, -n.transpose() * p->by_state};
}

void AddRow(PickResiduals& out, double r, Eigen::RowVectorXd j) {
  out.r.push_back(r);
  out.j.push_back(std::move(j));
}

void AddSegment(const Pick& pick, const WorldSolid& solid, const View& view, PickResiduals& out) {
  WorldPoint a, b;
  std::optional<Projected> pa, pb;
  if (ClippedEdge(solid, pick.contour, view, &a, &b)) pa = ProjectPoint(view, a), pb = ProjectPoint(view, b);
  std::optional<LineDistance> d0, d1;
  if (pa && pb)
    d0 = DistanceFromEdge(pick.ideal_start, *pa, *pb), d1 = DistanceFromEdge(pick.ideal_end, *pa, *pb);
  if (!d0 || !d1) {
    ++out.unseen;
    out.pick_rms_px.push_back(INFINITY);
    return;
  }
  const double length = std::max(1.0, (pick.ideal_end - pick.ideal_start).norm());
  const double sigma_offset = std::hypot(pick.sigma_offset_px, kBiasPx),
               sigma_angle = std::hypot(pick.sigma_angle_rad, 2 * kBiasPx / length);
  AddRow(out, (d0->distance + d1->distance) / 2 / sigma_offset,
         (d0->by_state + d1->by_state) / 2 / sigma_offset);
  AddRow(out, (d1->distance - d0->distance) / length / sigma_angle,
         (d1->by_state - d0->by_state) / length / sigma_angle);
  out.pick_rms_px.push_back(std::sqrt(
      (d0->distance * d0->distance + d0->distance * d1->distance + d1->distance * d1->distance) / 3));
  const double edge_px = (pb->ideal - pa->ideal).norm();
  for (double t : {d0->along, d1->along}) {
    const double beyond = edge_px * std::max({0.0, -t, t - 1}) / kOvershootPx;
    if (beyond > 1) out.overshoot += beyond * beyond;
  }
}

void AddArc(const Pick& pick, const WorldSolid& solid, const View& view, PickResiduals& out) {
  double sum = 0;
  const double sigma =
      std::hypot(pick.sigma_offset_px, kBiasPx) * std::sqrt(double(pick.ideal_points.size()) / 3);
  for (const auto& m : pick.ideal_points) {
    const auto d = DistanceFromCircle(m, solid.circles[std::size_t(pick.contour)], view);
    if (!d) {
      ++out.unseen;
      continue;
    }
    AddRow(out, d->distance / sigma, d->by_state / sigma);
    sum += d->distance * d->distance;
  }
  out.pick_rms_px.push_back(std::sqrt(sum / double(std::max<std::size_t>(1, pick.ideal_points.size()))));
}

}  // namespace

PickResiduals ResidualsOf(const FitQuestion& q, const PlacedObject& object, const std::vector<View>& views) {
  PickResiduals out;
  const WorldSolid solid = PlaceSolid(object);
  for (const auto& pick : q.picks) {
    if (pick.is_circle)
      AddArc(pick, solid, views[std::size_t(pick.image)], out);
    else
      AddSegment(pick, solid, views[std::size_t(pick.image)], out);
  }
  return out;
}

std::vector<Eigen::RowVectorXd> RowsOfContour(const WorldSolid& solid, bool is_circle, int contour,
                                              const View& view, const std::vector<Vector2d>& points) {
  std::vector<Eigen::RowVectorXd> rows;
  WorldPoint a, b;
  std::optional<Projected> pa, pb;
  if (!is_circle && ClippedEdge(solid, contour, view, &a, &b))
    pa = ProjectPoint(view, a), pb = ProjectPoint(view, b);
  for (const auto& m : points) {
    std::optional<LineDistance> d;
    if (is_circle)
      d = DistanceFromCircle(m, solid.circles[std::size_t(contour)], view);
    else if (pa && pb)
      d = DistanceFromEdge(m, *pa, *pb);
    if (!d) return {};
    rows.push_back(d->by_state / kBiasPx);
  }
  return rows;
}

}  // namespace vss::station
