// Ellipses through points.
#pragma once
#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>

namespace vss {

// point(t) = center + R(angle) (axes.x cos t, axes.y sin t); axes.x >= axes.y, angle in (-pi/2, pi/2].
struct Ellipse {
  Eigen::Vector2d center = {0, 0}, axes = {1, 1};
  double angle_rad = 0;

  Eigen::Vector2d PointAt(double t) const;
  double ParameterOf(
      const Eigen::Vector2d& p) const;  // rad, of the point in p's direction (scaled by the axes)
  // Distance to first order (Sampson), px; positive outside. `by_ellipse`: its derivative, exact on the contour,
  // by centre u, v, axes, angle.
  double Distance(const Eigen::Vector2d& p, Eigen::Matrix<double, 5, 1>* by_ellipse = nullptr) const;
};

struct EllipseFit {
  Ellipse ellipse;
  double rms_px = 0, max_px = 0;
  Eigen::Matrix<double, 5, 5> information =
      Eigen::Matrix<double, 5, 5>::Zero();  // of centre u, v, axes, angle, per unit variance
};

// Direct least squares (Fitzgibbon, Pilu, Fisher 1999, in the stable form of Halir and Flusser 1998), then
// Gauss-Newton on the distances. Empty where the points describe no ellipse ("fewer than 6" included).
// Gives up where the first fit's RMS is above `hopeless_px`.
std::optional<EllipseFit> FitEllipse(std::span<const Eigen::Vector2d> points,
                                     double hopeless_px = std::numeric_limits<double>::infinity());

}  // namespace vss
