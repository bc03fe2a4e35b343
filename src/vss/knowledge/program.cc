#include "vss/knowledge/program.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vss {
namespace {

double Apply(Op op, double a, double b) {
  switch (op) {
    case Op::kAdd:
      return a + b;
    case Op::kSubtract:
      return a - b;
    case Op::kMultiply:
      return a * b;
    case Op::kDivide:
      return a / b;
    case Op::kNegate:
      return -a;
    case Op::kMin:
      return std::min(a, b);
    case Op::kMax:
      return std::max(a, b);
    case Op::kAbs:
      return std::abs(a);
    case Op::kSqrt:
      return std::sqrt(std::max(a, 0.0));
    default:
      return 0;
  }
}

Dual Apply(Op op, const Dual& a, const Dual& b) {
  switch (op) {
    case Op::kAdd:
      return a + b;
    case Op::kSubtract:
      return a - b;
    case Op::kMultiply:
      return a * b;
    case Op::kDivide:
      return a / b;
    case Op::kNegate:
      return -a;
    case Op::kMin:
      return Min(a, b);
    case Op::kMax:
      return Max(a, b);
    case Op::kAbs:
      return Abs(a);
    case Op::kSqrt:
      return Sqrt(a);
    default:
      return a;
  }
}

Interval Hull(std::initializer_list<double> values) { return {std::min(values), std::max(values)}; }

Interval Product(Interval a, Interval b) {
  return Hull({a.min * b.min, a.min * b.max, a.max * b.min, a.max * b.max});
}

Interval Apply(Op op, Interval a, Interval b) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  switch (op) {
    case Op::kAdd:
      return {a.min + b.min, a.max + b.max};
    case Op::kSubtract:
      return {a.min - b.max, a.max - b.min};
    case Op::kMultiply:
      return Product(a, b);
    case Op::kDivide:
      if (b.min <= 0 && b.max >= 0) return {-kInfinity, kInfinity};
      return Product(a, {1 / b.max, 1 / b.min});
    case Op::kNegate:
      return {-a.max, -a.min};
    case Op::kMin:
      return {std::min(a.min, b.min), std::min(a.max, b.max)};
    case Op::kMax:
      return {std::max(a.min, b.min), std::max(a.max, b.max)};
    case Op::kAbs:
      return {a.min > 0 ? a.min : a.max < 0 ? -a.max : 0.0, std::max(std::abs(a.min), std::abs(a.max))};
    case Op::kSqrt:
      return {std::sqrt(std::max(a.min, 0.0)), std::sqrt(std::max(a.max, 0.0))};
    default:
      return a;
  }
}

template <class T, class Leaf>
std::vector<T> Run(const Program& program, const Leaf& leaf) {
  std::vector<T> values;
  values.reserve(program.size());
  for (const Instruction& i : program) {
    if (i.op == Op::kConstant || i.op == Op::kName)
      values.push_back(leaf(i));
    else
      values.push_back(Apply(i.op, values[i.a], values[i.b >= 0 ? i.b : i.a]));
  }
  return values;
}

}  // namespace

std::vector<double> Evaluate(const Program& program, std::span<const double> dimensions_mm) {
  return Run<double>(program,
                     [&](const Instruction& i) { return i.op == Op::kName ? dimensions_mm[i.a] : i.value; });
}

std::vector<Dual> EvaluateDual(const Program& program, std::span<const double> dimensions_mm) {
  const int n = static_cast<int>(dimensions_mm.size());
  return Run<Dual>(program, [&](const Instruction& i) {
    return i.op == Op::kName ? Dual::Variable(dimensions_mm[i.a], i.a, n) : Dual::Constant(i.value, n);
  });
}

std::vector<Interval> EvaluateInterval(const Program& program, std::span<const Interval> dimensions_mm) {
  return Run<Interval>(program, [&](const Instruction& i) {
    return i.op == Op::kName ? dimensions_mm[i.a] : Interval{i.value, i.value};
  });
}

}  // namespace vss
