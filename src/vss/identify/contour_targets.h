// World lines and circles taken for contours of an object: what they demand of its state.
#pragma once
#include <Eigen/Core>
#include <span>

#include "vss/identify/placed_object.h"

namespace vss {

using StateRow = Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, kMaxStateSize>;

// Normal equations of a linear system on the state of an object.
struct NormalEquations {
  Eigen::MatrixXd ata;
  Eigen::VectorXd atb;
  explicit NormalEquations(int n) : ata(Eigen::MatrixXd::Zero(n, n)), atb(Eigen::VectorXd::Zero(n)) {}
  void Add(const StateRow& j, double residual, double weight) {
    ata += weight * j.transpose() * j;
    atb -= weight * residual * j.transpose();
  }
};

// An edge that lies on a world line.
struct EdgeTarget {
  int edge;
  Eigen::Vector3d point, unit;  // the world line
  double lo, hi;                // its extent along `unit` from `point`
  bool flip;                    // the edge's start lies at hi
};
// A circle that is a world circle.
struct CircleTarget {
  int circle;
  Eigen::Vector3d center;  // world, mm
  double radius;           // mm
};

// Adds what edges on lines and circles on circles demand of `object`, and returns how far (mm) the worst of
// them misses its line or circle. `ends`: of the edges' ends too.
double AddTargets(const PlacedObject& object, std::span<const EdgeTarget> edges,
                  std::span<const CircleTarget> circles, NormalEquations& normal, bool ends = true);

// Holds height and tilt of a system on the state: what a seed does not tell.
void HoldUpright(Eigen::MatrixXd& ata, Eigen::VectorXd& atb);

}  // namespace vss
