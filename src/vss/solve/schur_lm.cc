#include "vss/solve/schur_lm.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace vss {

void SchurSystem::Reset(int num_shared, int num_blocks) {
  shared.setZero(num_shared, num_shared);
  shared_gradient.setZero(num_shared);
  blocks.resize(num_blocks);
  for (Block& b : blocks) {
    b.hessian.setZero();
    b.shared_hessian.setZero(num_shared, 6);
    b.gradient.setZero();
  }
}

namespace {
// The reduced system S x = s, with each block's factorisation kept.
bool Reduce(const SchurSystem& system, double damping, Eigen::MatrixXd& reduced, Eigen::VectorXd& right,
            std::vector<Eigen::LLT<Matrix6d>>& factors) {
  reduced = system.shared;
  reduced.diagonal() *= 1 + damping;
  right = system.shared_gradient;
  factors.resize(system.blocks.size());
  for (std::size_t i = 0; i < system.blocks.size(); ++i) {
    const auto& b = system.blocks[i];
    Matrix6d h = b.hessian;
    h.diagonal() *= 1 + damping;
    factors[i].compute(h);
    if (factors[i].info() != Eigen::Success) return false;
    const Eigen::Matrix<double, 6, Eigen::Dynamic> half =
        factors[i].matrixL().solve(b.shared_hessian.transpose());
    reduced.noalias() -= half.transpose() * half;
    right.noalias() -= half.transpose() * factors[i].matrixL().solve(b.gradient);
  }
  return true;
}
}  // namespace

bool SolveSchur(const SchurSystem& system, double damping, SchurStep& step) {
  Eigen::MatrixXd reduced;
  Eigen::VectorXd right;
  std::vector<Eigen::LLT<Matrix6d>> factors;
  if (!Reduce(system, damping, reduced, right, factors)) return false;
  const Eigen::LDLT<Eigen::MatrixXd> solver(reduced);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return false;
  step.shared = solver.solve(right);
  step.blocks.resize(system.blocks.size());
  for (std::size_t i = 0; i < system.blocks.size(); ++i)
    step.blocks[i] = factors[i].solve(system.blocks[i].gradient -
                                      system.blocks[i].shared_hessian.transpose() * step.shared);
  return step.shared.allFinite();
}

Eigen::MatrixXd SharedCovariance(const SchurSystem& system) {
  Eigen::MatrixXd reduced;
  Eigen::VectorXd right;
  std::vector<Eigen::LLT<Matrix6d>> factors;
  if (!Reduce(system, 0, reduced, right, factors)) return {};
  // Scaled to a unit diagonal, so that px and dimensionless coefficients compare.
  const Eigen::VectorXd scale = reduced.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * reduced * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  constexpr double kSingular = 1e-14;
  if (eigen.info() != Eigen::Success ||
      !(eigen.eigenvalues()[0] > kSingular * eigen.eigenvalues()[eigen.eigenvalues().size() - 1]))
    return {};
  const Eigen::MatrixXd inverse = eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                                  eigen.eigenvectors().transpose();
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace vss
