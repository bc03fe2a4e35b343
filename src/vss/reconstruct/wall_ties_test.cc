// Parts that lie against each other.
#include <gtest/gtest.h>

#include "vss/reconstruct/adjustment_scene.h"

namespace vss {
namespace {

using namespace test;

// A slab beside another one, `gap_mm` from its end face.
Scene SlabsWithGap(double gap_mm) {
  Scene scene;
  scene.parts.clear();
  scene.Add("box", {-300, 0, 0, 0, 0, 0}, {600, 200, 80}, -1);
  scene.Add("box", {200 + gap_mm, 0, 0, 0, 0, 0}, {400, 300, 200}, -1);
  return scene;
}

TEST(WallTies, FacesThatLieAgainstEachOtherAreFound) {
  const auto at = [](double gap_mm) { return FindWallTies(SlabsWithGap(gap_mm).parts, 15); };
  ASSERT_EQ(at(3).size(), 1u);  // the middle of the higher one's face lies above the lower one
  EXPECT_EQ(at(3)[0].part, 0);
  EXPECT_EQ(at(3)[0].other, 1);
  EXPECT_TRUE(at(30).empty());
  Scene turned = SlabsWithGap(3);
  turned.parts[1].object.placement[3] = 0.1;
  EXPECT_TRUE(FindWallTies(turned.parts, 15).empty());
}

// Of the first slab nothing is observed but its sides: its length and place along it hang on the wall.
TEST(WallTies, WhatIsNotSeenLiesAgainstTheWall) {
  const Scene scene = SlabsWithGap(0);
  Adjustment a = scene.Make();
  std::mt19937 random(3);
  Observe(a, 0.02, random, a.groups);
  std::erase_if(a.groups, [&](const ObservationGroup& g) {
    return g.part == 0 && std::any_of(g.observations.begin(), g.observations.end(), [](const Observation& o) {
             return std::abs(o.sample.point_in_world.x()) < 1;
           });
  });
  const auto sigma_of_length = [](Adjustment& b) {
    b.Solve(4, true);
    b.ComputeCovariance();
    return std::sqrt(b.PartCovariance(0)(kPlacementSize, kPlacementSize));
  };
  Adjustment bare = a;
  EXPECT_GT(sigma_of_length(bare), 5);
  a.walls = FindWallTies(a.parts, 15);
  ASSERT_EQ(a.walls.size(), 1u);
  a.parts[0].object.dimensions_mm[0] += 8;
  EXPECT_LT(sigma_of_length(a), 1.3);
  EXPECT_NEAR(a.parts[0].object.dimensions_mm[0], 600, 0.5);
  a.DropBrokenWalls(3);
  EXPECT_EQ(a.walls.size(), 1u);
}

TEST(WallTies, FacesThatThePicturesShowApartAreNotTied) {
  const Scene scene = SlabsWithGap(8);
  Adjustment a = scene.Make();
  std::mt19937 random(5);
  Observe(a, 0.02, random, a.groups);
  a.walls = FindWallTies(a.parts, 15);
  ASSERT_EQ(a.walls.size(), 1u);
  a.Solve(4, true);
  a.ComputeCovariance();
  a.DropBrokenWalls(3);
  EXPECT_TRUE(a.walls.empty());
}

}  // namespace
}  // namespace vss
