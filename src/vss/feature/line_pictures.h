// Pictures with known edges, for the tests of the line detector.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "vss/feature/line_image.h"

namespace vss {

inline constexpr double kTestBlurPx = 0.8;

// An edge's profile at t px from it towards the bright side, 0 to 1, seen through the blur and a pixel.
inline double TestStep(double t) {
  return 0.5 * std::erfc(-t / (std::sqrt(2.0) * std::hypot(kTestBlurPx, std::sqrt(1 / 12.0))));
}

// A rectangle (levels 60 around it and 140 within) whose sides are blurred.
struct TestRectangle {
  Eigen::Vector2d center = {100.3, 90.7};
  double half_length = 60, half_width = 30, angle = 0.3, low = 60, high = 140;

  double At(double u, double v) const {
    const Eigen::Vector2d d = Eigen::Vector2d(u, v) - center;
    const double x = std::cos(angle) * d.x() + std::sin(angle) * d.y(),
                 y = -std::sin(angle) * d.x() + std::cos(angle) * d.y();
    return low + (high - low) * (TestStep(half_length - x) - TestStep(-half_length - x)) *
                     (TestStep(half_width - y) - TestStep(-half_width - y));
  }
  // Corners in an order that has the inside to the left on the screen.
  std::array<Eigen::Vector2d, 4> Corners() const {
    const Eigen::Vector2d a(std::cos(angle), std::sin(angle)), b(-a.y(), a.x());
    return {center + half_length * a + half_width * b, center + half_length * a - half_width * b,
            center - half_length * a - half_width * b, center - half_length * a + half_width * b};
  }
};

// The grey values `value(u, v)` (0 to 255) with noise of `sigma`; 16 bit pictures have a hundred times of
// both.
template <class Value>
GreyImage Render(int width, int height, int bits, double sigma, const Value& value, unsigned seed = 7) {
  GreyImage image(width, height, bits);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const double exact = value(u, v) + (sigma > 0 ? sigma * noise(random) : 0);
      const double x = std::clamp(std::round(exact * (bits == 8 ? 1 : 100)), 0.0, image.view().MaxValue());
      if (bits == 8)
        image.Row8(v)[u] = static_cast<std::uint8_t>(x);
      else
        image.Row16(v)[u] = static_cast<std::uint16_t>(x);
    }
  return image;
}

inline LineImage LinesOf(const GreyImage& image, const Intrinsics* lens = nullptr) {
  return DetectLines(image.view(), lens, LineOptions{});
}

// Distance (px) of `p` from the line through `from` and `to`; positive below it on the screen where it runs
// to the right.
inline double AcrossPx(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Eigen::Vector2d& p) {
  const Eigen::Vector2d d = (to - from).normalized();
  return d.x() * (p.y() - from.y()) - d.y() * (p.x() - from.x());
}

inline bool IsFinite(const LineImage& lines) {
  for (const auto& s : lines.segments)
    if (!s.start.allFinite() || !s.end.allFinite() || !s.ideal_start.allFinite() ||
        !s.ideal_end.allFinite() || !std::isfinite(s.sigma_offset_px + s.sigma_angle_rad) ||
        !std::isfinite(s.contrast + s.blur_px + s.rms_distance_px))
      return false;
  return std::all_of(lines.arcs.begin(), lines.arcs.end(), [](const EllipticalArc& a) {
    return a.center.allFinite() && a.axes.allFinite() && a.ideal_center.allFinite() &&
           a.ideal_axes.allFinite() && a.covariance.allFinite() &&
           std::isfinite(a.angle_rad + a.from_rad + a.to_rad + a.blur_px + a.contrast);
  });
}

}  // namespace vss
