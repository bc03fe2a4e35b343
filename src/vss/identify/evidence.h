// What speaks for an identification, and what is left over.
#pragma once
#include <Eigen/Core>
#include <string>

namespace vss {

// Which line of which picture was taken for which contour edge of the part: indices into the picture's line
// image and into the solid's edges (or arcs and circles where `is_arc`).
struct ContourMatch {
  int image = 0, line = 0, edge = 0;
  bool is_arc = false;
  double residual_px = 0;
};

// The kind that would have explained the lines second best.
struct RunnerUp {
  std::string kind;
  double log_odds = 0;
};

// Lines that look like an object which no knowledge base describes.
struct UnknownGroup {
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), extent = Eigen::Vector3d::Zero();  // world, mm
  int num_lines = 0;
};

}  // namespace vss
