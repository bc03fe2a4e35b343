#include "vss/knowledge/build_solid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "vss/knowledge/triangulate.h"

namespace vss {
namespace {

constexpr int kFacetsPerTurn = 48;           // of a cylinder: the chord is off by 0.2 % of the radius
constexpr double kFrameTolerance_mm = 1e-6;  // how far base and centre may be off by rounding

struct Dual2 {
  Dual u, v;
};
Eigen::Vector2d ValueOf(const Dual2& p) { return {p.u.value, p.v.value}; }

// Extrusion axis and cross section to `part`; see Extrusion.
Eigen::Vector3d InPart(int axis, double u, double v, double w) {
  if (axis == 0) return {w, u, v};
  if (axis == 1) return {u, -w, v};
  return {u, v, w};
}

SolidPoint PointInPart(int axis, const Dual& u, const Dual& v, const Dual& w) {
  SolidPoint p;
  p.point_in_part = InPart(axis, u.value, v.value, w.value);
  p.by_dimension.resize(3, w.by_dimension.size());
  for (int i = 0; i < w.by_dimension.size(); ++i)
    p.by_dimension.col(i) = InPart(axis, u.by_dimension[i], v.by_dimension[i], w.by_dimension[i]);
  return p;
}

// One corner of the cross section made ready: where the contour leaves the straight edges before and after
// it.
struct CornerShape {
  Dual2 in, out;  // the same point where the corner is sharp
  bool rounded = false;
  bool hollow = false;  // the material is outside the rounding
  Dual2 center;
  Dual radius;
  double tangent_mm = 0;  // from the corner to `in` and to `out`
  bool convex = true;     // the material's angle is less than half a turn
};

class ProfileMaker {
 public:
  ProfileMaker(const Definition& definition, std::span<const double> dimensions_mm)
      : values_(EvaluateDual(definition.program, dimensions_mm)) {}

  const Dual& At(int place) const { return values_[place]; }
  Dual2 At(int u, int v) const { return {values_[u], values_[v]}; }

  std::vector<CornerShape> Corners(const ProfileLoop& loop) const {
    const std::size_t n = loop.corners.size();
    std::vector<CornerShape> shapes;
    for (std::size_t i = 0; i < n; ++i) {
      const Corner &a = loop.corners[(i + n - 1) % n], &b = loop.corners[i], &c = loop.corners[(i + 1) % n];
      shapes.push_back(Shape(At(a.u, a.v), At(b.u, b.v), At(c.u, c.v), b.round));
    }
    return shapes;
  }

 private:
  CornerShape Shape(const Dual2& before, const Dual2& corner, const Dual2& after, int round) const {
    CornerShape s;
    s.in = s.out = corner;
    const Eigen::Vector2d d1 = ValueOf(corner) - ValueOf(before), d2 = ValueOf(after) - ValueOf(corner);
    s.convex = d1.x() * d2.y() - d1.y() * d2.x() > 0;
    if (round < 0) return s;
    // Unit vectors e1, e2 along the edges; the tangent points lie t = r tan(angle / 2) from the corner, where
    // angle is the turn: tan(angle / 2) = |e1 x e2| / (1 + e1 . e2).
    const Dual2 e1 = Direction(before, corner), e2 = Direction(corner, after);
    const Dual cross = e1.u * e2.v - e1.v * e2.u;
    const Dual dot = e1.u * e2.u + e1.v * e2.v;
    const Dual one = Dual::Constant(1, static_cast<int>(dot.by_dimension.size()));
    s.rounded = true;
    s.hollow = !s.convex;
    s.radius = At(round);
    const Dual t = s.radius * Abs(cross) / (one + dot);
    s.tangent_mm = t.value;
    s.in = {corner.u - t * e1.u, corner.v - t * e1.v};
    s.out = {corner.u + t * e2.u, corner.v + t * e2.v};
    const double side = s.convex ? 1 : -1;  // the centre lies on the inner side of the turn
    s.center = {s.in.u - side * (s.radius * e1.v), s.in.v + side * (s.radius * e1.u)};
    return s;
  }

