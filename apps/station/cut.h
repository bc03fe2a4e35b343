// A part cut across one of its dimensions: which ones can be cut, and what the two pieces are.
#pragma once
#include <string>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/product/product.h"

namespace vss::station {

// A dimension along which an object can be cut: the extent of its solid along one axis of the `part` frame.
struct CutAxis {
  std::size_t dimension = 0;  // its index
  int axis = 0;               // 0, 1, 2: x, y, z of `part`
};

// Those of an object at these dimensions: its length, and every other one along which it is the same all
// along but for holes. A box can be cut along all three, a beam along its length.
std::vector<CutAxis> CutAxesOf(const ObjectModel& model, const std::vector<double>& dimensions_mm);
// Their names, for the object as it usually is.
std::vector<std::string> CutDimensionsOf(const ObjectModel& model);

// Lowest and highest place (mm) of the solid along that axis of `part`.
struct Extent {
  double low_mm = 0, high_mm = 0;
};
Extent ExtentAlong(const Solid& solid, int axis);

// The piece of `whole` from `from` to `to` (shares of its extent along the cut, 0 to 1) as an object at its
// place. Holes stay where they are; a piece without the holes of its kind is the plain block of the knowledge
// base. Errors: the cut goes through a hole; the piece is no object of the knowledge base. The contract's
// longer side is its length.
Result<PlacedObject> PieceOf(const PlacedObject& whole, const CutAxis& cut, double from, double to,
                             const KnowledgeBase& knowledge);

// `object` made to reach over `extent` (mm, along the cut's axis of its `part` frame), the contract's longer
// side first.
PlacedObject Stretched(const PlacedObject& object, const CutAxis& cut, const Extent& extent,
                       const KnowledgeBase& knowledge);

}  // namespace vss::station
