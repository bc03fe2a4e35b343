// The middle of some numbers.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

namespace vss {

// The upper of the two middle ones where their number is even; `otherwise` where there are none.
inline double Median(std::vector<double> values, double otherwise = 0) {
  if (values.empty()) return otherwise;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace vss
