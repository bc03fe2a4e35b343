#include "vss/camera/lens.h"

#include <Eigen/LU>
#include <cmath>

namespace vss {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

Vector2d DistortOpenCvWithJacobian(const std::array<double, 12>& d, const Vector2d& n, Matrix2d& j) {
  const double x = n.x(), y = n.y(), r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double num = 1 + d[0] * r2 + d[1] * r4 + d[4] * r6, den = 1 + d[5] * r2 + d[6] * r4 + d[7] * r6;
  const double radial = num / den;
  const double num_r2 = d[0] + 2 * d[1] * r2 + 3 * d[4] * r4, den_r2 = d[5] + 2 * d[6] * r2 + 3 * d[7] * r4;
  const double radial_r2 = (num_r2 - radial * den_r2) / den;
  const double prism_x = d[8] + 2 * d[9] * r2, prism_y = d[10] + 2 * d[11] * r2;
  j(0, 0) = radial + 2 * x * x * radial_r2 + 2 * d[2] * y + 6 * d[3] * x + 2 * x * prism_x;
  j(0, 1) = 2 * x * y * radial_r2 + 2 * d[2] * x + 2 * d[3] * y + 2 * y * prism_x;
  j(1, 0) = 2 * x * y * radial_r2 + 2 * d[2] * x + 2 * d[3] * y + 2 * x * prism_y;
  j(1, 1) = radial + 2 * y * y * radial_r2 + 6 * d[2] * y + 2 * d[3] * x + 2 * y * prism_y;
  Vector2d out;
  DistortOpenCv(d.data(), x, y, &out.x(), &out.y());
  return out;
}

Vector2d UndistortWengWithJacobian(const std::array<double, 12>& d, const Vector2d& n, Matrix2d& j) {
  const double u = n.x(), v = n.y(), q = u * u + v * v;
  const double radial = d[0] * q + d[5] * q * q, radial_q = d[0] + 2 * d[5] * q;
  j(0, 0) = 1 + 2 * (d[1] + d[3]) * u + d[4] * v + radial + 2 * u * u * radial_q;
  j(0, 1) = d[4] * u + 2 * d[1] * v + 2 * u * v * radial_q;
  j(1, 0) = 2 * d[2] * u + d[3] * v + 2 * u * v * radial_q;
  j(1, 1) = 1 + d[3] * u + 2 * (d[2] + d[4]) * v + radial + 2 * v * v * radial_q;
  Vector2d out;
  UndistortWeng(d.data(), u, v, &out.x(), &out.y());
  return out;
}

// Newton from x = y, along which the map must stay one-to-one (positive determinant).
template <class Map>
std::optional<Vector2d> Invert(const Map& map, const Vector2d& y, Matrix2d& jacobian) {
  constexpr int kMaxIterations = 30;     // Newton on a smooth lens needs 3 to 5
  constexpr double kTolerance = 1e-13;   // normalised units: 1e-10 px
  Vector2d x = y;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Vector2d residual = map(x, jacobian) - y;
    if (!(jacobian.determinant() > 0)) return std::nullopt;
    const Vector2d step = jacobian.inverse() * residual;
    x -= step;
    if (!x.allFinite()) return std::nullopt;
    if (step.squaredNorm() < kTolerance * kTolerance) {
      map(x, jacobian);
      if (!(jacobian.determinant() > 0)) return std::nullopt;
      return x;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<Vector2d> Intrinsics::ImgFromNormalized(const Vector2d& n, Matrix2d* jacobian) const {
  Matrix2d j = Matrix2d::Identity();
  Vector2d observed = n;
  if (model == LensModel::kOpenCv) {
    observed = DistortOpenCvWithJacobian(distortion, n, j);
    // Beyond the radius where the radial term turns back the model maps outer points inside again.
    const double r = n.norm();
    if (!(j.determinant() > 0) || (r > 0 && !(n.dot(j * n) > 0)) || !observed.allFinite()) return std::nullopt;
  } else if (model == LensModel::kWeng) {
    const auto inverse = Invert([&](const Vector2d& x, Matrix2d& jj) { return UndistortWengWithJacobian(distortion, x, jj); }, n, j);
    if (!inverse) return std::nullopt;
    observed = *inverse;
    if (jacobian) j = j.inverse().eval();
  }
  if (jacobian) *jacobian = Eigen::Vector2d(fx_px, fy_px).asDiagonal() * j;
  return IdealFromNormalized(observed);
}

std::optional<Vector2d> Intrinsics::NormalizedFromImg(const Vector2d& img, Matrix2d* jacobian) const {
  const Vector2d observed = NormalizedFromIdeal(img);
  Matrix2d j = Matrix2d::Identity();
  Vector2d n = observed;
  if (model == LensModel::kOpenCv) {
    const auto inverse = Invert([&](const Vector2d& x, Matrix2d& jj) { return DistortOpenCvWithJacobian(distortion, x, jj); }, observed, j);
    if (!inverse) return std::nullopt;
    n = *inverse;
    j = j.inverse().eval();
  } else if (model == LensModel::kWeng) {
    n = UndistortWengWithJacobian(distortion, observed, j);
    if (!(j.determinant() > 0)) return std::nullopt;
  }
  if (jacobian) *jacobian = j * Eigen::Vector2d(1 / fx_px, 1 / fy_px).asDiagonal();
  return n;
}

std::optional<Vector2d> Intrinsics::Project(const Eigen::Vector3d& p, Eigen::Matrix<double, 2, 3>* jacobian) const {
  constexpr double kMinDepthMm = 1e-6;  // at or behind the optical centre there is no picture
  if (!(p.z() > kMinDepthMm)) return std::nullopt;
  const Vector2d n(p.x() / p.z(), p.y() / p.z());
  Matrix2d j;
  const auto img = ImgFromNormalized(n, jacobian ? &j : nullptr);
  if (img && jacobian) {
    Eigen::Matrix<double, 2, 3> n_p;
    n_p << 1 / p.z(), 0, -n.x() / p.z(), 0, 1 / p.z(), -n.y() / p.z();
    *jacobian = j * n_p;
  }
  return img;
}

std::optional<Eigen::Vector3d> Intrinsics::Unproject(const Vector2d& img, Eigen::Matrix<double, 3, 2>* jacobian) const {
  Matrix2d j;
  const auto n = NormalizedFromImg(img, jacobian ? &j : nullptr);
  if (!n) return std::nullopt;
  const double norm = std::sqrt(1 + n->squaredNorm());
  const Eigen::Vector3d d = Eigen::Vector3d(n->x(), n->y(), 1) / norm;
  if (jacobian) {
    const Eigen::Matrix<double, 3, 2> d_n = (Eigen::Matrix3d::Identity() - d * d.transpose()).leftCols<2>() / norm;
    *jacobian = d_n * j;
  }
  return d;
}

}  // namespace vss
