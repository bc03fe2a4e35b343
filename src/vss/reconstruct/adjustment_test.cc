#include "vss/reconstruct/adjustment.h"

#include <gtest/gtest.h>

#include "vss/reconstruct/adjustment_scene.h"

namespace vss {
namespace {

using namespace test;

TEST(Adjustment, FindsTheTruthFromMillimetresOff) {
  const Scene scene;
  Adjustment a = scene.Make();
  std::mt19937 random(1);
  Observe(a, 1e-4, random, a.groups);
  for (auto& p : a.parts) {
    VectorXd x = p.object.State();
    x[0] += 3, x[1] -= 2, x[3] += 0.005, x[6] += 4, x[7] -= 3, x[8] += 2;
    p.object.SetState(x);
  }
  a.Solve(12, true);
  for (std::size_t p = 0; p < 2; ++p)
    EXPECT_LT((a.parts[p].object.State() - scene.parts[p].object.State()).cwiseAbs().maxCoeff(), 0.02) << p;
}

// Mean squared error against the bound (the covariance), and coverage of the 95 % regions, with calibration
// errors drawn from their priors.
TEST(Adjustment, CovarianceIsTheScatterOfSimulatedScenes) {
  const Scene scene;
  constexpr int kRuns = 60;
  std::mt19937 random(7);
  double sum = 0;
  int covered = 0, count = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Adjustment truth = DrawnTruth(scene, random);
    Adjustment a = scene.Make();
    Observe(truth, 0.05, random, a.groups);
    a.Solve(6, true);
    a.ComputeCovariance();
    for (int p = 0; p < 2; ++p) {
      std::vector<int> free;
      for (int i = 0; i < a.parts[static_cast<std::size_t>(p)].object.StateSize(); ++i)
        if (i != 4 && i != 5) free.push_back(i);
      const VectorXd e = (a.parts[static_cast<std::size_t>(p)].object.State() -
                          scene.parts[static_cast<std::size_t>(p)].object.State())(free);
      const MatrixXd c = a.PartCovariance(p)(free, free);
      const double chi = e.dot(c.ldlt().solve(e));
      const double limit = free.size() == 7 ? 14.07 : 16.92;  // chi-square, 95 %
      sum += chi / static_cast<double>(free.size());
      covered += chi < limit;
      ++count;
    }
  }
  EXPECT_GT(sum / count, 1 / 1.5);
  EXPECT_LT(sum / count, 1.5);
  EXPECT_GE(covered, 0.88 * count);  // 120 regions: 95 % +- 2 %
  EXPECT_LE(covered, count);
}

// The box's length and height are held at values off by their sigma, and nothing else is off: the tee on it
// is as high as the box is taken to be.
TEST(Adjustment, WhatHangsOnAHeldDimensionIsAsUncertainAsThat) {
  const Scene scene;
  constexpr int kRuns = 40, kLength = kPlacementSize, kHeight = kPlacementSize + 2, kTeeZ = 2;
  constexpr double kHeldSigmaMm = 0.5;
  std::mt19937 random(13);
  std::normal_distribution<double> off(0, kHeldSigmaMm);
  double squares = 0, variances = 0, taken_for_certain = 0;
  for (int run = 0; run < kRuns; ++run) {
    Adjustment a = scene.Make();
    Observe(a, 0.02, random, a.groups);
    auto& box = a.parts[0];
    box.held_covariance = MatrixXd::Zero(box.object.StateSize(), box.object.StateSize());
    for (int i : {kLength, kHeight}) {
      box.free[static_cast<std::size_t>(i)] = false;
      box.held_covariance(i, i) = kHeldSigmaMm * kHeldSigmaMm;
      box.object.dimensions_mm[static_cast<std::size_t>(i - kPlacementSize)] += off(random);
    }
    a.Solve(6, true);
    a.ComputeCovariance();
    squares += std::pow(a.parts[1].object.placement[kTeeZ] - scene.parts[1].object.placement[kTeeZ], 2);
    variances += a.PartCovariance(1)(kTeeZ, kTeeZ);
    EXPECT_NEAR(std::sqrt(a.PartCovariance(0)(kLength, kLength)), kHeldSigmaMm, 1e-9);
    box.held_covariance.setZero();
    a.ComputeCovariance();
    EXPECT_EQ(a.PartCovariance(0)(kLength, kLength), 0);
    taken_for_certain += a.PartCovariance(1)(kTeeZ, kTeeZ);
  }
  EXPECT_GT(squares, 0.5 * variances);
  EXPECT_LT(squares, 1.7 * variances);
  EXPECT_LT(taken_for_certain, 0.5 * variances);
}

TEST(Adjustment, AStopThatIsOffIsFound) {
  const Scene scene;
  Adjustment truth = scene.Make();
  truth.stops[2].value = Vector3d(0.4, -0.3, 0.2);
  Adjustment a = scene.Make();
  std::mt19937 random(3);
  Observe(truth, 0.02, random, a.groups);
  a.Solve(8, true);
  EXPECT_LT((a.stops[2].value - truth.stops[2].value).norm(), 0.25);
  EXPECT_GT(a.stops[2].value.x() - a.stops[1].value.x(), 0.2);
}

// The box's foot at one end, seen in two pictures only, is taken for the border of its shadow; the edge above
// is seen in all. Adjusted again and again, as when edges are measured anew, that edge keeps its place.
TEST(Adjustment, AWrongEdgeDoesNotPullARightOneOffFromRoundToRound) {
  const Scene scene;
  constexpr double kShadowPx = 1.2;
  Adjustment a = scene.Make();
  a.options.bias_px = AdjustmentOptions{}.bias_px;
  std::mt19937 random(11);
  Observe(a, 0.02, random, a.groups);
  const WorldSolid box = PlaceSolid(a.parts[0].object, false);
  const Vector3d middle = a.parts[0].object.placement.head<3>();
  const Vector3d along(std::cos(0.3), std::sin(0.3), 0);
  // Of the edges across the box at that end, the lower one; -1: another edge, 1: the upper one.
  const auto at_the_end = [&](const ObservationGroup& g) {
    if (g.part != 0) return -1;
    const auto& edge = box.edges[static_cast<std::size_t>(g.observations[0].sample.index)];
    const Vector3d &p = box.vertices[static_cast<std::size_t>(edge.start)].point,
                   &q = box.vertices[static_cast<std::size_t>(edge.end)].point;
    if (along.dot(p - middle) > -400 || along.dot(q - middle) > -400 || std::abs(p.z() - q.z()) > 1)
      return -1;
    return p.z() > 1 ? 1 : 0;
  };
  int feet = 0, tops = 0;
  // The edge above lies in uneven light, all others in even light.
  std::normal_distribution<double> even(0, 0.01), uneven(0, 0.2);
  for (auto& g : a.groups) {
    const int end = at_the_end(g);
    const double own = end == 1 ? uneven(random) : even(random);
    tops += end == 1;
    if (end != 0) {
      for (auto& o : g.observations) o.measured += own * o.normal;
      continue;
    }
    g.edge_class = ContourClass::kContact;
    if (++feet > 2) g.observations.clear();
    const auto& view = a.AdjustedViews()[static_cast<std::size_t>(g.view)];
    for (auto& o : g.observations) {
      const auto beyond = view.ProjectInside(o.sample.point_in_world - 5 * along);
      const double side = beyond && o.normal.dot(*beyond - o.measured) > 0 ? 1 : -1;
      o.measured += side * kShadowPx * o.normal;
    }
  }
  std::erase_if(a.groups, [](const auto& g) { return g.observations.empty(); });
  ASSERT_GE(feet, 2);
  ASSERT_GE(tops, 4);
  const auto length = [&] { return a.parts[0].object.dimensions_mm[0]; };
  a.Solve(4, true);
  const double first = length();
  for (int round = 0; round < 8; ++round) a.Solve(4, true);
  EXPECT_NEAR(length(), first, 0.1);
  EXPECT_NEAR(length(), 900, 2);  // a third of a pixel
}

// Against the adjustment without the picture's observations, with the weights as they were.
TEST(Adjustment, TellsWhatAPictureChangesWithoutSolvingAnew) {
  const Scene scene;
  Adjustment a = scene.Make();
  std::mt19937 random(5);
  Observe(a, 0.03, random, a.groups);
  constexpr int kView = 3;
  for (auto& g : a.groups)
    if (g.view == kView)
      for (auto& o : g.observations) o.measured.x() += 0.1;
  a.Solve(20, true);
  a.ComputeCovariance();
  const auto changes = a.ChangesWithout(kView);
  Adjustment without = a;
  std::erase_if(without.groups, [&](const auto& g) { return g.view == kView; });
  without.ComputeCovariance();
  for (int p = 0; p < 2; ++p) {
    const auto& c = changes[static_cast<std::size_t>(p)];
    const VectorXd step = without.StepOf(p);
    const VectorXd more = without.PartCovariance(p).diagonal() - a.PartCovariance(p).diagonal();
    for (Eigen::Index i = 0; i < step.size(); ++i) {
      if (i == 4 || i == 5) continue;
      const double sigma = std::sqrt(a.PartCovariance(p)(i, i));
      EXPECT_NEAR(c.step[i], step[i], 0.02 * sigma) << p << " " << i;
      EXPECT_NEAR(c.sigma[i] * c.sigma[i], more[i], 1e-6 * sigma * sigma) << p << " " << i;
    }
  }
  EXPECT_GT(changes[0].step.cwiseAbs().maxCoeff(), 0);
}

TEST(Adjustment, AKnownLengthGivesTheWholeItsScale) {
  const Scene scene;
  constexpr double kScale = 2e-3;
  // Cameras that stand where the file says, less the scale: all that is seen is larger.
  Adjustment truth = scene.Make();
  std::mt19937 random(9);
  Adjustment a = scene.Make();
  Observe(truth, 0.02, random, a.groups);
  a.options.known_lengths = {{0, 0, 900 * (1 + kScale), 0.05}};
  a.Solve(12, true);
  a.ComputeCovariance();
  EXPECT_GT(a.ScaleSigma(), 0);
  EXPECT_NEAR(a.scale, kScale, 4 * a.ScaleSigma());
  EXPECT_LT(a.ScaleSigma(), 0.2 * kScale);
  EXPECT_NEAR(a.parts[1].object.dimensions_mm[0], 600 * (1 + kScale), 0.2);
}

}  // namespace
}  // namespace vss
