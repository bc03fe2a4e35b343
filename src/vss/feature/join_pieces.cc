// Straight pieces that are one line become one.
#include "vss/feature/grey_sample.h"
#include "vss/feature/line_scene.h"

namespace vss {
namespace {

using Eigen::Vector2d;

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

// Whether the points of both lie on one line as well as on their own.
bool AreOneLine(const PieceState& a, const PieceState& b, double tolerance, const FittedLine& joint,
                double n) {
  constexpr double kRmsGrowth = 1.3, kRmsFloorPx = 0.1;
  for (const Vector2d& p : {a.Start(), a.End(), b.Start(), b.End()})
    if (std::abs(joint.Across(p)) > tolerance) return false;
  const double expected = std::sqrt((a.piece.moments.n * a.piece.line.rms_px * a.piece.line.rms_px +
                                     b.piece.moments.n * b.piece.line.rms_px * b.piece.line.rms_px) /
                                    n);
  return joint.rms_px <= kRmsGrowth * expected + kRmsFloorPx;
}

constexpr double kMaxOverlapPx = 4;

// Makes `b`, which begins where `a` ends, part of it if they are one line.
bool TryJoin(const Scene& s, PieceState& a, PieceState& b) {
  constexpr double kMaxTurnCosine = 0.97;  // 14 degrees: short pieces know their direction no better
  constexpr double kFreeGapPx = 3;         // joined without a look at the picture
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
  if (!AreOneLine(a, b, tolerance, line, joint.n)) return false;
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

// Pieces by the cell in which they start, in order of their index.
constexpr int kCellPx = 32;

struct StartGrid {
  int columns, rows;
  int Column(double u) const { return std::clamp(static_cast<int>(u / kCellPx), 0, columns - 1); }
  int Row(double v) const { return std::clamp(static_cast<int>(v / kCellPx), 0, rows - 1); }
};

StartGrid BuildStartGrid(const Scene& s) {
  const StartGrid grid{s.image.width / kCellPx + 1, s.image.height / kCellPx + 1};
  s.b.cell_first.assign(std::size_t(grid.columns) * grid.rows, -1);
  s.b.cell_next.resize(s.b.states.size());
  for (auto i = static_cast<std::int32_t>(s.b.states.size()); i-- > 0;) {
    const Vector2d p = s.b.states[std::size_t(i)].Start();
    auto& first = s.b.cell_first[std::size_t(grid.Row(p.y())) * grid.columns + grid.Column(p.x())];
    s.b.cell_next[std::size_t(i)] = first;
    first = i;
  }
  return grid;
}

bool JoinFollower(const Scene& s, const StartGrid& grid, PieceState& a) {
  constexpr double kDriftPx = 2;  // starts move as pieces grow
  const double reach = std::max(s.options.max_gap_px, kMaxOverlapPx) + kDriftPx;
  const Vector2d end = a.End();
  for (int y = grid.Row(end.y() - reach); y <= grid.Row(end.y() + reach); ++y)
    for (int x = grid.Column(end.x() - reach); x <= grid.Column(end.x() + reach); ++x)
      for (auto i = s.b.cell_first[std::size_t(y) * grid.columns + x]; i >= 0;
           i = s.b.cell_next[std::size_t(i)]) {
        PieceState& b = s.b.states[std::size_t(i)];
        if (&a != &b && b.alive && TryJoin(s, a, b)) return true;
      }
  return false;
}

// Whether a piece is worth looking at: near the significance that is asked of a segment in the end.
bool FillState(const Scene& s, const StraightPiece& p, PieceState& state) {
  constexpr double kShare = 0.6;
  double strength = 0, contrast = 0;
  for (auto i = p.begin; i < p.end; ++i) strength += s.PointAt(i).strength, contrast += s.b.contrast[i];
  const double n = p.end - p.begin;
  state = {p, contrast / n, strength / n};
  const EdgePoint& middle = s.PointAt((p.begin + p.end) / 2);
  return Significance(state.strength, n, s.b.noise.TextureAt(middle.cell_u, middle.cell_v)) >
         kShare * s.options.min_significance;
}

}  // namespace

void JoinPieces(const Scene& s) {
  s.b.states.clear();
  PieceState state;
  for (std::size_t i = 0; i < s.b.pieces.size(); ++i)
    if (!s.b.in_arc[i] && FillState(s, s.b.pieces[i], state)) s.b.states.push_back(state);
  const StartGrid grid = BuildStartGrid(s);
  for (bool again = true; again;) {
    again = false;
    for (auto& a : s.b.states)
      while (a.alive && JoinFollower(s, grid, a)) again = true;
  }
}

}  // namespace vss
