#include "vss/feature/tile_quantiles.h"

#include <array>
#include <cstring>

namespace vss {
namespace {

using Lanes = float __attribute__((vector_size(TileValues::kLanes * sizeof(float))));
constexpr int kRanked = TileValues::kRanked;

struct Exchange {
  int low, high;
};

// Batcher's odd-even merge sort.
constexpr int kExchanges = 63;
constexpr std::array<Exchange, kExchanges> SortingNetwork() {
  std::array<Exchange, kExchanges> network{};
  int n = 0;
  for (int p = 1; p < kRanked; p *= 2)
    for (int k = p; k >= 1; k /= 2)
      for (int j = k % p; j + k < kRanked; j += 2 * k)
        for (int i = 0; i < k && i + j + k < kRanked; ++i)
          if ((i + j) / (2 * p) == (i + j + k) / (2 * p)) network[n++] = {i + j, i + j + k};
  return network;
}
constexpr auto kNetwork = SortingNetwork();
static_assert(kNetwork.back().high > 0);

}  // namespace

void TileValues::Clear(int num_tiles) {
  tiles = num_tiles, stride = (num_tiles + kLanes - 1) / kLanes * kLanes;
  values.assign(static_cast<std::size_t>(stride) * kRanked, kNoValue);
}

void TileQuantiles(const TileValues& in, double share, std::vector<float>& out) {
  out.resize(static_cast<std::size_t>(in.tiles));
  for (int first = 0; first < in.tiles; first += TileValues::kLanes) {
    Lanes v[kRanked];
    for (int k = 0; k < kRanked; ++k)
      std::memcpy(&v[k], &in.values[static_cast<std::size_t>(k) * in.stride + first], sizeof v[k]);
    for (const auto& [low, high] : kNetwork) {
      const Lanes a = v[low], b = v[high];
      v[low] = a < b ? a : b;
      v[high] = a < b ? b : a;
    }
    for (int lane = 0; lane < TileValues::kLanes && first + lane < in.tiles; ++lane) {
      int n = 0;
      for (const auto& row : v) n += row[lane] < TileValues::kNoValue;
      out[static_cast<std::size_t>(first + lane)] =
          n == 0 ? TileValues::kNoValue : v[static_cast<int>(share * n)][lane];
    }
  }
}

}  // namespace vss
