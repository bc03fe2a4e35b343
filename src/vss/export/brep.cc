#include "vss/export/brep.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepLib.hxx>
#include <BRep_Tool.hxx>
#include <Eigen/Geometry>
#include <Geom_CylindricalSurface.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shell.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <array>
#include <cmath>
#include <gp_Circ.hxx>
#include <gp_Pln.hxx>
#include <map>
#include <numbers>
#include <optional>

namespace vss {
namespace {

using Eigen::Vector3d;

constexpr double kSewing_mm = 1e-4;  // faces are computed one by one; their common edges agree to rounding

gp_Pnt Pnt(const Vector3d& p) { return {p.x(), p.y(), p.z()}; }
gp_Dir Dir(const Vector3d& d) { return {d.x(), d.y(), d.z()}; }

// A piece of a plane face's border, from vertex `start` to vertex `end`; a whole circle has neither.
struct Piece {
  int start = -1, end = -1;
  const SolidArc* arc = nullptr;
  const SolidCircle* circle = nullptr;
};
using Loop = std::vector<Piece>;

class FaceMaker {
 public:
  explicit FaceMaker(const Solid& solid) : solid_(solid), tangents_(TangentsOf(solid)) {}

  std::optional<TopoDS_Face> Plane(int face) const {
    const Vector3d normal = solid_.faces[static_cast<std::size_t>(face)].normal_in_part;
    std::vector<Loop> loops = LoopsOf(face);
    if (loops.empty()) return std::nullopt;
    const auto area = [&](const Loop& loop) { return SignedArea(loop, normal); };
    std::sort(loops.begin(), loops.end(),
              [&](const Loop& a, const Loop& b) { return std::abs(area(a)) > std::abs(area(b)); });
    std::optional<BRepBuilderAPI_MakeFace> made;
    for (std::size_t i = 0; i < loops.size(); ++i) {
      BRepBuilderAPI_MakeWire wire;
      for (const Piece& piece : loops[i]) wire.Add(EdgeOf(piece));
      if (!wire.IsDone()) return std::nullopt;
      // The border runs counter-clockwise about the normal, holes clockwise.
      TopoDS_Wire oriented = wire.Wire();
      if ((area(loops[i]) > 0) != (i == 0)) oriented.Reverse();
      if (i == 0)
        made.emplace(gp_Pln(Pnt(PointOn(loops[0].front())), Dir(normal)), oriented);
      else
        made->Add(oriented);
    }
    if (!made->IsDone()) return std::nullopt;
    return made->Face();
  }

  // Between two rims, or between the two arcs of a rounded corner.
  std::optional<TopoDS_Face> Cylinder(int face) const {
    const SolidFace& f = solid_.faces[static_cast<std::size_t>(face)];
    const Vector3d axis = f.axis_direction.normalized();
    Vector3d zero = axis.unitOrthogonal();
    double turn_rad = 2 * std::numbers::pi, low = INFINITY, high = -INFINITY;
    const auto reach = [&](const Vector3d& center) {
      low = std::min(low, axis.dot(center - f.axis_point));
      high = std::max(high, axis.dot(center - f.axis_point));
    };
    for (const auto& c : solid_.circles)
      if (c.cylinder_face == face) reach(c.center.point_in_part);
    for (const auto& a : solid_.arcs) {
      if (a.cylinder_face != face) continue;
      reach(a.center.point_in_part);
      const Vector3d from = Vertex(a.start) - a.center.point_in_part,
                     to = Vertex(a.end) - a.center.point_in_part;
      const double angle = std::atan2(axis.dot(from.cross(to)), from.dot(to));
      zero = (angle > 0 ? from : to).normalized();
      turn_rad = std::abs(angle);
    }
    if (!(high > low) || !(turn_rad > 0)) return std::nullopt;
    const gp_Ax3 frame(Pnt(f.axis_point), Dir(axis), Dir(zero));
    const Handle(Geom_CylindricalSurface) surface = new Geom_CylindricalSurface(frame, f.radius_mm);
    BRepBuilderAPI_MakeFace made(surface, 0, turn_rad, low, high, kSewing_mm);
    if (!made.IsDone()) return std::nullopt;
    return f.is_hole ? TopoDS::Face(made.Face().Reversed()) : made.Face();
  }

 private:
  const Vector3d& Vertex(int index) const {
    return solid_.vertices[static_cast<std::size_t>(index)].point_in_part;
  }
  Vector3d PointOn(const Piece& piece) const {
    return piece.circle ? piece.circle->center.point_in_part : Vertex(piece.start);
  }

