// Levenberg-Marquardt for problems with few shared parameters and many blocks of six (a pose each) that meet
// only through the shared ones: the blocks are eliminated (Schur complement), so an iteration costs what its
// residuals cost. Triggs, McLauchlan, Hartley, Fitzgibbon 2000, "Bundle adjustment", section 6.1; damping
// after Nielsen 1999.
#pragma once
#include <Eigen/Core>
#include <functional>
#include <vector>

namespace vss {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Normal equations of one linearisation: J^T J and -J^T r, split in shared and block parts.
struct SchurSystem {
  struct Block {
    Matrix6d hessian = Matrix6d::Zero();
    Eigen::Matrix<double, Eigen::Dynamic, 6> shared_hessian;  // shared x block
    Vector6d gradient = Vector6d::Zero();
  };
  Eigen::MatrixXd shared;
  Eigen::VectorXd shared_gradient;
  std::vector<Block> blocks;

  void Reset(int num_shared, int num_blocks);
};

struct SchurStep {
  Eigen::VectorXd shared;
  std::vector<Vector6d> blocks;
};

// Solves the system with `damping` times its diagonal added. False where it is singular.
bool SolveSchur(const SchurSystem& system, double damping, SchurStep& step);

// Covariance of the shared parameters, for residuals of unit variance: the inverse of the reduced system.
// Empty where the data do not determine them.
Eigen::MatrixXd SharedCovariance(const SchurSystem& system);

struct LevenbergOptions {
  int max_iterations = 100;
  double relative_decrease = 1e-12;  // of the cost: stop below
  double start_damping = 1e-4;
};

struct LevenbergSummary {
  double cost = 0;  // sum of squares
  int iterations = 0;
  bool converged = false;
};

// `Problem` has double Evaluate(const State&, SchurSystem* system) (infinite where the state is impossible)
// and State Plus(const State&, const SchurStep&).
template <class Problem, class State>
LevenbergSummary MinimizeSchur(const Problem& problem, State& state, SchurSystem& system,
                               const LevenbergOptions& options = {}) {
  LevenbergSummary summary;
  summary.cost = problem.Evaluate(state, &system);
  double damping = options.start_damping, growth = 2;
  SchurStep step;
  SchurSystem trial_system;
  for (; summary.iterations < options.max_iterations; ++summary.iterations) {
    double trial_cost = summary.cost + 1;
    State trial = state;
    if (SolveSchur(system, damping, step)) {
      trial = problem.Plus(state, step);
      trial_cost = problem.Evaluate(trial, &trial_system);
    }
    if (trial_cost <= summary.cost) {
      const double decrease = summary.cost - trial_cost;
      state = std::move(trial);
      std::swap(system, trial_system);
      summary.cost = trial_cost;
      damping = std::max(1e-15, damping / 10);
      growth = 2;
      if (decrease <= options.relative_decrease * summary.cost) {
        summary.converged = true;
        break;
      }
    } else {
      damping *= growth;
      growth *= 2;
      if (damping > 1e12) {
        summary.converged = true;  // no direction leads down any more
        break;
      }
    }
  }
  return summary;
}

}  // namespace vss
