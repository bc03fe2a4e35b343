// The lines of a part that a person need not click one by one.
#pragma once
#include <functional>
#include <vector>

#include "manual_fit.h"

namespace vss::station {

// The lines of all pictures that lie on the visible contour of the fitted object, no more than `tolerance_px`
// beside it: what a person would click next. `taken` keeps out lines that are picked already, and those of
// other parts; `lines_of` gives all lines of a picture.
std::vector<Pick> CollectPicks(const PlacedObject& object, const std::vector<View>& views,
                               const Occluders* others, double tolerance_px,
                               const std::function<bool(const Pick& line)>& taken,
                               const std::function<std::vector<Pick>(int image)>& lines_of);

}  // namespace vss::station
