// Square markers of the public ArUco dictionaries (Garrido-Jurado et al. 2014).
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "vss/base/result.h"

namespace vss {

struct MarkerDictionary {
  int side = 0;  // bits a side, without the black border of one bit
  std::vector<std::uint64_t>
      bits;  // one marker each: row by row from the top left, first bit lowest; 1: white

  bool White(std::size_t id, int row, int column) const { return bits[id] >> (row * side + column) & 1; }
};

// "4x4_50" to "7x7_1000" (50, 100, 250, 1000) or "original".
Result<MarkerDictionary> PredefinedMarkers(const std::string& name);

}  // namespace vss