  static Dual2 Direction(const Dual2& from, const Dual2& to) {
    const Dual du = to.u - from.u, dv = to.v - from.v;
    const Dual length = Sqrt(du * du + dv * dv);
    return {du / length, dv / length};
  }

  std::vector<Dual> values_;
};

// Points of an arc about `center` from `from` to `to`, both included, the short way.
Loop2d ArcPoints(const Eigen::Vector2d& center, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d a = from - center, b = to - center;
  const double angle = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
  const int steps =
      std::max(1, static_cast<int>(std::ceil(std::abs(angle) * kFacetsPerTurn / (2 * std::numbers::pi))));
  Loop2d points{from};
  for (int i = 1; i < steps; ++i) points.push_back(center + Eigen::Rotation2Dd(angle * i / steps) * a);
  points.push_back(to);
  return points;
}

Loop2d CirclePoints(const Eigen::Vector2d& center, double radius_mm, bool clockwise) {
  Loop2d points;
  for (int i = 0; i < kFacetsPerTurn; ++i) {
    const double angle = 2 * std::numbers::pi * i / kFacetsPerTurn * (clockwise ? -1 : 1);
    points.push_back(center + radius_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return points;
}

class Builder {
 public:
  Builder(const Definition& definition, std::span<const double> dimensions_mm)
      : definition_(definition),
        ex_(definition.extrusion),
        maker_(definition, dimensions_mm),
        w_{ex_.axis == 1 ? -maker_.At(ex_.low()) : maker_.At(ex_.low()),
           ex_.axis == 1 ? -maker_.At(ex_.high()) : maker_.At(ex_.high())} {}

  Solid Run() {
    out_.faces.resize(2);
    out_.faces[0].normal_in_part = InPart(ex_.axis, 0, 0, -1);
    out_.faces[1].normal_in_part = InPart(ex_.axis, 0, 0, 1);
    for (const ProfileLoop& loop : ex_.loops) {
      if (loop.is_circle)
        AddCircle(loop);
      else
        AddPolygon(loop);
    }
    AddVertices();
    AddCaps();
    return std::move(out_);
  }

 private:
  Eigen::Vector3d InPartAt(const Eigen::Vector2d& p, int end) const {
    return InPart(ex_.axis, p.x(), p.y(), w_[end].value);
  }

  void AddCircle(const ProfileLoop& loop) {
    const Dual2 center = maker_.At(loop.u, loop.v);
    const Dual& radius = maker_.At(loop.radius);
    const int face = AddCylinder(ValueOf(center), radius.value, !loop.is_outline);
    for (int end = 0; end < 2; ++end) {
      SolidCircle c;
      c.center = PointInPart(ex_.axis, center.u, center.v, w_[end]);
      c.normal_in_part = Eigen::Vector3d::Unit(ex_.axis);
      c.radius_mm = radius.value;
      c.radius_by_dimension = radius.by_dimension;
      c.plane_face = end;
      c.cylinder_face = face;
      c.is_hole = !loop.is_outline;
      c.weight = loop.rim_weight[end];
      out_.circles.push_back(std::move(c));
    }
    Loop2d points = CirclePoints(ValueOf(center), radius.value, !loop.is_outline);
    for (std::size_t i = 0; i < points.size(); ++i)
      AddQuad(out_.faces[face], points[i], points[(i + 1) % points.size()]);
    contours_.push_back(std::move(points));
  }

  int AddCylinder(const Eigen::Vector2d& center, double radius_mm, bool is_hole) {
    SolidFace face;
    face.is_cylinder = true;
    face.axis_point = InPartAt(center, 0);
    face.axis_direction = Eigen::Vector3d::Unit(ex_.axis);
    face.normal_in_part = Eigen::Vector3d::Zero();
    face.radius_mm = radius_mm;
    face.is_hole = is_hole;
    out_.faces.push_back(std::move(face));
    return static_cast<int>(out_.faces.size()) - 1;
  }

  // The piece of a side between two points of the contour, material on the left of a -> b.
  void AddQuad(SolidFace& face, const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
    const Eigen::Vector3d a0 = InPartAt(a, 0), b0 = InPartAt(b, 0), a1 = InPartAt(a, 1), b1 = InPartAt(b, 1);
    face.triangles.push_back({a0, b0, b1});
    face.triangles.push_back({a0, b1, a1});
  }

  void AddPolygon(const ProfileLoop& loop) {
    const std::vector<CornerShape> shapes = maker_.Corners(loop);
    const std::size_t n = shapes.size();
    std::vector<int> in(n), out(n);  // profile vertices of each corner
    for (std::size_t i = 0; i < n; ++i) {
      in[i] = AddProfileVertex(shapes[i].in);
      out[i] = shapes[i].rounded ? AddProfileVertex(shapes[i].out) : in[i];
    }
    // Faces: the sides in their order, side i from corner i to corner i + 1; then the roundings.
    const int first_side = static_cast<int>(out_.faces.size());
    Loop2d contour;
    for (std::size_t i = 0; i < n; ++i) AddSide(ValueOf(shapes[i].out), ValueOf(shapes[(i + 1) % n].in));
    for (std::size_t i = 0; i < n; ++i) {
      const int next_side = first_side + static_cast<int>(i),
                last_side = first_side + static_cast<int>((i + n - 1) % n);
      AddRims(out[i], in[(i + 1) % n], next_side, loop.corners[i].rim_weight);
      if (shapes[i].rounded) {
        AddRounding(shapes[i], in[i], out[i], loop.corners[i].arc_weight, contour);
      } else {
        lengthwise_.push_back({in[i], last_side, next_side, shapes[i].convex, loop.corners[i].length_weight});
        contour.push_back(ValueOf(shapes[i].in));
      }
    }
    contours_.push_back(std::move(contour));
  }

  int AddProfileVertex(const Dual2& p) {
    profile_.push_back(p);
    return static_cast<int>(profile_.size()) - 1;
  }

  void AddSide(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    SolidFace face;
    const Eigen::Vector2d d = (b - a).normalized();
    face.normal_in_part = InPart(ex_.axis, d.y(), -d.x(), 0);
    AddQuad(face, a, b);
    out_.faces.push_back(std::move(face));
  }

  // Seen from outside, the side lies to the left of its low rim and to the right of its high one.
  void AddRims(int a, int b, int side, const std::array<double, 2>& weight) {
    rims_.push_back({a, b, side, 0, 0, weight[0]});
    rims_.push_back({a, b, 1, side, 1, weight[1]});
  }

  void AddRounding(const CornerShape& s, int in, int out, const std::array<double, 2>& weight,
                   Loop2d& contour) {
    const int face = AddCylinder(ValueOf(s.center), s.radius.value, s.hollow);
    Loop2d points = ArcPoints(ValueOf(s.center), ValueOf(s.in), ValueOf(s.out));
    for (std::size_t i = 0; i + 1 < points.size(); ++i) AddQuad(out_.faces[face], points[i], points[i + 1]);
    contour.insert(contour.end(), points.begin(), points.end());
    for (int end = 0; end < 2; ++end) {
      SolidArc arc;
      arc.center = PointInPart(ex_.axis, s.center.u, s.center.v, w_[end]);
      arc.normal_in_part = InPart(ex_.axis, 0, 0, end == 0 ? -1 : 1);
      arc.radius_mm = s.radius.value;
      arc.radius_by_dimension = s.radius.by_dimension;
      arc.start = end == 0 ? out : in;  // vertices of the cross section; AddVertices moves the high ones
      arc.end = end == 0 ? in : out;
      arc.plane_face = end;
      arc.cylinder_face = face;
      arc.is_hole = s.hollow;
      arc.weight = weight[end];
      out_.arcs.push_back(std::move(arc));
    }
  }

  void AddVertices() {
    const int n = static_cast<int>(profile_.size());
    for (int end = 0; end < 2; ++end)
      for (const Dual2& p : profile_) out_.vertices.push_back(PointInPart(ex_.axis, p.u, p.v, w_[end]));
    for (const Rim& r : rims_) {
      const int shift = r.end * n;
      out_.edges.push_back({r.a + shift, r.b + shift, r.left, r.right, true, r.weight});
    }
    for (const Lengthwise& l : lengthwise_)
      out_.edges.push_back({l.vertex, l.vertex + n, l.left, l.right, l.convex, l.weight});
    for (SolidArc& arc : out_.arcs) {
      if (arc.plane_face == 0) continue;
      arc.start += n;
      arc.end += n;
    }
  }

  void AddCaps() {
    Loop2d all;
    for (const Loop2d& c : contours_) all.insert(all.end(), c.begin(), c.end());
    for (const auto& [a, b, c] : Triangulate(contours_)) {
      out_.faces[0].triangles.push_back({InPartAt(all[a], 0), InPartAt(all[c], 0), InPartAt(all[b], 0)});
      out_.faces[1].triangles.push_back({InPartAt(all[a], 1), InPartAt(all[b], 1), InPartAt(all[c], 1)});
    }
  }

  struct Rim {
    int a, b, left, right, end;
    double weight;
  };
  struct Lengthwise {
    int vertex, left, right;
    bool convex;
    double weight;
  };
  const Definition& definition_;
  const Extrusion& ex_;
  ProfileMaker maker_;
  std::array<Dual, 2> w_;  // low and high end
  std::vector<Dual2> profile_;
  std::vector<Rim> rims_;
  std::vector<Lengthwise> lengthwise_;
  std::vector<Loop2d> contours_;
  Solid out_;
};

// --- checks ---

bool Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
           const Eigen::Vector2d& d) {
  const auto side = [](const Eigen::Vector2d& p, const Eigen::Vector2d& q, const Eigen::Vector2d& r) {
    return (q.x() - p.x()) * (r.y() - p.y()) - (q.y() - p.y()) * (r.x() - p.x());
  };
  return side(a, b, c) * side(a, b, d) <= 0 && side(c, d, a) * side(c, d, b) <= 0;
}

struct Contour {
  Loop2d points;
  const ProfileLoop* loop = nullptr;
};

bool BoxesTouch(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                const Eigen::Vector2d& d) {
  return (a.cwiseMin(b).array() <= c.cwiseMax(d).array()).all() &&
         (c.cwiseMin(d).array() <= a.cwiseMax(b).array()).all();
}

// Do two pieces of contour meet that do not follow each other?
bool Meet(const Contour& a, const Contour& b) {
  const std::size_t n = a.points.size(), m = b.points.size();
  const bool same = a.loop == b.loop;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = same ? i + 1 : 0; j < m; ++j) {
      if (same && (j == i + 1 || (i == 0 && j == n - 1))) continue;
      const Eigen::Vector2d &p = a.points[i], &q = a.points[(i + 1) % n], &r = b.points[j],
                            &s = b.points[(j + 1) % m];
      if (BoxesTouch(p, q, r, s) && Cross(p, q, r, s)) return true;
    }
  }
  return false;
}

bool Contains(const Loop2d& loop, const Eigen::Vector2d& p) {
  bool inside = false;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Eigen::Vector2d &a = loop[i], &b = loop[(i + 1) % loop.size()];
    if ((a.y() > p.y()) != (b.y() > p.y()) &&
        p.x() < a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x()))
      inside = !inside;
  }
  return inside;
}

