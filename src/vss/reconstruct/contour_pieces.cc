#include "vss/reconstruct/contour_pieces.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unordered_map>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kParallelCos = 0.94;     // 20 degrees: below, a strip can follow both contours
constexpr double kCrossMarginPx = 1.8;    // a crossing contour's blur reaches that far
constexpr double kMinReachPx = 1.6;       // less holds no step
constexpr double kMinHalfLengthPx = 1.4;  // less holds too few pixels
// Edges that are measured as a whole where strips fail: a shorter one is all ends, a longer one has room for
// a strip beside what crosses it.
constexpr double kShortestPx = 3, kShortPx = 16;
constexpr double kSamePx = 0.3;  // two contours that near are one line of the picture
constexpr double kCellPx = 16;   // of the hash grid
constexpr int kMinSamples = 2;   // of an edge: hidden by half is told from seen

// Along its contour: the picture tangent of a sample.
Vector2d ImgTangent(const View& view, const ContourSample& s) {
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix2d j;
  if (!k.ImgFromNormalized(k.NormalizedFromIdeal(s.ideal), &j)) return s.ideal_tangent;
  return (j * Vector2d(s.ideal_tangent.x() / k.fx_px, s.ideal_tangent.y() / k.fy_px)).normalized();
}

double DistanceToTriangle(const Vector3d& p, const std::array<Vector3d, 3>& t, double limit) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
  const double area = n.norm();
  if (area < 1e-9) return INFINITY;
  const double height = std::abs(n.dot(p - t[0])) / area;
  if (height > limit) return INFINITY;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d& a = t[i];
    const Vector3d e = t[(i + 1) % 3] - a;
    if (n.cross(e).dot(p - a) < -limit * area * e.norm()) return INFINITY;
  }
  return height;
}

// The outward normal of a face at `at` on it.
Vector3d NormalAt(const SolidFace& face, const Vector3d& at) {
  if (!face.is_cylinder) return face.normal_in_part;
  Vector3d out = at - face.axis_point;
  out -= face.axis_direction * face.axis_direction.dot(out);
  return (face.is_hole ? -1.0 : 1.0) * out.normalized();
}

// See ContourPiece::background; `normal`: of the curve in the picture.
int BackgroundOf(const WorldSolid& solid, const View& view, const ContourSample& s, const Vector2d& normal) {
  if (!s.silhouette || s.source == ContourSample::Source::kLimb) return 0;
  const auto i = static_cast<std::size_t>(s.index);
  const bool edge = s.source == ContourSample::Source::kEdge;
  const int one = edge ? solid.edges[i].left_face : solid.circles[i].plane_face;
  const int two = edge ? solid.edges[i].right_face : solid.circles[i].cylinder_face;
  const Vector3d to_eye = view.center_in_world - s.point_in_world;
  Vector3d seen = NormalAt(solid.faces[static_cast<std::size_t>(one)], s.point_in_world);
  Vector3d hidden = NormalAt(solid.faces[static_cast<std::size_t>(two)], s.point_in_world);
  if (seen.dot(to_eye) < 0) std::swap(seen, hidden);
  // The face that is seen leads away from the edge, against the normal of the other one.
  constexpr double kStepMm = 1;
  const Vector3d into = (hidden.dot(seen) * seen - hidden) * (edge && !solid.edges[i].convex ? -1 : 1);
  const auto a = view.ProjectIdeal(s.point_in_world),
             b = view.ProjectIdeal(s.point_in_world + kStepMm * into.normalized());
  if (!a || !b) return 0;
  return normal.dot(*b - *a) > 0 ? -1 : 1;
}

struct Contact {
  std::span<const WorldSolid> solids;
  std::vector<Eigen::AlignedBox3d> boxes;
  double gap_mm;

  Contact(std::span<const WorldSolid> s, double gap) : solids(s), gap_mm(gap) {
    for (const auto& solid : s) {
      Eigen::AlignedBox3d box;
      for (const auto& f : solid.faces)
        for (const auto& t : f.triangles)
          for (const auto& v : t) box.extend(v);
      box.min().array() -= gap;
      box.max().array() += gap;
      boxes.push_back(box);
    }
  }

