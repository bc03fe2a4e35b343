// What lies about a segment's strip: parallel edges, corners, all else that keeps pixels out of it.
#pragma once
#include "vss/feature/line_refine.h"

namespace vss {

inline constexpr double kStripReachPx = 5;  // of the strip on either side
inline constexpr double kStripMarginPx =
    2.5;                                    // an edge of usual blur has reached its levels at this distance
inline constexpr double kStripWidePx = 10;  // how far pixels tell the levels
inline constexpr double kNearPx = kStripWidePx + kStripMarginPx + 2;

struct Surroundings {
  int partner = -1;  // a parallel edge so near that both are fitted together
  StripEdge partner_edge{};
};

// How far (px) from an edge of that blur (lens and pixel) lines may lie that tell of nothing else: its maxima
// wander with the noise, and a second edge of the same polarity so near would not show.
double SameEdgePx(double blur_px);

// The neighbours of a segment with the frame `f`, its blur and contrast, among b.grid.nearby, into
// b.neighbours.
Surroundings Survey(const StripFrame& f, double blur_px, double contrast,
                    const std::vector<LineSegment>& segments, RefineBuffers& b);

// Corners of two regions at the ends of `s`: lines that it meets with the same
// levels on both sides.
struct Corners {
  StripCorner at[2];
  std::size_t count = 0;
  bool dark = false, at_start = false, at_end = false;
};

// Finds the corners of `s` among b.grid.nearby and takes their lines out of
// b.neighbours (`frame` is that of the neighbours).
Corners FindCorners(const Intrinsics* lens, const LineSegment& s, const std::vector<LineSegment>& all,
                    const StripFrame& frame, RefineBuffers& b);

}  // namespace vss
