// Boxes in a plane, to be found by place: what is asked of a yard then costs no more the longer it is.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace vss {

class BoxGrid {
 public:
  explicit BoxGrid(double cell = 1) : cell_(cell) {}

  // Boxes are numbered in the order in which they are added, from 0.
  void Add(const Eigen::AlignedBox2d& box);
  int size() const { return int(boxes_.size()); }
  // The numbers of the boxes that meet `box`, ascending.
  void Find(const Eigen::AlignedBox2d& box, std::vector<int>& out) const;

 private:
  struct Cells {
    std::int64_t from_x, to_x, from_y, to_y;
    double Count() const { return double(to_x - from_x + 1) * double(to_y - from_y + 1); }
  };
  Cells CellsOf(const Eigen::AlignedBox2d& box) const;

  double cell_;
  std::vector<Eigen::AlignedBox2d> boxes_;
  std::unordered_map<std::int64_t, std::vector<int>> cells_;
  std::vector<int> large_;  // boxes of too many cells, always looked at
};

}  // namespace vss
