#include "vss/identify/contour.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Does the segment eye + s * d, s in (0, limit), meet the triangle? (Moeller, Trumbore 1997.)
bool Meets(const Vector3d& eye, const Vector3d& d, double limit, const std::array<Vector3d, 3>& t) {
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

// Is the front of the triangle turned to `eye`?
bool Toward(const std::array<Vector3d, 3>& t, const Vector3d& eye) {
  return (t[1] - t[0]).cross(t[2] - t[0]).dot(eye - t[0]) > 0;
}

// A point on an edge lies on its own faces: rays stop this far before it, so that it does not hide itself.
constexpr double kSelfMarginMm = 0.5;
// The facets of a cylinder lie off it by less than this share of its radius (knowledge/build_solid.cc:
// .0021).
constexpr double kFacetShare = 0.003;

// What can hide, as a picture shows it: triangles in `ideal` px, the inverse depth an affine function there.
class Screen {
 public:
  void Add(const View& view, const std::array<Vector3d, 3>& triangle) {
    constexpr double kMinDepthMm = 1.0;
    const auto& k = view.camera->intrinsics;
    Triangle t;
    Vector2d p[3];
    double inverse[3];
    for (int i = 0; i < 3; ++i) {
      const Vector3d c = view.cam_from_world * triangle[std::size_t(i)];
      if (c.z() < kMinDepthMm) {  // reaches behind the camera
        near_.push_back(triangle);
        return;
      }
      p[i] = {k.fx_px * c.x() / c.z() + k.cx_px, k.fy_px * c.y() / c.z() + k.cy_px};
      inverse[i] = 1 / c.z();
    }
    const double area = (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
    if (std::abs(area) < 1e-9) return;
    t.lo = p[0].cwiseMin(p[1]).cwiseMin(p[2]);
    t.hi = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
    // Barycentric coordinates as affine functions of the place.
    for (int i = 0; i < 3; ++i) {
      const Vector2d &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
      t.share[i] = Vector3d(a.y() - b.y(), b.x() - a.x(), a.x() * b.y() - a.y() * b.x()) / area;
    }
    t.inverse_depth = inverse[0] * t.share[0] + inverse[1] * t.share[1] + inverse[2] * t.share[2];
    triangles_.push_back(t);
  }

  // Does anything hide the point, which projects to `ideal` at `depth`, from more than `margin` (a share of
  // the distance) before it?
  bool Hides(const Vector2d& ideal, double depth, double margin, const Vector3d& eye,
             const Vector3d& point) const {
    const double least = 1 / (depth * (1 - margin));
    const Vector3d at(ideal.x(), ideal.y(), 1);
    for (const auto& t : triangles_) {
      if (ideal.x() < t.lo.x() || ideal.x() > t.hi.x() || ideal.y() < t.lo.y() || ideal.y() > t.hi.y())
        continue;
      if (t.inverse_depth.dot(at) <= least) continue;
      if (t.share[0].dot(at) >= 0 && t.share[1].dot(at) >= 0 && t.share[2].dot(at) >= 0) return true;
    }
    for (const auto& t : near_)
      if (Meets(eye, point - eye, 1 - margin, t)) return true;
    return false;
  }

 private:
  struct Triangle {
    Vector2d lo, hi;
    Vector3d share[3];
    Vector3d inverse_depth;
  };
  std::vector<Triangle> triangles_;
  std::vector<std::array<Vector3d, 3>> near_;
};

struct Sampler {
  const WorldSolid& solid;
  const View& view;
  const ContourSampling& sampling;
  Screen self, others;
  std::vector<bool> front;
  std::vector<ContourSample> samples;

  Sampler(const WorldSolid& s, const View& v, const ContourSampling& how, const Occluders* around)
      : solid(s), view(v), sampling(how) {
    front.resize(solid.faces.size());
    for (std::size_t i = 0; i < solid.faces.size(); ++i) {
      const auto& f = solid.faces[i];
      front[i] = f.is_cylinder || f.triangles.empty() ||
                 f.normal_in_part.dot(view.center_in_world - f.triangles[0][0]) > 0;
    }
    if (!sampling.visibility) return;
    if (around) {
      std::vector<const std::array<Vector3d, 3>*> facing;
      around->Facing(view.center_in_world, facing);
      for (const auto* t : facing) others.Add(view, *t);
    }
    // A convex solid hides its own contour only by faces turned away; any other by faces turned to the
    // camera, which a ray from there meets first.
    const bool convex = solid.circles.empty() && std::all_of(solid.edges.begin(), solid.edges.end(),
                                                             [](const SolidEdge& e) { return e.convex; });
    if (convex) return;
    for (const auto& f : solid.faces)
      for (const auto& t : f.triangles)
        if (Toward(t, view.center_in_world)) self.Add(view, t);
  }

  bool FaceFront(int face, const Vector3d& at) const {
    const auto& f = solid.faces[static_cast<std::size_t>(face)];
    if (!f.is_cylinder) return front[static_cast<std::size_t>(face)];
    Vector3d out = at - f.axis_point;
    out -= f.axis_direction * f.axis_direction.dot(out);
    return (f.is_hole ? -1.0 : 1.0) * out.dot(view.center_in_world - at) > 0;
  }

  // `step_mm`: the contour's piece. `lift` (mm): where the ray that asks for visibility ends, against the
  // sample's own point.
  void Add(ContourSample sample, const Vector3d& tangent, double step_mm, int face_a, int face_b,
           const Vector3d& lift = Vector3d::Zero()) {
    constexpr double kMinDepthMm = 1.0;
    const bool a = FaceFront(face_a, sample.point_in_world), b = FaceFront(face_b, sample.point_in_world);
    if (!a && !b && sample.source != ContourSample::Source::kLimb) return;
    const auto& k = view.camera->intrinsics;
    const Vector3d p = view.cam_from_world * sample.point_in_world;
    if (p.z() < kMinDepthMm) return;
    const Vector2d normalized(p.x() / p.z(), p.y() / p.z());
    sample.ideal = k.IdealFromNormalized(normalized);
    if (!view.maybe_inside.contains(sample.ideal)) return;
    if (sampling.img || !view.surely_inside.contains(sample.ideal)) {
      const auto img = view.ProjectInside(sample.point_in_world);
      if (!img) return;
      sample.img = *img;
    }
    const Vector3d d = view.cam_from_world.rotation * tangent;
    const Vector2d direction(k.fx_px * (d.x() - normalized.x() * d.z()),
                             k.fy_px * (d.y() - normalized.y() * d.z()));
    const double length = direction.norm();
    if (length < 1e-9 * k.fx_px) return;
    sample.ideal_tangent = direction / length;
    sample.step_px = step_mm * length / p.z();
    sample.silhouette = a != b || sample.source == ContourSample::Source::kLimb;
    sample.visible = true;
    if (sampling.visibility) {
      const bool lifted = !lift.isZero(0);
      const Vector3d q = lifted ? Vector3d(view.cam_from_world * (sample.point_in_world + lift)) : p;
      const Vector2d ideal = lifted ? k.IdealFromNormalized({q.x() / q.z(), q.y() / q.z()}) : sample.ideal;
      const Vector3d target = sample.point_in_world + lift;
      const double distance = std::max(q.norm(), 1.0);
      auto margin = [&](double mm) { return std::min(mm / distance, 0.5); };
      sample.visible = !self.Hides(ideal, q.z(), margin(kSelfMarginMm), view.center_in_world, target) &&
                       !others.Hides(ideal, q.z(), margin(sampling.touch_mm), view.center_in_world, target);
    }
    samples.push_back(sample);
  }

  int Count(double length_px) const {
    return std::clamp(static_cast<int>(length_px / sampling.spacing_px), sampling.min_samples,
                      sampling.max_samples);
  }

  double LengthPx(const Vector3d& a, const Vector3d& b) const {
    const double depth = ((a + b) / 2 - view.center_in_world).norm();
    return (b - a).norm() * view.camera->intrinsics.fx_px / std::max(depth, 1.0);
  }

  void Edges() {
    for (std::size_t i = 0; i < solid.edges.size(); ++i) {
      const auto& e = solid.edges[i];
      const Vector3d& a = solid.vertices[static_cast<std::size_t>(e.start)].point;
      const Vector3d& b = solid.vertices[static_cast<std::size_t>(e.end)].point;
      const int n = Count(LengthPx(a, b));
      const double length = std::max((b - a).norm(), 1e-9);
      for (int k = 0; k < n; ++k) {
        ContourSample s;
        s.index = static_cast<int>(i);
        s.t = (k + 0.5) / n;
        s.t_step = 1.0 / n;
        s.point_in_world = a + s.t * (b - a);
        Add(s, (b - a) / length, length / n, e.left_face, e.right_face);
      }
    }
  }

  void Circles() {
    for (std::size_t i = 0; i < solid.circles.size(); ++i) {
      const auto& c = solid.circles[i];
      const int n = std::max(8, Count(LengthPx(Vector3d::Zero() + c.center.point,
                                               c.center.point + c.axis_u * (2 * kPi * c.radius_mm))));
      for (int k = 0; k < n; ++k) {
        ContourSample s;
        s.source = ContourSample::Source::kCircle;
        s.index = static_cast<int>(i);
        s.t = 2 * kPi * (k + 0.5) / n;
        s.t_step = 2 * kPi / n;
        const Vector3d out = c.axis_u * std::cos(s.t) + c.axis_v * std::sin(s.t);
        s.point_in_world = c.center.point + c.radius_mm * out;
        // The facets of a hole's wall stand before its true rims, which they would else hide.
        const bool hole = solid.faces[static_cast<std::size_t>(c.cylinder_face)].is_hole;
        const Vector3d lift = hole ? Vector3d(-kFacetShare * c.radius_mm * out) : Vector3d::Zero();
        Add(s, c.normal.cross(out), 2 * kPi * c.radius_mm / n, c.plane_face, c.cylinder_face, lift);
      }
    }
  }

  // The two lines along which a whole cylinder turns away from the camera; its ends are its two rims.
  void Limbs() {
    for (std::size_t i = 0; i < solid.faces.size(); ++i) {
      const auto& f = solid.faces[i];
      if (!f.is_cylinder || f.is_hole) continue;
      std::vector<const WorldSolid::Circle*> rims;
      for (const auto& c : solid.circles)
        if (c.cylinder_face == static_cast<int>(i)) rims.push_back(&c);
      if (rims.size() != 2) continue;
      const Vector3d& axis = f.axis_direction;
      Vector3d to_eye = view.center_in_world - rims[0]->center.point;
      to_eye -= axis * axis.dot(to_eye);
      const double distance = to_eye.norm(), radius = rims[0]->radius_mm;
      if (distance <= radius) continue;  // the camera looks down the axis
      const double along = radius / distance;
      const Vector3d forward = to_eye / distance, side = axis.cross(forward);
      for (int sign : {-1, 1}) {
        const Vector3d out = forward * along + side * (sign * std::sqrt(1 - along * along));
        const Vector3d a = rims[0]->center.point + out * radius, b = rims[1]->center.point + out * radius;
        const int n = Count(LengthPx(a, b));
        for (int k = 0; k < n; ++k) {
          ContourSample s;
          s.source = ContourSample::Source::kLimb;
          s.index = static_cast<int>(i);
          s.limb_side = sign;
          s.t = (k + 0.5) / n;
          s.t_step = 1.0 / n;
          s.point_in_world = a + s.t * (b - a);
          // Seen a hair outside the faceted cylinder, which would else hide its own limb.
          Add(s, axis, (b - a).norm() / n, static_cast<int>(i), static_cast<int>(i), out * kSelfMarginMm);
        }
      }
    }
  }
};

}  // namespace

void Occluders::Add(const WorldSolid& solid, int owner) {
  Body body;
  body.owner = owner;
  Eigen::AlignedBox3d box;
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles) {
      body.triangles.push_back(t);
      for (const auto& v : t) box.extend(v);
    }
  if (body.triangles.empty()) return;
  body.center = box.center();
  body.radius = box.sizes().norm() / 2;
  bodies_.push_back(std::move(body));
}

