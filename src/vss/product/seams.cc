#include "vss/product/seams.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "vss/product/make_part.h"

namespace vss {
namespace {

using Eigen::Vector3d;

struct Interval {
  double from = 0, to = 1;  // of the edge, 0 at its start, 1 at its end
  double Length() const { return std::max(0.0, to - from); }
};

struct Edge {
  Vector3d start, end;
  Vector3d contact_normal, seam_normal;  // outward normals of its two faces
};

// The part of the segment that lies within `margin_mm` of the triangle, in the triangle's plane.
Interval ClipToTriangle(const Edge& edge, const std::array<Vector3d, 3>& triangle, const Vector3d& normal,
                        double margin_mm) {
  Interval inside;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d side = triangle[(i + 1) % 3] - triangle[i];
    if (side.norm() == 0) return {0, 0};
    const Vector3d inward = normal.cross(side).normalized();
    const double from = inward.dot(edge.start - triangle[i]) + margin_mm;
    const double to = inward.dot(edge.end - triangle[i]) + margin_mm;
    if (from < 0 && to < 0) return {0, 0};
    if (from < 0) inside.from = std::max(inside.from, from / (from - to));
    if (to < 0) inside.to = std::min(inside.to, from / (from - to));
  }
  return inside;
}

std::vector<Interval> Union(std::vector<Interval> intervals) {
  constexpr double kJoin = 1e-6;  // neighbouring triangles share their side up to rounding
  std::sort(intervals.begin(), intervals.end(), [](const auto& a, const auto& b) { return a.from < b.from; });
  std::vector<Interval> out;
  for (const auto& i : intervals) {
    if (i.Length() <= 0) continue;
    if (!out.empty() && i.from <= out.back().to + kJoin)
      out.back().to = std::max(out.back().to, i.to);
    else
      out.push_back(i);
  }
  return out;
}

std::vector<Interval> ClipToFace(const Edge& edge, const SolidFace& face, double margin_mm) {
  std::vector<Interval> pieces;
  for (const auto& triangle : face.triangles)
    pieces.push_back(ClipToTriangle(edge, triangle, face.normal_in_part, margin_mm));
  return Union(std::move(pieces));
}

double HeightOver(const SolidFace& face, const Vector3d& point) {
  return face.normal_in_part.dot(point - face.triangles.front()[0]);
}

bool InPlane(const Edge& edge, const SolidFace& face, double max_gap_mm) {
  return std::abs(HeightOver(face, edge.start)) <= max_gap_mm &&
         std::abs(HeightOver(face, edge.end)) <= max_gap_mm;
}

// The edges of `solid` that lie on `face` with one of their two faces, which looks against it.
std::vector<Edge> EdgesOn(const WorldSolid& solid, const SolidFace& face, double max_gap_mm) {
  constexpr double kAgainst = -0.97;   // 14 degrees: contact faces of parts that lean a little
  constexpr double kAlongside = 0.97;  // the other face must leave the plane, or there is no corner to weld
  std::vector<Edge> edges;
  for (const auto& e : solid.edges) {
    const auto& left = solid.faces[static_cast<std::size_t>(e.left_face)];
    const auto& right = solid.faces[static_cast<std::size_t>(e.right_face)];
    if (left.is_cylinder || right.is_cylinder) continue;
    Edge edge{solid.vertices[static_cast<std::size_t>(e.start)].point,
              solid.vertices[static_cast<std::size_t>(e.end)].point, left.normal_in_part,
              right.normal_in_part};
    if (edge.contact_normal.dot(face.normal_in_part) > edge.seam_normal.dot(face.normal_in_part))
      std::swap(edge.contact_normal, edge.seam_normal);
    if (edge.contact_normal.dot(face.normal_in_part) > kAgainst ||
        std::abs(edge.seam_normal.dot(face.normal_in_part)) > kAlongside)
      continue;
    if (InPlane(edge, face, max_gap_mm)) edges.push_back(edge);
  }
  return edges;
}

void AddSeams(const Edge& edge, const SolidFace& face, const SeamOptions& options, const Seam& names,
              std::vector<Seam>& seams) {
  const double length_mm = (edge.end - edge.start).norm();
  if (length_mm < options.min_length_mm) return;
  std::vector<Interval> pieces = ClipToFace(edge, face, 0);
  if (pieces.empty()) pieces = ClipToFace(edge, face, options.max_gap_mm);  // flush with the face's border
  for (const auto& piece : pieces) {
    if (piece.Length() * length_mm < options.min_length_mm) continue;
    Seam seam = names;
    seam.start = edge.start + piece.from * (edge.end - edge.start);
    seam.end = edge.start + piece.to * (edge.end - edge.start);
    seam.normal_a = face.normal_in_part;
    seam.normal_b = edge.seam_normal;
    seam.gap_mm = std::max(HeightOver(face, seam.start), HeightOver(face, seam.end));
    seams.push_back(seam);
  }
}

bool SamePlace(const Seam& a, const Seam& b, double tolerance_mm) {
  const auto near = [&](const Vector3d& p, const Vector3d& q) { return (p - q).norm() <= tolerance_mm; };
  return (near(a.start, b.start) && near(a.end, b.end)) || (near(a.start, b.end) && near(a.end, b.start));
}

Seam Between(const Part& a, const Part& b) {
  Seam seam;
  seam.part_a = a.id;
  seam.part_b = b.id;
  return seam;
}

// Could the two touch at all?
bool BoxesTouch(const Part& a, const Part& b, double gap_mm) {
  const auto box = [](const Part& part) {
    Eigen::AlignedBox3d out;
    for (const auto& v : part.vertices) out.extend(v);
    for (const auto& c : part.circles) {
      out.extend(Vector3d(c.center.array() - c.radius_mm));
      out.extend(Vector3d(c.center.array() + c.radius_mm));
    }
    return out;
  };
  Eigen::AlignedBox3d inflated = box(a);
  inflated.min().array() -= gap_mm;
  inflated.max().array() += gap_mm;
  return inflated.intersects(box(b));
}

}  // namespace

