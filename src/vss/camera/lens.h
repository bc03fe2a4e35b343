// Lens models: how a direction in the camera frame becomes a pixel and back.
//
// Normalised coordinates (x, y) = (X/Z, Y/Z) of a point in `cam`. `ideal` are pixels without distortion,
// u = fx x + cx, v = fy y + cy; `img` are pixels as taken, (0, 0) the centre of the first pixel.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>

#include "vss/base/result.h"

namespace vss {

enum class LensModel {
  kPinhole,  // no distortion
  kOpenCv,   // ideal -> observed: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 (OpenCV's order)
  kWeng,     // observed -> ideal: k1 g1 g2 g3 g4, then k2 (Weng, Cohen, Herniou 1992, eq. 14, with k2 the next radial term)
};

struct Intrinsics {
  LensModel model = LensModel::kPinhole;
  double fx_px = 1, fy_px = 1, cx_px = 0, cy_px = 0;
  std::array<double, 12> distortion{};
  int num_distortion = 0;           // how many of `distortion` the file gives
  double pixel_pitch_v_mm = 0;      // kWeng: from the data sheet; fixes the scale of the image distance

  Eigen::Vector2d IdealFromNormalized(const Eigen::Vector2d& n) const { return {fx_px * n.x() + cx_px, fy_px * n.y() + cy_px}; }
  Eigen::Vector2d NormalizedFromIdeal(const Eigen::Vector2d& u) const { return {(u.x() - cx_px) / fx_px, (u.y() - cy_px) / fy_px}; }

  // Distorts. Empty where the model folds over (a direction that this lens does not see). `jacobian`: d img / d normalized.
  std::optional<Eigen::Vector2d> ImgFromNormalized(const Eigen::Vector2d& n, Eigen::Matrix2d* jacobian = nullptr) const;
  // Undistorts. Empty where no direction has this pixel under the model. `jacobian`: d normalized / d img.
  std::optional<Eigen::Vector2d> NormalizedFromImg(const Eigen::Vector2d& img, Eigen::Matrix2d* jacobian = nullptr) const;

  // A point in `cam` (mm) to `img` (px). Empty behind the camera or beyond the lens. `jacobian`: d img / d point_in_cam.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& point_in_cam, Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const;
  // `img` (px) to the unit direction in `cam`. `jacobian`: d direction / d img.
  std::optional<Eigen::Vector3d> Unproject(const Eigen::Vector2d& img, Eigen::Matrix<double, 3, 2>* jacobian = nullptr) const;
};

// OpenCV's model, ideal -> observed, on normalised coordinates; d: the twelve coefficients. T may be a Ceres Jet.
template <class T>
void DistortOpenCv(const T* d, const T& x, const T& y, T* xd, T* yd) {
  const T r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const T radial = (T(1) + d[0] * r2 + d[1] * r4 + d[4] * r6) / (T(1) + d[5] * r2 + d[6] * r4 + d[7] * r6);
  *xd = x * radial + T(2) * d[2] * x * y + d[3] * (r2 + T(2) * x * x) + d[8] * r2 + d[9] * r4;
  *yd = y * radial + d[2] * (r2 + T(2) * y * y) + T(2) * d[3] * x * y + d[10] * r2 + d[11] * r4;
}

// Weng's model, observed -> ideal, on normalised coordinates; d: k1 g1 g2 g3 g4 k2.
template <class T>
void UndistortWeng(const T* d, const T& u, const T& v, T* ui, T* vi) {
  const T q = u * u + v * v;
  const T radial = d[0] * q + d[5] * q * q;
  *ui = u + (d[1] + d[3]) * u * u + d[4] * u * v + d[1] * v * v + u * radial;
  *vi = v + d[2] * u * u + d[3] * u * v + (d[2] + d[4]) * v * v + v * radial;
}

}  // namespace vss
