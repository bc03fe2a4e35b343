// Elliptical arcs among the pieces of the chains.
#include <Eigen/Cholesky>
#include <optional>

#include "vss/feature/ellipse_fit.h"
#include "vss/feature/line_scene.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {
namespace {

using Eigen::Vector2d;

struct PieceRun {
  std::size_t begin, end;  // of b.pieces
};

// The turn from a piece to the next of its chain, towards v positive; nothing where it is no smooth one.
std::optional<double> TurnBetween(const StraightPiece& a, const StraightPiece& b) {
  constexpr double kMaxTurnRad = 0.9;       // more is a corner
  constexpr std::uint32_t kMaxSkipped = 8;  // points between pieces that are on none
  if (a.chain != b.chain || b.begin > a.end + kMaxSkipped) return std::nullopt;
  const Vector2d &d = a.line.direction, &e = b.line.direction;
  const double turn = std::atan2(d.x() * e.y() - d.y() * e.x(), d.dot(e));
  if (std::abs(turn) > kMaxTurnRad) return std::nullopt;
  return turn;
}

// The longest run of pieces from `begin` on that turns to one side; empty where it turns too little.
PieceRun TurningRun(const std::vector<StraightPiece>& pieces, std::size_t begin) {
  constexpr double kMinTotalRad = 0.5;
  double total = 0;
  std::size_t end = begin + 1;
  for (; end < pieces.size(); ++end) {
    const auto turn = TurnBetween(pieces[end - 1], pieces[end]);
    if (!turn || *turn * total < 0) break;
    total += *turn;
  }
  if (std::abs(total) < kMinTotalRad || end - begin < 3) return {begin, begin};
  return {begin, end};
}

struct FoundArc {
  EllipseFit ideal, img;
  std::uint32_t begin, end;  // of the chains' order
};

constexpr std::uint32_t kMinPoints = 16;

// The points [begin, end) of the chains' order.
std::optional<FoundArc> FitArc(const Scene& s, std::uint32_t begin, std::uint32_t end) {
  constexpr double kMaxRmsPx = 0.35;
  constexpr double kMinAxisRatio = 0.08;
  if (end - begin < kMinPoints) return std::nullopt;
  double tolerance = 0, strength = 0;
  for (auto i = begin; i < end; ++i) tolerance += s.b.tolerance[i], strength += s.PointAt(i).strength;
  const double n = end - begin;
  tolerance /= n;
  const EdgePoint& middle = s.PointAt((begin + end) / 2);
  if (Significance(strength / n, n, s.b.noise.TextureAt(middle.cell_u, middle.cell_v)) <
      s.options.min_significance)
    return std::nullopt;
  s.b.arc_ideal.assign(s.b.positions.begin() + begin, s.b.positions.begin() + end);
  constexpr double kHopeless = 4;  // of the limit: no ellipse, whatever the distances are weighed like
  const double max_rms = std::max(kMaxRmsPx, tolerance / 3);
  const auto ideal = FitEllipse(s.b.arc_ideal, kHopeless * max_rms);
  if (!ideal) return std::nullopt;
  const Ellipse& e = ideal->ellipse;
  if (ideal->rms_px > max_rms || ideal->max_px > 3 * tolerance || e.axes.y() < kMinAxisRatio * e.axes.x() ||
      e.axes.x() > s.image.width + s.image.height)
    return std::nullopt;
  if (!s.lens) return FoundArc{*ideal, *ideal, begin, end};
  s.b.arc_points.clear();
  for (auto i = begin; i < end; ++i) s.b.arc_points.emplace_back(s.PointAt(i).u, s.PointAt(i).v);
  const auto img = FitEllipse(s.b.arc_points);
  if (!img) return std::nullopt;
  return FoundArc{*ideal, *img, begin, end};
}

// The run may begin or end in a straight edge: without its outer pieces, until an ellipse fits.
std::optional<FoundArc> FitArcTrimmed(const Scene& s, PieceRun& run) {
  const PieceRun tries[] = {run,
                            {run.begin + 1, run.end},
                            {run.begin, run.end - 1},
                            {run.begin + 1, run.end - 1},
                            {run.begin + 2, run.end},
                            {run.begin, run.end - 2}};
  for (const PieceRun& t : tries) {
    if (t.end < t.begin + 3) continue;
    if (auto arc = FitArc(s, s.b.pieces[t.begin].begin, s.b.pieces[t.end - 1].end)) {
      run = t;
      return arc;
    }
  }
  return std::nullopt;
}

struct ParameterRange {
  double from, to;
};

// Parameter angles of the points in their order, unwrapped; a full turn is given as 2 pi.
ParameterRange RangeOf(const Ellipse& e, std::span<const Vector2d> points) {
  double at = e.ParameterOf(points.front()), low = at, high = at;
  for (const auto& p : points) {
    at += std::remainder(e.ParameterOf(p) - at, 2 * kPi);
    low = std::min(low, at), high = std::max(high, at);
  }
  constexpr double kClosed = 0.15;  // rad: a gap of less than this is none
  if (high - low > 2 * kPi - kClosed) return {0, 2 * kPi};
  const double turns = std::floor(low / (2 * kPi)) * 2 * kPi;
  return {low - turns, high - turns};
}

void AppendArc(const Scene& s, const FoundArc& found, LineImage& out) {
  s.b.arc_ideal.assign(s.b.positions.begin() + found.begin, s.b.positions.begin() + found.end);
  s.b.arc_points.clear();
  EllipticalArc arc;
  double contrast = 0, variance = 0, inward = 0;
  for (auto i = found.begin; i < found.end; ++i) {
    const EdgePoint& p = s.PointAt(i);
    s.b.arc_points.emplace_back(p.u, p.v);
    contrast += s.b.contrast[i], variance += ProfileVariance(p);
    inward += (found.img.ellipse.center - Vector2d(p.u, p.v)).dot(Vector2d(p.nu, p.nv)) > 0 ? 1 : -1;
  }
  const double n = found.end - found.begin;
  arc.center = found.img.ellipse.center, arc.axes = found.img.ellipse.axes,
  arc.angle_rad = found.img.ellipse.angle_rad;
  arc.ideal_center = found.ideal.ellipse.center, arc.ideal_axes = found.ideal.ellipse.axes,
  arc.ideal_angle_rad = found.ideal.ellipse.angle_rad;
  const auto img = RangeOf(found.img.ellipse, s.b.arc_points),
             ideal = RangeOf(found.ideal.ellipse, s.b.arc_ideal);
  arc.from_rad = img.from, arc.to_rad = img.to, arc.ideal_from_rad = ideal.from, arc.ideal_to_rad = ideal.to;
  arc.bright_inside = inward > 0;
  const double sigma = std::max(found.ideal.rms_px, kMinPlaceSigmaPx);
  arc.covariance = found.ideal.information.ldlt().solve(Eigen::Matrix<double, 5, 5>::Identity()) *
                   (sigma * sigma * kNeighbourCorrelation);
  arc.contrast = contrast / n;
  arc.blur_px = std::sqrt(std::max(0.0, variance / n - kGradientVariance));
  arc.rms_distance_px = found.ideal.rms_px;
  arc.num_points = static_cast<int>(n);
  out.arcs.push_back(arc);
}

// Whether the contour turns to one side over the points [begin, end), and by more than a corner of a plate.
bool Turns(const Scene& s, std::uint32_t begin, std::uint32_t end) {
  constexpr std::uint32_t kStep = 4;
  constexpr double kMinTotalRad = 1.2, kMinShare = 0.9;  // of the turning, to one side
  double total = 0, both = 0;
  for (auto i = begin; i + kStep < end; i += kStep) {
    const EdgePoint &p = s.PointAt(i), &q = s.PointAt(i + kStep);
    const double turn = std::asin(std::clamp(double{p.nu} * q.nv - double{p.nv} * q.nu, -1.0, 1.0));
    total += turn, both += std::abs(turn);
  }
  return std::abs(total) > std::max(kMinTotalRad, kMinShare * both);
}

// Contours that turn so fast that they have no straight pieces, between those that are straight. Two corners
// close together look like them: RefineArcs keeps those that explain the pixels down to the noise.
void FindTightArcs(const Scene& s, LineImage& out) {
  constexpr double kStraightPx = 10;      // so long a piece is no part of them
  constexpr std::uint32_t kAtCorner = 2;  // points that a corner may spoil
  std::size_t piece = 0;
  for (std::uint32_t c = 0; c < s.b.chains.size(); ++c) {
    std::uint32_t begin = s.b.chains.start[c];
    auto look = [&](std::uint32_t end) {
      const std::uint32_t from = begin + kAtCorner, to = end - kAtCorner;
      if (end < begin + 2 * kAtCorner + kMinPoints || !Turns(s, from, to)) return;
      if (const auto arc = FitArc(s, from, to)) AppendArc(s, *arc, out);
    };
    for (; piece < s.b.pieces.size() && s.b.pieces[piece].chain == c; ++piece) {
      const StraightPiece& p = s.b.pieces[piece];
      if (!s.b.in_arc[piece] && p.to - p.from < kStraightPx) continue;
      look(p.begin);
      begin = p.end;
    }
    look(s.b.chains.start[c + 1]);
  }
}

}  // namespace

void FindArcs(const Scene& s, LineImage& out) {
  s.b.in_arc.assign(s.b.pieces.size(), 0);
  s.b.num_sure_arcs = 0;
  if (!s.options.arcs) return;
  for (std::size_t i = 0; i + 3 <= s.b.pieces.size();) {
    PieceRun run = TurningRun(s.b.pieces, i);
    const auto arc = run.end > run.begin ? FitArcTrimmed(s, run) : std::nullopt;
    if (!arc) {
      ++i;
      continue;
    }
    AppendArc(s, *arc, out);
    std::fill(s.b.in_arc.begin() + std::ptrdiff_t(run.begin), s.b.in_arc.begin() + std::ptrdiff_t(run.end),
              1);
    i = run.end;
  }
  s.b.num_sure_arcs = out.arcs.size();
  FindTightArcs(s, out);
}

}  // namespace vss
