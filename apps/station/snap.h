// A line or an arc drawn by hand, moved onto the edge that it means.
#pragma once
#include <array>

#include "vss/feature/line_image.h"
#include "vss/identify/view.h"

namespace vss::station {

// `drawn`: start and end in img. Looks across the line, up to `reach_px` to both sides, for the strongest
// grey value step along its whole length, to a fraction of a pixel. Where there is none the line stays as
// drawn, with contrast 0 and the uncertainty of a hand. The lens is taken into account: the line is straight
// in ideal coordinates.
LineSegment SnapToEdge(const GreyView& image, const Intrinsics& lens, const LineSegment& drawn,
                       double reach_px = 5);

// The rim on which the three clicked points (img, in their order) lie: the ellipse as which a horizontal
// circle of the world through them is seen, moved onto the grey values' edge and followed beyond the first
// and the last as far as the edge goes. Where there is no edge it stays as drawn, with contrast 0 and the
// uncertainty of a hand. An error where the points lie on a straight line.
Result<EllipticalArc> SnapToRim(const GreyView& image, const View& view,
                                const std::array<Eigen::Vector2d, 3>& clicked);

// The `ideal_*` values of an arc of which those of the picture are known; false where they describe no
// ellipse.
bool StraightenArc(const Intrinsics& lens, EllipticalArc& arc);

}  // namespace vss::station