  bool Touches(int part, const Vector3d& p) const {
    if (std::abs(p.z()) < gap_mm) return true;
    for (std::size_t i = 0; i < solids.size(); ++i) {
      if (static_cast<int>(i) == part || !boxes[i].contains(p)) continue;
      for (const auto& f : solids[i].faces)
        for (const auto& t : f.triangles)
          if (DistanceToTriangle(p, t, gap_mm) < gap_mm) return true;
    }
    return false;
  }
};

struct Candidate {
  ContourPiece piece;
  int curve_id = 0;  // same for all samples of one edge, rim or limb
};

class Cutter {
 public:
  Cutter(std::span<const WorldSolid> solids, std::span<const Occluders> occluders, const View& view,
         const PieceOptions& options)
      : solids_(solids), view_(view), options_(options), contact_(solids, options.contact_gap_mm) {
    for (std::size_t i = 0; i < solids.size(); ++i) AddPart(static_cast<int>(i), occluders[i]);
    for (std::size_t i = 0; i < all_.size(); ++i) cells_[Cell(all_[i].piece.curve.point)].push_back(i);
  }

  std::vector<ContourPiece> Pieces() {
    std::vector<ContourPiece> out;
    for (auto& c : wanted_) {
      if (!IsAsked(c) || !Surround(c)) continue;
      Describe(c.piece);
      out.push_back(c.piece);
      measured_.insert(c.curve_id);
    }
    return out;
  }

  // Of those edges that Pieces() has nothing of.
  std::vector<ShortEdge> ShortEdges() {
    std::vector<ShortEdge> out;
    for (auto& c : short_) {
      if (!IsAsked(c) || measured_.contains(c.curve_id)) continue;
      Describe(c.piece);
      out.push_back({c.piece, Around(c)});
    }
    return out;
  }

 private:
  bool IsAsked(const Candidate& c) const {
    return options_.only_part < 0 || c.piece.part == options_.only_part;
  }

  void Describe(ContourPiece& piece) const {
    const auto& solid = solids_[static_cast<std::size_t>(piece.part)];
    const auto& s = piece.sample;
    piece.background = BackgroundOf(solid, view_, s, piece.curve.normal);
    piece.above_foot_px = (s.point_in_world.z() - solid.world_from_part.translation.z()) *
                          view_.camera->intrinsics.fx_px / (view_.cam_from_world * s.point_in_world).z();
  }

  std::vector<ShortEdge::Around> Around(const Candidate& c) const {
    std::vector<ShortEdge::Around> out;
    for (const Candidate& other : all_) {
      if (other.curve_id == c.curve_id) continue;
      const auto& piece = other.piece;
      const double reach = c.piece.half_length_px + options_.reach_px + piece.half_length_px;
      if ((piece.curve.point - c.piece.curve.point).norm() > reach) continue;
      out.push_back({piece.curve, piece.half_length_px, other.curve_id});
    }
    return out;
  }

  static std::int64_t Key(std::int64_t u, std::int64_t v) { return (u << 32) + v; }
  static std::int64_t Cell(const Vector2d& p) {
    return Key(static_cast<std::int64_t>(std::floor(p.x() / kCellPx)),
               static_cast<std::int64_t>(std::floor(p.y() / kCellPx)));
  }

  void AddPart(int part, const Occluders& others) {
    const auto samples = SampleContour(solids_[static_cast<std::size_t>(part)], view_, options_.length_px,
                                       kMinSamples, &others, options_.touch_mm);
    std::size_t begin = 0;
    while (begin < samples.size()) {
      std::size_t end = begin + 1;
      const auto& a = samples[begin];
      while (end < samples.size() && samples[end].source == a.source && samples[end].index == a.index &&
             samples[end].limb_side == a.limb_side)
        ++end;
      const auto curve = std::span(samples).subspan(begin, end - begin);
      AddCurve(part, curve);
      if (a.source != ContourSample::Source::kCircle) AddStraight(part, curve);
      begin = end;
    }
  }

