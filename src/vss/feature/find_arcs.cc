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

constexpr double kMaxTurnRad = 0.9;  // between pieces; more is a corner

// The turn from a piece to the next of its chain, towards v positive; nothing where it is no smooth one.
std::optional<double> TurnBetween(const StraightPiece& a, const StraightPiece& b) {
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

// Points of a chain in their order: those of a closed one may go on from its last to its first.
struct PointRun {
  std::uint32_t begin, end;              // end - begin points
  std::uint32_t chain_begin, chain_end;  // of the chains' order

  std::uint32_t Place(std::uint32_t i) const { return i < chain_end ? i : i - chain_end + chain_begin; }
  std::uint32_t Size() const { return end - begin; }
};

PointRun RunOf(const Scene& s, std::uint32_t chain, std::uint32_t begin, std::uint32_t end) {
  return {begin, end, s.b.chains.start[chain], s.b.chains.start[chain + 1]};
}

struct FoundArc {
  EllipseFit ideal, img;
  PointRun run;
};

constexpr std::uint32_t kMinPoints = 16;

void TakePlaces(const Scene& s, const PointRun& run) {
  s.b.arc_ideal.clear();
  for (auto i = run.begin; i < run.end; ++i) s.b.arc_ideal.push_back(s.b.positions[run.Place(i)]);
}

std::optional<FoundArc> FitArc(const Scene& s, const PointRun& run) {
  constexpr double kMaxRmsPx = 0.35;
  constexpr double kMinAxisRatio = 0.08;
  if (run.Size() < kMinPoints) return std::nullopt;
  double tolerance = 0, strength = 0;
  for (auto i = run.begin; i < run.end; ++i)
    tolerance += s.b.tolerance[run.Place(i)], strength += s.PointAt(run.Place(i)).strength;
  const double n = run.Size();
  tolerance /= n;
  const EdgePoint& middle = s.PointAt(run.Place((run.begin + run.end) / 2));
  if (Significance(strength / n, n, s.b.noise.TextureAt(middle.cell_u, middle.cell_v)) <
      s.options.min_significance)
    return std::nullopt;
  TakePlaces(s, run);
  constexpr double kHopeless = 4;  // of the limit: no ellipse, whatever the distances are weighed like
  const double max_rms = std::max(kMaxRmsPx, tolerance / 3);
  const auto ideal = FitEllipse(s.b.arc_ideal, kHopeless * max_rms);
  if (!ideal) return std::nullopt;
  const Ellipse& e = ideal->ellipse;
  if (ideal->rms_px > max_rms || ideal->max_px > 3 * tolerance || e.axes.y() < kMinAxisRatio * e.axes.x() ||
      e.axes.x() > s.image.width + s.image.height)
    return std::nullopt;
  if (!s.lens) return FoundArc{*ideal, *ideal, run};
  s.b.arc_points.clear();
  for (auto i = run.begin; i < run.end; ++i)
    s.b.arc_points.emplace_back(s.PointAt(run.Place(i)).u, s.PointAt(run.Place(i)).v);
  const auto img = FitEllipse(s.b.arc_points);
  if (!img) return std::nullopt;
  return FoundArc{*ideal, *img, run};
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
    const StraightPiece &first = s.b.pieces[t.begin], &last = s.b.pieces[t.end - 1];
    if (auto arc = FitArc(s, RunOf(s, first.chain, first.begin, last.end))) {
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
  const PointRun& run = found.run;
  TakePlaces(s, run);
  s.b.arc_points.clear();
  EllipticalArc arc;
  double contrast = 0, variance = 0, inward = 0;
  for (auto i = run.begin; i < run.end; ++i) {
    const EdgePoint& p = s.PointAt(run.Place(i));
    s.b.arc_points.emplace_back(p.u, p.v);
    contrast += s.b.contrast[run.Place(i)], variance += ProfileVariance(p);
    inward += (found.img.ellipse.center - Vector2d(p.u, p.v)).dot(Vector2d(p.nu, p.nv)) > 0 ? 1 : -1;
  }
  const double n = run.Size();
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

// Whether the contour turns to one side over the points, and by more than a corner of a plate.
bool Turns(const Scene& s, const PointRun& run) {
  constexpr std::uint32_t kStep = 4;
  constexpr double kMinTotalRad = 1.2, kMinShare = 0.9;  // of the turning, to one side
  double total = 0, both = 0;
  for (auto i = run.begin; i + kStep < run.end; i += kStep) {
    const EdgePoint &p = s.PointAt(run.Place(i)), &q = s.PointAt(run.Place(i + kStep));
    const double turn = std::asin(std::clamp(double{p.nu} * q.nv - double{p.nv} * q.nu, -1.0, 1.0));
    total += turn, both += std::abs(turn);
  }
  return std::abs(total) > std::max(kMinTotalRad, kMinShare * both);
}

// Whether a chain's last point is followed by its first.
bool IsClosed(const Scene& s, std::uint32_t chain) {
  constexpr double kStepPx = 3, kMinCosine = 0.7;  // chains step over a hole of one pixel, along one contour
  const EdgePoint &p = s.PointAt(s.b.chains.start[chain]), &q = s.PointAt(s.b.chains.start[chain + 1] - 1);
  return std::hypot(p.u - q.u, p.v - q.v) <= kStepPx && p.nu * q.nu + p.nv * q.nv >= kMinCosine;
}

// An arc of the points, without those that corners at their ends may spoil.
void LookForTightArc(const Scene& s, PointRun run, LineImage& out) {
  constexpr std::uint32_t kAtCorner = 2;
  if (run.Size() < 2 * kAtCorner + kMinPoints) return;
  run.begin += kAtCorner, run.end -= kAtCorner;
  if (!Turns(s, run)) return;
  if (const auto arc = FitArc(s, run)) AppendArc(s, *arc, out);
}

// Contours that turn so fast that they have no straight pieces, between those that are straight. Two corners
// close together look like them: RefineArcs keeps those that explain the pixels down to the noise.
void FindTightArcs(const Scene& s, LineImage& out) {
  // Pieces of a circle lie within the tolerance on either side, and so are 16 times as long as the tolerance
  // over the turn from one to the next: a longer one is no part of a contour that turns more than runs of
  // pieces may.
  const double straight_px = 16 * s.options.tolerance_px / kMaxTurnRad;
  std::size_t piece = 0;
  for (std::uint32_t c = 0; c < s.b.chains.size(); ++c) {
    const std::uint32_t chain_begin = s.b.chains.start[c], chain_end = s.b.chains.start[c + 1];
    std::uint32_t begin = chain_begin, first_end = chain_end;
    bool any = false;
    for (; piece < s.b.pieces.size() && s.b.pieces[piece].chain == c; ++piece) {
      const StraightPiece& p = s.b.pieces[piece];
      if (!s.b.in_arc[piece] && p.to - p.from < straight_px) continue;
      if (any)
        LookForTightArc(s, RunOf(s, c, begin, p.begin), out);
      else
        first_end = p.begin;
      any = true, begin = p.end;
    }
    if (any && IsClosed(s, c)) {  // what comes before the first straight piece goes on from the last
      LookForTightArc(s, RunOf(s, c, begin, chain_end + first_end - chain_begin), out);
      continue;
    }
    if (any) LookForTightArc(s, RunOf(s, c, chain_begin, first_end), out);
    LookForTightArc(s, RunOf(s, c, begin, chain_end), out);
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
