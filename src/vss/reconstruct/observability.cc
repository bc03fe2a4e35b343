#include "vss/reconstruct/observability.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace vss {

Observability AnalyseObservability(const Eigen::MatrixXd& information, const Eigen::VectorXd& prior_sigma,
                                   double gain) {
  constexpr double kMaxShare = 0.02;  // squared part of an unknown in undetermined directions
  const Eigen::MatrixXd scaled = prior_sigma.asDiagonal() * information * prior_sigma.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (scaled + scaled.transpose()));
  const auto n = information.rows();
  Observability out;
  out.observable.assign(static_cast<std::size_t>(n), true);
  out.singular_values = eigen.eigenvalues().reverse().cwiseMax(0).cwiseSqrt();
  out.directions = eigen.eigenvectors().rowwise().reverse();
  for (Eigen::Index i = 0; i < n; ++i) {
    double lost = 0;
    for (Eigen::Index k = 0; k < n; ++k)
      if (out.singular_values[k] < gain) lost += out.directions(i, k) * out.directions(i, k);
    out.observable[static_cast<std::size_t>(i)] = lost < kMaxShare;
  }
  return out;
}

}  // namespace vss
