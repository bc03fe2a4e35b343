// A camera's place from a cube, against rendered cubes whose camera is known.
#include "vss/calibrate/cube.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <fstream>

#include "vss/calibrate/cube_synthetic.h"

namespace vss {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using synthetic::CubeLights;
using synthetic::LookAt;
using synthetic::RenderCube;
using synthetic::Scene;
using testing::HasSubstr;

const CubeSpec kCube{600, {1500, 900, 0}, 0.3};

Scene Camera400() {
  Scene s;
  s.width_px = s.height_px = 400;
  s.lens = {LensModel::kWeng, 520, 515, 203.2, 196.4, {0.05, 2e-4, -1e-4, 4e-4, -2e-4, 0.01}, 6, 0.01};
  s.noise_levels = 1.5;
  return s;
}

struct Rig {
  Scene scene = Camera400();
  CubeSpec cube = kCube;
  CubeLights lights;
  RigidTransform cam_from_world;  // at displacement zero
  Matrix3d axes = Matrix3d::Identity();

  CubePicture Picture(const Vector3d& gantry_mm, unsigned seed) const {
    Scene s = scene;
    s.seed = seed;
    RigidTransform at = cam_from_world;
    at.translation -= at.rotation * (axes * gantry_mm);
    return {fmt::format("cube{}.png", seed), RenderCube(s, cube, lights, at), gantry_mm};
  }
  Vector3d Centre() const { return cam_from_world.Inverse().translation; }
};

// Eight directions from which three faces are seen.
Rig RigOf(int i) {
  Rig rig;
  const double azimuth = 0.3 + 0.75 * i, height = 1900 + 100 * (i % 3), away = 1100 + 120 * (i % 4);
  const Vector3d centre =
      kCube.position_mm + Vector3d(away * std::cos(azimuth), away * std::sin(azimuth), height);
  rig.cam_from_world = LookAt(centre, kCube.position_mm + Vector3d(30 * (i % 3), -20, 250), 0.4 * i);
  return rig;
}

// Squared error over its covariance: the mean of a fit of six numbers that knows its uncertainty is 6.
double NormalisedError(const Rig& rig, const CubeResult& found) {
  Eigen::Matrix<double, 6, 1> error;
  error << VectorFromRotation(rig.cam_from_world.rotation * found.cam_from_world.rotation.transpose()),
      rig.cam_from_world.translation - found.cam_from_world.translation;
  return error.dot(found.covariance.ldlt().solve(error));
}

constexpr double kChi2Of6At999 = 22.5;

TEST(CubePlace, OneStopWithARoughPlaceGivesThePoseWithinItsSigma) {
  double sum = 0;
  for (int i = 0; i < 8; ++i) {
    const Rig rig = RigOf(i);
    const auto found = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, {rig.Picture({0, 0, 0}, i + 1)},
                                         rig.Centre() + Vector3d(200, -250, 150), {});
    ASSERT_TRUE(found) << i << ": " << found.error().message;
    const double normalised = NormalisedError(rig, *found);
    EXPECT_LT(normalised, kChi2Of6At999) << i;
    EXPECT_LT((found->cam_from_world.Inverse().translation - rig.Centre()).norm(), 1.0) << i;
    sum += normalised / 8;
  }
  // The sigma allows for chamfers and uneven light that these pictures do not have: it is not to be too
  // small.
  EXPECT_LT(sum, 8);
}

TEST(CubePlace, SeveralStopsDecideWithoutARoughPlace) {
  for (int i : {1, 4, 6}) {
    Rig rig = RigOf(i);
    rig.lights.shadow = 0.5;
    const std::vector<CubePicture> pictures{rig.Picture({0, 0, 0}, 1), rig.Picture({220, -60, 0}, 2),
                                            rig.Picture({-100, 210, 0}, 3)};
    const auto found = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, pictures, std::nullopt, {});
    ASSERT_TRUE(found) << i << ": " << found.error().message;
    EXPECT_LT(NormalisedError(rig, *found), kChi2Of6At999) << i;
    EXPECT_LT((found->cam_from_world.Inverse().translation - rig.Centre()).norm(), 1.0) << i;
    EXPECT_THAT(found->warnings, testing::IsEmpty());
    ASSERT_EQ(found->moves.size(), 2u);
    EXPECT_LT((found->moves[0].seen_mm - Vector3d(220, -60, 0)).norm(), 1.0);
    EXPECT_NEAR(found->cube_scale, 1, 5 * found->cube_scale_sigma);
  }
}

