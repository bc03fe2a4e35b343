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
  double blur_px = 0;        // of lens and pixel, as most segments have it; 0: not known
  std::vector<char> moved;   // since the ends were looked for; or its ends since it was fitted
  std::vector<char> fitted;  // stands where a fit has put it
  std::vector<char> kept;
  std::vector<int> place;
  std::vector<LineSegment> hidden;  // edges that only the fit of one beside them has seen
  std::vector<float> coherence;     // of the fit's residuals
};

// Moves every segment to the place of maximum likelihood, with covariance, contrast and blur. A segment whose
// fit fails or would move it by more than a pixel keeps its place.
void RefinePlaces(const RefineContext& context, std::vector<LineSegment>& segments, RefineBuffers& buffers);

// Lets the free ends of segments that b.moved go on as far as the picture shows their edge, and drops
// segments that repeat longer ones. Whether any grew so much that its place is worth another fit: those are
// now b.moved.
bool ExtendEnds(const RefineContext& context, std::vector<LineSegment>& segments, RefineBuffers& buffers);

// Fits those again whose ends b.moved; the fit counts where it explains the pixels down to the noise, and
// only those are b.moved then.
void RefineGrown(const RefineContext& context, std::vector<LineSegment>& segments, RefineBuffers& buffers);

// Puts each end to the crossing with the line that it meets there, if there is one.
void JoinEnds(const RefineContext& context, std::vector<LineSegment>& segments, RefineBuffers& buffers);

// Drops segments shorter than that, but those that a junction has cut, which are as long as their edge. The
// junctions of the others follow.
void DropShort(double min_length_px, std::vector<LineSegment>& segments, RefineBuffers& buffers);

}  // namespace vss
