#include "vss/identify/refine.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "vss/identify/contour_targets.h"
#include "vss/identify/fit_to_lines.h"
#include "vss/identify/vote.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// All of the state may move but the height and the tilt.
std::vector<bool> FreeOfUpright(const PlacedObject& object) {
  std::vector<bool> free(std::size_t(object.StateSize()), true);
  free[2] = free[4] = free[5] = false;
  return free;
}

// A tall part may lean by a degree or so, which moves its top against its foot further than lines are looked
// for.
void RefineLean(Hypothesis& h, const SeedContext& context) {
  constexpr double kUsualLean = 1 * kPi / 180, kMaxLean = 3 * kPi / 180;
  constexpr double kLeans =
      10;  // log-odds that leaning must bring: two more parameters, and most parts stand upright
  constexpr double kFirstReach = 4, kLastReach = 1;  // tolerances
  const double tolerance = context.scene.tolerance_px;
  const WorldSolid upright = PlaceSolid(h.object, false);
  double top = h.object.placement[2];
  for (const auto& v : upright.vertices) top = std::max(top, v.point.z());
  if ((top - h.object.placement[2]) * kUsualLean < tolerance * context.mm_per_px) return;
  std::vector<bool> free(std::size_t(h.object.StateSize()), true);
  free[2] = false;
  PlacedObject leaning = h.object;
  FitToLines(leaning, h.views, context.scene, free, kFirstReach * tolerance, kLastReach * tolerance, 8,
             context.others);
  if (leaning.placement.tail<2>().norm() > kMaxLean || !Allowed(leaning)) return;
  const double after = FullLogOdds(leaning, h.views, context);
  if (after < h.log_odds + kLeans) return;
  h.log_odds = after;
  h.object = leaning;
}

// What the contours of `goal` at `from_z_mm` and above demand of `now`.
NormalEquations DemandsOf(const WorldSolid& goal, double from_z_mm, const WorldSolid& now, int state_size) {
  NormalEquations normal(state_size);
  for (std::size_t i = 0; i < now.vertices.size(); ++i) {
    const Vector3d& at = goal.vertices[i].point;
    if (at.z() < from_z_mm) continue;
    for (int axis = 0; axis < 3; ++axis)
      normal.Add(now.vertices[i].by_state.row(axis), now.vertices[i].point[axis] - at[axis], 1);
  }
  for (std::size_t i = 0; i < now.circles.size(); ++i) {
    const auto &c = now.circles[i], &at = goal.circles[i];
    if (at.center.point.z() < from_z_mm) continue;
    for (int axis = 0; axis < 3; ++axis)
      normal.Add(c.center.by_state.row(axis), c.center.point[axis] - at.center.point[axis], 1);
    normal.Add(c.radius_by_state, c.radius_mm - at.radius_mm, 1);
  }
  return normal;
}

}  // namespace

std::optional<PlacedObject> MovedTo(const WorldSolid& goal, double from_z_mm, PlacedObject object) {
  constexpr int kIterations = 4;
  constexpr double kWeakHold = 1e-3;  // of one vertex: on dimensions that none of those contours shows
  const std::vector<double> start = object.dimensions_mm;
  const int n = object.StateSize();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    auto [a, b] = DemandsOf(goal, from_z_mm, PlaceSolid(object), n);
    for (int i = kPlacementSize; i < n; ++i) {
      const auto d = std::size_t(i - kPlacementSize);
      a(i, i) += kWeakHold;
      b[i] -= kWeakHold * (object.dimensions_mm[d] - start[d]);
    }
    HoldUpright(a, b);
    const Eigen::VectorXd state = object.State() + Eigen::VectorXd(a.ldlt().solve(b));
    if (!state.allFinite()) return std::nullopt;
    object.SetState(state);
  }
  return object;
}

std::optional<Hypothesis> Reseat(const Hypothesis& hypothesis, const SeedContext& context,
                                 double support_z_mm) {
  Hypothesis h = hypothesis;
  const WorldSolid before = PlaceSolid(h.object, false);
  // What is hardly higher than the new support was its own foot, and moves with it.
  const double stays_mm = support_z_mm + 2 * context.mm_per_px;
  h.object.placement[2] = support_z_mm;
  auto moved = MovedTo(before, stays_mm, std::move(h.object));
  if (!moved) return std::nullopt;
  h.object = std::move(*moved);
  const auto defs = h.object.model->dimensions();
  if (!InRange(h.object, 2 * context.mm_per_px)) return std::nullopt;
  for (std::size_t i = 0; i < defs.size(); ++i)
    h.object.dimensions_mm[i] = std::clamp(h.object.dimensions_mm[i], defs[i].min_mm, defs[i].max_mm);
  if (!Allowed(h.object)) return std::nullopt;
  RefineAndWeigh(h, context);
  return h;
}

