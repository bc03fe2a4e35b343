#include "vss/calibrate/board_solver.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "vss/calibrate/intrinsic.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Intrinsics Lens(LensModel model) {
  Intrinsics k{model, 531, 542, 261.8, 258.9, {}, 0, 0};
  if (model == LensModel::kOpenCv) k.distortion = {-0.12, 0.02, 6e-4, -7.5e-4}, k.num_distortion = 4;
  if (model == LensModel::kWeng)
    k.distortion = {0.11, 6e-4, -3e-4, 12e-4, -6e-4, 0.02}, k.num_distortion = 6;  // g1 = g3 / 2, g2 = g4 / 2
  return k;
}

// Ten boards of 9 x 7 marks, tilted by up to `tilt_rad` about different axes.
std::vector<BoardView> Views(const Intrinsics& lens, double noise_px, unsigned seed, double tilt_rad = 0.55,
                             double bow_mm = 0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::vector<BoardView> views;
  for (int v = 0; v < 10; ++v) {
    const double axis = 2.4 * v, tilt = tilt_rad * (0.6 + 0.4 * (v % 3) / 2.0);
    const Eigen::Matrix3d r = RotationFromVector(tilt * Vector3d(std::cos(axis), std::sin(axis), 0)) *
                              RotationFromVector(0.3 * v * Vector3d::UnitZ());
    const RigidTransform pose{
        r, Vector3d(60 * std::cos(v), 60 * std::sin(2 * v), 620 + 25 * (v % 4)) - r * Vector3d(200, 150, 0)};
    BoardView view;
    view.anchored = true;
    for (int j = 0; j < 7; ++j)
      for (int i = 0; i < 9; ++i) {
        const Vector2d p(50 * i, 50 * j);
        const double x = p.x() / 200 - 1, y = p.y() / 150 - 1;
        const auto img = lens.Project(pose * Vector3d(p.x(), p.y(), bow_mm * (1 - x * x + 1 - y * y)));
        if (!img || img->minCoeff() < 0 || img->maxCoeff() > 511) continue;
        view.point_in_board.push_back(p);
        view.img.push_back(*img + noise_px * Vector2d(noise(random), noise(random)));
      }
    views.push_back(view);
  }
  return views;
}

BoardProblemOptions Problem(LensModel model) {
  BoardProblemOptions options;
  options.model = model;
  options.terms = DefaultTerms(model);
  options.board_size_mm = {400, 300};
  options.width_px = options.height_px = 512;
  return options;
}

class BoardSolverTest : public testing::TestWithParam<LensModel> {};

TEST_P(BoardSolverTest, ExactMarksGiveTheLensBack) {
  const Intrinsics truth = Lens(GetParam());
  const auto solution = SolveBoards(Views(truth, 0, 1), Problem(GetParam()));
  ASSERT_TRUE(solution) << solution.error().message;
  EXPECT_LT(solution->rms_px, 1e-6);
  EXPECT_NEAR(solution->intrinsics.fx_px, truth.fx_px, 1e-4);
  EXPECT_NEAR(solution->intrinsics.fy_px, truth.fy_px, 1e-4);
  EXPECT_NEAR(solution->intrinsics.cx_px, truth.cx_px, 1e-4);
  for (int i = 0; i < truth.num_distortion; ++i)
    EXPECT_NEAR(solution->intrinsics.distortion[i], truth.distortion[i], 1e-6) << i;
}

TEST_P(BoardSolverTest, NoSmallChangeOfTheLensLowersTheResidual) {
  // The optimum is the optimum: poses solved anew for every changed lens.
  const auto views = Views(Lens(GetParam()), 0.1, 3);
  const auto problem = Problem(GetParam());
  const auto solution = SolveBoards(views, problem);
  ASSERT_TRUE(solution);
  for (int i = 0; i < 4; ++i)
    for (double h : {-0.3, 0.3}) {
      BoardSolution other = *solution;
      double* value[] = {&other.intrinsics.fx_px, &other.intrinsics.fy_px, &other.intrinsics.cx_px,
                         &other.intrinsics.cy_px};
      *value[i] += h;
      EXPECT_GT(SolveBoardPoses(views, problem, other)->rms_px, solution->rms_px) << i;
    }
}

