// Pictures of a warm workpiece, as if they showed it at 20 degrees.
#pragma once
#include <span>
#include <vector>

#include "part_json.h"
#include "vss/identify/view.h"

namespace vss::station {

// The middle about which a run reduced its parts: of all vertices and circles, on the ground. The reduction
// leaves it where it is, so that the reduced parts tell it.
Eigen::Vector3d MiddleOfReduction(std::span<const Part> parts);

// The cameras drawn towards that middle as the parts were: a reduced part lies on its lines, and what is
// fitted or measured in the pictures is at 20 degrees like the rest of the product. `run`: "settings", "run";
// nothing happens where it reduced nothing.
void ReduceViews(const Json& run, std::vector<View>& views);

}  // namespace vss::station
