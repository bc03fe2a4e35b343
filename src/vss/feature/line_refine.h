// From raw segments to their maximum-likelihood places and true ends.
#pragma once
#include <span>
#include <vector>

#include "vss/feature/line_image.h"
#include "vss/feature/segment_grid.h"
#include "vss/feature/strip_fit.h"

namespace vss {

struct RefineContext {
  const GreyView& image;
  const Intrinsics* lens;
  const NoiseMap& noise;
  Simd simd;
};

struct RefineBuffers {
  StripBuffers strip;
  std::vector<StripNeighbour> neighbours;
  std::vector<LineSegment> before;
  SegmentGrid grid;
  std::vector<char> sound;       // needs no second fit
  std::vector<float> coherence;  // of the fit's residuals
};

// Moves every segment to the place of maximum likelihood, with covariance, contrast and blur. A segment whose
// fit fails or would move it by more than a pixel keeps its place.
void RefinePlaces(const RefineContext& context, std::vector<LineSegment>& segments, RefineBuffers& buffers);

// Puts each end to where the edge ends: to the crossing with the line that it meets there, else to half its
// contrast.
void RefineEnds(const RefineContext& context, std::vector<LineSegment>& segments, RefineBuffers& buffers);

}  // namespace vss
