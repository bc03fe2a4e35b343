#include "vss/simulate/shadows.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHighestShare = 0.98;  // of the lamp's height: what reaches higher is cut there
// A pixel is a square; a disc of this share of its side has its variance (1/12 = share^2 / 4).
constexpr double kPixelDisc = 0.577;

// atan2 to 1e-6 (a minimax polynomial after Abramowitz, Stegun 4.4.49): shadows need no more.
double QuickAtan2(double y, double x) {
  const double ax = std::abs(x), ay = std::abs(y), big = std::max(ax, ay);
  if (!(big > 0)) return 0;
  const double q = std::min(ax, ay) / big, s = q * q;
  double a =
      q * (1 + s * (-0.3333314528 +
                    s * (0.1999355085 +
                         s * (-0.1420889944 +
                              s * (0.1065626393 +
                                   s * (-0.0752896400 +
                                        s * (0.0429096138 + s * (-0.0161657367 + s * 0.0028662257))))))));
  if (ay > ax) a = kPi / 2 - a;
  if (x < 0) a = kPi - a;
  return y < 0 ? -a : a;
}

double Cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
double AngleBetween(const Vector2d& a, const Vector2d& b) { return QuickAtan2(Cross(a, b), a.dot(b)); }
double AngleOf(const Vector2d& a) { return QuickAtan2(a.y(), a.x()); }

// The angle (rad, of a whole turn for a disc that is covered whole) that an edge adds which crosses a disc
// about the origin; empty where it does not cross it. `radius2`: the disc's radius, squared, for the edge's
// place nearest to the middle, where it lies at share t of the way.
template <class Radius2>
std::optional<double> CrossingAngle(const Vector2d& a, const Vector2d& b, double most_radius2,
                                    const Radius2& radius2) {
  const Vector2d d = b - a;
  const double length2 = d.squaredNorm(), cross = Cross(a, b);
  if (!(length2 > 0) || cross * cross >= most_radius2 * length2) return std::nullopt;
  const double towards = -a.dot(d);
  if (towards < 0 ? a.squaredNorm() >= most_radius2 : towards > length2 && b.squaredNorm() >= most_radius2)
    return std::nullopt;  // the nearest place is an end
  const double middle = towards / length2, r2 = radius2(std::clamp(middle, 0.0, 1.0));
  const double reach2 = r2 * length2 - cross * cross;
  if (reach2 <= 0) return std::nullopt;
  const double half = std::sqrt(reach2) / length2;
  if (middle - half >= 1 || middle + half <= 0) return std::nullopt;
  const double from = std::max(middle - half, 0.0), to = std::min(middle + half, 1.0);
  double angle = cross * (to - from) / r2;
  if (from > 0) angle += AngleBetween(a, a + from * d);
  if (to < 1) angle += AngleBetween(a + to * d, b);
  return angle;
}

// The polygon's part on the side of `sign` * (z - level) >= 0. The same edge gives the same cut from either
// side.
std::vector<Vector3d> Clip(const std::vector<Vector3d>& polygon, double level, double sign) {
  std::vector<Vector3d> out;
  const std::size_t n = polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vector3d &a = polygon[i], &b = polygon[(i + 1) % n];
    const bool a_in = sign * (a.z() - level) >= 0, b_in = sign * (b.z() - level) >= 0;
    if (a_in) out.push_back(a);
    if (a_in == b_in) continue;
    const bool forward = std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
    const Vector3d &p = forward ? a : b, &q = forward ? b : a;
    Vector3d cut = p + (q - p) * ((level - p.z()) / (q.z() - p.z()));
    cut.z() = level;
    out.push_back(cut);
  }
  return out;
}

