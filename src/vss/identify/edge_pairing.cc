#include "vss/identify/edge_pairing.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector3d;
using Direction = WorldLine::Direction;

// Planes that meet at less than this say nothing of the depth (sine).
constexpr double kMinPlaneAngle = 0.03;
// The share of the shorter line that must lie beside the other.
constexpr double kMinOverlap = 0.4;
// Of each picture so many of its longest segments are paired with those of the others: every pair of segments
// of every pair of pictures is a candidate, and parts are made of long edges, texture of short ones. All
// others still join the edges that these found.
constexpr std::size_t kMaxPaired = 600;

std::vector<int> Longest(const LineIndex& index, double min_length_px) {
  std::vector<int> segments;
  for (int k = 0; k < index.num_segments(); ++k)
    if (index.lines()[std::size_t(k)].length_px >= min_length_px) segments.push_back(k);
  if (segments.size() > kMaxPaired) {
    std::stable_sort(segments.begin(), segments.end(), [&](int a, int b) {
      return index.lines()[std::size_t(a)].length_px > index.lines()[std::size_t(b)].length_px;
    });
    segments.resize(kMaxPaired);
    std::sort(segments.begin(), segments.end());
  }
  return segments;
}

int LeastViews(const EdgeCandidate& c) { return c.kind == Direction::kInclined ? 3 : 2; }

constexpr double kPerStop = 0.5, kPerPx = 1e-4, kMostPx = 2000;

// Horizontal and vertical explain more with less: one witness more.
double Score(const EdgeCandidate& c) {
  return c.num_views + kPerStop * c.num_stops + (c.kind == Direction::kInclined ? 0 : 1) +
         kPerPx * std::min(c.support_px, kMostPx);
}

// What a candidate that `views` pictures show scores at most.
double MostScore(int views, const EdgeCandidate& c) {
  constexpr double kRounded = 1e-6;
  return views + kPerStop * views + (c.kind == Direction::kInclined ? 0 : 1) + kPerPx * kMostPx + kRounded;
}

}  // namespace

EdgePairing::EdgePairing(const EdgeFitter& fitter, std::span<const LineIndex> indices) : fitter_(fitter) {
  for (const LineIndex& index : indices) paired_.push_back(Longest(index, fitter.options().min_length_px));
}

std::optional<EdgeCandidate> EdgePairing::Explain(int i, int line) const {
  constexpr double kMinBaselineMm = 1e-6;
  const View& view = fitter_.ViewOf(i);
  const ViewLine& a = fitter_.LineOf({i, line});
  std::vector<EdgeCandidate> candidates;
  for (const int j : fitter_.Together(i)) {
    const View& other = fitter_.ViewOf(j);
    if ((other.center_in_world - view.center_in_world).norm() < kMinBaselineMm) continue;
    const Eigen::AlignedBox2d room = RoomIn(other, view, a);
    for (const int k : Paired(j)) {
      const ViewLine& b = fitter_.LineOf({j, k});
      if (room.intersects(Eigen::AlignedBox2d(b.start.cwiseMin(b.end), b.start.cwiseMax(b.end))))
        PairUp(view, a, other, b, candidates);
    }
  }
  return Best(i, line, candidates);
}

// Where `other` may show what is line `a` of `view`, between the least and the largest height.
Eigen::AlignedBox2d EdgePairing::RoomIn(const View& other, const View& view, const ViewLine& a) const {
  // An upright edge is placed near its rays, not on them.
  constexpr double kMarginPx = 20, kMarginMm = 50, kMinSlope = 1e-3, kNearMm = 10;
  const Eigen::AlignedBox2d all(Eigen::Vector2d::Constant(-INFINITY), Eigen::Vector2d::Constant(INFINITY));
  Eigen::AlignedBox2d room;
  for (const Vector3d& ray : {a.ray_start, a.ray_end}) {
    if (ray.z() > -kMinSlope) return all;
    const auto at = [&](double z) {  // not behind the camera that sees it
      return Vector3d(view.center_in_world + std::max(0.0, (z - view.center_in_world.z()) / ray.z()) * ray);
    };
    const Vector3d low = at(fitter_.options().min_height_mm - kMarginMm);
    Vector3d high = at(fitter_.options().max_height_mm + kMarginMm);
    const double depth = (other.cam_from_world * low).z(), high_depth = (other.cam_from_world * high).z();
    if (depth <= kNearMm) return all;
    if (high_depth < kNearMm) high = low + (high - low) * ((depth - kNearMm) / (depth - high_depth));
    const auto from = other.ProjectIdeal(low), to = other.ProjectIdeal(high);
    if (!from || !to) return all;
    room.extend(*from);
    room.extend(*to);
  }
  return {room.min().array() - kMarginPx, room.max().array() + kMarginPx};
}

void EdgePairing::PairUp(const View& va, const ViewLine& a, const View& vb, const ViewLine& b,
                         std::vector<EdgeCandidate>& out) const {
  EdgeCandidate c;
  if (!Place(va, a, vb, b, c)) return;
  for (const Vector3d& x : {c.start, c.end})
    if (!x.allFinite() || x.z() < fitter_.options().min_height_mm || x.z() > fitter_.options().max_height_mm)
      return;
  if (Beside(vb, b, c.start, c.end)) out.push_back(std::move(c));
}

