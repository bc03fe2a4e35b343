#include "vss/feature/marks_lattice.h"

#include <Eigen/LU>
#include <cmath>
#include <deque>
#include <map>
#include <optional>

namespace vss {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// How far, in steps of the lattice, a neighbour may lie from where the step before predicts it: perspective
// and lens change a step by some 20 % from mark to mark at most.
constexpr double kStepTolerance = 0.33;

struct Node {
  int column = 0, row = 0;
  Matrix2d steps;  // columns: one column on, one row on (px)
};

// Which unit step leads to `delta`; empty where none does.
std::optional<std::pair<int, int>> StepOf(const Matrix2d& steps, const Vector2d& delta) {
  const Vector2d s = steps.inverse() * delta;
  for (const auto& [a, b] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
    if ((s - Vector2d(a, b)).norm() < kStepTolerance) return std::pair{a, b};
  return std::nullopt;
}

// A seed needs two steps that are not collinear; the more of its neighbours they explain the better.
std::optional<Matrix2d> SeedSteps(const std::vector<Vector2d>& points, const std::vector<int>& near, int seed,
                                  int& explained) {
  std::optional<Matrix2d> best;
  explained = 0;
  for (int a : near)
    for (int b : near) {
      Matrix2d steps;
      steps << points[a] - points[seed], points[b] - points[seed];
      const double sine = steps.determinant() / (steps.col(0).norm() * steps.col(1).norm());
      if (!(sine > 0.2)) continue;  // right-handed, and at least 11 degrees apart
      int n = 0;
      for (int c : near) n += StepOf(steps, points[c] - points[seed]).has_value();
      if (n > explained) explained = n, best = steps;
    }
  return best;
}

std::map<int, Node> Grow(const std::vector<Vector2d>& points, const std::vector<std::vector<int>>& neighbours,
                         int seed, const Matrix2d& steps) {
  std::map<int, Node> nodes{{seed, {0, 0, steps}}};
  std::map<std::pair<int, int>, int> taken{{{0, 0}, seed}};
  std::deque<int> open{seed};
  while (!open.empty()) {
    const int p = open.front();
    open.pop_front();
    const Node node = nodes[p];
    for (int q : neighbours[p]) {
      if (nodes.count(q)) continue;
      const Vector2d delta = points[q] - points[p];
      const auto step = StepOf(node.steps, delta);
      if (!step) continue;
      const std::pair<int, int> label{node.column + step->first, node.row + step->second};
      if (taken.count(label)) continue;
      Node next{label.first, label.second, node.steps};
      if (step->first)
        next.steps.col(0) = step->first * delta;
      else
        next.steps.col(1) = step->second * delta;
      nodes[q] = next;
      taken[label] = q;
      open.push_back(q);
    }
  }
  return nodes;
}

}  // namespace

std::vector<LatticeLabel> LabelLattice(const std::vector<Vector2d>& points,
                                       const std::vector<std::vector<int>>& neighbours) {
  std::vector<bool> used(points.size(), false);
  std::map<int, Node> best;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (used[i] || neighbours[i].size() < 3) continue;
    int explained = 0;
    const auto steps = SeedSteps(points, neighbours[i], static_cast<int>(i), explained);
    if (!steps || explained < 3) continue;
    auto nodes = Grow(points, neighbours, static_cast<int>(i), *steps);
    for (const auto& entry : nodes) used[entry.first] = true;
    if (nodes.size() > best.size()) best = std::move(nodes);
  }
  std::vector<LatticeLabel> labels;
  for (const auto& [p, node] : best) labels.push_back({p, node.column, node.row});
  return labels;
}

}  // namespace vss
