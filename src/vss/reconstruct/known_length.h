// A dimension of a part that is known from elsewhere, and with it the scale of the whole.
#pragma once

namespace vss {

struct KnownLength {
  int part = 0, dimension = 0;  // indices
  double value_mm = 0, sigma_mm = 0.1;
};

}  // namespace vss
