#include "vss/identify/on_walls.h"

#include <gtest/gtest.h>

#include <cmath>

#include "vss/identify/four_views.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// A bar of which the pictures show the long edges, not where it ends; a wall stands across it at x = 300.
struct Bar : test::FourViews {
  static constexpr double kWallMm = 300, kHalfWidthMm = 60, kHeightMm = 120;
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  WorldSolid wall = PlaceSolid(Box({kWallMm + 20, 0, 0}, {40, 900, 300}), false);

  Bar() {
    for (const double y : {-kHalfWidthMm, kHalfWidthMm})
      for (const double z : {0.0, kHeightMm}) Draw(Vector3d(-250, y, z), Vector3d(250, y, z));
  }

  PlacedObject Box(const Vector3d& at, std::vector<double> dimensions_mm) const {
    PlacedObject o;
    o.model = knowledge.Find("box");
    o.placement.head<3>() = at;
    o.dimensions_mm = std::move(dimensions_mm);
    return o;
  }

  // The ends at which the bar is tried that was found up to `end_mm`.
  std::vector<double> Ends(double end_mm) const {
    const SceneIndex index = MakeSceneIndex(views, 1.5, 1);
    const SeedContext context{.scene = index, .lines = {}, .circles = {}, .mm_per_px = index.mm_per_px};
    Hypothesis h;
    h.object = Box({(end_mm - 300) / 2, 0, 0}, {end_mm + 300, 2 * kHalfWidthMm, kHeightMm});
    h.views = {0, 1, 2, 3};
    std::vector<double> ends;
    for (const auto& on : OnWalls(h, std::span(&wall, 1), context)) {
      EXPECT_NEAR(on.object.placement[1], 0, 1);
      EXPECT_NEAR(on.object.dimensions_mm[1], 2 * kHalfWidthMm, 1);
      ends.push_back(on.object.placement[0] + on.object.dimensions_mm[0] / 2);
    }
    return ends;
  }
};

TEST(OnWalls, AnEndThatNoLineShowsIsBroughtToTheWallFromEitherSide) {
  const Bar bar;
  for (const double end_mm : {Bar::kWallMm - 35, Bar::kWallMm + 30}) {
    const auto ends = bar.Ends(end_mm);
    ASSERT_FALSE(ends.empty()) << end_mm;
    for (const double end : ends) EXPECT_NEAR(end, Bar::kWallMm, 0.5);
  }
}

TEST(OnWalls, WhatTouchesAlreadyOrEndsFarOffStaysWhereItIs) {
  const Bar bar;
  EXPECT_TRUE(bar.Ends(Bar::kWallMm + 1).empty());
  EXPECT_TRUE(bar.Ends(Bar::kWallMm - 150).empty());
}

}  // namespace
}  // namespace vss
