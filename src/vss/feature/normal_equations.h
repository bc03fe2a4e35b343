// Small normal equations: a symmetric positive definite matrix, factored in place on the stack.
#pragma once
#include <Eigen/Core>
#include <cmath>

namespace vss {

// L L^T = h. Fails where h is not positive definite: `ok()` says so, and nothing else may be asked then.
template <int N>
class Cholesky {
 public:
  explicit Cholesky(const Eigen::Matrix<double, N, N>& h) {
    for (int j = 0; j < N; ++j) {
      double d = h(j, j);
      for (int k = 0; k < j; ++k) d -= l_[j][k] * l_[j][k];
      if (!(d > 0) || !std::isfinite(d)) return;
      l_[j][j] = std::sqrt(d);
      inverse_[j] = 1 / l_[j][j];
      for (int i = j + 1; i < N; ++i) {
        double s = h(i, j);
        for (int k = 0; k < j; ++k) s -= l_[i][k] * l_[j][k];
        l_[i][j] = s * inverse_[j];
      }
    }
    ok_ = true;
  }

  bool ok() const { return ok_; }

  // L^-1 g: the square of each is by how much that unknown, when the earlier ones are free already, lowers a
  // sum of squares.
  Eigen::Matrix<double, N, 1> Forward(const Eigen::Matrix<double, N, 1>& g) const {
    Eigen::Matrix<double, N, 1> x;
    for (int i = 0; i < N; ++i) {
      double s = g[i];
      for (int k = 0; k < i; ++k) s -= l_[i][k] * x[k];
      x[i] = s * inverse_[i];
    }
    return x;
  }

  Eigen::Matrix<double, N, 1> Solve(const Eigen::Matrix<double, N, 1>& g) const {
    Eigen::Matrix<double, N, 1> x = Forward(g);
    for (int i = N; i-- > 0;) {
      double s = x[i];
      for (int k = i + 1; k < N; ++k) s -= l_[k][i] * x[k];
      x[i] = s * inverse_[i];
    }
    return x;
  }

  // The inverse's first M rows and columns.
  template <int M>
  Eigen::Matrix<double, M, M> InverseOfFirst() const {
    Eigen::Matrix<double, M, M> out;
    for (int j = 0; j < M; ++j) out.col(j) = Solve(Eigen::Matrix<double, N, 1>::Unit(j)).template head<M>();
    return out;
  }

 private:
  double l_[N][N], inverse_[N];
  bool ok_ = false;
};

}  // namespace vss
