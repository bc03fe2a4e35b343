// Cameras that stand elsewhere than was said.
#pragma once
#include <vector>

#include "vss/reconstruct/adjustment.h"

namespace vss {

// The camera that least fits its prior is let go, before the priors' scale takes its move for ordinary,
// unless the others fit theirs no better than it does; then the others are looked at again. Returns how
// significant each camera's correction is: its chi-square per degree of freedom against its prior, 0 where
// cameras are not adjusted.
std::vector<double> ReleaseMovedCameras(Adjustment& a);

}  // namespace vss