TEST(CubePlace, OneStopAloneLeavesSeveralPlacesAndSaysSo) {
  const Rig rig = RigOf(2);
  const auto found = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, {rig.Picture({0, 0, 0}, 1)}, {}, {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, HasSubstr("looks alike from "));
  EXPECT_THAT(found.error().message, HasSubstr("camera_near"));
}

TEST(CubePlace, TwoEqualStopsDecideNoMoreThanOne) {
  const Rig rig = RigOf(2);
  const auto found = CalibrateFromCube("cam1", rig.scene.lens, rig.cube,
                                       {rig.Picture({50, 0, 0}, 1), rig.Picture({50, 0, 0}, 2)}, {}, {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, HasSubstr("camera_near"));
}

TEST(CubePlace, AFarRoughPlaceIsWarnedOf) {
  const Rig rig = RigOf(3);
  const Vector3d far = rig.Centre() + 0.6 * (rig.Centre() - kCube.position_mm);
  // Further off than the places lie apart from which the cube looks alike: alone it decides nothing.
  const auto refused =
      CalibrateFromCube("cam1", rig.scene.lens, rig.cube, {rig.Picture({0, 0, 0}, 1)}, far, {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("camera_near does not decide"));
  const auto found = CalibrateFromCube(
      "cam1", rig.scene.lens, rig.cube,
      {rig.Picture({0, 0, 0}, 1), rig.Picture({220, -60, 0}, 2), rig.Picture({-100, 210, 0}, 3)}, far, {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_THAT(found->warnings, testing::ElementsAre(HasSubstr("camera_near is")));
}

TEST(CubePlace, PictureWithoutTheCubeIsRefused) {
  Rig rig = RigOf(0);
  rig.lights = {0.4, 0.4, {0.4, 0.4, 0.4, 0.4}, 0, 30};
  const auto found =
      CalibrateFromCube("cam1", rig.scene.lens, rig.cube, {rig.Picture({0, 0, 0}, 1)}, rig.Centre(), {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, HasSubstr("no cube of 600 mm was found where cube1.png"));
}

TEST(CubePlace, AWrongSizeIsContradictedByTheMoves) {
  const Rig rig = RigOf(1);
  const std::vector<CubePicture> pictures{rig.Picture({0, 0, 0}, 1), rig.Picture({220, -60, 0}, 2),
                                          rig.Picture({-100, 210, 0}, 3)};
  CubeSpec said = rig.cube;
  said.size_mm = 612;
  const auto found = CalibrateFromCube("cam1", rig.scene.lens, said, pictures, rig.Centre(), {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, HasSubstr("measure the cube"));
}

TEST(CubePlace, AWrongDisplacementAmongSeveralIsLeftOutAndNamed) {
  const Rig rig = RigOf(1);
  for (const Vector3d& off : {Vector3d(4, -3, 0), Vector3d(30, 0, 0), Vector3d(-400, 300, 0)})
    for (std::size_t wrong : {0u, 2u}) {
      std::vector<CubePicture> pictures{rig.Picture({0, 0, 0}, 1), rig.Picture({220, -60, 0}, 2),
                                        rig.Picture({-100, 210, 0}, 3)};
      pictures[wrong].gantry_mm += off;
      const auto found = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, pictures, rig.Centre(), {});
      ASSERT_TRUE(found) << found.error().message;
      EXPECT_THAT(found->warnings,
                  testing::ElementsAre(testing::AllOf(HasSubstr(pictures[wrong].file),
                                                      HasSubstr("left out; check the displacements"))));
      EXPECT_LT(NormalisedError(rig, *found), kChi2Of6At999);
    }
}

TEST(CubePlace, TwoStopsThatContradictEachOtherAreWarnedOfOrRefused) {
  const Rig rig = RigOf(1);
  std::vector<CubePicture> pictures{rig.Picture({0, 0, 0}, 1), rig.Picture({220, -60, 0}, 2)};
  pictures[1].gantry_mm += Vector3d(0, 0, 6);
  const auto warned = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, pictures, rig.Centre(), {});
  ASSERT_TRUE(warned) << warned.error().message;
  EXPECT_THAT(warned->warnings, testing::ElementsAre(HasSubstr("check the displacements")));
  pictures[1].gantry_mm += Vector3d(12, 0, 8);
  const auto refused = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, pictures, rig.Centre(), {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("check the displacements"));
}

TEST(CubePlace, ACameraThatLooksStraightDownNeedsTheMovesToTellItsTurn) {
  Rig rig;
  rig.cam_from_world = LookAt(kCube.position_mm + Vector3d(40, -30, 2400), kCube.position_mm, 0.7);
  const auto one = CalibrateFromCube("cam1", rig.scene.lens, rig.cube, {rig.Picture({0, 0, 0}, 1)},
                                     rig.Centre() + Vector3d(100, 100, 0), {});
  ASSERT_FALSE(one);
  EXPECT_THAT(one.error().message, HasSubstr("camera_near does not decide"));
  const auto found = CalibrateFromCube(
      "cam1", rig.scene.lens, rig.cube,
      {rig.Picture({0, 0, 0}, 1), rig.Picture({220, -60, 0}, 2), rig.Picture({-100, 210, 0}, 3)},
      rig.Centre() + Vector3d(100, 100, 0), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_LT(NormalisedError(rig, *found), kChi2Of6At999);
}

TEST(GantryAxes, ScaleSkewAndDirectionComeFromTwoCamerasAtManyStops) {
  Matrix3d axes = Matrix3d::Identity();
  axes << 1.012, 0.008, -0.002, -0.004, 0.998, 0.003, 0.001, -0.002, 1.002;
  std::vector<Rig> rigs{RigOf(1), RigOf(5)};
  const std::vector<Vector3d> stops{
      {0, 0, 0}, {230, -80, 0}, {-150, 180, 0}, {60, 120, 160}, {-90, -120, -140}};
  std::vector<std::vector<CubePicture>> pictures(2);
  std::vector<CubeJob> jobs;
  unsigned seed = 1;
  for (std::size_t k = 0; k < 2; ++k) {
    rigs[k].axes = axes;
    for (const auto& g : stops) pictures[k].push_back(rigs[k].Picture(g, seed++));
    // As `vss calibrate` does: first with the axes as they are called, then the axes.
    const auto start =
        CalibrateFromCube("cam1", rigs[k].scene.lens, rigs[k].cube, pictures[k], rigs[k].Centre(), {}, false);
    ASSERT_TRUE(start) << start.error().message;
    jobs.push_back({"cam1", rigs[k].scene.lens, rigs[k].cube, &pictures[k], start->cam_from_world});
  }
  const auto found = CalibrateGantryAxes(jobs);
  ASSERT_TRUE(found) << found.error().message;
  double sum = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double z = (found->axes(i, j) - axes(i, j)) / found->sigma(i, j);
      EXPECT_LT(std::abs(z), 4) << i << j << ": " << found->axes(i, j) << " +- " << found->sigma(i, j);
      EXPECT_LT(found->sigma(i, j), 2e-3);
      sum += z * z / 9;
    }
  EXPECT_LT(sum, 3);
}

TEST(GantryAxes, StopsAtOnePlaceSayNothingOfADirection) {
  const Rig rig = RigOf(1);
  const std::vector<CubePicture> pictures{rig.Picture({0, 0, 0}, 1), rig.Picture({20, 0, 0}, 2)};
  const auto found = CalibrateGantryAxes({{"cam1", rig.scene.lens, rig.cube, &pictures, rig.cam_from_world}});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, HasSubstr("more than 100 mm apart"));
}

}  // namespace
}  // namespace vss
