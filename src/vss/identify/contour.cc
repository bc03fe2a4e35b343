#include "vss/identify/contour.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "vss/identify/views_that_see.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A point on an edge lies on its own faces: rays stop this far before it, so that it does not hide itself.
constexpr double kSelfMarginMm = 0.5;
// The facets of a cylinder lie off it by less than this share of its radius (knowledge/build_solid.cc:
// .0021).
constexpr double kFacetShare = 0.003;

struct Sampler {
  const WorldSolid& solid;
  const View& view;
  const ContourSampling& sampling;
  Screen self, made;
  const Screen* others = nullptr;
  int except = Screen::kNobody;
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
    if (around && !around->Empty()) {
      others = &around->ScreenOf(view, made);
      except = around->Left();
    }
    // A convex solid hides its own contour only by faces turned away; any other by faces turned to the
    // camera, which a ray from there meets first.
    const bool convex = solid.circles.empty() && std::all_of(solid.edges.begin(), solid.edges.end(),
                                                             [](const SolidEdge& e) { return e.convex; });
    if (convex) return;
    for (const auto& f : solid.faces) self.Add(view, f.triangles);
  }

  bool FaceFront(int face, const Vector3d& at) const {
    const auto& f = solid.faces[static_cast<std::size_t>(face)];
    if (!f.is_cylinder) return front[static_cast<std::size_t>(face)];
    Vector3d out = at - f.axis_point;
    out -= f.axis_direction * f.axis_direction.dot(out);
    return (f.is_hole ? -1.0 : 1.0) * out.dot(view.center_in_world - at) > 0;
  }

  // Wherever one looks at the edge?
  bool BothTurnedAway(const SolidEdge& e) const {
    const auto away = [&](int face) {
      return !solid.faces[static_cast<std::size_t>(face)].is_cylinder &&
             !front[static_cast<std::size_t>(face)];
    };
    return away(e.left_face) && away(e.right_face);
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
                       !(others && others->Hides(ideal, q.z(), margin(sampling.touch_mm),
                                                 view.center_in_world, target, except));
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
      if (BothTurnedAway(e)) continue;
      const Vector3d& a = solid.vertices[static_cast<std::size_t>(e.start)].point;
      const Vector3d& b = solid.vertices[static_cast<std::size_t>(e.end)].point;
      if (view.SurelyMisses(a, b)) continue;
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
  bodies_.push_back(std::make_shared<const Body>(std::move(body)));
  screens_.reset();
}

void Occluders::Prepare(std::span<const View> views) {
  auto screens = std::make_shared<Screens>();
  screens->views = views;
  for (const View& view : views) {
    Screen& screen = screens->of_view.emplace_back();
    for (const auto& body : bodies_)
      if (view.MayShowBall(body->center, body->radius)) screen.Add(view, body->triangles, body->owner);
  }
  screens_ = std::move(screens);
}

Occluders Occluders::Without(int owner) const {
  Occluders rest = *this;
  std::erase_if(rest.bodies_, [&](const auto& body) { return body->owner == owner; });
  rest.left_ = owner;
  return rest;
}

const Screen& Occluders::ScreenOf(const View& view, Screen& made) const {
  if (screens_) {
    const View* first = screens_->views.data();
    const std::less<const View*> before;
    if (!before(&view, first) && before(&view, first + screens_->views.size()))
      return screens_->of_view[std::size_t(&view - first)];
  }
  for (const auto& body : bodies_) made.Add(view, body->triangles, body->owner);
  return made;
}

bool Occluders::Free(const Vector3d& eye, const Vector3d& point, double margin_mm) const {
  const Vector3d d = point - eye;
  const double length = d.norm();
  const double limit = 1 - margin_mm / std::max(length, margin_mm);
  for (const auto& body : bodies_) {
    const double along = std::clamp((body->center - eye).dot(d) / (length * length), 0.0, 1.0);
    if ((eye + along * d - body->center).squaredNorm() > body->radius * body->radius) continue;
    for (const auto& t : body->triangles)
      if (Meets(eye, d, limit, t)) return false;
  }
  return true;
}

double Occluders::Cast(const Vector3d& origin, const Vector3d& direction, double most_mm) const {
  constexpr double kSquarely = -0.995;
  double nearest = INFINITY;
  for (const auto& body : bodies_) {
    const double along = std::clamp((body->center - origin).dot(direction), 0.0, most_mm);
    if ((origin + along * direction - body->center).squaredNorm() > body->radius * body->radius) continue;
    for (const auto& t : body->triangles) {
      const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
      if (normal.dot(direction) > kSquarely || !Meets(origin, direction, most_mm, t)) continue;
      nearest = std::min(nearest, normal.dot(t[0] - origin) / normal.dot(direction));
    }
  }
  return nearest;
}

std::vector<Occluders> OthersOf(std::span<const WorldSolid> solids) {
  std::vector<Occluders> out(solids.size());
  for (std::size_t i = 0; i < solids.size(); ++i)
    for (std::size_t k = 0; k < solids.size(); ++k)
      if (k != i) out[i].Add(solids[k], static_cast<int>(k));
  return out;
}

std::vector<Occluders> OthersOf(std::span<const WorldSolid> solids, std::span<const View> views) {
  Occluders all;
  for (std::size_t i = 0; i < solids.size(); ++i) all.Add(solids[i], static_cast<int>(i));
  all.Prepare(views);
  std::vector<Occluders> out;
  for (std::size_t i = 0; i < solids.size(); ++i) out.push_back(all.Without(static_cast<int>(i)));
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
  Screen made;
  const Screen& screen = others.ScreenOf(view, made);
  const auto& k = view.camera->intrinsics;
  std::vector<bool> hidden(points_in_world.size());
  for (std::size_t i = 0; i < points_in_world.size(); ++i) {
    const Vector3d p = view.cam_from_world * points_in_world[i];
    const double margin = std::min(touch_mm / std::max(p.norm(), 1.0), 0.5);
    hidden[i] = screen.Hides(k.IdealFromNormalized({p.x() / p.z(), p.y() / p.z()}), p.z(), margin,
                             view.center_in_world, points_in_world[i], others.Left());
  }
  return hidden;
}

StateColumns SampleByState(const WorldSolid& solid, const ContourSample& s) {
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
  std::vector<int> all(views.size());
  std::iota(all.begin(), all.end(), 0);
  return ViewsThatSee(solid, views, all, most);
}

}  // namespace vss
