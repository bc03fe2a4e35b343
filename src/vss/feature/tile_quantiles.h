// Quantiles of the tiles of a picture, many tiles at once.
#pragma once
#include <limits>
#include <vector>

namespace vss {

// Up to kRanked values a tile: those of rank k stand at values[k * stride + tile]; kNoValue where there is
// none.
struct TileValues {
  static constexpr int kRanked = 16, kLanes = 8;
  static constexpr float kNoValue = std::numeric_limits<float>::max();

  std::vector<float> values;
  int tiles = 0, stride = 0;  // stride: tiles in whole lanes

  void Clear(int num_tiles);
  float& At(int k, int tile) { return values[static_cast<std::size_t>(k) * stride + tile]; }
};

// out[tile]: of the tile's n values that with int(share * n) below it; TileValues::kNoValue of none.
void TileQuantiles(const TileValues& in, double share, std::vector<float>& out);

}  // namespace vss
