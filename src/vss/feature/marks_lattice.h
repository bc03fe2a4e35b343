// From points and their neighbours to rows and columns.
#pragma once
#include <Eigen/Core>
#include <vector>

namespace vss {

struct LatticeLabel {
  int point = 0;  // index into the points
  int column = 0, row = 0;
};

// Labels the largest connected part of the graph `neighbours` (indices, symmetric or not) so that neighbours
// differ by one in one coordinate. Right-handed: columns to rows turns as u to v. A point whose label
// contradicts is left out.
std::vector<LatticeLabel> LabelLattice(const std::vector<Eigen::Vector2d>& points,
                                       const std::vector<std::vector<int>>& neighbours);

}  // namespace vss
