// Segments by the cells of the picture that they cross, for neighbourhood queries.
#pragma once
#include <cstdint>
#include <vector>

#include "vss/feature/line_image.h"

namespace vss {

struct SegmentGrid {
  int columns = 0, rows = 0;
  std::vector<std::uint32_t> cell_start, cell_items, seen;
  std::uint32_t stamp = 0;
  std::vector<std::uint32_t> nearby;  // of the last query, ascending

  void Build(const GreyView& image, const std::vector<LineSegment>& segments);

  // Fills `nearby` with the other segments whose cells lie within `margin_px` of segment `i`.
  void FindNearby(const std::vector<LineSegment>& segments, std::size_t i, double margin_px);
};

}  // namespace vss