TEST_P(BoardSolverTest, CovarianceIsTheScatterOfNoisyRuns) {
  constexpr int kTrials = 60;
  const Intrinsics truth = Lens(GetParam());
  const auto problem = Problem(GetParam());
  double nees = 0;
  for (int i = 0; i < kTrials; ++i) {
    const auto s = SolveBoards(Views(truth, 0.05, 100 + i), problem);
    ASSERT_TRUE(s);
    Eigen::VectorXd e(8);
    const auto& k = s->intrinsics;
    const double p1 = GetParam() == LensModel::kWeng ? truth.distortion[1] : truth.distortion[2],
                 p2 = GetParam() == LensModel::kWeng ? truth.distortion[2] : truth.distortion[3];
    const double k2 = GetParam() == LensModel::kWeng ? truth.distortion[5] : truth.distortion[1];
    e << k.fx_px - truth.fx_px, k.fy_px - truth.fy_px, k.cx_px - truth.cx_px, k.cy_px - truth.cy_px,
        s->term_values[0] - truth.distortion[0], s->term_values[1] - k2, s->term_values[2] - p1,
        s->term_values[3] - p2;
    nees += e.dot(s->covariance.ldlt().solve(e)) / 8 / kTrials;
  }
  EXPECT_NEAR(nees, 1, 0.28);  // four sigma of a chi-square of 480
}

INSTANTIATE_TEST_SUITE_P(Models, BoardSolverTest, testing::Values(LensModel::kOpenCv, LensModel::kWeng));

TEST(BoardSolver, FindsTheBowOfABoard) {
  auto problem = Problem(LensModel::kOpenCv);
  const auto views = Views(Lens(LensModel::kOpenCv), 0.02, 5, 0.55, 0.6);
  const auto flat = SolveBoards(views, problem);
  problem.estimate_bow = true;
  const auto bowed = SolveBoards(views, problem);
  ASSERT_TRUE(flat && bowed);
  EXPECT_NEAR(bowed->bow_mm.x(), 0.6, 0.03);
  EXPECT_NEAR(bowed->bow_mm.y(), 0.6, 0.03);
  EXPECT_LT(bowed->rms_px, 0.5 * flat->rms_px);
  EXPECT_LT(std::abs(bowed->intrinsics.fx_px - 531), 0.3 * std::abs(flat->intrinsics.fx_px - 531));
}

TEST(BoardSolver, EccentricityOfADiscIsThatOfItsPicture) {
  // Against the closed form for a pinhole: the centre of the conic H^-T C H^-1.
  const Intrinsics lens{LensModel::kPinhole, 1000, 1000, 256, 256, {}, 0, 0};
  const RigidTransform pose{RotationFromVector(Vector3d(0.7, 0, 0)), Vector3d(10, -20, 600)};
  const double radius = 8;
  const Vector2d p(20, 30);
  Eigen::Matrix3d k, h, circle;
  k << 1000, 0, 256, 0, 1000, 256, 0, 0, 1;
  h << pose.rotation.col(0), pose.rotation.col(1), pose.translation;
  h = k * h;
  circle << 1, 0, -p.x(), 0, 1, -p.y(), -p.x(), -p.y(), p.squaredNorm() - radius * radius;
  const Eigen::Matrix3d conic = h.inverse().transpose() * circle * h.inverse();
  const Vector2d centre = -conic.topLeftCorner<2, 2>().inverse() * conic.topRightCorner<2, 1>();
  const Vector2d expected = centre - *lens.Project(pose * Vector3d(p.x(), p.y(), 0));
  EXPECT_GT(expected.norm(), 0.03);
  EXPECT_LT((DiscEccentricity(lens, pose, p, radius) - expected).norm(), 0.02 * expected.norm());
}

TEST(BoardSolver, MarksOnALineSpanNoPlane) {
  EXPECT_FALSE(HomographyFromMarks({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}},
                                   {{0, 0}, {10, 1}, {20, 2}, {30, 3}, {40, 4}}));
}

TEST(Maps, AnotherLensTurnedDiffersByNothing) {
  Intrinsics a = Lens(LensModel::kPinhole), b = a;
  EXPECT_LT(LensDifference(a, b, 512, 512).max, 1e-9);
  b.fx_px *= 1.001, b.fy_px *= 1.001;
  const auto map = LensDifference(a, b, 512, 512);
  EXPECT_GT(map.rms, 0.1);
  EXPECT_LT(map.max, 0.5);
}

}  // namespace
}  // namespace vss
