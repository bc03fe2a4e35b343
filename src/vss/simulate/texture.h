// Texture of surfaces: noise of all sizes between a grain and a blotch, the same everywhere and always.
#pragma once
#include <Eigen/Core>

namespace vss {

// Zero in the mean, standard deviation 1, at place (u, v) in units of the finest grain; repeats after 256 of
// them.
double TextureNoise(double u, double v);

// 1 where the surface is as its material says, less in the grain's dark spots and in patches. `place`: mm.
double TextureFactor(const Eigen::Vector2d& place_mm, double grain, double patches);

}  // namespace vss
