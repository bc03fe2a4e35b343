// Where a camera may hang, from the straight edges of its cube pictures: every four-sided figure of lines
// that could be a face of the cube is taken for each of its faces, and judged by the lines of all pictures.
#pragma once
#include "vss/calibrate/cube_geometry.h"

namespace vss::cube {

struct Start {
  RigidTransform cam_from_world;  // at gantry displacement zero
  double score = 0;               // share of the predicted edges that lines confirm, over all pictures
};

// Best first, no two alike.
std::vector<Start> FindStarts(const Intrinsics& lens, const Geometry& g,
                              const std::vector<CubePicture>& pictures, const Eigen::Matrix3d& axes);

}  // namespace vss::cube
