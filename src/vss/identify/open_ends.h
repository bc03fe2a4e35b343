// Parts whose ends no picture shows: a length of cable, or of what paint and shadows draw, taken for a bar.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"

namespace vss {

// What all pictures show of one or several edges of a solid.
struct EdgeShown {
  int num_views = 0;                     // that show them
  double open_px = 0, supported_px = 0;  // their length there that no other part claims; on which lines lie

  double Share() const { return open_px > 0 ? supported_px / open_px : 0; }
};

// Two upright plane faces that look away from each other, and the edges that run from one to the other.
struct OppositeEnds {
  EdgeShown ends[2], sides;
};
std::vector<OppositeEnds> FindOppositeEnds(const WorldSolid& solid, std::span<const EdgeShown> by_edge);

// Are there sides of which lines are found while both their ends, large enough to be found in several
// pictures, are not? `by_edge`: of the solid's edges.
bool LacksBothEnds(const WorldSolid& solid, std::span<const EdgeShown> by_edge);

}  // namespace vss
