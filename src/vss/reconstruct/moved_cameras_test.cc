#include "vss/reconstruct/moved_cameras.h"

#include <gtest/gtest.h>

#include "vss/reconstruct/adjustment_scene.h"

namespace vss {
namespace {

using namespace test;

// Tilted and lowered by six sigmas of what was declared, while the other one hangs where it should: what is
// level says which of the two it was.
TEST(MovedCameras, OneThatWasKnockedIsNamedBesideOnesThatWereNot) {
  const Scene scene;
  std::mt19937 random(11);
  Adjustment truth = scene.Make();
  truth.cameras[0].value.head<3>() = Vector3d(3e-4, 0, 0);
  truth.cameras[0].value.segment<3>(3) = Vector3d(0, 0, -0.6);
  Adjustment a = scene.Make();
  Observe(truth, 0.05, random, a.groups);
  a.Solve(6, true);
  ReleaseMovedCameras(a);
  EXPECT_TRUE(a.cameras[0].loosened);
  EXPECT_FALSE(a.cameras[1].loosened);
}

TEST(MovedCameras, NoneIsNamedWhereAllAreAsDeclared) {
  const Scene scene;
  constexpr int kRuns = 12;
  std::mt19937 random(17);
  int named = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Adjustment truth = DrawnTruth(scene, random);
    Adjustment a = scene.Make();
    Observe(truth, 0.05, random, a.groups);
    a.Solve(6, true);
    ReleaseMovedCameras(a);
    for (const auto& c : a.cameras) named += c.loosened;
  }
  EXPECT_EQ(named, 0);
}

}  // namespace
}  // namespace vss
