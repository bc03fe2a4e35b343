// Which unknowns the pictures determine: singular values of the Jacobian with its columns scaled by what was
// known beforehand.
#pragma once
#include <Eigen/Core>
#include <vector>

namespace vss {

struct Observability {
  std::vector<bool> observable;  // per unknown
  Eigen::VectorXd
      singular_values;         // of the scaled Jacobian, descending: 1 means "as much as was known before"
  Eigen::MatrixXd directions;  // columns, scaled unknowns
};

// `information`: J^T W J of the data alone; `prior_sigma`: what is known beforehand, of each unknown. A
// direction is determined where the data know it `gain` times better than the prior; an unknown is observable
// where (nearly) none of it lies in undetermined directions.
Observability AnalyseObservability(const Eigen::MatrixXd& information, const Eigen::VectorXd& prior_sigma,
                                   double gain);

}  // namespace vss
