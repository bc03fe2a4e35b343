// What the steps of DetectLines share.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "vss/feature/edge_chains.h"
#include "vss/feature/edge_points.h"
#include "vss/feature/line_image.h"
#include "vss/feature/line_refine.h"
#include "vss/feature/straight_pieces.h"
#include "vss/feature/strip_sums.h"
#include "vss/feature/undistortion_grid.h"

namespace vss {

// A straight piece on its way to a segment.
struct PieceState {
  StraightPiece piece;
  double contrast = 0, strength = 0;  // means of its points
  bool alive = true;                  // not yet part of another

  Eigen::Vector2d Start() const { return piece.line.point + piece.from * piece.line.direction; }
  Eigen::Vector2d End() const { return piece.line.point + piece.to * piece.line.direction; }
  double Length() const { return piece.to - piece.from; }
};

// The pixels about an arc in lots of kStripLanes, as AccumulateArc takes them, and the sector of the contour
// that each belongs to; those that take no part have no weight.
struct ArcBuffers {
  std::vector<float> t, by[5], bend, u, v, grey, weight, residual, by_place, sorted;
  std::vector<std::uint8_t> sector;
  std::size_t size = 0, count = 0;  // pixels in all lots; of those that take part

  void Clear() { size = count = 0; }
  // Room for one more lot.
  void Grow() {
    if (size + kStripLanes <= t.size()) return;
    for (auto* x :
         {&t, &by[0], &by[1], &by[2], &by[3], &by[4], &bend, &u, &v, &grey, &weight, &residual, &by_place})
      x->resize(2 * size + 1024);
    sector.resize(2 * size + 1024);
  }
};

struct LineWorkspace::Buffers {
  EdgeBuffers edges;
  NoiseMap noise;
  std::vector<EdgePoint> points;
  EdgeChains chains;
  UndistortionGrid grid;
  std::vector<Eigen::Vector2d> positions;  // ideal, of the chains' points in order
  std::vector<float> contrast;             // grey levels, of the same
  std::vector<float> tolerance;            // px, of the same
  std::vector<StraightPiece> pieces;
  std::vector<char> in_arc;  // per piece
  std::vector<Eigen::Vector2d> arc_points, arc_ideal;
  ArcBuffers arc_fit;
  std::vector<char> arc_covered;
  std::size_t num_sure_arcs =
      0;  // of those that were found; the others have to show that they explain the pixels
  std::vector<PieceState> states;
  std::vector<std::int32_t> cell_first, cell_next;
  RefineBuffers refine;
};

struct Scene {
  const GreyView& image;
  const Intrinsics* lens;
  const LineOptions& options;
  LineWorkspace::Buffers& b;

  Eigen::Vector2d Img(const Eigen::Vector2d& ideal) const {
    if (!lens) return ideal;
    return lens->ImgFromNormalized(lens->NormalizedFromIdeal(ideal)).value_or(ideal);
  }
  const EdgePoint& PointAt(std::uint32_t place) const { return b.points[b.chains.order[place]]; }
};

// A parabola's place is no better than this, and the filter makes the noise of so many neighbours on a
// contour one.
inline constexpr double kMinPlaceSigmaPx = 0.03, kNeighbourCorrelation = 3.5;

// Grey levels between the two sides: the profile is taken for a Gaussian edge seen through the filter.
inline float ContrastOf(const EdgePoint& p) {
  constexpr float kTwoPi = 6.2831853f;
  const float variance = std::clamp(ProfileVariance(p), static_cast<float>(kGradientVariance), 25.0f);
  return p.strength / static_cast<float>(kGradientGain) * std::sqrt(kTwoPi * variance);
}

// Elliptical arcs are runs of pieces that keep turning; the pieces that make one are marked in b.in_arc.
void FindArcs(const Scene& scene, LineImage& out);

// Moves every arc to its place of maximum likelihood, with covariance; one whose fit fails keeps its place.
void RefineArcs(const Scene& scene, std::vector<EllipticalArc>& arcs);

// b.states from the pieces that are worth it, joined where they are one line.
void JoinPieces(const Scene& scene);

}  // namespace vss
