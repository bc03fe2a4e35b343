// Pictures from geometry alone, for tests and benchmarks: what a camera of a given lens sees of a given
// board.
#pragma once
#include <algorithm>
#include <cmath>
#include <random>

#include "vss/camera/lens.h"
#include "vss/feature/marks.h"
#include "vss/geometry/rigid_transform.h"
#include "vss/image/marker_dictionary.h"

namespace vss::synthetic {

struct Scene {
  Intrinsics lens;
  int width_px = 512, height_px = 512;
  double blur_px = 0.55;    // sigma of the lens's blur
  double noise_levels = 0;  // of 255
  unsigned seed = 1;
  int subsamples = 4;     // a side
  bool inverted = false;  // light discs on a dark board
  double vignetting = 0;  // share of the light that the picture's corners lose
  double exposure = 1;    // times the light; what exceeds 1 is cut off
};

// Is the marker of a coded square white at (x, y) of the square, both from 0 to 1? The ids follow the marked
// squares row by row.
inline bool MarkerWhite(const TargetSpec& t, const MarkerDictionary& markers, int c, int r, double x,
                        double y) {
  const double share = t.marker_mm / t.pitch_mm;
  const int n = markers.side + 2, u = static_cast<int>(std::floor((x - 0.5 + 0.5 * share) / share * n)),
            v = static_cast<int>(std::floor((y - 0.5 + 0.5 * share) / share * n));
  if (u < 0 || v < 0 || u >= n || v >= n) return true;
  if (u == 0 || v == 0 || u == n - 1 || v == n - 1) return false;
  std::size_t id = 0;
  for (int row = 0; row <= r; ++row)
    for (int column = 0; column <= (row < r ? t.columns : c - 1); ++column)
      id += (column + row) % 2 == (t.first_square_white ? 0 : 1);
  return markers.White(id, v - 1, u - 1);
}

// Light of the board at a point of its plane: 0.08 to 0.9; the world beside the board is grey.
inline double BoardLight(const TargetSpec& t, const Eigen::Vector2d& p,
                         const MarkerDictionary* markers = nullptr) {
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
  const bool dark = (c + r) % 2 == (markers && t.first_square_white ? 1 : 0) ||
                    (markers && !MarkerWhite(t, *markers, c, r, x + 1 - c, y + 1 - r));
  return dark ? kDark / kLight * light : light;
}

// The picture of whatever sends `light(direction in cam)` to the camera.
template <class Light>
GreyImage Expose(const Scene& s, const Light& light) {
  const int w = s.width_px, h = s.height_px;
  // Rays of the pixels' corners; within a pixel a lens bends by less than 1e-6 of it.
  std::vector<std::optional<Eigen::Vector2d>> corner(std::size_t(w + 1) * (h + 1));
  for (int v = 0; v <= h; ++v)
    for (int u = 0; u <= w; ++u)
      corner[std::size_t(v) * (w + 1) + u] = s.lens.NormalizedFromImg({u - 0.5, v - 0.5});
  std::vector<double> sharp(std::size_t(w) * h), rows(sharp.size());
  for (int v = 0; v < h; ++v)
    for (int u = 0; u < w; ++u) {
      const auto *above = &corner[std::size_t(v) * (w + 1) + u], *below = above + w + 1;
      if (!above[0] || !above[1] || !below[0] || !below[1]) continue;
      double sum = 0;
      for (int j = 0; j < s.subsamples; ++j)
        for (int i = 0; i < s.subsamples; ++i) {
          // No two samples share a row or a column: an edge along either is as fine as one across.
          const double n_side = s.subsamples, x = (i + (j + 0.5) / n_side) / n_side,
                       y = (j + 1 - (i + 0.5) / n_side) / n_side;
          const Eigen::Vector2d n =
              (1 - y) * ((1 - x) * *above[0] + x * *above[1]) + y * ((1 - x) * *below[0] + x * *below[1]);
          sum += light(Eigen::Vector3d(n.homogeneous()));
        }
      const double off = std::hypot(2.0 * u / (w - 1) - 1, 2.0 * v / (h - 1) - 1) / std::sqrt(2.0);
      sharp[std::size_t(v) * w + u] =
          s.exposure * (1 - s.vignetting * off * off) * sum / (s.subsamples * s.subsamples);
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

inline GreyImage Render(const Scene& s, const TargetSpec& target, const RigidTransform& cam_from_board) {
  const RigidTransform board_from_cam = cam_from_board.Inverse();
  std::optional<MarkerDictionary> markers;
  if (target.pattern == TargetPattern::kCharuco) markers = *PredefinedMarkers(target.dictionary);
  return Expose(s, [&](const Eigen::Vector3d& in_cam) {
    const Eigen::Vector3d d = board_from_cam.rotation * in_cam;
    const double along = -board_from_cam.translation.z() / d.z();
    if (!(along > 0)) return 0.0;
    const Eigen::Vector3d p = board_from_cam.translation + along * d;
    const double light = BoardLight(target, p.head<2>(), markers ? &*markers : nullptr);
    return s.inverted ? 1 - light : light;
  });
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
