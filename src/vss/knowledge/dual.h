// A value with its derivatives by the dimensions of an object: forward-mode automatic differentiation.
// Source: Griewank and Walther, Evaluating Derivatives, 2nd ed. 2008, chapter 3.
#pragma once
#include <Eigen/Core>
#include <cmath>

namespace vss {

inline constexpr int kMaxDimensions = 16;  // of one object: a solid with more is two objects
using Gradient = Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, kMaxDimensions>;

struct Dual {
  double value = 0;
  Gradient by_dimension;

  static Dual Constant(double value, int num_dimensions) { return {value, Gradient::Zero(num_dimensions)}; }
  static Dual Variable(double value, int index, int num_dimensions) {
    return {value, Gradient::Unit(num_dimensions, index)};
  }
};

inline Dual operator+(const Dual& a, const Dual& b) {
  return {a.value + b.value, a.by_dimension + b.by_dimension};
}
inline Dual operator-(const Dual& a, const Dual& b) {
  return {a.value - b.value, a.by_dimension - b.by_dimension};
}
inline Dual operator-(const Dual& a) { return {-a.value, -a.by_dimension}; }
inline Dual operator*(const Dual& a, const Dual& b) {
  return {a.value * b.value, a.by_dimension * b.value + b.by_dimension * a.value};
}
inline Dual operator*(double s, const Dual& a) { return {s * a.value, s * a.by_dimension}; }
inline Dual operator/(const Dual& a, const Dual& b) {
  const double q = a.value / b.value;
  return {q, (a.by_dimension - q * b.by_dimension) / b.value};
}
// At a tie the first operand decides: a subgradient.
inline Dual Min(const Dual& a, const Dual& b) { return b.value < a.value ? b : a; }
inline Dual Max(const Dual& a, const Dual& b) { return b.value > a.value ? b : a; }
inline Dual Abs(const Dual& a) { return a.value < 0 ? -a : a; }
// The derivative at 0, which is infinite, is taken as 0.
inline Dual Sqrt(const Dual& a) {
  const double root = std::sqrt(std::max(a.value, 0.0));
  const double slope = root > 0 ? 0.5 / root : 0.0;
  return {root, a.by_dimension * slope};
}

}  // namespace vss
