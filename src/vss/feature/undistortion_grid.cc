#include "vss/feature/undistortion_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vss {
namespace {

bool Same(const Intrinsics& a, const Intrinsics& b) {
  return a.model == b.model && a.fx_px == b.fx_px && a.fy_px == b.fy_px && a.cx_px == b.cx_px &&
         a.cy_px == b.cy_px && a.distortion == b.distortion;
}

struct Cubic {
  double w[4];
};

// Catmull-Rom weights of the nodes at -1, 0, 1, 2 for t in [0, 1].
Cubic CubicWeights(double t) {
  const double t2 = t * t, t3 = t2 * t;
  return {
      {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2), 0.5 * (-3 * t3 + 4 * t2 + t), 0.5 * (t3 - t2)}};
}

}  // namespace

void UndistortionGrid::Prepare(const Intrinsics& lens, int width_px, int height_px) {
  if (!shift_.empty() && width_px == width_px_ && height_px == height_px_ && Same(lens, lens_)) return;
  lens_ = lens, width_px_ = width_px, height_px_ = height_px;
  columns_ = (width_px + kStepPx - 1) / kStepPx + 4;
  const int rows = (height_px + kStepPx - 1) / kStepPx + 4;
  shift_.resize(std::size_t(columns_) * rows);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns_; ++x) {
      const Eigen::Vector2d img((x - 1) * kStepPx, (y - 1) * kStepPx);
      const auto n = lens.NormalizedFromImg(img);
      shift_[std::size_t(y) * columns_ + x] =
          n ? Eigen::Vector2d(lens.IdealFromNormalized(*n) - img)
            : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    }
}

Eigen::Vector2d UndistortionGrid::Ideal(double u, double v) const {
  const double x = std::clamp(u, 0.0, width_px_ - 1.0) / kStepPx,
               y = std::clamp(v, 0.0, height_px_ - 1.0) / kStepPx;
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const Cubic wx = CubicWeights(x - ix), wy = CubicWeights(y - iy);
  Eigen::Vector2d shift(0, 0);
  for (int j = 0; j < 4; ++j) {
    const Eigen::Vector2d* node = &shift_[std::size_t(iy + j) * columns_ + ix];
    shift += wy.w[j] * (wx.w[0] * node[0] + wx.w[1] * node[1] + wx.w[2] * node[2] + wx.w[3] * node[3]);
  }
  return Eigen::Vector2d(u, v) + shift;
}

}  // namespace vss