// Counter-clockwise (Andrew's monotone chain, 1979).
std::vector<Vector2d> Hull(std::vector<Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = hull.size();
    for (const Vector2d& p : points) {
      while (hull.size() >= base + 2 &&
             Cross(hull.back() - hull[hull.size() - 2], p - hull[hull.size() - 2]) <= 0)
        hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

// Collects directed edges; one and its reverse cancel.
class Outline {
 public:
  void Add(const std::vector<Vector3d>& polygon) {
    const std::size_t n = polygon.size();
    for (std::size_t i = 0; i < n; ++i) {
      const int a = IndexOf(polygon[i]), b = IndexOf(polygon[(i + 1) % n]);
      if (a == b) continue;
      ++count_[{a, b}];
    }
  }
  // The edges that are left, one after the other.
  std::vector<std::vector<Vector3d>> Loops() {
    std::map<int, std::vector<int>> next;
    for (const auto& [edge, count] : count_) {
      const auto back = count_.find({edge[1], edge[0]});
      for (int k = back == count_.end() ? 0 : back->second; k < count; ++k) next[edge[0]].push_back(edge[1]);
    }
    std::vector<std::vector<Vector3d>> loops;
    while (!next.empty()) {
      auto& loop = loops.emplace_back();
      for (auto at = next.begin(); at != next.end();) {
        loop.push_back(corners_[std::size_t(at->first)]);
        const int to = at->second.back();
        at->second.pop_back();
        if (at->second.empty()) next.erase(at);
        at = next.find(to);
      }
    }
    return loops;
  }

 private:
  int IndexOf(const Vector3d& p) {
    const auto [place, is_new] = index_.try_emplace({p.x(), p.y(), p.z()}, static_cast<int>(corners_.size()));
    if (is_new) corners_.push_back(p);
    return place->second;
  }
  std::map<std::array<double, 3>, int> index_;
  std::map<std::array<int, 2>, int> count_;
  std::vector<Vector3d> corners_;
};

}  // namespace

Shadows::Shadows(const SceneMesh& mesh, std::vector<PlacedLamp> lamps)
    : mesh_(mesh), lamps_(std::move(lamps)) {
  receivers_.resize(mesh.planes.size());
  for (auto& row : receivers_) row.resize(lamps_.size());
}

Shadows::Receiver& Shadows::ReceiverOf(int plane, int lamp) {
  auto& place = receivers_[std::size_t(plane)][std::size_t(lamp)];
  if (place) return *place;
  place = std::make_unique<Receiver>();
  Receiver& r = *place;
  const SceneMesh::Plane& p = mesh_.planes[std::size_t(plane)];
  r.normal = p.normal;
  r.origin = p.normal * p.offset;
  r.axis_u =
      (std::abs(p.normal.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY()).cross(p.normal).normalized();
  r.axis_v = p.normal.cross(r.axis_u);
  Eigen::Matrix3d axes;
  axes << r.axis_u.transpose(), r.axis_v.transpose(), r.normal.transpose();
  const PlacedLamp& light = lamps_[std::size_t(lamp)];
  r.lamp = light.overhead ? Vector3d(0, 0, light.height_mm) : Vector3d(axes * (light.position - r.origin));
  const double highest = kHighestShare * r.lamp.z();
  // Bodies count from some height above the plane on: what touches it is cut there, since its projection
  // would be at infinity.
  const double lowest = p.shadow_from_mm;
  if (highest <= lowest) return r;
  for (const auto& caster : mesh_.casters) {
    if (!MayShade(caster, p, light)) continue;
    Outline outline;
    bool any = false;
    for (std::size_t i = 0; i < caster.triangles.size(); ++i) {
      const Vector3d& n = caster.normals[i];
      const double towards =
          light.overhead ? n.dot(r.normal) : n.dot(light.position - caster.triangles[i][0]);
      if (!(towards > 0)) continue;
      std::vector<Vector3d> polygon;
      double top = -1;
      for (const Vector3d& corner : caster.triangles[i]) {
        polygon.push_back(axes * (corner - r.origin));
        top = std::max(top, polygon.back().z());
      }
      if (top <= lowest) continue;
      polygon = Clip(Clip(polygon, lowest, 1), highest, -1);
      if (polygon.size() < 3) continue;
      outline.Add(polygon);
      any = true;
    }
    if (!any) continue;
    Body body;
    std::vector<Vector2d> shadow;
    for (const auto& loop : outline.Loops()) {
      auto& corners = body.loops.emplace_back();
      for (const Vector3d& c : loop) {
        corners.push_back({c.head<2>(), r.lamp.z() / c.z()});
        const double stretch = c.z() / (r.lamp.z() - c.z());
        shadow.push_back(light.overhead ? Vector2d(c.head<2>())
                                        : Vector2d(c.head<2>() + (c - r.lamp).head<2>() * stretch));
        body.penumbra_mm = std::max(body.penumbra_mm, light.radius_mm * stretch);
      }
    }
    if (shadow.size() < 3) continue;
    body.hull = Hull(std::move(shadow));
    r.bodies.push_back(std::move(body));
  }
  return r;
}

// Does the caster's ball reach between the plane's ball and the lamp's?
bool Shadows::MayShade(const SceneMesh::Caster& caster, const SceneMesh::Plane& plane,
                       const PlacedLamp& lamp) const {
  if (plane.normal.dot(caster.middle) - plane.offset + caster.radius_mm <= plane.shadow_from_mm) return false;
  if (!std::isfinite(plane.radius_mm)) return true;
  const Vector3d end = lamp.overhead ? Vector3d(plane.middle + plane.normal * lamp.height_mm) : lamp.position;
  const Vector3d way = end - plane.middle;
  const double t = std::clamp((caster.middle - plane.middle).dot(way) / way.squaredNorm(), 0.0, 1.0);
  return (caster.middle - plane.middle - t * way).norm() <
         caster.radius_mm + std::max(plane.radius_mm, lamp.radius_mm);
}

bool Shadows::Touches(const Body& body, const Vector2d& p, double radius_mm) {
  const std::size_t n = body.hull.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2d &a = body.hull[i], d = body.hull[(i + 1) % n] - a;
    if (Cross(d, p - a) < -(radius_mm + body.penumbra_mm) * d.norm()) return false;
  }
  return true;
}

void Shadows::Near(int plane, int lamp, const Vector3d& point, double radius_mm, std::vector<int>& bodies) {
  bodies.clear();
  const Receiver& r = ReceiverOf(plane, lamp);
  const Vector3d d = point - r.origin;
  const Vector2d p(r.axis_u.dot(d), r.axis_v.dot(d));
  for (std::size_t i = 0; i < r.bodies.size(); ++i)
    if (Touches(r.bodies[i], p, radius_mm)) bodies.push_back(static_cast<int>(i));
}

// The angle (rad) that a closed outline adds; see the top of the header.
double Shadows::LoopAngle(const std::vector<Body::Corner>& loop, const Vector2d& p,
                          const Vector2d& lamp_from_point, double radius_mm, double blur_mm) {
  const double radius2 = radius_mm * radius_mm;
  // How far a step across the pixel moves a corner over the disc depends on its scale.
  const auto blurred2 = [&](double scale) {
    const double blur = blur_mm * (scale - 1);
    return radius2 + blur * blur;
  };
  const auto project = [&](const Body::Corner& c) -> Vector2d {
    return (c.place - p) * c.scale - lamp_from_point;
  };
  double angle = 0;
  int turns = 0;
  bool first_crosses = false, last_crosses = false;
  const Vector2d start = project(loop[0]);
  Vector2d a = start;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Body::Corner &from = loop[i], &to = loop[i + 1 < loop.size() ? i + 1 : 0];
    const Vector2d b = i + 1 < loop.size() ? project(to) : start;
    const auto crossing = CrossingAngle(a, b, blurred2(std::max(from.scale, to.scale)), [&](double t) {
      return blurred2(from.scale + t * (to.scale - from.scale));
    });
    if (crossing) {
      angle += *crossing;
    } else if ((a.y() >= 0) !=
               (b.y() >= 0)) {  // around the origin by the negative x axis, where AngleOf jumps
      const double cross = Cross(a, b);
      if (a.y() >= 0 && cross > 0) ++turns;
      if (a.y() < 0 && cross < 0) --turns;
    }
    const bool crosses = crossing.has_value();
    if (i == 0)
      first_crosses = crosses;
    else if (crosses != last_crosses)
      angle += crosses ? AngleOf(a) : -AngleOf(a);
    last_crosses = crosses;
    a = b;
  }
  if (first_crosses != last_crosses) angle += first_crosses ? AngleOf(start) : -AngleOf(start);
  return angle + 2 * kPi * turns;
}

double Shadows::Covered(int plane, int lamp, const Vector3d& point, double pixel_mm,
                        const std::vector<int>& bodies) {
  const Receiver& r = ReceiverOf(plane, lamp);
  const PlacedLamp& light = lamps_[std::size_t(lamp)];
  const Vector3d from_origin = point - r.origin;
  const Vector2d p(r.axis_u.dot(from_origin), r.axis_v.dot(from_origin));
  const Vector2d lamp_from_point = light.overhead ? Vector2d::Zero() : Vector2d(r.lamp.head<2>() - p);
  double open = 1;
  for (const int i : bodies) {
    const Body& body = r.bodies[std::size_t(i)];
    if (!Touches(body, p, pixel_mm)) continue;
    double angle = 0;
    for (const auto& loop : body.loops)
      angle += LoopAngle(loop, p, lamp_from_point, light.radius_mm, kPixelDisc * pixel_mm);
    const double covered = angle / (2 * kPi);
    open *= 1 - std::clamp(covered, 0.0, 1.0);
  }
  return 1 - open;
}

}  // namespace vss
