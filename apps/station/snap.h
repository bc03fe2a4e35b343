// A line drawn by hand, moved onto the edge that it means.
#pragma once
#include "vss/feature/line_image.h"

namespace vss::station {

// `drawn`: start and end in img. Looks across the line, up to `reach_px` to both sides, for the strongest grey value
// step along its whole length, to a fraction of a pixel. Where there is none the line stays as drawn, with contrast 0
// and the uncertainty of a hand. The lens is taken into account: the line is straight in ideal coordinates.
LineSegment SnapToEdge(const GreyView& image, const Intrinsics& lens, const LineSegment& drawn, double reach_px = 5);

}  // namespace vss::station
