// The steps from a picture to its line image.
#include <algorithm>
#include <cmath>

#include "vss/feature/edge_chains.h"
#include "vss/feature/edge_points.h"
#include "vss/feature/ellipse_fit.h"
#include "vss/feature/line_image.h"
#include "vss/feature/line_refine.h"
#include "vss/feature/straight_pieces.h"
#include "vss/feature/undistortion_grid.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {

struct LineWorkspace::Buffers {
  EdgeBuffers edges;
  NoiseMap noise;
  std::vector<EdgePoint> points;
  std::vector<std::uint32_t> row_start;
  EdgeChains chains;
  UndistortionGrid grid;
  std::vector<Eigen::Vector2d> positions;  // ideal, of the chains' points in order
  std::vector<float> tolerance;
  std::vector<StraightPiece> pieces;
  std::vector<char> used;  // by an arc, per point in order
  std::vector<Eigen::Vector2d> arc_points, arc_ideal;
  RefineBuffers refine;
};

LineWorkspace::LineWorkspace() : buffers_(std::make_unique<Buffers>()) {}
LineWorkspace::~LineWorkspace() = default;
LineWorkspace::LineWorkspace(LineWorkspace&&) noexcept = default;
LineWorkspace& LineWorkspace::operator=(LineWorkspace&&) noexcept = default;

namespace {

using Eigen::Vector2d;
using Buffers = LineWorkspace::Buffers;

constexpr int kMinChainPoints = 5;
constexpr double kQuantisationSigma = 0.28867513459481287;  // grey levels: 1/sqrt(12)

struct Scene {
  const GreyView& image;
  const Intrinsics* lens;
  const LineOptions& options;
  Buffers& b;

