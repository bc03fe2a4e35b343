// The rays of a camera's pixels, lens distortion undone, in blocks that halve down to the pixel.
#pragma once
#include <Eigen/Core>
#include <array>
#include <vector>

#include "vss/base/result.h"
#include "vss/camera/camera.h"

namespace vss {

// Directions are normalised coordinates (x, y) = (X/Z, Y/Z) in `cam`. Within a pixel the lens is taken to be
// linear: the bend left out is below 1e-5 px for any lens whose distortion changes by less than 1 % over 10
// px.
class PixelRays {
 public:
  static constexpr int kMargin = 4;  // px beyond the frame on every side, which the blur looks at

  // An error where the lens cannot be undone at a pixel.
  static Result<PixelRays> Make(const Camera& camera, int threads);

  int width() const { return width_; }    // with the margin
  int height() const { return height_; }  // with the margin

  struct Pixel {
    float x, y;            // of its centre
    float xu, xv, yu, yv;  // d (x, y) / d (u, v)
  };
  const Pixel& At(int u, int v) const {
    return pixels_[std::size_t(v) * std::size_t(width_) + std::size_t(u)];
  }

  // A block of 2^level x 2^level pixels and a circle around all its directions.
  struct Block {
    float x, y, radius;  // radius < 0: no pixel
  };
  int levels() const { return static_cast<int>(blocks_.size()); }
  int BlocksAcross(int level) const { return (width_ + (1 << level) - 1) >> level; }
  int BlocksDown(int level) const { return (height_ + (1 << level) - 1) >> level; }
  const Block& BlockAt(int level, int i, int j) const {
    return blocks_[std::size_t(level)][std::size_t(j) * std::size_t(BlocksAcross(level)) + std::size_t(i)];
  }

 private:
  int width_ = 0, height_ = 0;
  std::vector<Pixel> pixels_;
  std::vector<std::vector<Block>> blocks_;
};

}  // namespace vss
