// The expressions of an object, names resolved, in an order in which each can be computed from those before
// it.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/knowledge/dual.h"
#include "vss/knowledge/syntax.h"

namespace vss {

struct Instruction {
  Op op = Op::kConstant;  // kName: a dimension, whose index is `a`
  int a = -1, b = -1;
  double value = 0;
};

using Program = std::vector<Instruction>;

// The value of every instruction at `dimensions_mm`.
std::vector<double> Evaluate(const Program& program, std::span<const double> dimensions_mm);
// The same with derivatives.
std::vector<Dual> EvaluateDual(const Program& program, std::span<const double> dimensions_mm);

// What values each instruction can take where each dimension stays in its interval: a superset.
struct Interval {
  double min = 0, max = 0;
};
std::vector<Interval> EvaluateInterval(const Program& program, std::span<const Interval> dimensions_mm);

}  // namespace vss
