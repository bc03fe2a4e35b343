#include "vss/feature/ellipse_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "vss/geometry/rigid_transform.h"

namespace vss {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

constexpr std::size_t kMinPoints = 6;
constexpr double kMinAxisPx = 1e-3;

struct Conic {
  double a, b, c, d, e, f;  // a x^2 + b x y + c y^2 + d x + e y + f = 0
};

std::optional<Conic> DirectFit(std::span<const Vector2d> points, const Vector2d& centre, double scale) {
  Matrix3d s1 = Matrix3d::Zero(), s2 = Matrix3d::Zero(), s3 = Matrix3d::Zero();
  for (const auto& p : points) {
    const Vector2d q = (p - centre) / scale;
    const Vector3d quadratic(q.x() * q.x(), q.x() * q.y(), q.y() * q.y()), linear(q.x(), q.y(), 1);
    s1 += quadratic * quadratic.transpose();
    s2 += quadratic * linear.transpose();
    s3 += linear * linear.transpose();
  }
  const Eigen::FullPivLU<Matrix3d> lu(s3);
  if (!lu.isInvertible()) return std::nullopt;
  const Matrix3d t = -lu.solve(s2.transpose());
  const Matrix3d m = s1 + s2 * t;
  Matrix3d reduced;
  reduced << m.row(2) / 2, -m.row(1), m.row(0) / 2;
  const Eigen::EigenSolver<Matrix3d> solver(reduced);
  for (int i = 0; i < 3; ++i) {
    const Vector3d v = solver.eigenvectors().col(i).real();
    if (std::abs(solver.eigenvalues()[i].imag()) > 1e-9 * std::abs(solver.eigenvalues()[i])) continue;
    if (!(4 * v[0] * v[2] - v[1] * v[1] > 0)) continue;
    const Vector3d w = t * v;
    return Conic{v[0], v[1], v[2], w[0], w[1], w[2]};
  }
  return std::nullopt;
}

void Normalise(Ellipse& e) {
  e.axes = e.axes.cwiseAbs();
  if (e.axes.x() < e.axes.y()) {
    std::swap(e.axes.x(), e.axes.y());
    e.angle_rad += kPi / 2;
  }
  e.angle_rad = std::remainder(e.angle_rad, kPi);
}

std::optional<Ellipse> EllipseOf(const Conic& k, const Vector2d& centre, double scale) {
  const double det = 4 * k.a * k.c - k.b * k.b;
  if (!(det > 0)) return std::nullopt;
  const Vector2d c((k.b * k.e - 2 * k.c * k.d) / det, (k.b * k.d - 2 * k.a * k.e) / det);
  const double value = k.f + 0.5 * (k.d * c.x() + k.e * c.y());
  const double half = 0.5 * (k.a - k.c), root = std::sqrt(half * half + 0.25 * k.b * k.b),
               mean = 0.5 * (k.a + k.c);
  const double l1 = mean + root, l2 = mean - root;
  Ellipse e;
  e.angle_rad = 0.5 * std::atan2(k.b, k.a - k.c);
  const double q1 = -value / l1, q2 = -value / l2;
  if (!(q1 > 0 && q2 > 0 && std::isfinite(q1) && std::isfinite(q2))) return std::nullopt;
  e.axes = Vector2d(std::sqrt(q1), std::sqrt(q2)) * scale;
  e.center = centre + scale * c;
  Normalise(e);
  return e;
}

struct Turned {  // an ellipse, the direction of its first axis, and its axes' inverses
  const Ellipse& e;
  double cs = std::cos(e.angle_rad), sn = std::sin(e.angle_rad), ia = 1 / e.axes.x(), ib = 1 / e.axes.y();
};

// Sampson distance and its derivatives by centre u, v, axes, angle.
double DistanceAndJacobian(const Turned& turned, const Vector2d& p, Vector5d* jacobian) {
  const auto& [e, cs, sn, ia, ib] = turned;
  const Vector2d d = p - e.center;
  const double x = cs * d.x() + sn * d.y(), y = -sn * d.x() + cs * d.y(), sx = x * ia, sy = y * ib;
  const double f = sx * sx + sy * sy - 1;
  const double gx = 2 * sx * ia, gy = 2 * sy * ib, g = std::sqrt(gx * gx + gy * gy);
  if (!(g > 0)) return -e.axes.y();
  const double ig = 1 / g;
  if (jacobian) {
    // Of f alone: on the contour, where it matters, the gradient's own change counts for nothing.
    *jacobian << ig * (gy * sn - gx * cs), -ig * (gx * sn + gy * cs), -ig * gx * sx, -ig * gy * sy,
        ig * (gx * y - gy * x);
  }
  return f * ig;
}

struct Judged {
  EllipseFit fit;
  Vector5d gradient = Vector5d::Zero();  // half of the sum of squares', by the ellipse
};

Judged Judge(std::span<const Vector2d> points, const Ellipse& e) {
  Judged out{{e}};
  EllipseFit& fit = out.fit;
  double sum = 0;
  const Turned turned{e};
  for (const auto& p : points) {
    Vector5d j = Vector5d::Zero();
    const double r = DistanceAndJacobian(turned, p, &j);
    fit.information += j * j.transpose();
    out.gradient += j * r;
    sum += r * r;
    fit.max_px = std::max(fit.max_px, std::abs(r));
  }
  fit.rms_px = std::sqrt(sum / double(points.size()));
  return out;
}

// Gauss-Newton from what was judged.
bool Step(const Judged& at, Ellipse& e) {
  Matrix5d h = at.fit.information;
  h.diagonal() += Vector5d(1e-9 * h.diagonal()) + Vector5d::Constant(1e-12);
  const Vector5d step = h.ldlt().solve(at.gradient);
  if (!step.allFinite()) return false;
  e.center -= step.head<2>();
  e.axes -= step.segment<2>(2);
  e.angle_rad -= step[4];
  return e.axes.minCoeff() > kMinAxisPx;
}

}  // namespace

