// Undistortion of many points: the exact model on a grid of nodes, cubic between them (within 0.002 px for
// lenses that a camera model describes at all), so that a point costs nanoseconds.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "vss/camera/lens.h"

namespace vss {

class UndistortionGrid {
 public:
  // Does nothing where lens and size are those of the call before.
  void Prepare(const Intrinsics& lens, int width_px, int height_px);

  // `img` to `ideal` (px). Not finite where no direction has this pixel under the model.
  Eigen::Vector2d Ideal(double u, double v) const;

 private:
  static constexpr int kStepPx = 16;

  Intrinsics lens_;
  int width_px_ = 0, height_px_ = 0, columns_ = 0;
  std::vector<Eigen::Vector2d> shift_;  // ideal - img at the nodes; the first node lies one step outside
};

}  // namespace vss
