// How much of a step the grey values show along a short piece of a predicted contour, whether or not a line
// was found there.
#pragma once
#include <Eigen/Core>
#include <optional>

#include "vss/image/grey_image.h"

namespace vss {

// The strongest step within `reach_px` of the piece.
struct EdgeResponse {
  double step = 0;       // grey values: plus side (along the normal) less minus side
  double offset_px = 0;  // along the normal
  double bright = 0;     // grey values: the mean of the brighter side
};

// `middle` (px, img) of a straight piece of `length_px` along the unit vector `tangent`; the normal is the
// tangent turned by +90 degrees (u towards v). The grey values are averaged along the piece; a step is the
// difference of the means of 1.5 px on either side. Empty where the strip leaves the picture.
std::optional<EdgeResponse> RespondToEdge(const GreyView& picture, const Eigen::Vector2d& middle,
                                          const Eigen::Vector2d& tangent, double length_px, double reach_px);

// What |step| usually is where nothing is predicted: the median over many places and directions of the
// picture. Never 0.
double TypicalResponse(const GreyView& picture, double length_px, double reach_px);

}  // namespace vss
