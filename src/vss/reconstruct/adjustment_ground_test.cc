#include <gtest/gtest.h>

#include "vss/reconstruct/adjustment_scene.h"

namespace vss {
namespace {

using namespace test;

constexpr double kChiSquare = 21.1;  // three degrees of freedom, 1 in 10000

// The scene's parts, moved as one body onto the plane.
std::vector<AdjustedPart> OnPlane(const Scene& scene, const Vector3d& height_and_slopes) {
  AdjustedGround ground;
  ground.value = height_and_slopes;
  std::vector<AdjustedPart> parts = scene.parts;
  const Eigen::Matrix3d turn =
      Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), ground.Normal()).toRotationMatrix();
  for (auto& p : parts) {
    auto& x = p.object.placement;
    const double yaw = x[3];
    x.head<3>() = turn * Vector3d(x.head<3>()) + Vector3d(0, 0, ground.value[0]);
    const Vector3d axis =
        RotationFromVector(Vector3d(0, 0, -yaw)) * Vector3d(ground.value[2], -ground.value[1], 0);
    x[4] = axis.x();
    x[5] = axis.y();
  }
  return parts;
}

TEST(AdjustmentGround, HeightAndSlopeAreFoundWhereTheyAreNotZero) {
  const Scene scene;
  const Vector3d there(4, 2e-3, -1.5e-3);
  Adjustment truth = scene.Make();
  truth.parts = OnPlane(scene, there);
  std::mt19937 random(2);
  Adjustment a = scene.Make();
  Observe(truth, 0.05, random, a.groups);
  a.Solve(4, false);
  ASSERT_GT(a.GainOfFreeingGround().chi_square, kChiSquare);
  EXPECT_FALSE(a.ground.free) << "to ask changes nothing";
  a.FreeGround();
  a.Solve(12, true);
  a.ComputeCovariance();
  const Vector3d sigma = a.GroundCovariance().diagonal().cwiseSqrt();
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.ground.value[i], there[i], 4 * sigma[i]) << i;
  EXPECT_LT(sigma[0], 0.6);
  EXPECT_LT(sigma[1], 5e-4);
  for (std::size_t p = 0; p < 2; ++p) {
    const WorldSolid is = PlaceSolid(a.parts[p].object, false),
                     should = PlaceSolid(truth.parts[p].object, false);
    for (std::size_t i = 0; i < is.vertices.size(); ++i)
      EXPECT_LT((is.vertices[i].point - should.vertices[i].point).norm(), 0.5) << p << " " << i;
  }
}

TEST(AdjustmentGround, NoiseAloneDoesNotMoveIt) {
  const Scene scene;
  std::mt19937 random(4);
  int beyond_95_percent = 0;
  constexpr int kRuns = 20;
  for (int run = 0; run < kRuns; ++run) {
    Adjustment truth = scene.Make();
    for (auto& c : truth.cameras) c.value = Draw(c.prior_covariance, random);
    Adjustment a = scene.Make();
    Observe(truth, 0.05, random, a.groups);
    a.Solve(6, true);
    const double gain = a.GainOfFreeingGround().chi_square;
    EXPECT_LT(gain, kChiSquare);
    beyond_95_percent += gain > 7.81;
  }
  EXPECT_LE(beyond_95_percent, 4);
}

// A part that leans against sloping ground touches it where it is lowest.
TEST(AdjustmentGround, ALeaningPartIsTiedToItByItsLowestVertex) {
  const Scene scene;
  const Vector3d there(2, 1e-3, 0);
  Adjustment truth = scene.Make();
  truth.parts = OnPlane(scene, there);
  PlacedObject& tee = truth.parts[1].object;
  tee.placement[4] += 0.02;
  const Vector3d normal = AdjustedGround{true, there}.Normal(), place = tee.placement.head<3>();
  double lowest = 0;
  for (const auto& v : PlaceSolid(tee, false).vertices)
    lowest = std::min(lowest, normal.dot(v.point - place));
  tee.placement[2] -= lowest / normal.z();
  std::mt19937 random(6);
  Adjustment a = scene.Make();
  Observe(truth, 0.02, random, a.groups);
  a.Solve(4, false);
  a.FreeGround();
  a.Solve(6, true);
  EXPECT_GT(a.GainOfLeaning(1, 0.02).chi_square, kChiSquare);
  a.Lean(1, 0.02);
  a.Solve(12, true);
  EXPECT_NEAR(a.parts[1].object.placement[4], truth.parts[1].object.placement[4], 2e-3);
  EXPECT_NEAR(a.ground.value[1], there[1], 5e-4);
}

}  // namespace
}  // namespace vss
