#include "vss/simulate/pixel_rays.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "vss/base/parallel.h"

namespace vss {

Result<PixelRays> PixelRays::Make(const Camera& camera, int threads) {
  PixelRays rays;
  rays.width_ = camera.width_px + 2 * kMargin;
  rays.height_ = camera.height_px + 2 * kMargin;
  rays.pixels_.resize(std::size_t(rays.width_) * std::size_t(rays.height_));
  std::atomic<int> bad = -1;
  ParallelFor(std::size_t(rays.height_), threads, [&](std::size_t v) {
    for (int u = 0; u < rays.width_; ++u) {
      Eigen::Matrix2d jacobian;
      const auto n =
          camera.intrinsics.NormalizedFromImg({double(u - kMargin), double(int(v) - kMargin)}, &jacobian);
      if (!n) {
        bad = int(v) * rays.width_ + u;
        return;
      }
      rays.pixels_[v * std::size_t(rays.width_) + std::size_t(u)] = {
          float(n->x()),         float(n->y()),         float(jacobian(0, 0)),
          float(jacobian(0, 1)), float(jacobian(1, 0)), float(jacobian(1, 1))};
    }
  });
  if (bad >= 0)
    return InputError("camera {}: its lens has no direction for pixel ({}, {}); check the distortion",
                      camera.id, bad % rays.width_ - kMargin, bad / rays.width_ - kMargin);
  // Half a pixel's diagonal, a hundredth more for the lens's bend and rounding.
  constexpr float kHalfPixel = 0.505F;
  std::vector<Block>& leaves = rays.blocks_.emplace_back();
  leaves.reserve(rays.pixels_.size());
  for (const Pixel& p : rays.pixels_)
    leaves.push_back(
        {p.x, p.y,
         kHalfPixel * std::max(std::hypot(p.xu + p.xv, p.yu + p.yv), std::hypot(p.xu - p.xv, p.yu - p.yv))});
  for (int level = 1; rays.BlocksAcross(level - 1) > 1 || rays.BlocksDown(level - 1) > 1; ++level) {
    std::vector<Block> blocks;
    const int across = rays.BlocksAcross(level - 1), down = rays.BlocksDown(level - 1);
    for (int j = 0; j < rays.BlocksDown(level); ++j)
      for (int i = 0; i < rays.BlocksAcross(level); ++i) {
        Block block{0, 0, 0};
        int count = 0;
        const auto each = [&](auto&& use) {
          for (int y = 2 * j; y < std::min(2 * j + 2, down); ++y)
            for (int x = 2 * i; x < std::min(2 * i + 2, across); ++x) use(rays.BlockAt(level - 1, x, y));
        };
        each([&](const Block& b) { block.x += b.x, block.y += b.y, ++count; });
        block.x /= float(count), block.y /= float(count);
        constexpr float kRounding = 1.0001F;
        each([&](const Block& b) {
          block.radius =
              std::max(block.radius, kRounding * (std::hypot(b.x - block.x, b.y - block.y) + b.radius));
        });
        blocks.push_back(block);
      }
    rays.blocks_.push_back(std::move(blocks));
  }
  return rays;
}

}  // namespace vss