bool Occluders::Free(const Vector3d& eye, const Vector3d& point, double margin_mm) const {
  const Vector3d d = point - eye;
  const double length = d.norm();
  const double limit = 1 - margin_mm / std::max(length, margin_mm);
  for (const auto& body : bodies_) {
    const double along = std::clamp((body.center - eye).dot(d) / (length * length), 0.0, 1.0);
    if ((eye + along * d - body.center).squaredNorm() > body.radius * body.radius) continue;
    for (const auto& t : body.triangles)
      if (Meets(eye, d, limit, t)) return false;
  }
  return true;
}

double Occluders::Cast(const Vector3d& origin, const Vector3d& direction, double most_mm) const {
  constexpr double kSquarely = -0.995;
  double nearest = INFINITY;
  for (const auto& body : bodies_) {
    const double along = std::clamp((body.center - origin).dot(direction), 0.0, most_mm);
    if ((origin + along * direction - body.center).squaredNorm() > body.radius * body.radius) continue;
    for (const auto& t : body.triangles) {
      const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
      if (normal.dot(direction) > kSquarely || !Meets(origin, direction, most_mm, t)) continue;
      nearest = std::min(nearest, normal.dot(t[0] - origin) / normal.dot(direction));
    }
  }
  return nearest;
}

void Occluders::Facing(const Vector3d& eye, std::vector<const std::array<Vector3d, 3>*>& out) const {
  for (const auto& body : bodies_)
    for (const auto& t : body.triangles)
      if (Toward(t, eye)) out.push_back(&t);
}

