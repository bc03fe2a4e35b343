// Parts whose ends no picture shows: a length of cable, or of what paint and shadows draw, taken for a bar.
#pragma once
#include <span>

#include "vss/identify/placed_object.h"

namespace vss {

// What all pictures show of one or several edges of a solid.
struct EdgeShown {
  int num_views = 0;                     // that show them
  double open_px = 0, supported_px = 0;  // their length there that no other part claims; on which lines lie

  double Share() const { return open_px > 0 ? supported_px / open_px : 0; }
};

// How many of two opposite ends, large enough to be found in several pictures, are not found though lines are
// on the sides between them: of those two that lack most, 0 to 2. `by_edge`: of the solid's edges. Of what
// is higher than cables are thick always 0: flanges and brackets hide and shade the ends of stiffeners.
int MissingEnds(const WorldSolid& solid, std::span<const EdgeShown> by_edge);

}  // namespace vss
