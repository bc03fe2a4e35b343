// How far two bodies are apart.
#pragma once
#include <Eigen/Core>
#include <array>
#include <span>

namespace vss {

using Triangle3 = std::array<Eigen::Vector3d, 3>;

// The least distance between two sets of triangles, 0 where they meet; `beyond_mm` or more where it is not
// less than that (which saves time). Source: Ericson, Real-Time Collision Detection, 2005, 5.1.5 and 5.1.9.
double DistanceOf(std::span<const Triangle3> a, std::span<const Triangle3> b, double beyond_mm);

}  // namespace vss