std::vector<Occluders> OthersOf(std::span<const WorldSolid> solids) {
  std::vector<Occluders> out(solids.size());
  for (std::size_t i = 0; i < solids.size(); ++i)
    for (std::size_t k = 0; k < solids.size(); ++k)
      if (k != i) out[i].Add(solids[k], static_cast<int>(k));
  return out;
}

std::vector<ContourSample> SampleContour(const WorldSolid& solid, const View& view,
                                         const ContourSampling& sampling, const Occluders* others) {
  constexpr std::size_t kUsual = 6;  // samples of a contour that shows
  Sampler sampler(solid, view, sampling, others);
  sampler.samples.reserve(kUsual * (solid.edges.size() + solid.circles.size()));
  sampler.Edges();
  sampler.Circles();
  sampler.Limbs();
  return std::move(sampler.samples);
}

std::vector<ContourSample> SampleContour(const WorldSolid& solid, const View& view, double spacing_px,
                                         int min_samples, const Occluders* others, double touch_mm) {
  ContourSampling sampling;
  sampling.spacing_px = spacing_px;
  sampling.min_samples = min_samples;
  sampling.touch_mm = touch_mm;
  return SampleContour(solid, view, sampling, others);
}

std::vector<bool> HiddenBy(const View& view, const Occluders& others,
                           std::span<const Vector3d> points_in_world, double touch_mm) {
  std::vector<const std::array<Vector3d, 3>*> facing;
  others.Facing(view.center_in_world, facing);
  Screen screen;
  for (const auto* t : facing) screen.Add(view, *t);
  const auto& k = view.camera->intrinsics;
  std::vector<bool> hidden(points_in_world.size());
  for (std::size_t i = 0; i < points_in_world.size(); ++i) {
    const Vector3d p = view.cam_from_world * points_in_world[i];
    const double margin = std::min(touch_mm / std::max(p.norm(), 1.0), 0.5);
    hidden[i] = screen.Hides(k.IdealFromNormalized({p.x() / p.z(), p.y() / p.z()}), p.z(), margin,
                             view.center_in_world, points_in_world[i]);
  }
  return hidden;
}

