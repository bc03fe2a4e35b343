// Measures the contours of all parts in one picture: each piece of visible contour is looked for in the grey
// values across it, and the pieces of one edge become one group of observations.
#pragma once
#include <span>
#include <vector>

#include "vss/reconstruct/adjustment.h"

namespace vss {

// What is measured and known of each picture while rounds go by.
struct PictureState {
  double blur_px = 0.7, blur_sigma_px = 0.3, noise = 0;
  double slope_sigma = kAnySlope;  // how light changes beside edges, of their contrast per px
};

// Before anything is measured: blur and noise of the view's line image, where it has one.
PictureState StateBefore(const View& view);

// What one picture gave.
struct Measured {
  std::vector<ObservationGroup> groups;
  std::vector<double> blurs, noises;
  std::vector<std::pair<double, double>> slopes;  // beside edges: value, sigma
  std::vector<double> short_support;      // of each part: px of short edges that are met less px that are not
  std::vector<ContourPiece> short_edges;  // those seen, whether or not they could be measured
};

struct MeasureOptions {
  double search_px = 3;        // how far from its predicted place an edge is looked for
  double piece_length_px = 8;  // for a blur of one pixel or less
  int only_part = -1;          // -1: all
  bool short_edges = true;     // those of a few pixels, too: only where they lie within a pixel
};

// `others[i]`: the solids that may hide part i.
Measured MeasureView(std::span<const WorldSolid> solids, std::span<const Occluders> others, const View& view,
                     int view_index, const GreyView& picture, const PictureState& state,
                     const MeasureOptions& options);

}  // namespace vss
