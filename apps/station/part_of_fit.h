// What a product says of a part that was fitted by hand.
#pragma once
#include "manual_fit.h"

namespace vss::station {

// The part with everything that a product says of it, `source` and id excepted.
Part PartOfFit(const FitAnswer& answer, const FitQuestion& question);

}  // namespace vss::station