Vector3d ApproachOf(const Seam& seam) {
  const Vector3d sum = seam.normal_a + seam.normal_b;
  constexpr double kNoDirection = 1e-6;  // opposite normals, or none
  return sum.norm() > kNoDirection ? sum.normalized() : Vector3d::Zero();
}

std::span<const ParameterOf<SeamOptions>> SeamParameters() {
  static const ParameterOf<SeamOptions> rows[] = {
      {"seams.max_gap_mm", &SeamOptions::max_gap_mm, 0, 50, "mm",
       "Two parts that are farther apart than this do not touch."},
      {"seams.min_length_mm", &SeamOptions::min_length_mm, 1, 1000, "mm",
       "Contacts shorter than this are no seams."},
  };
  return rows;
}

std::vector<Seam> FindSeams(const Product& product, const KnowledgeBase& knowledge,
                            const SeamOptions& options) {
  std::vector<std::optional<WorldSolid>> solids;
  for (const auto& part : product.parts) solids.push_back(SolidOfPart(part, knowledge));
  std::vector<Seam> seams;
  for (std::size_t a = 0; a < solids.size(); ++a)
    for (std::size_t b = 0; b < solids.size(); ++b) {
      if (a == b || !solids[a] || !solids[b] ||
          !BoxesTouch(product.parts[a], product.parts[b], options.max_gap_mm))
        continue;
      std::vector<Seam> found;
      for (const auto& face : solids[a]->faces) {
        if (face.is_cylinder || face.triangles.empty()) continue;
        for (const auto& edge : EdgesOn(*solids[b], face, options.max_gap_mm))
          AddSeams(edge, face, options, Between(product.parts[a], product.parts[b]), found);
      }
      for (const auto& seam : found) {
        const bool known = std::any_of(seams.begin(), seams.end(), [&](const auto& s) {
          return SamePlace(s, seam, 2 * options.max_gap_mm);
        });
        if (!known) seams.push_back(seam);
      }
    }
  return seams;
}

}  // namespace vss