  Vector2d Img(const Vector2d& ideal) const {
    if (!lens) return ideal;
    return lens->ImgFromNormalized(lens->NormalizedFromIdeal(ideal)).value_or(ideal);
  }
  Vector2d Ideal(const Vector2d& img) const {
    if (!lens) return img;
    const auto n = lens->NormalizedFromImg(img);
    return n ? lens->IdealFromNormalized(*n) : img;
  }
};

double Strength(const EdgePoint& p) { return std::hypot(p.gx, p.gy); }

// Grey levels between the two sides: the profile is taken for a Gaussian edge seen through the filter.
double ContrastOf(const EdgePoint& p) {
  const double variance = std::clamp(double{p.width2_px2}, kGradientVariance, 25.0);
  return Strength(p) / kGradientGain * std::sqrt(2 * kPi * variance);
}

// A contour's mean gradient over the sigma that noise and texture would give a mean over so many points.
double Significance(double mean_strength, double num_points, double texture) {
  constexpr double kTextureGrainPx = 6;  // points of texture nearer together than this tell the same
  return mean_strength / texture * std::sqrt(num_points / kTextureGrainPx);
}

// How far the point may lie off a line: three sigmas of its place, which follows from contrast and noise.
float ToleranceOf(const EdgePoint& p, const Scene& s) {
  constexpr double kSigmas = 3.0;
  constexpr double kPlaceNoise =
      1.5;  // px of the point's place per noise over contrast: measured, blur 0.7 to 1.5 px
  constexpr double kMaxTolerancePx = 1.5;
  const double sigma = s.b.noise.At(p.cell_u, p.cell_v);
  return static_cast<float>(std::clamp(kSigmas * kPlaceNoise * sigma / std::max(ContrastOf(p), 1e-9),
                                       s.options.tolerance_px,
                                       std::max(kMaxTolerancePx, s.options.tolerance_px)));
}

void FillPositions(const Scene& s) {
  s.b.positions.clear();
  s.b.tolerance.clear();
  for (const auto i : s.b.chains.order) {
    const EdgePoint& p = s.b.points[i];
    Vector2d at(p.u, p.v);
    if (s.lens) {
      const Vector2d ideal = s.b.grid.Ideal(p.u, p.v);
      if (ideal.allFinite()) at = ideal;
    }
    s.b.positions.push_back(at);
    s.b.tolerance.push_back(ToleranceOf(p, s));
  }
}

const EdgePoint& PointAt(const Buffers& b, std::uint32_t place) { return b.points[b.chains.order[place]]; }

// ---- arcs ----

double TurnBetween(const Vector2d& a, const Vector2d& b) {
  return std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
}

struct ArcCandidate {
  std::uint32_t begin, end;
};

// Runs of a chain that keep turning to one side.
std::vector<ArcCandidate> TurningRuns(const Buffers& b, std::uint32_t begin, std::uint32_t end) {
  constexpr std::uint32_t kStep = 4;           // points between the directions that are compared
  constexpr double kMaxTurnRad = 0.9;          // more within a step is a corner
  constexpr double kMaxCounterTurnRad = 0.25;  // noise may turn a step back by this
  constexpr double kMinTotalRad = 0.7;         // 40 degrees
  std::vector<ArcCandidate> runs;
  const std::uint32_t n = (end - begin) / kStep;
  if (n < 3) return runs;
  auto direction = [&](std::uint32_t k) {
    const EdgePoint& p = PointAt(b, begin + k * kStep);
    return Vector2d(-p.gy, p.gx);
  };
  for (std::uint32_t k = 0; k + 2 < n;) {
    double total = 0, back = 0;
    std::uint32_t j = k;
    for (; j + 1 < n; ++j) {
      const double turn = TurnBetween(direction(j), direction(j + 1));
      if (std::abs(turn) > kMaxTurnRad) break;
      const double next = total + turn;
      if (total != 0 && turn * total < 0 && std::abs(turn) > kMaxCounterTurnRad) break;
      back = turn * total < 0 ? back + std::abs(turn) : 0;
      if (back > kMaxCounterTurnRad) break;
      total = next;
    }
    if (std::abs(total) > kMinTotalRad)
      runs.push_back({begin + k * kStep, std::min(end, begin + j * kStep + 1)});
    k = std::max(j, k + 1);
  }
  return runs;
}

struct FoundArc {
  EllipseFit ideal, img;
  std::uint32_t begin, end;
};

std::optional<FoundArc> FitArc(const Scene& s, const ArcCandidate& c) {
  constexpr std::uint32_t kMinPoints = 16;
  constexpr double kMaxRmsPx = 0.35;
  constexpr double kMinAxisRatio = 0.08;
  if (c.end - c.begin < kMinPoints) return std::nullopt;
  s.b.arc_ideal.assign(s.b.positions.begin() + c.begin, s.b.positions.begin() + c.end);
  s.b.arc_points.clear();
  for (auto i = c.begin; i < c.end; ++i) s.b.arc_points.emplace_back(PointAt(s.b, i).u, PointAt(s.b, i).v);
  const auto ideal = FitEllipse(s.b.arc_ideal);
  if (!ideal) return std::nullopt;
  double tolerance = 0;
  for (auto i = c.begin; i < c.end; ++i) tolerance += s.b.tolerance[i];
  tolerance /= c.end - c.begin;
  const Ellipse& e = ideal->ellipse;
  if (ideal->rms_px > std::max(kMaxRmsPx, tolerance / 3) || ideal->max_px > 3 * tolerance ||
      e.axes.y() < kMinAxisRatio * e.axes.x())
    return std::nullopt;
  if (e.axes.x() > s.image.width + s.image.height) return std::nullopt;
  double strength = 0;
  for (auto i = c.begin; i < c.end; ++i) strength += Strength(PointAt(s.b, i));
  const double n = c.end - c.begin;
  const EdgePoint& middle = PointAt(s.b, (c.begin + c.end) / 2);
  if (Significance(strength / n, n, s.b.noise.TextureAt(middle.cell_u, middle.cell_v)) <
      s.options.min_significance)
    return std::nullopt;
  const auto img = s.lens ? FitEllipse(s.b.arc_points) : ideal;
  if (!img) return std::nullopt;
  return FoundArc{*ideal, *img, c.begin, c.end};
}

// The run may begin or end in a straight edge: halve from both ends until an ellipse fits.
std::optional<FoundArc> FitArcTrimmed(const Scene& s, ArcCandidate c) {
  constexpr int kTries = 3;
  for (int i = 0; i < kTries; ++i) {
    if (auto arc = FitArc(s, c)) return arc;
    const auto cut = (c.end - c.begin) / 8;
    c.begin += cut, c.end -= cut;
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
    const EdgePoint& p = PointAt(s.b, i);
    s.b.arc_points.emplace_back(p.u, p.v);
    contrast += ContrastOf(p), variance += p.width2_px2;
    inward += (found.img.ellipse.center - Vector2d(p.u, p.v)).dot(Vector2d(p.gx, p.gy)) > 0 ? 1 : -1;
    s.b.used[i] = 1;
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
  constexpr double kNeighbourCorrelation =
      3.5;  // the filter makes the noise of points on a contour one over so many
  constexpr double kMinPlaceSigmaPx = 0.03;  // a parabola's own error
  const double sigma = std::max(found.ideal.rms_px, kMinPlaceSigmaPx);
  arc.covariance = found.ideal.information.ldlt().solve(Eigen::Matrix<double, 5, 5>::Identity()) *
                   (sigma * sigma * kNeighbourCorrelation);
  arc.contrast = contrast / n;
  arc.blur_px = std::sqrt(std::max(0.0, variance / n - kGradientVariance));
  arc.rms_distance_px = found.ideal.rms_px;
  arc.num_points = static_cast<int>(n);
  out.arcs.push_back(arc);
}

void FindArcs(const Scene& s, LineImage& out) {
  s.b.used.assign(s.b.chains.order.size(), 0);
  if (!s.options.arcs) return;
  for (std::size_t c = 0; c < s.b.chains.size(); ++c)
    for (const auto& run : TurningRuns(s.b, s.b.chains.start[c], s.b.chains.start[c + 1]))
      if (const auto arc = FitArcTrimmed(s, run)) AppendArc(s, *arc, out);
}

// ---- straight lines ----

void FindPieces(const Scene& s) {
  constexpr int kSeedPoints = 6;
  s.b.pieces.clear();
  for (std::uint32_t c = 0; c < s.b.chains.size(); ++c)
    for (std::uint32_t from = s.b.chains.start[c], end = s.b.chains.start[c + 1]; from < end;) {
      std::uint32_t to = from;
      while (to < end && !s.b.used[to]) ++to;
      SplitChain(s.b.positions, s.b.tolerance, c, from, to, kSeedPoints, s.b.pieces);
      from = std::max(to, from + 1);
      while (from < end && s.b.used[from]) ++from;
    }
}

double Sample(const GreyView& image, const Vector2d& p) {
  const double u = std::clamp(p.x(), 0.0, image.width - 1.001),
               v = std::clamp(p.y(), 0.0, image.height - 1.001);
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const double a = u - iu, b = v - iv;
  return (1 - b) * ((1 - a) * image.At(iu, iv) + a * image.At(iu + 1, iv)) +
         b * ((1 - a) * image.At(iu, iv + 1) + a * image.At(iu + 1, iv + 1));
}

double PieceStrength(const Scene& s, const StraightPiece& p) {
  double sum = 0;
  for (auto i = p.begin; i < p.end; ++i) sum += Strength(PointAt(s.b, i));
  return sum / (p.end - p.begin);
}

double PieceContrast(const Scene& s, const StraightPiece& p) {
  double sum = 0;
  for (auto i = p.begin; i < p.end; ++i) sum += ContrastOf(PointAt(s.b, i));
  return sum / (p.end - p.begin);
}

// Whether the picture shows an edge of the right sign and at least a third of the contrast between the two
// places (ideal).
bool GapShowsEdge(const Scene& s, const Vector2d& from, const Vector2d& to, double contrast) {
  constexpr double kSidePx = 1.5;
  constexpr double kMinShare = 0.3, kMinPositive = 0.75;
  const int steps = std::max(2, static_cast<int>((to - from).norm()));
  const Vector2d d = (to - from).normalized(), left(d.y(), -d.x());
  double sum = 0;
  int positive = 0;
  for (int i = 0; i <= steps; ++i) {
    const Vector2d p = from + (to - from) * (double(i) / steps);
    const double difference =
        Sample(s.image, s.Img(p + kSidePx * left)) - Sample(s.image, s.Img(p - kSidePx * left));
    sum += difference;
    positive += difference > 0;
  }
  return sum / (steps + 1) > kMinShare * contrast && positive >= kMinPositive * (steps + 1);
}

// Whether a piece is worth looking at: half the significance that is asked of a segment in the end.
bool PieceMatters(const Scene& s, const StraightPiece& p) {
  const EdgePoint& middle = PointAt(s.b, (p.begin + p.end) / 2);
  return Significance(PieceStrength(s, p), p.end - p.begin,
                      s.b.noise.TextureAt(middle.cell_u, middle.cell_v)) > 0.6 * s.options.min_significance;
}

struct PieceState {
  StraightPiece piece;
  double contrast, strength;
  bool alive = true;
  Vector2d Start() const { return piece.line.point + piece.from * piece.line.direction; }
  Vector2d End() const { return piece.line.point + piece.to * piece.line.direction; }
  double Length() const { return piece.to - piece.from; }
};

bool TryJoin(const Scene& s, PieceState& a, PieceState& b) {
  constexpr double kMaxTurnCosine = 0.97;  // 14 degrees: short pieces know their direction no better
  constexpr double kFreeGapPx = 3;         // joined without a look at the picture
  constexpr double kMaxOverlapPx = 4;
  constexpr double kGapShare = 0.6;
  if (a.piece.line.direction.dot(b.piece.line.direction) < kMaxTurnCosine) return false;
  const double gap = a.piece.line.Along(b.Start()) - a.piece.to;
  const double max_gap =
      std::min(s.options.max_gap_px, std::max(kFreeGapPx, kGapShare * std::max(a.Length(), b.Length())));
  if (gap < -kMaxOverlapPx || gap > max_gap) return false;
  const double tolerance =
      std::max(s.options.tolerance_px, 3 * std::max(a.piece.line.rms_px, b.piece.line.rms_px));
  const PieceState &longer = a.Length() >= b.Length() ? a : b, &shorter = a.Length() >= b.Length() ? b : a;
  const double reach = 1 + (shorter.Length() + std::max(0.0, gap)) / std::max(1.0, longer.Length());
  if (std::abs(longer.piece.line.Across(shorter.Start())) > tolerance * reach ||
      std::abs(longer.piece.line.Across(shorter.End())) > tolerance * reach)
    return false;
  LineMoments joint = a.piece.moments;
  joint.Add(b.piece.moments);
  const FittedLine line = FitLine(joint, longer.piece.line.direction);
  for (const Vector2d& p : {a.Start(), a.End(), b.Start(), b.End()})
    if (std::abs(line.Across(p)) > tolerance) return false;
  const double expected = std::sqrt((a.piece.moments.n * a.piece.line.rms_px * a.piece.line.rms_px +
                                     b.piece.moments.n * b.piece.line.rms_px * b.piece.line.rms_px) /
                                    joint.n);
  constexpr double kRmsGrowth = 1.3, kRmsFloorPx = 0.1;
  if (line.rms_px > kRmsGrowth * expected + kRmsFloorPx) return false;
  if (gap > kFreeGapPx && !GapShowsEdge(s, a.End(), b.Start(), std::min(a.contrast, b.contrast)))
    return false;
  const Vector2d start = a.Start(), end = b.End(), other = a.End();
  a.contrast = (a.contrast * a.piece.moments.n + b.contrast * b.piece.moments.n) / joint.n;
  a.strength = (a.strength * a.piece.moments.n + b.strength * b.piece.moments.n) / joint.n;
  a.piece.moments = joint;
  a.piece.line = line;
  a.piece.from = line.Along(start);
  a.piece.to = std::max(line.Along(end), line.Along(other));
  b.alive = false;
  return true;
}

void JoinPieces(const Scene& s, std::vector<PieceState>& states) {
  for (bool again = true; again;) {
    again = false;
    for (auto& a : states)
      for (auto& b : states)
        if (&a != &b && a.alive && b.alive && TryJoin(s, a, b)) again = true;
  }
}

LineSegment SegmentOf(const Scene& s, const PieceState& state) {
  LineSegment out;
  out.ideal_start = state.Start(), out.ideal_end = state.End();
  out.start = s.Img(out.ideal_start), out.end = s.Img(out.ideal_end);
  const auto& m = state.piece.moments;
  constexpr double kNeighbourCorrelation = 3.5, kMinPlaceSigmaPx = 0.03;
  const double sigma =
      std::max(state.piece.line.rms_px, kMinPlaceSigmaPx) * std::sqrt(kNeighbourCorrelation / m.n);
  out.sigma_offset_px = sigma;
  out.sigma_angle_rad = sigma * std::sqrt(12.0) / state.Length();
  out.contrast = state.contrast;
  double variance = 0;
  for (auto i = state.piece.begin; i < state.piece.end; ++i) variance += PointAt(s.b, i).width2_px2;
  out.blur_px =
      std::sqrt(std::max(0.0, variance / (state.piece.end - state.piece.begin) - kGradientVariance));
  out.rms_distance_px = state.piece.line.rms_px;
  out.num_points = static_cast<int>(m.n);
  return out;
}

bool Accepted(const Scene& s, const LineSegment& x, double strength) {
  const double length = (x.end - x.start).norm();
  if (length < s.options.min_length_px) return false;
  const Vector2d middle = 0.5 * (x.start + x.end);
  const int u = std::clamp(int(middle.x()), 0, s.image.width - 1),
            v = std::clamp(int(middle.y()), 0, s.image.height - 1);
  return x.contrast >= s.options.min_contrast &&
         Significance(strength, length, s.b.noise.TextureAt(u, v)) > s.options.min_significance;
}

}  // namespace

LineImage DetectLines(const GreyView& image, const Intrinsics* lens, const LineOptions& options,
                      LineWorkspace* workspace) {
  LineImage out;
  out.width_px = std::max(image.width, 0), out.height_px = std::max(image.height, 0);
  out.lens_known = lens != nullptr;
  if (image.data == nullptr || image.width < 1 || image.height < 1) return out;
  LineWorkspace own;
  Scene s{image, lens, options, workspace ? workspace->buffers() : own.buffers()};
  EstimateNoise(image, static_cast<float>(kQuantisationSigma), s.b.edges, s.b.noise);
  out.noise_sigma = s.b.noise.median_sigma;
  FindEdgePoints(image, s.b.noise, options.edge_threshold, s.b.edges, s.b.points, s.b.row_start);
  JoinChains(s.b.points, s.b.row_start, image.width, image.height, kMinChainPoints, s.b.chains);
  if (lens) s.b.grid.Prepare(*lens, image.width, image.height);
  FillPositions(s);
  FindArcs(s, out);
  FindPieces(s);
  std::vector<PieceState> states;
  for (const auto& p : s.b.pieces)
    if (PieceMatters(s, p)) states.push_back({p, PieceContrast(s, p), PieceStrength(s, p)});
  JoinPieces(s, states);
  for (const auto& state : states) {
    if (!state.alive) continue;
    const LineSegment segment = SegmentOf(s, state);
    if (Accepted(s, segment, state.strength)) out.segments.push_back(segment);
  }
  const RefineContext refine{image, lens, s.b.noise, s.b.edges.simd};
  RefinePlaces(refine, out.segments, s.b.refine);
  RefineEnds(refine, out.segments, s.b.refine);
  return out;
}

}  // namespace vss
