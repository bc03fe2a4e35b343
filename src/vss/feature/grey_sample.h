// Grey values between the pixels.
#pragma once
#include <Eigen/Core>
#include <algorithm>

#include "vss/image/grey_image.h"

namespace vss {

// Bilinear at `p` (px, img); beyond the picture's border its nearest pixels go on.
inline double Sample(const GreyView& image, const Eigen::Vector2d& p) {
  const double u = std::clamp(p.x(), 0.0, image.width - 1.001),
               v = std::clamp(p.y(), 0.0, image.height - 1.001);
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const double a = u - iu, b = v - iv;
  return (1 - b) * ((1 - a) * image.At(iu, iv) + a * image.At(iu + 1, iv)) +
         b * ((1 - a) * image.At(iu, iv + 1) + a * image.At(iu + 1, iv + 1));
}

}  // namespace vss
