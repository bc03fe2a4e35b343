// Calibration targets to print, true to scale.
#pragma once
#include <string>

#include "vss/feature/marks.h"

namespace vss {

// The page is the board with a margin of one pitch: print it at 100 %. An error where the target cannot be
// drawn.
Result<std::string> TargetToSvg(const TargetSpec& target);
Result<std::string> TargetToPdf(const TargetSpec& target);

}  // namespace vss
