// Maximum likelihood of an edge (or of two close ones) on the pixels about it.
//
// Model: grey = b(a) + sum_i c_i(a) Phi((t - o_i - k_i a) / s) with a along, t
// across the edge (px, bright side positive), levels linear in a, s the blur of
// lens and pixel. Gauss-Newton on everything; Gaussian noise makes that the
// maximum of likelihood, whose variance is the Cramer-Rao bound.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "vss/feature/edge_points.h"
#include "vss/image/grey_image.h"

namespace vss {

// The frame of a strip: a point has a = along . (p - middle), t = across . (p -
// middle) - sag(a); `across` points to the bright side. sag(a) is the bend that
// the lens gives a straight edge (px): the polynomial through kNodes points of
// it, in Newton's form; all zero without a lens.
struct StripFrame {
  static constexpr int kNodes = 6;

  Eigen::Vector2d middle = {0, 0}, along = {1, 0}, across = {0, -1};
  double from = 0, to = 0;  // of the edge, along
  double node[kNodes] = {}, difference[kNodes] = {};

  bool Bent() const { return node[0] != node[1]; }
  double Sag(double a) const {
    double y = difference[kNodes - 1];
    for (int i = kNodes - 1; i-- > 0;) y = y * (a - node[i]) + difference[i];
    return y;
  }
  double SagSlope(double a) const {
    double y = difference[kNodes - 1], slope = 0;
    for (int i = kNodes - 1; i-- > 0;)
      slope = slope * (a - node[i]) + y, y = y * (a - node[i]) + difference[i];
    return slope;
  }
};

// Another edge in the frame: pixels near it do not take part.
struct StripNeighbour {
  Eigen::Vector2d from = {0, 0}, to = {0, 0};  // (a, t)
};

// A line that the edge meets at a corner of its two regions, both with the same
// levels: behind it the edge is no more.
struct StripCorner {
  Eigen::Vector2d point = {0, 0}, bright = {0, 0};  // (img) on the line; unit vector towards its bright side
};

struct StripEdge {
  double offset = 0, slope = 0;                          // t = offset + slope a
  double contrast = 0;                                   // positive: bright where t is larger
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // of offset at a = 0 and slope
};

// Residuals of no more than so much of the noise leave nothing to explain; more is texture, or levels that
// are not constant.
inline constexpr double kExplainedShare = 1.15;

struct StripFit {
  bool ok = false;
  bool profiled = false;  // the buffers' profile is this fit's
  bool overexposed =
      false;  // the bright side is saturated; its level is not known to a fit that does not know the blur
  StripEdge edges[2];
  double blur_px = 0;         // lens and pixel: s of the model
  double residual_sigma = 0;  // grey levels
  double coherence = 0;       // what the residuals' means at equal t have over noise:
                              // about 20 where the model holds
  double rms_px = 0;          // of single columns' places about the line
  int num_columns = 0;
  double from = 0, to = 0;  // along, of the columns that took part
};

// What a fit left, by the distance from its line: sums of the residuals in bins
// of t.
struct StripProfile {
  static constexpr int kBins = 48;
  static constexpr double kBinPx = 0.5;

  double low = 0;                             // t of the first bin's beginning
  double offset = 0, contrast = 0, blur = 0;  // of the fit's first edge
  float sum[kBins] = {}, count[kBins] = {};
  double squares = 0,
         pixels = 0;  // sum of the squared residuals, and over how many pixels

  // The bins' sums squared over what noise as large as the residuals would
  // give: about the number of bins where the model holds.
  double Coherence() const;
};

// A neighbour, prepared.
struct StripObstacle {
  Eigen::Vector2d from, to;
  double along, across, length,
      reach;           // unit direction; half of what it spoils, along t
  double first, last;  // of a, where it matters
};

// Sums over the pixels beyond the strip on one side, where the edge's profile is flat: all that they tell is
// the level. `along` counts in px, in half lengths once they are prepared.
struct StripWing {
  double n = 0, along = 0, along2 = 0, grey = 0, grey_along = 0, grey2 = 0;
  bool saturated = false;
};

struct StripBuffers {
  static constexpr std::size_t kSpare = 64;  // floats beyond the last pixel that may be written

  std::vector<float> along, across, grey, weight, corner, residual,
      by_place;  // per pixel
  std::vector<std::uint32_t> column_start;
  std::vector<float> column_place, column_along, sorted;
  std::vector<StripObstacle> obstacles;
  StripWing wing[2];     // of the darker side (t < 0), and of the other
  StripProfile profile;  // of the last fit

  void Grow(std::size_t size) {
    for (auto* v : {&along, &across, &grey, &weight, &corner, &residual, &by_place}) v->resize(size);
  }
};

struct StripSettings {
  double reach_px = 4;       // how far pixels are taken on either side
  double wide_px = 4;        // how far those that only tell levels
  double margin_px = 2.5;    // distance to neighbours, and from the ends
  double noise_sigma = 1;    // grey levels
  double start_blur_px = 1;  // lens and pixel
  double blur_sigma_px = 0;  // how well that is known beforehand; 0: not at all
  int column_step = 1;       // every so many columns take part
  // Corners at the ends, all of them bright inside (convex for the bright side)
  // or all dark inside.
  std::span<const StripCorner> corners = {};
  bool dark_corners = false;
};

// `start`: one edge, or two (in order of t). Pixels come from the frame's
// [from, to].
StripFit FitStrip(const GreyView& image, const StripFrame& frame, std::span<const StripEdge> start,
                  std::span<const StripNeighbour> neighbours, const StripSettings& settings, Simd simd,
                  StripBuffers& buffers);

}  // namespace vss
