#include "vss/feature/segment_grid.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr int kCellPx = 32;

template <class Visit>
void ForCells(const SegmentGrid& grid, const LineSegment& s, double margin, const Visit& visit) {
  const double u0 = std::min(s.start.x(), s.end.x()) - margin, u1 = std::max(s.start.x(), s.end.x()) + margin;
  const double v0 = std::min(s.start.y(), s.end.y()) - margin, v1 = std::max(s.start.y(), s.end.y()) + margin;
  const Vector2d d = s.end - s.start;
  const double length = std::max(d.norm(), 1e-9), reach = margin + 0.75 * kCellPx;
  auto cell = [](double x, int n) { return std::clamp(static_cast<int>(x / kCellPx), 0, n - 1); };
  for (int y = cell(v0, grid.rows); y <= cell(v1, grid.rows); ++y)
    for (int x = cell(u0, grid.columns); x <= cell(u1, grid.columns); ++x) {
      const Vector2d centre((x + 0.5) * kCellPx, (y + 0.5) * kCellPx), e = centre - s.start;
      if (std::abs(d.x() * e.y() - d.y() * e.x()) / length <= reach) visit(std::size_t(y) * grid.columns + x);
    }
}

}  // namespace

void SegmentGrid::Build(const GreyView& image, const std::vector<LineSegment>& segments) {
  columns = image.width / kCellPx + 1, rows = image.height / kCellPx + 1;
  cell_start.assign(std::size_t(columns) * rows + 1, 0);
  for (const auto& s : segments) ForCells(*this, s, 0, [&](std::size_t c) { ++cell_start[c + 1]; });
  for (std::size_t c = 0; c + 1 < cell_start.size(); ++c) cell_start[c + 1] += cell_start[c];
  cell_items.resize(cell_start.back());
  for (std::size_t i = segments.size(); i-- > 0;)
    ForCells(*this, segments[i], 0,
             [&](std::size_t c) { cell_items[--cell_start[c + 1]] = static_cast<std::uint32_t>(i); });
  // Filling moved every start one to the left of where it stands.
  for (std::size_t c = 0; c + 1 < cell_start.size(); ++c) cell_start[c] = cell_start[c + 1];
  cell_start.back() = static_cast<std::uint32_t>(cell_items.size());
  seen.assign(segments.size(), 0);
  stamp = 0;
}

void SegmentGrid::FindNearby(const std::vector<LineSegment>& segments, std::size_t i, double margin_px) {
  nearby.clear();
  ++stamp;
  ForCells(*this, segments[i], margin_px, [&](std::size_t c) {
    for (auto k = cell_start[c]; k < cell_start[c + 1]; ++k) {
      const auto j = cell_items[k];
      if (j == i || seen[j] == stamp) continue;
      seen[j] = stamp;
      nearby.push_back(j);
    }
  });
  std::sort(nearby.begin(), nearby.end());
}

}  // namespace vss