Vector2d Ellipse::PointAt(double t) const {
  const double cs = std::cos(angle_rad), sn = std::sin(angle_rad), x = axes.x() * std::cos(t),
               y = axes.y() * std::sin(t);
  return center + Vector2d(cs * x - sn * y, sn * x + cs * y);
}

double Ellipse::ParameterOf(const Vector2d& p) const {
  const double cs = std::cos(angle_rad), sn = std::sin(angle_rad);
  const Vector2d d = p - center;
  return std::atan2((-sn * d.x() + cs * d.y()) / axes.y(), (cs * d.x() + sn * d.y()) / axes.x());
}

double Ellipse::Distance(const Vector2d& p, Vector5d* by_ellipse) const {
  return DistanceAndJacobian({*this}, p, by_ellipse);
}

std::optional<EllipseFit> FitEllipse(std::span<const Vector2d> points, double hopeless_px) {
  if (points.size() < kMinPoints) return std::nullopt;
  Vector2d centre(0, 0);
  for (const auto& p : points) centre += p;
  centre /= double(points.size());
  double scale = 0;
  for (const auto& p : points) scale += (p - centre).norm();
  scale /= double(points.size());
  if (!(scale > 0) || !std::isfinite(scale)) return std::nullopt;
  const auto conic = DirectFit(points, centre, scale);
  if (!conic) return std::nullopt;
  auto ellipse = EllipseOf(*conic, centre, scale);
  if (!ellipse || !(ellipse->axes.y() > kMinAxisPx)) return std::nullopt;
  Judged best = Judge(points, *ellipse);
  if (!(best.fit.rms_px <= hopeless_px)) return std::nullopt;
  constexpr int kSteps = 4;
  constexpr double kWorthMore = 0.999;  // of the RMS: a step that gains less ends the search
  for (int i = 0; i < kSteps; ++i) {
    Ellipse next = best.fit.ellipse;
    if (!Step(best, next)) break;
    Normalise(next);
    const Judged judged = Judge(points, next);
    if (!(judged.fit.rms_px < best.fit.rms_px)) break;
    const bool more = judged.fit.rms_px < kWorthMore * best.fit.rms_px;
    best = judged;
    if (!more) break;
  }
  return best.fit;
}

}  // namespace vss
