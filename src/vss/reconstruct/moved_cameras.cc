#include "vss/reconstruct/moved_cameras.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <span>

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Chi-square per degree of freedom of six that calls a camera moved: 1 in 1000.
constexpr double kMovedChiSquare = 3.7;
// Without calibration's word the same is asked against what the others' is; of few cameras the declaration is
// believed, too, with one camera's weight: corrections that happen to be small do not make a rig precise. By
// simulation of independent cameras that are as declared, 0.1 to 0.3 % of rigs of 2 to 20 have one called so.
constexpr double kMovedAgainstOthers = 5, kDeclaredDegrees = 6;

// Of a camera's correction against its prior as declared: under it the correction has the covariance prior -
// posterior.
struct Correction {
  double chi_square = 0;
  int degrees = 0;  // in so many directions the pictures tell
  double PerDegree() const { return degrees > 0 ? chi_square / degrees : 0; }
};

Correction CorrectionOf(const Adjustment& a, std::size_t c) {
  const auto& camera = a.cameras[c];
  const MatrixXd& prior = camera.prior_covariance;
  const VectorXd unit = prior.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd gained =
      unit.asDiagonal() * (prior - a.CameraCovariance(static_cast<int>(c))) * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(0.5 * (gained + gained.transpose()));
  const VectorXd x = eigen.eigenvectors().transpose() * unit.cwiseProduct(camera.value);
  Correction out;
  constexpr double kDetermined = 0.2;  // directions of which the pictures say little tell nothing
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (eigen.eigenvalues()[i] > kDetermined)
      out.chi_square += x[i] * x[i] / eigen.eigenvalues()[i], ++out.degrees;
  return out;
}

// Of all cameras; of those that were let go what they had before.
void Update(Adjustment& a, std::vector<Correction>& corrections) {
  a.ComputeCovariance();
  for (std::size_t c = 0; c < a.cameras.size(); ++c)
    if (!a.cameras[c].loosened) corrections[c] = CorrectionOf(a, c);
}

// Those without calibration's word that have their priors, together.
Correction Others(const Adjustment& a, std::span<const Correction> corrections) {
  Correction sum;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.cameras[c].loosened || a.cameras[c].prior_from_calibration) continue;
    sum.chi_square += corrections[c].chi_square;
    sum.degrees += corrections[c].degrees;
  }
  return sum;
}

// What a camera that was let go must have had to be called moved.
double LimitOf(const Adjustment& a, std::size_t camera, std::span<const Correction> corrections) {
  if (a.cameras[camera].prior_from_calibration) return kMovedChiSquare;
  const Correction others = Others(a, corrections);
  return kMovedAgainstOthers * (kDeclaredDegrees + others.chi_square) / (kDeclaredDegrees + others.degrees);
}

}  // namespace

std::vector<double> ReleaseMovedCameras(Adjustment& a) {
  std::vector<double> significance(a.cameras.size(), 0);
  if (!a.options.adjust_cameras) return significance;
  std::vector<Correction> corrections(a.cameras.size());
  Update(a, corrections);
  bool any = true;
  while (any) {
    any = false;
    // A camera that was moved drags the others along: each of the worst is let go in turn, and what fits the
    // others best is what happened.
    constexpr std::size_t kTried = 2;
    constexpr int kSteps = 3;
    std::vector<std::size_t> worst;
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      // With all others where they were said to be to a hair, the limit is lowest.
      const double least = a.cameras[c].prior_from_calibration
                               ? kMovedChiSquare
                               : kMovedAgainstOthers / static_cast<double>(a.cameras.size());
      if (!a.cameras[c].loosened && corrections[c].PerDegree() > least) worst.push_back(c);
    }
    std::stable_sort(worst.begin(), worst.end(), [&](std::size_t p, std::size_t q) {
      return corrections[p].PerDegree() > corrections[q].PerDegree();
    });
    if (worst.size() > kTried) worst.erase(worst.begin() + kTried, worst.end());
    if (worst.empty()) break;
    const Adjustment before = a;
    Adjustment best = a;
    std::vector<Correction> best_corrections;
    double least_left = INFINITY;
    for (const std::size_t c : worst) {
      a = before;
      std::vector<Correction> then = corrections;
      a.cameras[c].loosened = true;
      a.Solve(kSteps, true);
      Update(a, then);
      const double left = Others(a, then).chi_square;
      if (corrections[c].PerDegree() < LimitOf(a, c, then) || left >= least_left) continue;
      any = true;
      least_left = left;
      best = a;
      best_corrections = std::move(then);
    }
    a = std::move(best);
    if (any) corrections = std::move(best_corrections);
  }
  for (std::size_t c = 0; c < a.cameras.size(); ++c) significance[c] = corrections[c].PerDegree();
  return significance;
}

}  // namespace vss
