// Horizontal circles of the world, each found as arcs of several pictures.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/identify/world_line.h"

namespace vss {

// A horizontal circle.
struct WorldCircle {
  Eigen::Vector3d center;
  double radius_mm = 0;
  std::vector<LineRef> arcs;
  int num_views = 0;
};

std::vector<WorldCircle> FindWorldCircles(std::span<const View> views, const WorldLineOptions& options);

// What one picture alone may show at one height: its arcs, on the horizontal plane `z_mm` (world).
std::vector<WorldCircle> LevelCircles(const View& view, double z_mm, double tolerance_px);

}  // namespace vss
