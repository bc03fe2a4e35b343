// Edge points joined to chains: each walks along one contour with the bright side to its left (as seen on the
// screen).
#pragma once
#include <cstdint>
#include <vector>

#include "vss/feature/edge_points.h"

namespace vss {

// Chain i is points[order[start[i]] .. order[start[i + 1]]).
struct EdgeChains {
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> start;
  std::vector<std::uint16_t> cell;  // 1 + index within the row of the point at a pixel, 0 where there is none
  std::vector<std::uint32_t> forward, backward;

  std::size_t size() const { return start.empty() ? 0 : start.size() - 1; }
};

// Chains of fewer than `min_points` are dropped.
void JoinChains(const std::vector<EdgePoint>& points, const std::vector<std::uint32_t>& row_start, int width,
                int height, int min_points, EdgeChains& chains);

}  // namespace vss
