// A plane polygon with holes as triangles.
#pragma once
#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

namespace vss {

using Loop2d = std::vector<Eigen::Vector2d>;

// Twice the signed area: positive for a counter-clockwise loop.
double SignedDoubleArea(std::span<const Eigen::Vector2d> loop);

// `loops[0]` is the outline, counter-clockwise, the others are holes, clockwise, disjoint and inside it. The
// answer's triangles are counter-clockwise; their indices count the points of all loops in their order. Ear
// clipping after the holes were joined to the outline by bridges (Eberly, Triangulation by Ear Clipping,
// 2002). For an outline that crosses itself the triangles are of no use, but there are some.
std::vector<std::array<int, 3>> Triangulate(std::span<const Loop2d> loops);

}  // namespace vss