// Line `a` placed where its plane and that of `b` meet, or nearly so where that is level or plumb; false
// where they do not meet before both cameras.
bool EdgePairing::Place(const View& va, const ViewLine& a, const View& vb, const ViewLine& b,
                        EdgeCandidate& c) const {
  const Vector3d cross = a.plane_normal.cross(b.plane_normal);
  const double sine = cross.norm();
  if (sine < kMinPlaneAngle) return false;
  const Vector3d direction = cross / sine;
  // End points of `a` pushed onto the plane of `b`.
  auto meet = [&](const Vector3d& ray) {
    return va.center_in_world -
           ray * (b.plane_normal.dot(va.center_in_world - vb.center_in_world) / b.plane_normal.dot(ray));
  };
  const double slack =
      2 * fitter_.options().tolerance_px * (1 / a.length_px + 1 / b.length_px) / sine;  // rad, to first order
  const double level = std::abs(direction.z()), plumb = direction.head<2>().norm();
  if (level < std::max(slack, 0.01)) {
    c.kind = Direction::kHorizontal;
    if (a.plane_normal.head<2>().norm() < kMinPlaneTilt) return false;
    const Vector3d mid = meet((a.ray_start + a.ray_end).normalized());
    const double h = mid.z() - va.center_in_world.z();
    if (std::abs(a.ray_start.z()) < 1e-6 || std::abs(a.ray_end.z()) < 1e-6) return false;
    const double s0 = h / a.ray_start.z(), s1 = h / a.ray_end.z();
    if (!(s0 > 0) || !(s1 > 0)) return false;
    c.start = va.center_in_world + s0 * a.ray_start;
    c.end = va.center_in_world + s1 * a.ray_end;
  } else if (plumb < std::max(slack, 0.01)) {
    c.kind = Direction::kVertical;
    const Vector3d mid = meet((a.ray_start + a.ray_end).normalized());
    if ((mid - va.center_in_world).dot(a.ray_start) <= 0) return false;
    auto at = [&](const Vector3d& ray) {
      return Vector3d(mid +
                      Vector3d::UnitZ() * ClosestOnLine(mid, Vector3d::UnitZ(), va.center_in_world, ray));
    };
    c.start = at(a.ray_start);
    c.end = at(a.ray_end);
  } else {
    c.kind = Direction::kInclined;
    c.start = meet(a.ray_start);
    c.end = meet(a.ray_end);
    if ((c.start - va.center_in_world).dot(a.ray_start) <= 0 ||
        (c.end - va.center_in_world).dot(a.ray_end) <= 0)
      return false;
  }
  return true;
}

// Does the projection of start-end lie on line `l`, overlapping by a share of the shorter?
bool EdgePairing::Beside(const View& view, const ViewLine& l, const Vector3d& start,
                         const Vector3d& end) const {
  const auto p = view.ProjectIdeal(start), q = view.ProjectIdeal(end);
  if (!p || !q) return false;
  double s = (*p - l.start).dot(l.direction), t = (*q - l.start).dot(l.direction);
  double ds = (*p - l.start).dot(l.normal), dt = (*q - l.start).dot(l.normal);
  if (s > t) {
    std::swap(s, t);
    std::swap(ds, dt);
  }
  const double lo = std::max(0.0, s), hi = std::min(l.length_px, t);
  if (hi - lo < kMinOverlap * std::min(l.length_px, t - s) || hi <= lo) return false;
  const double slope = (dt - ds) / std::max(t - s, 1e-9);
  return std::abs(ds + slope * (lo - s)) < fitter_.options().tolerance_px &&
         std::abs(ds + slope * (hi - s)) < fitter_.options().tolerance_px;
}

std::optional<EdgeCandidate> EdgePairing::Best(int i, int line,
                                               std::vector<EdgeCandidate>& candidates) const {
  // Candidates that agree with many others first: those are worth a look at all pictures.
  std::optional<EdgeCandidate> best;
  double best_score = 0;
  std::vector<bool> done(candidates.size());
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    if (done[k]) continue;
    EdgeCandidate& c = candidates[k];
    for (std::size_t m = k + 1; m < candidates.size();
         ++m)  // the same edge within the tolerance, seen from here
      if (!done[m] && candidates[m].kind == c.kind && SameDepth(fitter_.ViewOf(i), c, candidates[m]))
        done[m] = true;
    c.support = {{i, line}};
    if (!FindSupport(c, best_score)) continue;
    fitter_.Count(c);
    if (c.num_views < LeastViews(c)) continue;
    const double score = Score(c);
    if (score > best_score) {
      best_score = score;
      best = c;
    }
  }
  return best;
}

// Adds the lines of all other pictures that lie beside the candidate's first; false, and not all of them,
// where so few show it that it is no edge, or scores no more than `least_score`.
bool EdgePairing::FindSupport(EdgeCandidate& c, double least_score) const {
  std::vector<int> lookers;
  for (const int v : fitter_.Together(c.support[0].view))
    if (!fitter_.ViewOf(v).SurelyMisses(c.start, c.end)) lookers.push_back(v);
  int views = 1;  // that show it
  for (std::size_t n = 0; n < lookers.size(); ++n) {
    // Each picture that is left may show it, from a stop of its own.
    const int most = views + int(lookers.size() - n);
    if (most < LeastViews(c) || MostScore(most, c) <= least_score) return false;
    const int v = lookers[n];
    const std::size_t before = c.support.size();
    std::vector<LineRef> found;
    fitter_.Collinear(v, c.start, c.end, found);
    for (const LineRef& r : found)
      if (Beside(fitter_.ViewOf(v), fitter_.LineOf(r), c.start, c.end)) c.support.push_back(r);
    views += c.support.size() > before;
  }
  return true;
}

bool EdgePairing::SameDepth(const View& view, const EdgeCandidate& a, const EdgeCandidate& b) const {
  // A depth step that moves the edge by less than half the tolerance in a picture one baseline of 1/5 depth
  // away.
  const double depth = (a.start - view.center_in_world).norm();
  const double step = 0.5 * fitter_.options().tolerance_px * depth / view.camera->intrinsics.fx_px * 5;
  return (a.start - b.start).norm() < step && (a.end - b.end).norm() < step;
}

}  // namespace vss