  // Pieces of a straight edge or limb: each stretch that is seen, without its ends, cut into equal parts that
  // are as long as wanted in the picture, however the edge is foreshortened.
  void AddStraight(int part, std::span<const ContourSample> samples) {
    const auto follows = [](const ContourSample& a, const ContourSample& b) {
      return b.visible && b.t - a.t < 1.5 * a.t_step;
    };
    for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end) {
      end = begin + 1;
      if (!samples[begin].visible) continue;
      while (end < samples.size() && follows(samples[end - 1], samples[end])) ++end;
      AddStretch(part, samples[begin], samples[end - 1]);
    }
  }

  // `first` and `last`: seen, and all between them.
  void AddStretch(int part, const ContourSample& first, const ContourSample& last) {
    const Vector3d along = AlongCurve(part, first);
    const auto point = [&](double t) -> Vector3d { return first.point_in_world + (t - first.t) * along; };
    // To the end of the edge where the next sample would lie beyond it; else what hides it, or the border,
    // begins somewhere behind the last sample.
    double t0 = first.t - first.t_step < 0 ? 0 : first.t, t1 = last.t + last.t_step > 1 ? 1 : last.t;
    const auto a = view_.ProjectIdeal(point(t0)), b = view_.ProjectIdeal(point(t1));
    if (!a || !b) return;
    const double length = (*b - *a).norm(), rest = length - 2 * options_.vertex_margin_px;
    if (t0 == 0 && t1 == 1 && length >= kShortestPx && length < kShortPx) {
      ContourSample s = first;
      s.t = 0.5;
      AddPieceAt(part, s, point(0.5), point(0), point(1), short_);
    }
    if (rest < 2 * kMinHalfLengthPx) return;
    const double margin = options_.vertex_margin_px / length * (t1 - t0);
    t0 += margin, t1 -= margin;
    const int n = std::max(1, static_cast<int>(std::lround(rest / options_.length_px)));
    for (int k = 0; k < n; ++k) {
      ContourSample s = first;
      s.t = t0 + (k + 0.5) / n * (t1 - t0);
      const double half_t = (t1 - t0) / n / 2;
      AddPieceAt(part, s, point(s.t), point(s.t - half_t), point(s.t + half_t), wanted_);
    }
  }

  // d point / d t of a straight curve.
  Vector3d AlongCurve(int part, const ContourSample& s) const {
    const auto& solid = solids_[static_cast<std::size_t>(part)];
    if (s.source == ContourSample::Source::kEdge) {
      const auto& e = solid.edges[static_cast<std::size_t>(s.index)];
      return solid.vertices[static_cast<std::size_t>(e.end)].point -
             solid.vertices[static_cast<std::size_t>(e.start)].point;
    }
    std::vector<Vector3d> rims;
    for (const auto& c : solid.circles)
      if (c.cylinder_face == s.index) rims.push_back(c.center.point);
    return rims.size() == 2 ? Vector3d(rims[1] - rims[0]) : Vector3d::Zero();
  }

  void AddPieceAt(int part, ContourSample s, const Vector3d& at, const Vector3d& from, const Vector3d& to,
                  std::vector<Candidate>& out) {
    const auto img = view_.ProjectInside(at), a = view_.ProjectInside(from), b = view_.ProjectInside(to);
    const auto ideal = view_.ProjectIdeal(at), ahead = view_.ProjectIdeal(to);
    if (!img || !a || !b || !ideal || !ahead || (*b - *a).norm() < 1e-6) return;
    s.point_in_world = at;
    s.img = *img;
    s.ideal = *ideal;
    s.ideal_tangent = (*ahead - *ideal).normalized();
    Candidate c;
    c.curve_id = num_curves_;
    c.piece.part = part;
    c.piece.sample = s;
    const Vector2d t = (*b - *a).normalized();
    c.piece.half_length_px = (*b - *a).norm() / 2;
    c.piece.curve.point = *img;
    c.piece.curve.normal = Vector2d(-t.y(), t.x());
    const double half = c.piece.half_length_px;
    c.piece.curve.curvature = c.piece.curve.normal.dot(*a + *b - 2 * *img) / (half * half);
    c.piece.edge_class = ClassOf(part, s);
    out.push_back(std::move(c));
  }

  // Picture length that one sample of its curve stands for.
  double RawLength(int part, const ContourSample& s) const {
    if (s.source == ContourSample::Source::kCircle) return options_.length_px;
    const Vector3d half = AlongCurve(part, s) * (s.t_step / 2);
    const auto a = view_.ProjectIdeal(s.point_in_world - half),
               b = view_.ProjectIdeal(s.point_in_world + half);
    return a && b ? (*b - *a).norm() : options_.length_px;
  }

  ContourClass ClassOf(int part, const ContourSample& s) const {
    if (s.source == ContourSample::Source::kLimb) return ContourClass::kLimb;
    const bool edge = s.source == ContourSample::Source::kEdge;
    if (edge && !solids_[static_cast<std::size_t>(part)].edges[static_cast<std::size_t>(s.index)].convex)
      return ContourClass::kContact;
    if (contact_.Touches(part, s.point_in_world)) return ContourClass::kContact;
    return edge ? ContourClass::kFree : ContourClass::kRound;
  }

  // The samples of one edge, rim or limb, in order; those out of the picture are missing from it.
  void AddCurve(int part, std::span<const ContourSample> samples) {
    ++num_curves_;
    const std::size_t n = samples.size();
    std::vector<Vector2d> tangents;
    for (const auto& s : samples) tangents.push_back(ImgTangent(view_, s));
    for (std::size_t i = 0; i < n; ++i) {
      if (!samples[i].visible) continue;
      Candidate c;
      c.curve_id = num_curves_;
      c.piece.part = part;
      c.piece.sample = samples[i];
      const Vector2d& t = tangents[i];
      c.piece.curve.point = samples[i].img;
      c.piece.curve.normal = Vector2d(-t.y(), t.x());
      double step_px = RawLength(part, samples[i]);
      bool free_ends = true;
      std::array<bool, 2> has{i > 0, i + 1 < n};
      double turn = 0, arc = 0;
      for (int side : {0, 1}) {
        if (!has[static_cast<std::size_t>(side)]) continue;
        const std::size_t k = side == 0 ? i - 1 : i + 1;
        const Vector2d q = samples[k].img - samples[i].img;
        if (q.norm() > 3 * options_.length_px + 4)
          continue;  // a gap: the samples between are not in the picture
        free_ends &= samples[k].visible;
        const double along = q.dot(t);
        turn += 2 * c.piece.curve.normal.dot(q) / std::max(along * along, 1e-6);
        arc += 1;
        step_px = std::min(step_px, std::abs(along));
      }
      if (arc > 0) c.piece.curve.curvature = turn / arc;
      c.piece.half_length_px = step_px / 2;
      const bool round = samples[i].source == ContourSample::Source::kCircle;
      if (round && free_ends && c.piece.half_length_px >= kMinHalfLengthPx) {
        c.piece.edge_class = ClassOf(part, samples[i]);
        wanted_.push_back(c);
      }
      all_.push_back(std::move(c));
    }
  }

  // Looks at the contours around; false where the piece cannot be measured.
  bool Surround(Candidate& c) {
    ContourPiece& p = c.piece;
    p.reach_minus_px = p.reach_plus_px = options_.reach_px;
    const Vector2d n = p.curve.normal, t(-n.y(), n.x());
    const double look = options_.reach_px + p.half_length_px + options_.length_px + kCrossMarginPx;
    struct Parallel {
      double across, along;
      std::size_t index;
    };
    std::map<int, Parallel> parallels;
    const auto u0 = static_cast<std::int64_t>(std::floor((p.curve.point.x() - look) / kCellPx));
    const auto u1 = static_cast<std::int64_t>(std::floor((p.curve.point.x() + look) / kCellPx));
    const auto v0 = static_cast<std::int64_t>(std::floor((p.curve.point.y() - look) / kCellPx));
    const auto v1 = static_cast<std::int64_t>(std::floor((p.curve.point.y() + look) / kCellPx));
    for (auto u = u0; u <= u1; ++u)
      for (auto v = v0; v <= v1; ++v) {
        const auto cell = cells_.find(Key(u, v));
        if (cell == cells_.end()) continue;
        for (std::size_t i : cell->second) {
          const Candidate& other = all_[i];
          if (other.curve_id == c.curve_id) continue;
          const Vector2d q = other.piece.curve.point - p.curve.point;
          const Vector2d m = other.piece.curve.normal, tm(-m.y(), m.x());
          const double half = std::max(other.piece.half_length_px, options_.length_px / 2);
          if (std::abs(m.dot(n)) >= kParallelCos) {
            if (std::abs(q.dot(t)) > p.half_length_px + half) continue;
            const double across = -other.piece.curve.Distance(p.curve.point) * (m.dot(n) > 0 ? 1 : -1);
            const auto [at, fresh] = parallels.insert({other.curve_id, {across, q.dot(t), i}});
            if (!fresh && std::abs(q.dot(t)) < std::abs(at->second.along)) at->second = {across, q.dot(t), i};
          } else {
            Limit(p, q, t, n, tm, other.piece.half_length_px);
          }
        }
      }
    for (const auto& [id, parallel] : parallels) {
      const double gap = std::abs(parallel.across);
      // Where two parts meet, their edges are one line of the picture.
      const bool meet = gap < kSamePx && p.edge_class == ContourClass::kContact &&
                        all_[parallel.index].piece.part != p.part;
      if (meet) continue;
      if (gap < options_.min_gap_px) return false;
      const double reach = parallel.across > 0 ? p.reach_plus_px : p.reach_minus_px;
      if (gap > reach + kCrossMarginPx) continue;
      const Candidate& other = all_[parallel.index];
      if (static_cast<int>(p.neighbours.size()) < kMaxNeighbours) {
        ProfileCurve curve = other.piece.curve;
        if (curve.normal.dot(n) < 0) curve.normal = -curve.normal, curve.curvature = -curve.curvature;
        p.neighbours.push_back(curve);
      } else {
        (parallel.across > 0 ? p.reach_plus_px : p.reach_minus_px) = gap - kCrossMarginPx;
      }
    }
    return p.reach_minus_px >= kMinReachPx && p.reach_plus_px >= kMinReachPx;
  }

  // Shortens the reach to before a crossing contour, a stretch of +-half along tm around q.
  static void Limit(ContourPiece& p, const Vector2d& q, const Vector2d& t, const Vector2d& n,
                    const Vector2d& tm, double half) {
    constexpr int kSteps = 8;
    for (int k = -kSteps; k <= kSteps; ++k) {
      const Vector2d at = q + tm * (half * k / kSteps);
      if (std::abs(at.dot(t)) > p.half_length_px + kCrossMarginPx) continue;
      const double across = at.dot(n);
      double& reach = across > 0 ? p.reach_plus_px : p.reach_minus_px;
      reach = std::min(reach, std::abs(across) - kCrossMarginPx);
    }
  }

  std::span<const WorldSolid> solids_;
  const View& view_;
  const PieceOptions& options_;
  Contact contact_;
  std::vector<Candidate> all_;     // every sample that is seen: what may lie beside a piece
  std::vector<Candidate> wanted_;  // the pieces
  std::vector<Candidate> short_;   // edges as a whole
  std::set<int> measured_;         // curves that there are pieces of
  std::unordered_map<std::int64_t, std::vector<std::size_t>> cells_;
  int num_curves_ = 0;
};

}  // namespace

