// Pictures of boards from geometry alone, for tests and benchmarks: what a camera of a given lens sees of a
// given board.
#pragma once
#include <algorithm>
#include <cmath>
#include <random>

#include "vss/camera/lens.h"
#include "vss/feature/marks.h"
#include "vss/geometry/rigid_transform.h"

namespace vss::synthetic {

struct Scene {
  Intrinsics lens;
  int width_px = 512, height_px = 512;
  double blur_px = 0.55;    // sigma of the lens's blur
  double noise_levels = 0;  // of 255
  unsigned seed = 1;
  int subsamples = 4;  // a side
};

// Light of the board at a point of its plane: 0.08 to 0.9; the world beside the board is grey.
inline double BoardLight(const TargetSpec& t, const Eigen::Vector2d& p) {
  constexpr double kDark = 0.08, kLight = 0.9, kBeside = 0.3;
  const double x = p.x() / t.pitch_mm, y = p.y() / t.pitch_mm,
               margin = t.pattern == TargetPattern::kDiscs ? 1.0 : 1.6;
  if (x < -margin || y < -margin || x > t.columns - 1 + margin || y > t.rows - 1 + margin) return kBeside;
  const double light = kLight * (1 - 0.15 * x / t.columns + 0.1 * y / t.rows);  // uneven illumination
  if (t.pattern == TargetPattern::kDiscs) {
    const int c = static_cast<int>(std::lround(x)), r = static_cast<int>(std::lround(y));
    if (c < 0 || r < 0 || c >= t.columns || r >= t.rows) return light;
    const bool other = std::find(t.distinguished.begin(), t.distinguished.end(), std::array<int, 2>{c, r}) !=
                       t.distinguished.end();
    const double radius = 0.5 * (other ? t.distinguished_diameter_mm : t.diameter_mm) / t.pitch_mm;
    return std::hypot(x - c, y - r) < radius ? kDark / kLight * light : light;
  }
  const int c = static_cast<int>(std::floor(x)) + 1,
            r = static_cast<int>(std::floor(y)) + 1;  // square; 0, 0 at the top left
  if (c < 0 || r < 0 || c > t.columns || r > t.rows) return light;
  return (c + r) % 2 == 0 ? kDark / kLight * light : light;
}

inline GreyImage Render(const Scene& s, const TargetSpec& target, const RigidTransform& cam_from_board) {
  const int w = s.width_px, h = s.height_px;
  const RigidTransform board_from_cam = cam_from_board.Inverse();
  std::vector<double> sharp(std::size_t(w) * h), rows(sharp.size());
  for (int v = 0; v < h; ++v)
    for (int u = 0; u < w; ++u) {
      double sum = 0;
      for (int j = 0; j < s.subsamples; ++j)
        for (int i = 0; i < s.subsamples; ++i) {
          const auto n = s.lens.NormalizedFromImg(
              {u + (i + 0.5) / s.subsamples - 0.5, v + (j + 0.5) / s.subsamples - 0.5});
          if (!n) continue;
          const Eigen::Vector3d d = board_from_cam.rotation * n->homogeneous();
          const double along = -board_from_cam.translation.z() / d.z();
          if (!(along > 0)) continue;
          const Eigen::Vector3d p = board_from_cam.translation + along * d;
          sum += BoardLight(target, p.head<2>());
        }
      sharp[std::size_t(v) * w + u] = sum / (s.subsamples * s.subsamples);
    }
  const int radius = static_cast<int>(std::ceil(4 * s.blur_px));
  std::vector<double> kernel;
  double total = 0;
  for (int i = -radius; i <= radius; ++i)
    kernel.push_back(std::exp(-0.5 * i * i / (s.blur_px * s.blur_px))), total += kernel.back();
  const auto blur = [&](const std::vector<double>& from, std::vector<double>& to, int du, int dv) {
    for (int v = 0; v < h; ++v)
      for (int u = 0; u < w; ++u) {
        double sum = 0;
        for (int i = -radius; i <= radius; ++i)
          sum += kernel[i + radius] *
                 from[std::size_t(std::clamp(v + i * dv, 0, h - 1)) * w + std::clamp(u + i * du, 0, w - 1)];
        to[std::size_t(v) * w + u] = sum / total;
      }
  };
  blur(sharp, rows, 1, 0);
  blur(rows, sharp, 0, 1);
  std::mt19937 random(s.seed);
  std::normal_distribution<double> noise(0, s.noise_levels / 255);
  GreyImage image(w, h, 16);
  for (int v = 0; v < h; ++v)
    for (int u = 0; u < w; ++u)
      image.Row16(v)[u] = static_cast<std::uint16_t>(
          std::clamp(std::lround(65535 * (sharp[std::size_t(v) * w + u] + noise(random))), 0l, 65535l));
  return image;
}

// A pose that looks at the board's middle from `distance_mm`, tilted by `tilt_rad` about the axis at
// `axis_rad` in the picture, turned by `turn_rad`, the board's middle at `at` (normalised coordinates).
inline RigidTransform BoardPose(const TargetSpec& t, double distance_mm, double tilt_rad, double axis_rad,
                                double turn_rad, const Eigen::Vector2d& at = {0, 0}) {
  const Eigen::Matrix3d rotation =
      RotationFromVector(tilt_rad * Eigen::Vector3d(std::cos(axis_rad), std::sin(axis_rad), 0)) *
      RotationFromVector(turn_rad * Eigen::Vector3d::UnitZ());
  const Eigen::Vector2d middle = 0.5 * t.PointOnBoard(t.columns - 1, t.rows - 1);
  return {rotation, distance_mm * at.homogeneous() - rotation * Eigen::Vector3d(middle.x(), middle.y(), 0)};
}

}  // namespace vss::synthetic
