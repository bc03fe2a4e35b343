// Which of some views see an object.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/view.h"

namespace vss {

// Of `views` those among `near` (ascending) that see the object, those that show it largest first, at most
// `most`; ascending.
std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, std::span<const int> near,
                              int most);

}  // namespace vss