std::string NameOf(const ProfileLoop& loop) { return loop.is_outline ? "outline" : "cutout"; }

class Checker {
 public:
  Checker(const Definition& definition, std::span<const double> dimensions_mm)
      : definition_(definition), dimensions_mm_(dimensions_mm), maker_(definition, dimensions_mm) {}

  Status Run() {
    const Extrusion& ex = definition_.extrusion;
    const double from = maker_.At(ex.from).value, to = maker_.At(ex.to).value;
    if (!(from < to))
      return Fail(ex.at,
                  fmt::format("the extrusion from {:g} mm to {:g} mm is empty; write the smaller end first",
                              from, to));
    for (const ProfileLoop& loop : ex.loops) VSS_RETURN_IF_ERROR(AddContour(loop));
    VSS_RETURN_IF_ERROR(CheckCrossings());
    return CheckFrame();
  }

 private:
  tl::unexpected<Error> Fail(SourcePosition at, const std::string& what) const {
    std::string where;
    for (std::size_t i = 0; i < dimensions_mm_.size(); ++i)
      where += fmt::format("{}{} {:g} mm", i ? ", " : "", definition_.dimensions[i].name, dimensions_mm_[i]);
    return ErrorAt(definition_.file, at, fmt::format("at {}: {}", where, what));
  }

