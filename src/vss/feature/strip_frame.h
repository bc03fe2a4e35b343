// The frame of a segment's strip, and the lens between the picture and straight lines.
#pragma once
#include "vss/camera/lens.h"
#include "vss/feature/line_image.h"
#include "vss/feature/strip_fit.h"

namespace vss {

// A place as taken (img) of one without distortion (ideal), and back; the place itself where no lens is known
// or no direction has it.
Eigen::Vector2d ImgOf(const Intrinsics* lens, const Eigen::Vector2d& ideal);
Eigen::Vector2d IdealOf(const Intrinsics* lens, const Eigen::Vector2d& img);

StripFrame FrameOf(const Intrinsics* lens, const LineSegment& segment);

// (a, t) of a place (img).
Eigen::Vector2d InFrame(const StripFrame& frame, const Eigen::Vector2d& img);

}  // namespace vss
