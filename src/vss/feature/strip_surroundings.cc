#include "vss/feature/strip_surroundings.h"

#include <algorithm>
#include <cmath>

#include "vss/feature/strip_frame.h"

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr double kPairPx = 5.5;  // parallel edges nearer than this are fitted together

// Contrasts that may be those of the same two regions.
bool AreAlike(double a, double b) {
  constexpr double kMaxContrastRatio = 1.6;
  return std::max(a, b) <= kMaxContrastRatio * std::min(a, b);
}

// How segment `n` continues `s` round a corner: +1 to the left (bright inside),
// -1 to the right, 0 not at all.
int TurnAtCorner(const LineSegment& s, const LineSegment& n, bool at_end) {
  constexpr double kReachPx = 4;  // raw ends miss their corner by this at most
  constexpr double kMinLengthPx = 6;
  constexpr double kMinSine = 0.35;  // 20 degrees
  const Vector2d &mine = at_end ? s.ideal_end : s.ideal_start, &its = at_end ? n.ideal_start : n.ideal_end;
  if ((mine - its).squaredNorm() > 2 * kReachPx * kReachPx || !AreAlike(s.contrast, n.contrast)) return 0;
  const Vector2d d = s.ideal_end - s.ideal_start, e = n.ideal_end - n.ideal_start;
  if (e.norm() < kMinLengthPx) return 0;
  const double sine = (d.x() * e.y() - d.y() * e.x()) / (d.norm() * e.norm());
  if (std::abs(sine) < kMinSine) return 0;
  const Vector2d w = n.ideal_start - mine;
  const double along = (w.x() * e.y() - w.y() * e.x()) / (sine * e.norm());
  const Vector2d cross = mine + along * d.normalized();
  if (std::abs(along) > kReachPx || (cross - its).norm() > kReachPx) return 0;
  const double turn = at_end ? sine : -sine;  // on the way through the corner
  return turn < 0 ? 1 : -1;                   // v points down: a turn to the left has a negative sine
}

// The corner's line at its place: under a distorting lens the tangent there.
StripCorner CornerOf(const Intrinsics* lens, const LineSegment& n, bool at_its_start) {
  const Vector2d d = (n.ideal_end - n.ideal_start).normalized();
  constexpr double kChordPx = 8;
  const Vector2d near = at_its_start ? n.ideal_start : Vector2d(n.ideal_end - kChordPx * d);
  const Vector2d p = ImgOf(lens, near), q = ImgOf(lens, near + kChordPx * d), t = (q - p).normalized();
  return {p, {t.y(), -t.x()}};
}

// Whether the neighbour from `p` to `q` (in the frame) tells of the same edge as the segment: the same
// polarity, lying on its line where they are beside each other.
bool IsSameEdge(const StripFrame& f, double blur_px, const Vector2d& p, const Vector2d& q) {
  constexpr double kMaxSlope = 0.5;
  const double slope = (q.y() - p.y()) / (q.x() - p.x());
  if (!(q.x() > p.x()) || !(std::abs(slope) < kMaxSlope)) return false;
  for (const double end : {f.from, f.to}) {
    const double t = p.y() + slope * (std::clamp(end, p.x(), q.x()) - p.x());
    if (std::abs(t) > SameEdgePx(blur_px)) return false;
  }
  return true;
}

}  // namespace

double SameEdgePx(double blur_px) {
  constexpr double kBlurs = 1.3, kMinPx = 1.0;
  return std::max(kMinPx, kBlurs * blur_px);
}

Surroundings Survey(const StripFrame& f, double blur_px, double contrast,
                    const std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr double kParallel = 0.12;   // slope
  constexpr double kMinOverlap = 0.5;  // of the segment's length
  Surroundings out;
  double nearest = kPairPx;
  b.neighbours.clear();
  std::size_t partner_place = 0;
  for (const auto j : b.grid.nearby) {
    const Vector2d p = InFrame(f, segments[j].start), q = InFrame(f, segments[j].end);
    const double low = std::min(p.x(), q.x()), high = std::max(p.x(), q.x());
    if (high < f.from - kNearPx || low > f.to + kNearPx || std::min(p.y(), q.y()) > kNearPx ||
        std::max(p.y(), q.y()) < -kNearPx)
      continue;
    if (AreAlike(contrast, segments[j].contrast) && IsSameEdge(f, blur_px, p, q)) continue;
    b.neighbours.push_back({p, q});
    const double slope = (q.y() - p.y()) / (q.x() - p.x());
    const double overlap = std::min(high, f.to) - std::max(low, f.from);
    const double at = p.y() - slope * p.x();
    if (!(std::abs(slope) < kParallel) || overlap < kMinOverlap * (f.to - f.from) ||
        std::abs(at) >= nearest || std::abs(at) < 0.7)
      continue;
    nearest = std::abs(at);
    out.partner = static_cast<int>(j);
    const bool same = q.x() > p.x();
    out.partner_edge = {at, slope, same ? segments[j].contrast : -segments[j].contrast,
                        Eigen::Matrix2d::Zero()};
    partner_place = b.neighbours.size() - 1;
  }
  if (out.partner >= 0) b.neighbours.erase(b.neighbours.begin() + std::ptrdiff_t(partner_place));
  return out;
}

Corners FindCorners(const Intrinsics* lens, const LineSegment& s, const std::vector<LineSegment>& all,
                    const StripFrame& frame, RefineBuffers& b) {
  Corners out;
  for (const bool at_end : {false, true})
    for (const auto j : b.grid.nearby) {
      const int turn = TurnAtCorner(s, all[j], at_end);
      if (turn == 0 || (out.count > 0 && out.dark != (turn < 0))) continue;
      out.dark = turn < 0;
      out.at[out.count++] = CornerOf(lens, all[j], at_end);
      (at_end ? out.at_end : out.at_start) = true;
      const Vector2d p = InFrame(frame, all[j].start), q = InFrame(frame, all[j].end);
      std::erase_if(b.neighbours, [&](const StripNeighbour& n) { return n.from == p && n.to == q; });
      break;
    }
  return out;
}

}  // namespace vss
