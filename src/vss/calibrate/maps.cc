#include "vss/calibrate/maps.h"

#include <Eigen/Dense>
#include <cmath>

namespace vss {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

Vector2d CellPlace(int i, int j, int columns, int rows, int width_px, int height_px) {
  return {(width_px - 1) * double(i) / (columns - 1), (height_px - 1) * double(j) / (rows - 1)};
}

void Summarise(PictureMap& map) {
  double sum = 0;
  int n = 0;
  map.max = 0;
  for (double v : map.value) {
    if (!std::isfinite(v)) continue;
    sum += v * v, ++n;
    map.max = std::max(map.max, v);
  }
  map.rms = n > 0 ? std::sqrt(sum / n) : std::numeric_limits<double>::quiet_NaN();
}

PictureMap LensDifference(const Intrinsics& a, const Intrinsics& b, int width_px, int height_px,
                          Matrix3d* b_from_a) {
  PictureMap map{kMapCells, kMapCells, {}, 0, 0};
  std::vector<std::optional<Vector3d>> rays_a, rays_b;
  Matrix3d covariance = Matrix3d::Zero();
  for (int j = 0; j < map.rows; ++j)
    for (int i = 0; i < map.columns; ++i) {
      const Vector2d img = CellPlace(i, j, map.columns, map.rows, width_px, height_px);
      rays_a.push_back(a.Unproject(img));
      rays_b.push_back(b.Unproject(img));
      if (rays_a.back() && rays_b.back()) covariance += *rays_b.back() * rays_a.back()->transpose();
    }
  const Eigen::JacobiSVD<Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d sign = Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Matrix3d rotation = svd.matrixU() * sign * svd.matrixV().transpose();
  if (b_from_a) *b_from_a = rotation;
  for (std::size_t k = 0; k < rays_a.size(); ++k) {
    double distance = std::numeric_limits<double>::quiet_NaN();
    if (rays_a[k] && rays_b[k]) {
      // Compared in the picture of a, where a pixel is a pixel.
      const auto pa = a.Project(*rays_a[k]), pb = a.Project(rotation.transpose() * *rays_b[k]);
      if (pa && pb) distance = (*pa - *pb).norm();
    }
    map.value.push_back(distance);
  }
  Summarise(map);
  return map;
}

MatrixXd RayJacobian(const Intrinsics& lens, const Vector2d& img) {
  const int n = 4 + lens.num_distortion;
  MatrixXd j(2, n);
  Eigen::Matrix2d n_by_img;
  const auto centre = lens.NormalizedFromImg(img, &n_by_img);
  if (!centre) return MatrixXd::Constant(2, n, std::numeric_limits<double>::quiet_NaN());
  const Eigen::Matrix2d img_by_n = n_by_img.inverse();
  for (int k = 0; k < n; ++k) {
    const auto moved = [&](double sign) {
      Intrinsics l = lens;
      const double h = k < 4 ? 1e-3 : 1e-6;
      double* value = k == 0   ? &l.fx_px
                      : k == 1 ? &l.fy_px
                      : k == 2 ? &l.cx_px
                      : k == 3 ? &l.cy_px
                               : &l.distortion[k - 4];
      *value += sign * h;
      const auto x = l.NormalizedFromImg(img);
      return x ? Vector2d((*x - *centre) / (sign * h))
               : Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    };
    const Vector2d slope = img_by_n * Vector2d(0.5 * (moved(1) + moved(-1)));
    j(0, k) = slope.x(), j(1, k) = slope.y();
  }
  return j;
}

PictureMap UncertaintyMap(const Intrinsics& lens, const MatrixXd& covariance, int width_px, int height_px) {
  PictureMap map{kMapCells, kMapCells, {}, 0, 0};
  const int cells = kMapCells * kMapCells, n = 4 + lens.num_distortion;
  MatrixXd by_parameters(2 * cells, n), by_rotation(2 * cells, 3);
  for (int k = 0; k < cells; ++k) {
    const Vector2d img = CellPlace(k % kMapCells, k / kMapCells, kMapCells, kMapCells, width_px, height_px);
    by_parameters.middleRows(2 * k, 2) = RayJacobian(lens, img);
    Eigen::Matrix2d n_by_img;
    const auto x = lens.NormalizedFromImg(img, &n_by_img);
    if (!x) {
      by_parameters.middleRows(2 * k, 2).setZero();
      by_rotation.middleRows(2 * k, 2).setZero();
      continue;
    }
    Eigen::Matrix<double, 2, 3> turn;  // d n / d w for p = (x, y, 1): w x p, projected
    turn << -x->x() * x->y(), 1 + x->x() * x->x(), -x->y(), -(1 + x->y() * x->y()), x->x() * x->y(), x->x();
    by_rotation.block<2, 3>(2 * k, 0) = n_by_img.inverse() * turn;
  }
  by_parameters = by_parameters.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  const MatrixXd rest =
      by_parameters -
      by_rotation *
          (by_rotation.transpose() * by_rotation).ldlt().solve(by_rotation.transpose() * by_parameters);
  for (int k = 0; k < cells; ++k) {
    const Eigen::VectorXd u = rest.row(2 * k), v = rest.row(2 * k + 1);
    map.value.push_back(std::sqrt(std::max(0.0, 0.5 * (u.dot(covariance * u) + v.dot(covariance * v)))));
  }
  Summarise(map);
  return map;
}

}  // namespace vss