  // Where a rounded corner runs smoothly into a plane there is no contour, so Solid has no edge: the lines
  // between the ends of the rounding's two arcs.
  static std::vector<std::array<int, 2>> TangentsOf(const Solid& solid) {
    std::vector<std::array<int, 2>> lines;
    for (std::size_t i = 0; i < solid.arcs.size(); ++i)
      for (std::size_t j = i + 1; j < solid.arcs.size(); ++j) {
        const SolidArc &a = solid.arcs[i], &b = solid.arcs[j];
        if (a.cylinder_face != b.cylinder_face) continue;
        lines.push_back(
            {a.start, b.end});  // the two turn opposite ways, each about the outward normal of its end
        lines.push_back({a.end, b.start});
      }
    return lines;
  }

  // Twice the area that the loop encloses about `normal`; arcs count as their chords, which decides nothing
  // here.
  double SignedArea(const Loop& loop, const Vector3d& normal) const {
    if (loop.front().circle) {
      const double r = loop.front().circle->radius_mm;
      return 2 * std::numbers::pi * r * r * (loop.front().circle->normal_in_part.dot(normal) > 0 ? 1 : -1);
    }
    double sum = 0;
    const Vector3d& origin = Vertex(loop.front().start);
    for (const Piece& p : loop) sum += normal.dot((Vertex(p.start) - origin).cross(Vertex(p.end) - origin));
    return sum;
  }

  std::vector<Loop> LoopsOf(int face) const {
    std::vector<Loop> loops;
    std::vector<Piece> open;
    for (const auto& c : solid_.circles)
      if (c.plane_face == face) loops.push_back({{-1, -1, nullptr, &c}});
    for (const auto& e : solid_.edges)
      if (e.left_face == face || e.right_face == face) open.push_back({e.start, e.end, nullptr, nullptr});
    for (const auto& a : solid_.arcs)
      if (a.plane_face == face) open.push_back({a.start, a.end, &a, nullptr});
    std::map<int, int> ends;
    for (const Piece& p : open) ++ends[p.start], ++ends[p.end];
    for (const auto& [a, b] : tangents_)
      if (ends[a] == 1 && ends[b] == 1) open.push_back({a, b, nullptr, nullptr});
    while (!open.empty()) {
      Loop loop{open.back()};
      open.pop_back();
      while (loop.back().end != loop.front().start) {
        const int at = loop.back().end;
        const auto next = std::find_if(open.begin(), open.end(),
                                       [&](const Piece& p) { return p.start == at || p.end == at; });
        if (next == open.end()) return {};
        if (next->start != at) std::swap(next->start, next->end);
        loop.push_back(*next);
        open.erase(next);
      }
      loops.push_back(std::move(loop));
    }
    return loops;
  }

  TopoDS_Edge EdgeOf(const Piece& piece) const {
    if (piece.circle)
      return BRepBuilderAPI_MakeEdge(
          gp_Circ(gp_Ax2(Pnt(piece.circle->center.point_in_part), Dir(piece.circle->normal_in_part)),
                  piece.circle->radius_mm));
    const Vector3d &from = Vertex(piece.start), &to = Vertex(piece.end);
    if (!piece.arc) return BRepBuilderAPI_MakeEdge(Pnt(from), Pnt(to));
    // A circle that turns from `from` to `to` the short way.
    const Vector3d& center = piece.arc->center.point_in_part;
    const Vector3d axis = (from - center).cross(to - center).normalized();
    return BRepBuilderAPI_MakeEdge(gp_Circ(gp_Ax2(Pnt(center), Dir(axis)), piece.arc->radius_mm), Pnt(from),
                                   Pnt(to));
  }

  const Solid& solid_;
  std::vector<std::array<int, 2>> tangents_;  // pairs of vertices
};

std::optional<TopoDS_Shell> Sewn(const std::vector<TopoDS_Face>& faces) {
  BRepBuilderAPI_Sewing sewing(kSewing_mm);
  for (const auto& face : faces) sewing.Add(face);
  sewing.Perform();
  TopExp_Explorer shells(sewing.SewedShape(), TopAbs_SHELL);
  if (!shells.More()) return std::nullopt;
  const TopoDS_Shell shell = TopoDS::Shell(shells.Current());
  shells.Next();
  if (shells.More() || !BRep_Tool::IsClosed(shell)) return std::nullopt;
  return shell;
}

}  // namespace

Result<TopoDS_Solid> BrepOf(const Solid& solid) {
  const FaceMaker maker(solid);
  std::vector<TopoDS_Face> faces;
  for (std::size_t i = 0; i < solid.faces.size(); ++i) {
    const auto face = solid.faces[i].is_cylinder ? maker.Cylinder(int(i)) : maker.Plane(int(i));
    if (!face) return InputError("face {} of its solid has no closed border", i);
    faces.push_back(*face);
  }
  const auto shell = Sewn(faces);
  if (!shell) return InputError("the {} faces of its solid do not close", faces.size());
  TopoDS_Solid out = BRepBuilderAPI_MakeSolid(*shell);
  if (!BRepLib::OrientClosedSolid(out) || !BRepCheck_Analyzer(out).IsValid())
    return InputError("its {} faces make no valid solid", faces.size());
  return out;
}

}  // namespace vss
