#include "vss/identify/contour.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "vss/identify/four_views.h"

namespace vss {
namespace {

PlacedObject Box(const KnowledgeBase& knowledge, double x, std::vector<double> dimensions_mm) {
  PlacedObject o;
  o.model = knowledge.Find("box");
  o.placement << x, 0, 0, 0.1, 0, 0;
  o.dimensions_mm = std::move(dimensions_mm);
  return o;
}

std::vector<bool> Visible(const WorldSolid& solid, const View& view, const Occluders& others) {
  std::vector<bool> visible;
  for (const auto& s : SampleContour(solid, view, 6, 3, &others)) visible.push_back(s.visible);
  return visible;
}

TEST(ContourTest, WhatWasProjectedBeforehandHidesTheSameSamples) {
  const test::FourViews scene;
  const KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  const WorldSolid low = PlaceSolid(Box(knowledge, 0, {900, 300, 60}), false),
                   wall = PlaceSolid(Box(knowledge, 250, {60, 500, 600}), false),
                   other_wall = PlaceSolid(Box(knowledge, -350, {60, 500, 400}), false);
  Occluders both, one;
  both.Add(wall, 1);
  both.Add(other_wall, 2);
  one.Add(other_wall, 2);
  Occluders prepared = both;
  prepared.Prepare(scene.views);
  bool any_hidden = false;
  for (const View& view : scene.views) {
    const auto visible = Visible(low, view, both);
    EXPECT_EQ(Visible(low, view, prepared), visible);
    EXPECT_EQ(Visible(low, view, prepared.Without(1)), Visible(low, view, one));
    any_hidden |= std::find(visible.begin(), visible.end(), false) != visible.end();
  }
  EXPECT_TRUE(any_hidden);
}

TEST(ContourTest, AllOthersProjectedOnceHideTheSameSamples) {
  const test::FourViews scene;
  const KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  const std::vector<WorldSolid> solids{PlaceSolid(Box(knowledge, 0, {900, 300, 60}), false),
                                       PlaceSolid(Box(knowledge, 250, {60, 500, 600}), false),
                                       PlaceSolid(Box(knowledge, -350, {60, 500, 400}), false)};
  const auto each = OthersOf(solids), at_once = OthersOf(solids, scene.views);
  bool any_hidden = false;
  for (const View& view : scene.views)
    for (std::size_t i = 0; i < solids.size(); ++i) {
      const auto visible = Visible(solids[i], view, each[i]);
      EXPECT_EQ(Visible(solids[i], view, at_once[i]), visible) << i;
      any_hidden |= std::find(visible.begin(), visible.end(), false) != visible.end();
    }
  EXPECT_TRUE(any_hidden);
}

}  // namespace
}  // namespace vss
