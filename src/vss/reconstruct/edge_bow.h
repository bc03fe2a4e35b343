// Whether an edge is straight: how far its middle lies off the line through its ends, from the measurements
// of all pictures together.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "vss/reconstruct/adjustment.h"

namespace vss {

// The edge as measured is its straight line plus 4 t (1 - t) bow_mm, t from 0 at its start to 1 at its end.
struct EdgeBow {
  int part = 0, edge = 0;
  Eigen::Vector3d bow_mm = Eigen::Vector3d::Zero();      // world, across the edge
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of it, mm^2
  double chi_square = 0;                                 // of no bow, two degrees of freedom
  int num_views = 0;
};

// Edges that at least two pictures measured over a good part of their length. To be called after Solve.
std::vector<EdgeBow> EdgeBows(const Adjustment& adjustment);

}  // namespace vss