  Status AddContour(const ProfileLoop& loop) {
    Contour c;
    c.loop = &loop;
    if (loop.is_circle) {
      const double radius = maker_.At(loop.radius).value;
      if (!(radius > 0))
        return Fail(
            loop.at,
            fmt::format("the circle's radius is {:g} mm; keep it above 0 with a range or require", radius));
      c.points = CirclePoints(ValueOf(maker_.At(loop.u, loop.v)), radius, !loop.is_outline);
    } else {
      VSS_RETURN_IF_ERROR(AddPolygon(loop, c.points));
    }
    for (const Eigen::Vector2d& p : c.points)
      if (!p.allFinite())
        return Fail(loop.at,
                    fmt::format("a corner of the {} has no finite place; check for a division by zero",
                                NameOf(loop)));
    contours_.push_back(std::move(c));
    return {};
  }

  Status AddPolygon(const ProfileLoop& loop, Loop2d& points) const {
    const std::vector<CornerShape> shapes = maker_.Corners(loop);
    const std::size_t n = shapes.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Corner &a = loop.corners[i], &b = loop.corners[(i + 1) % n];
      const double length = (ValueOf(maker_.At(b.u, b.v)) - ValueOf(maker_.At(a.u, a.v))).norm();
      if (!(length > kFrameTolerance_mm))
        return Fail(
            b.at, fmt::format("corners '{}' and '{}' fall together; keep them apart with a range or require",
                              a.name, b.name));
      if (shapes[i].rounded && !(shapes[i].radius.value > 0))
        return Fail(
            a.at,
            fmt::format("the rounding at '{}' has radius {:g} mm; keep it above 0 with a range or require",
                        a.name, shapes[i].radius.value));
      const double rounded = shapes[i].tangent_mm + shapes[(i + 1) % n].tangent_mm;
      if (!(rounded < length))
        return Fail(
            b.at,
            fmt::format(
                "the roundings at '{}' and '{}' need {:g} mm and the edge has {:g} mm; make them smaller",
                a.name, b.name, rounded, length));
      if (!shapes[i].rounded)
        points.push_back(ValueOf(shapes[i].in));
      else
        for (const auto& p :
             ArcPoints(ValueOf(shapes[i].center), ValueOf(shapes[i].in), ValueOf(shapes[i].out)))
          points.push_back(p);
    }
    return {};
  }

  Status CheckCrossings() const {
    for (std::size_t i = 0; i < contours_.size(); ++i) {
      const Contour& c = contours_[i];
      if (Meet(c, c))
        return Fail(c.loop->at,
                    fmt::format("this {} crosses itself; check the order of its corners", NameOf(*c.loop)));
      const bool forward = SignedDoubleArea(c.points) > 0;
      if (forward != c.loop->is_outline)
        return Fail(c.loop->at,
                    fmt::format("this {} turns inside out; keep its corners in order with a range or require",
                                NameOf(*c.loop)));
      for (std::size_t j = 0; j < i; ++j)
        if (Meet(contours_[j], c))
          return Fail(c.loop->at,
                      fmt::format("this {} meets the {} of line {}; keep them apart with require",
                                  NameOf(*c.loop), NameOf(*contours_[j].loop), contours_[j].loop->at.line));
      if (i > 0 && !Contains(contours_[0].points, c.points[0]))
        return Fail(c.loop->at, "this cutout lies outside the outline; move it or add a require");
      for (std::size_t j = 1; j < i; ++j)
        if (Contains(contours_[j].points, c.points[0]) || Contains(c.points, contours_[j].points[0]))
          return Fail(
              c.loop->at,
              fmt::format("this cutout lies inside or around the cutout of line {}; leave one of them out",
                          contours_[j].loop->at.line));
    }
    return {};
  }

  // Base on z = 0, the footprint's bounding rectangle centred on the origin.
  Status CheckFrame() const {
    const Extrusion& ex = definition_.extrusion;
    Eigen::Vector3d lo = Eigen::Vector3d::Constant(1e300), hi = -lo;
    const auto add = [&](const Eigen::Vector2d& p) {
      for (int end : {ex.from, ex.to}) {
        const double w = maker_.At(end).value;
        const Eigen::Vector3d q = InPart(ex.axis, p.x(), p.y(), ex.axis == 1 ? -w : w);
        lo = lo.cwiseMin(q);
        hi = hi.cwiseMax(q);
      }
    };
    const Contour& outline = contours_[0];
    if (outline.loop->is_circle) {
      const Eigen::Vector2d center = ValueOf(maker_.At(outline.loop->u, outline.loop->v));
      const double r = maker_.At(outline.loop->radius).value;
      add(center - Eigen::Vector2d(r, r));
      add(center + Eigen::Vector2d(r, r));
    } else {
      for (const Eigen::Vector2d& p : outline.points) add(p);
    }
    const double tolerance = kFrameTolerance_mm + ArcSag();
    if (std::abs(lo.z()) > tolerance)
      return Fail(ex.at,
                  fmt::format("the lowest point is at z = {:g} mm; the base must lie on z = 0", lo.z()));
    const Eigen::Vector3d middle = (lo + hi) / 2;
    for (int i = 0; i < 2; ++i)
      if (std::abs(middle[i]) > tolerance)
        return Fail(ex.at, fmt::format("the footprint's middle is at {} = {:g} mm; shift it to 0", "xy"[i],
                                       middle[i]));
    return {};
  }
  // How far a faceted rounding may stay short of the true one.
  double ArcSag() const {
    double radius = 0;
    for (const Corner& c : definition_.extrusion.loops[0].corners)
      if (c.round >= 0) radius = std::max(radius, maker_.At(c.round).value);
    return radius * (1 - std::cos(std::numbers::pi / kFacetsPerTurn));
  }

  const Definition& definition_;
  std::span<const double> dimensions_mm_;
  ProfileMaker maker_;
  std::vector<Contour> contours_;
};

}  // namespace

Solid BuildSolid(const Definition& definition, std::span<const double> dimensions_mm) {
  return Builder(definition, dimensions_mm).Run();
}

Status CheckSolid(const Definition& definition, std::span<const double> dimensions_mm) {
  return Checker(definition, dimensions_mm).Run();
}

double LoopDoubleArea(const Definition& definition, const ProfileLoop& loop,
                      std::span<const double> dimensions_mm) {
  const std::vector<double> values = Evaluate(definition.program, dimensions_mm);
  Loop2d points;
  for (const Corner& c : loop.corners) points.emplace_back(values[c.u], values[c.v]);
  return SignedDoubleArea(points);
}

}  // namespace vss
