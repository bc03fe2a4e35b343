#include "vss/reconstruct/moved_cameras.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMovedChiSquare = 3.7;  // per degree of freedom of six: 1 in 1000

// Chi-square per degree of freedom of a camera's correction against its prior as declared: under it the
// correction has the covariance prior - posterior.
double Significance(const Adjustment& a, std::size_t c) {
  const auto& camera = a.cameras[c];
  const MatrixXd& prior = camera.prior_covariance;
  const VectorXd unit = prior.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd gained =
      unit.asDiagonal() * (prior - a.CameraCovariance(static_cast<int>(c))) * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(0.5 * (gained + gained.transpose()));
  const VectorXd x = eigen.eigenvectors().transpose() * unit.cwiseProduct(camera.value);
  double sum = 0;
  int n = 0;
  constexpr double kDetermined = 0.2;  // directions of which the pictures say little tell nothing
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (eigen.eigenvalues()[i] > kDetermined) sum += x[i] * x[i] / eigen.eigenvalues()[i], ++n;
  return n > 0 ? sum / n : 0;
}

// How much larger than declared the corrections of all cameras without calibration's word are, by the
// smaller half of them: one that was knocked does not raise it.
double CommonSignificance(const Adjustment& a, std::span<const double> significance) {
  std::vector<double> chi;
  for (std::size_t c = 0; c < a.cameras.size(); ++c)
    if (!a.cameras[c].prior_from_calibration) chi.push_back(significance[c]);
  if (chi.empty()) return 1;
  const auto middle = chi.begin() + static_cast<std::ptrdiff_t>((chi.size() - 1) / 2);
  std::nth_element(chi.begin(), middle, chi.end());
  return std::max(1.0, *middle);
}

}  // namespace

std::vector<double> ReleaseMovedCameras(Adjustment& a) {
  std::vector<double> significance(a.cameras.size(), 0);
  if (!a.options.adjust_cameras) return significance;
  for (std::size_t rounds = 0; rounds < a.cameras.size(); ++rounds) {
    a.ComputeCovariance();
    for (std::size_t c = 0; c < a.cameras.size(); ++c)
      if (!a.cameras[c].loosened) significance[c] = Significance(a, c);
    const double common = CommonSignificance(a, significance);
    std::size_t worst = a.cameras.size();
    double most = kMovedChiSquare;
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      const double relative = significance[c] / (a.cameras[c].prior_from_calibration ? 1 : common);
      if (!a.cameras[c].loosened && relative > most) worst = c, most = relative;
    }
    if (worst == a.cameras.size()) return significance;
    a.cameras[worst].loosened = true;
    constexpr int kSteps = 3;
    a.Solve(kSteps, true);
  }
  return significance;
}

}  // namespace vss
