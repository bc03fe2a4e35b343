// The steps from a picture to its line image.
#include "vss/feature/line_scene.h"

namespace vss {

LineWorkspace::LineWorkspace() : buffers_(std::make_unique<Buffers>()) {}
LineWorkspace::~LineWorkspace() = default;
LineWorkspace::LineWorkspace(LineWorkspace&&) noexcept = default;
LineWorkspace& LineWorkspace::operator=(LineWorkspace&&) noexcept = default;

namespace {

using Eigen::Vector2d;

constexpr int kMinChainPoints = 5;
constexpr int kSeedPoints = 6;                              // of a straight piece
constexpr double kChainShare = 0.5;                         // of the significance that a segment needs
constexpr double kQuantisationSigma = 0.28867513459481287;  // grey levels: 1/sqrt(12)

// How far the point may lie off a line: three sigmas of its place, which follows from contrast and noise.
float ToleranceOf(const EdgePoint& p, double contrast, const Scene& s) {
  constexpr double kSigmas = 3.0;
  constexpr double kPlaceNoise =
      1.5;  // px of the point's place per noise over contrast: measured, blur 0.7 to 1.5 px
  constexpr double kMaxTolerancePx = 1.5;
  const double sigma = s.b.noise.At(p.cell_u, p.cell_v);
  return static_cast<float>(std::clamp(kSigmas * kPlaceNoise * sigma / std::max(contrast, 1e-9),
                                       s.options.tolerance_px,
                                       std::max(kMaxTolerancePx, s.options.tolerance_px)));
}

void FillPositions(const Scene& s) {
  s.b.positions.clear();
  s.b.contrast.clear();
  s.b.tolerance.clear();
  for (const auto i : s.b.chains.order) {
    const EdgePoint& p = s.b.points[i];
    Vector2d at(p.u, p.v);
    if (s.lens) {
      const Vector2d ideal = s.b.grid.Ideal(p.u, p.v);
      if (ideal.allFinite()) at = ideal;
    }
    s.b.positions.push_back(at);
    s.b.contrast.push_back(ContrastOf(p));
    s.b.tolerance.push_back(ToleranceOf(p, s.b.contrast.back(), s));
  }
}

void FindPieces(const Scene& s) {
  s.b.pieces.clear();
  for (std::uint32_t c = 0; c < s.b.chains.size(); ++c)
    SplitChain(s.b.positions, s.b.tolerance, c, s.b.chains.start[c], s.b.chains.start[c + 1], kSeedPoints,
               s.b.pieces);
}

LineSegment SegmentOf(const Scene& s, const PieceState& state) {
  LineSegment out;
  out.ideal_start = state.Start(), out.ideal_end = state.End();
  out.start = s.Img(out.ideal_start), out.end = s.Img(out.ideal_end);
  const auto& m = state.piece.moments;
  const double sigma =
      std::max(state.piece.line.rms_px, kMinPlaceSigmaPx) * std::sqrt(kNeighbourCorrelation / m.n);
  out.sigma_offset_px = sigma;
  out.sigma_angle_rad = sigma * std::sqrt(12.0) / state.Length();
  out.contrast = state.contrast;
  double variance = 0;
  for (auto i = state.piece.begin; i < state.piece.end; ++i) variance += ProfileVariance(s.PointAt(i));
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

void FindSegments(const Scene& s, LineImage& out) {
  JoinPieces(s);
  for (const auto& state : s.b.states) {
    if (!state.alive) continue;
    const LineSegment segment = SegmentOf(s, state);
    if (Accepted(s, segment, state.strength)) out.segments.push_back(segment);
  }
}

}  // namespace

void DetectLines(const GreyView& image, const Intrinsics* lens, const LineOptions& options,
                 LineWorkspace& workspace, LineImage& out) {
  out.image.clear(), out.segments.clear(), out.arcs.clear();
  out.width_px = std::max(image.width, 0), out.height_px = std::max(image.height, 0);
  out.noise_sigma = 0;
  out.lens_known = lens != nullptr;
  if (image.data == nullptr || image.width < 1 || image.height < 1) return;
  const Scene s{image, lens, options, workspace.buffers()};
  EstimateNoise(image, static_cast<float>(kQuantisationSigma), s.b.edges, s.b.noise);
  out.noise_sigma = s.b.noise.median_sigma;
  FindEdgePoints(image, s.b.noise, options.edge_threshold, s.b.edges, s.b.points);
  JoinChains(s.b.points, image.width, image.height, s.b.noise, kMinChainPoints,
             kChainShare * options.min_significance, s.b.chains);
  if (lens) s.b.grid.Prepare(*lens, image.width, image.height);
  FillPositions(s);
  FindPieces(s);
  FindArcs(s, out);
  RefineArcs(s, out.arcs);
  FindSegments(s, out);
  const RefineContext refine{image, lens, s.b.noise, s.b.edges.simd};
  RefinePlaces(refine, out.segments, s.b.refine);
  constexpr int kRounds = 2;
  for (int i = 0; i < kRounds && ExtendEnds(refine, out.segments, s.b.refine); ++i)
    RefineGrown(refine, out.segments, s.b.refine);
  JoinEnds(refine, out.segments, s.b.refine);
  DropShort(options.min_length_px, out.segments, s.b.refine);
}

LineImage DetectLines(const GreyView& image, const Intrinsics* lens, const LineOptions& options,
                      LineWorkspace* workspace) {
  LineImage out;
  LineWorkspace own;
  DetectLines(image, lens, options, workspace ? *workspace : own, out);
  return out;
}

}  // namespace vss
