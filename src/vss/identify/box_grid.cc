#include "vss/identify/box_grid.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

// A box of more cells is compared with directly: cheaper than entering it everywhere.
constexpr double kMostCells = 400;
// Beyond so many cells from the origin all is one cell: rows must not run over.
constexpr double kFarthest = 1e6;

std::int64_t Key(std::int64_t x, std::int64_t y) { return (x << 32) + y; }

}  // namespace

BoxGrid::Cells BoxGrid::CellsOf(const Eigen::AlignedBox2d& box) const {
  const auto at = [&](double x) {
    return std::int64_t(std::floor(std::clamp(x / cell_, -kFarthest, kFarthest)));
  };
  return {at(box.min().x()), at(box.max().x()), at(box.min().y()), at(box.max().y())};
}

void BoxGrid::Add(const Eigen::AlignedBox2d& box) {
  const int number = size();
  boxes_.push_back(box);
  if (box.isEmpty()) return;
  const Cells cells = CellsOf(box);
  if (cells.Count() > kMostCells) {
    large_.push_back(number);
    return;
  }
  for (auto x = cells.from_x; x <= cells.to_x; ++x)
    for (auto y = cells.from_y; y <= cells.to_y; ++y) cells_[Key(x, y)].push_back(number);
}

void BoxGrid::Find(const Eigen::AlignedBox2d& box, std::vector<int>& out) const {
  out.clear();
  const Cells cells = CellsOf(box);
  const auto consider = [&](int i) {
    if (boxes_[std::size_t(i)].intersects(box)) out.push_back(i);
  };
  if (cells.Count() > double(cells_.size())) {
    for (int i = 0; i < size(); ++i)
      if (!boxes_[std::size_t(i)].isEmpty()) consider(i);
    return;
  }
  for (const int i : large_) consider(i);
  for (auto x = cells.from_x; x <= cells.to_x; ++x)
    for (auto y = cells.from_y; y <= cells.to_y; ++y)
      if (const auto it = cells_.find(Key(x, y)); it != cells_.end())
        for (const int i : it->second) consider(i);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

}  // namespace vss
