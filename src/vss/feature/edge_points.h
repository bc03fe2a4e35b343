// Sub-pixel edge points of a picture, and the noise that decides which of them count.
//
// Gradient: 5x5, binomial (1 4 6 4 1) across, (-1 -2 0 2 1) along; an edge point is a maximum of its
// magnitude along the axis that is nearer to the gradient, put between the pixels by a parabola.
#pragma once
#include <cstdint>
#include <vector>

#include "vss/feature/tile_quantiles.h"
#include "vss/image/grey_image.h"

namespace vss {

// The filter's gain on a ramp of one grey level a pixel, its noise (a factor on the picture's sigma), and the
// variance (px^2) that it adds to an edge's profile.
inline constexpr double kGradientGain = 128.0;
inline constexpr double kGradientNoise = 26.457513110645906;  // sqrt(70 * 10)
inline constexpr double kGradientVariance = 0.875;            // mean of 1 (binomial) and 0.75 (derivative)

// `u`, `v`: px, img. `nu`, `nv`: unit vector towards the bright side. `strength`: length of the gradient,
// filter units. `profile_ratio`: of the gradients before and after it, their product over its own square; 0
// where they have not all the same sign.
struct EdgePoint {
  float u, v, nu, nv, strength, profile_ratio;
  std::uint32_t cell_u, cell_v;  // the pixel that it was found at
};

// Variance of the gradient's profile across the edge, px^2: of the Gaussian through the three gradients.
float ProfileVariance(const EdgePoint& point);

// Noise of a picture in tiles: sigma in grey levels, from the mean absolute response to the mask (1 -2 1)^T
// (1 -2 1), which is blind to straight edges along the axes and to shading (Immerkaer 1996), median over a
// tile's blocks, so that edges within a tile do not count, and median over the 3x3 tiles around.
struct NoiseMap {
  static constexpr int kTilePx = 32;
  int columns = 0, rows = 0;
  std::vector<float> sigma;
  std::vector<float> texture;  // sigma of a component of the gradient (filter units) where there are no
                               // edges: noise and texture, the low quantile of a tile's blocks
  float median_sigma = 0;

  std::size_t Tile(int u, int v) const { return std::size_t(v / kTilePx) * columns + u / kTilePx; }
  float At(int u, int v) const { return sigma[Tile(u, v)]; }
  float TextureAt(int u, int v) const { return texture[Tile(u, v)]; }
};

// Which instructions the row filters use; integer arithmetic, so the results are the same.
enum class Simd { kBest, kPortable, kAvx2, kAvx512 };

// What one picture's edge points need; kept by the caller, so that repeated calls allocate nothing.
struct EdgeBuffers {
  std::vector<std::int32_t> rows;  // filtered rows in flight
  std::vector<std::uint8_t> flags;
  std::vector<std::uint32_t> flagged;
  TileValues noise_blocks, texture_blocks;  // mean magnitudes, of a row of tiles
  TileValues around;
  std::vector<float> of_row;
  std::vector<float> raw_sigma, raw_texture;
  Simd simd = Simd::kBest;
};

// Fills `noise`. `min_sigma`: no tile is taken for quieter than that (quantisation, grey levels).
void EstimateNoise(const GreyView& image, float min_sigma, EdgeBuffers& buffers, NoiseMap& noise);

// The edge points in raster order; those below `threshold_sigmas` of the gradient's noise, or lost in the
// texture around them, are left out.
void FindEdgePoints(const GreyView& image, const NoiseMap& noise, double threshold_sigmas,
                    EdgeBuffers& buffers, std::vector<EdgePoint>& points);

}  // namespace vss
