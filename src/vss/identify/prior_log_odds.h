// What an object must overcome before any line is looked at.
#pragma once
#include "vss/identify/placed_object.h"

namespace vss {

// Natural logarithm of the odds: every dimension pays for itself, more so one too small to be seen in the
// pictures, and a resting pose that is not the first.
double PriorLogOdds(const PlacedObject& object, double mm_per_px);

}  // namespace vss
