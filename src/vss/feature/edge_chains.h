// Edge points joined to chains: each walks along one contour with the bright side to its left (as seen on the
// screen).
#pragma once
#include <cstdint>
#include <vector>

#include "vss/feature/edge_points.h"

namespace vss {

// Where edge points are: a bit a pixel, and for every 64 of them the index of the first point.
struct PointMap {
  struct Word {
    std::uint64_t free = 0, all = 0;  // points not yet on a chain; every point
    std::uint32_t first = 0;
  };
  std::size_t words = 0;  // of a row
  std::vector<Word> word;
};

// Bits that are set, without a processor's instruction for it, which not every one has.
inline std::uint32_t CountBits(std::uint64_t x) {
  x -= x >> 1 & 0x5555555555555555u;
  x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
  x = (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0Fu;
  return static_cast<std::uint32_t>(x * 0x0101010101010101u >> 56);
}

// Chain i is points[order[start[i]] .. order[start[i + 1]]).
struct EdgeChains {
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> start;
  PointMap map;
  std::vector<std::uint32_t> forward, backward;

  std::size_t size() const { return start.empty() ? 0 : start.size() - 1; }
};

// A contour's mean gradient over the sigma that noise and texture would give a mean over so many points.
double Significance(double mean_strength, double num_points, double texture);

// Chains of fewer than `min_points`, and those that could not reach `min_significance` were all their points
// as strong as the strongest, are dropped.
void JoinChains(const std::vector<EdgePoint>& points, int width, int height, const NoiseMap& noise,
                int min_points, double min_significance, EdgeChains& chains);

}  // namespace vss