void RefineAndWeigh(Hypothesis& h, const SeedContext& context) {
  constexpr double kHopeless = -60;  // no fit within a few pixels brings that much
  constexpr double kFarPx = 30;      // an object that moves so far is fitted to other lines
  constexpr double kStillPx = 0.02;  // no line tells where a contour is to within that
  const std::vector<bool> free = FreeOfUpright(h.object);
  const double tolerance = context.scene.tolerance_px;
  const PlacedObject start = h.object;
  std::vector<PlacedObject> weighed{start};
  h.log_odds = FullLogOdds(start, h.views, context);
  if (h.log_odds < kHopeless) return;
  // A wide reach forgives a poor start, a narrow one is not led astray by neighbours: what explains most is
  // kept.
  for (double reach : {3.0, 2.0, 1.0}) {
    PlacedObject fitted = reach == 1.0 ? h.object : start;
    FitToLines(fitted, h.views, context.scene, free, reach * tolerance, tolerance, 5, context.others);
    const double moved_mm = (fitted.placement.head<2>() - start.placement.head<2>()).norm();
    if (moved_mm > kFarPx * context.mm_per_px || !Allowed(fitted)) continue;
    // Fits from near and far mostly end in one place.
    if (std::any_of(weighed.begin(), weighed.end(), [&](const PlacedObject& o) {
          return SamePlace(o, fitted, kStillPx * context.mm_per_px);
        }))
      continue;
    weighed.push_back(fitted);
    const double after = FullLogOdds(fitted, h.views, context);
    if (after <= h.log_odds) continue;
    h.log_odds = after;
    h.object = fitted;
  }
  RefineLean(h, context);
}

std::vector<Eigen::VectorXd> WeakDirections(const Hypothesis& hypothesis, const SeedContext& context) {
  constexpr int kMost = 3;
  constexpr double kWeak = 0.3;  // px^2 per mm^2: what some ten samples on lines tell
  const std::vector<bool> free = FreeOfUpright(hypothesis.object);
  PlacedObject unmoved = hypothesis.object;
  const double tolerance = context.scene.tolerance_px;
  const FitToLinesResult fit =
      FitToLines(unmoved, hypothesis.views, context.scene, free, tolerance, tolerance, 1, context.others);
  if (fit.information.size() == 0) return {};
  // In mm: a turn by what it moves the ends.
  double reach = 1;
  for (const auto& v : PlaceSolid(hypothesis.object, false).vertices)
    reach = std::max(reach, (v.point - hypothesis.object.placement.head<3>()).norm());
  std::vector<int> states;
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(hypothesis.object.StateSize());
  scale[3] = 1 / reach;
  for (int i = 0; i < int(free.size()); ++i)
    if (free[std::size_t(i)]) states.push_back(i);
  const int n = int(states.size());
  Eigen::MatrixXd a(n, n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      a(i, k) = fit.information(states[std::size_t(i)], states[std::size_t(k)]) *
                scale[states[std::size_t(i)]] * scale[states[std::size_t(k)]];
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
  std::vector<Eigen::VectorXd> out;
  for (int way = 0; way < std::min(n, kMost) && solver.eigenvalues()[way] < kWeak; ++way) {
    Eigen::VectorXd direction = Eigen::VectorXd::Zero(hypothesis.object.StateSize());
    for (int i = 0; i < n; ++i)
      direction[states[std::size_t(i)]] = solver.eigenvectors()(i, way) * scale[states[std::size_t(i)]];
    const double largest = direction.tail(direction.size() - kPlacementSize).cwiseAbs().maxCoeff();
    if (largest < 0.1) continue;  // it moves as a whole
    out.push_back(direction / largest);
  }
  return out;
}

std::vector<Hypothesis> Slides(const Hypothesis& hypothesis, const SeedContext& context) {
  constexpr double kFarMm = 400;       // an end is not lost further
  constexpr std::size_t kRefined = 2;  // of each way
  std::vector<Hypothesis> out;
  for (const Eigen::VectorXd& direction : WeakDirections(hypothesis, context)) {
    std::vector<Hypothesis> better;
    for (double far :
         VoteAlong(hypothesis.object, direction, -kFarMm, kFarMm, hypothesis.views, context.scene)) {
      Hypothesis h = hypothesis;
      h.object.SetState(hypothesis.object.State() + far * direction);
      if (!InRange(h.object, 0) || !Allowed(h.object)) continue;
      h.log_odds = FullLogOdds(h.object, h.views, context);
      better.push_back(std::move(h));
    }
    std::stable_sort(better.begin(), better.end(),
                     [](const Hypothesis& x, const Hypothesis& y) { return x.log_odds > y.log_odds; });
    if (better.size() > kRefined) better.resize(kRefined);
    for (auto& h : better) {
      RefineAndWeigh(h, context);
      if (h.log_odds > hypothesis.log_odds) out.push_back(std::move(h));
    }
  }
  return out;
}

}  // namespace vss