Eigen::Matrix3Xd SampleByState(const WorldSolid& solid, const ContourSample& s) {
  if (s.source == ContourSample::Source::kEdge) {
    const auto& e = solid.edges[static_cast<std::size_t>(s.index)];
    return (1 - s.t) * solid.vertices[static_cast<std::size_t>(e.start)].by_state +
           s.t * solid.vertices[static_cast<std::size_t>(e.end)].by_state;
  }
  if (s.source == ContourSample::Source::kCircle) {
    const auto& c = solid.circles[static_cast<std::size_t>(s.index)];
    const Vector3d out = c.axis_u * std::cos(s.t) + c.axis_v * std::sin(s.t);
    return c.center.by_state + out * c.radius_by_state;
  }
  const WorldSolid::Circle* rims[2] = {nullptr, nullptr};
  int n = 0;
  for (const auto& c : solid.circles)
    if (c.cylinder_face == s.index && n < 2) rims[n++] = &c;
  const Vector3d axis_point = rims[0]->center.point + s.t * (rims[1]->center.point - rims[0]->center.point);
  const Vector3d out = (s.point_in_world - axis_point).normalized();
  return (1 - s.t) * (rims[0]->center.by_state + out * rims[0]->radius_by_state) +
         s.t * (rims[1]->center.by_state + out * rims[1]->radius_by_state);
}

std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, int most) {
  std::vector<Vector3d> points;
  for (const auto& v : solid.vertices) points.push_back(v.point);
  for (const auto& e : solid.edges)
    for (double t : {0.25, 0.5, 0.75})
      points.push_back((1 - t) * solid.vertices[std::size_t(e.start)].point +
                       t * solid.vertices[std::size_t(e.end)].point);
  for (const auto& c : solid.circles)
    for (int k = 0; k < 8; ++k)
      points.push_back(c.center.point +
                       c.radius_mm * (c.axis_u * std::cos(k * kPi / 4) + c.axis_v * std::sin(k * kPi / 4)));
  std::vector<std::pair<double, int>> seen;
  for (std::size_t i = 0; i < views.size(); ++i) {
    int inside = 0;
    double size = 0;
    for (const auto& p : points) {
      if (!views[i].Shows(p)) continue;
      ++inside;
      size += views[i].camera->intrinsics.fx_px / (p - views[i].center_in_world).norm();
    }
    if (inside > 0) seen.push_back({-size, static_cast<int>(i)});
  }
  std::sort(seen.begin(), seen.end());
  if (static_cast<int>(seen.size()) > most) seen.resize(static_cast<std::size_t>(most));
  std::vector<int> out;
  for (const auto& s : seen) out.push_back(s.second);
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace vss
