// Low parts beside their own shadow.
//
// A plate a few pixels high hides, or is beside, a band of shadow of a pixel or two that is about as dark as
// it is: its outline is found at the shadow's border, outside its true place, in all pictures, so that it
// seems larger, and lower, than it is.
#pragma once
#include <optional>

#include "vss/identify/hypothesis.h"

namespace vss {

// The hypothesis higher and with its outline farther in, where that explains more of the pictures than any
// such change that is a little smaller or larger; empty where it stands too high for that, or nothing is
// gained.
std::optional<Hypothesis> OutOfItsShadow(const Hypothesis& hypothesis, const SeedContext& context);

}  // namespace vss