const char* NameOf(ContourClass edge_class) {
  switch (edge_class) {
    case ContourClass::kFree:
      return "free";
    case ContourClass::kContact:
      return "contact";
    case ContourClass::kRound:
      return "round";
    case ContourClass::kLimb:
      return "limb";
    case ContourClass::kShadowed:
      return "shadowed";
  }
  return "";
}

std::vector<ContourPiece> CutContour(std::span<const WorldSolid> solids, std::span<const Occluders> occluders,
                                     const View& view, const PieceOptions& options,
                                     std::vector<ShortEdge>* short_edges) {
  Cutter cutter(solids, occluders, view, options);
  auto pieces = cutter.Pieces();
  if (short_edges) *short_edges = cutter.ShortEdges();
  return pieces;
}

std::optional<double> TopUnder(const WorldSolid& solid, double x_mm, double y_mm, double z_mm) {
  std::optional<double> top;
  for (const auto& f : solid.faces)
    for (const auto& t : f.triangles) {
      const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
      if (n.z() <= 0.5 * n.norm()) continue;
      bool inside = true;
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3d e = t[(i + 1) % 3] - t[i];
        inside &= e.x() * (y_mm - t[i].y()) - e.y() * (x_mm - t[i].x()) >= -1e-6 * e.norm();
      }
      if (!inside) continue;
      const double z = t[0].z() - (n.x() * (x_mm - t[0].x()) + n.y() * (y_mm - t[0].y())) / n.z();
      if (!top || std::abs(z - z_mm) < std::abs(*top - z_mm)) top = z;
    }
  return top;
}

}  // namespace vss
