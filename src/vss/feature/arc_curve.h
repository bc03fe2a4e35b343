// Where places lie to an ellipse and to the part of it that is seen.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "vss/feature/ellipse_fit.h"
#include "vss/feature/line_image.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {

// Where a place lies about an ellipse (ideal): a number that grows with the angle of its parameter, 0 to 4,
// without a trigonometric function.
inline double AroundEllipse(double x, double y) {
  const double sum = std::abs(x) + std::abs(y);
  if (!(sum > 0)) return 0;
  const double share = y / sum;
  return x >= 0 ? (y >= 0 ? share : 4 + share) : 2 - share;
}

// An ellipse, and how a place lies to it.
struct ArcCurve {
  Ellipse ellipse;
  double cs, sn, a2, b2;

  explicit ArcCurve(const Ellipse& e)
      : ellipse(e),
        cs(std::cos(e.angle_rad)),
        sn(std::sin(e.angle_rad)),
        a2(e.axes.x() * e.axes.x()),
        b2(e.axes.y() * e.axes.y()) {}

  struct Place {
    double distance, curvature, around;  // outward, px (ideal); of the contour there, 1/px; see AroundEllipse
    Eigen::Vector2d normal;              // outward
    Eigen::Matrix<double, 5, 1> by_ellipse;  // of the distance
  };

  // The distance along the gradient at `p`, on which the conic is a parabola; its derivatives are those where
  // the contour is met, and are left out (zero) farther than `reach` from it.
  Place At(const Eigen::Vector2d& p, double reach) const {
    const Eigen::Vector2d d = p - ellipse.center;
    const double x = cs * d.x() + sn * d.y(), y = -sn * d.x() + cs * d.y();
    const double f = x * x / a2 + y * y / b2 - 1, gx = 2 * x / a2, gy = 2 * y / b2,
                 g = std::max(1e-12, std::sqrt(gx * gx + gy * gy));
    const double nx = gx / g, ny = gy / g, bend = 2 * (nx * nx / a2 + ny * ny / b2);
    Place out;
    out.distance = 2 * f / (g + std::sqrt(std::max(0.0, g * g - 2 * bend * f)));
    out.around = AroundEllipse(x / ellipse.axes.x(), y / ellipse.axes.y());
    out.normal = {cs * nx - sn * ny, sn * nx + cs * ny};
    out.curvature = 0, out.by_ellipse.setZero();
    if (std::abs(out.distance) > reach) return out;
    const double fx = x - out.distance * nx, fy = y - out.distance * ny, hx = 2 * fx / a2, hy = 2 * fy / b2,
                 h = std::sqrt(hx * hx + hy * hy);
    const double mx = hx / h, my = hy / h;
    out.curvature = 2 * (my * my / a2 + mx * mx / b2) / h;
    out.by_ellipse << -(mx * cs - my * sn), -(mx * sn + my * cs), -fx * mx / ellipse.axes.x(),
        -fy * my / ellipse.axes.y(), mx * fy - my * fx;
    return out;
  }
};

// The part of the contour that is seen, in numbers of AroundEllipse.
struct ArcRange {
  bool whole;
  double from, length;
  bool Has(double around) const {
    if (whole) return true;
    const double a = around - from;
    return (a < 0 ? a + 4 : a) < length;
  }
};

// From the place `first` of the contour to `last`, without their surroundings where `trim_px` is given.
inline ArcRange ArcRangeBetween(const Ellipse& e, const Eigen::Vector2d& first, const Eigen::Vector2d& last,
                                double trim_px) {
  const double trim = trim_px / std::max(1.0, e.axes.y()), from = e.ParameterOf(first) + trim,
               to = e.ParameterOf(last) - trim;
  const double a = AroundEllipse(std::cos(from), std::sin(from)),
               b = AroundEllipse(std::cos(to), std::sin(to));
  return {false, a, b > a ? b - a : b - a + 4};
}

inline bool IsWholeEllipse(const EllipticalArc& arc) {
  return arc.ideal_to_rad - arc.ideal_from_rad > 2 * kPi - 1e-6;
}

inline Ellipse EllipseOf(const EllipticalArc& arc) {
  return {arc.ideal_center, arc.ideal_axes, arc.ideal_angle_rad};
}

inline ArcRange ArcRangeOf(const EllipticalArc& arc) {
  if (IsWholeEllipse(arc)) return {true, 0, 4};
  const Ellipse e = EllipseOf(arc);
  return ArcRangeBetween(e, e.PointAt(arc.ideal_from_rad), e.PointAt(arc.ideal_to_rad), 0);
}

}  // namespace vss
