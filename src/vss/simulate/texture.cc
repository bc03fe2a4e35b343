#include "vss/simulate/texture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vss/simulate/random.h"

namespace vss {
namespace {

constexpr int kSize = 256;

// Value noise: random values on lattices of 8 to 128 cells, smoothly interpolated, each finer lattice weaker.
std::vector<float> MakeTile() {
  constexpr double kWeaker = 0.65;
  std::vector<double> tile(kSize * kSize, 0.0);
  double amplitude = 1;
  Random random(20);
  for (int cells = 8; cells <= kSize / 2; cells *= 2, amplitude *= kWeaker) {
    std::vector<double> lattice(std::size_t(cells) * std::size_t(cells));
    for (double& value : lattice) value = random.Normal();
    const auto at = [&](int i, int j) { return lattice[std::size_t((j % cells) * cells + i % cells)]; };
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        const double u = double(x) * cells / kSize, v = double(y) * cells / kSize;
        const int i = int(u), j = int(v);
        const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
        const double s = smooth(u - i), t = smooth(v - j);
        tile[std::size_t(y * kSize + x)] += amplitude * ((1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) +
                                                         t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1)));
      }
  }
  double mean = 0, square = 0;
  for (const double value : tile) mean += value, square += value * value;
  mean /= double(tile.size());
  const double sigma = std::sqrt(square / double(tile.size()) - mean * mean);
  std::vector<float> out;
  out.reserve(tile.size());
  for (const double value : tile) out.push_back(float((value - mean) / sigma));
  return out;
}

}  // namespace

double TextureNoise(double u, double v) {
  static const std::vector<float> tile = MakeTile();
  const double fu = std::floor(u), fv = std::floor(v);
  const auto i = std::size_t(std::int64_t(fu) & (kSize - 1)), j = std::size_t(std::int64_t(fv) & (kSize - 1));
  const std::size_t i1 = (i + 1) & (kSize - 1), j1 = (j + 1) & (kSize - 1);
  const double s = u - fu, t = v - fv;
  return (1 - t) * ((1 - s) * tile[j * kSize + i] + s * tile[j * kSize + i1]) +
         t * ((1 - s) * tile[j1 * kSize + i] + s * tile[j1 * kSize + i1]);
}

double TextureFactor(const Eigen::Vector2d& place_mm, double grain, double patches) {
  constexpr double kGrainMm = 5, kPatchMm = 13;  // the finest of either
  constexpr double kPatchFrom = 0.5,
                   kPatchTo = 1.1;  // where the noise is above, a patch begins; a fifth of the surface
  double factor = 1;
  if (grain > 0) factor += grain * TextureNoise(place_mm.x() / kGrainMm, place_mm.y() / kGrainMm);
  if (patches > 0) {
    const double noise = TextureNoise(place_mm.y() / kPatchMm + 77.7, place_mm.x() / kPatchMm + 33.3);
    const double t = std::clamp((noise - kPatchFrom) / (kPatchTo - kPatchFrom), 0.0, 1.0);
    factor *= 1 - patches * t * t * (3 - 2 * t);
  }
  return std::max(factor, 0.05);  // no surface is black
}

}  // namespace vss
