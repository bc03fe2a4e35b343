#include "vss/identify/plates.h"

#include <gtest/gtest.h>

#include <cmath>

#include "vss/identify/four_views.h"

namespace vss {
namespace {

// A block on a plate; the plate has been read in many sizes and in two heights, the block as standing on the
// ground.
struct Stacked : test::FourViews {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  IdentifyOptions options;
  Progress progress;
  SceneData data{views, knowledge, options, 1, progress};

  Stacked() {
    Draw(Box(0, {1400, 900, 40}));
    Draw(Box(40, {500, 300, 160}));
    data.index = MakeSceneIndex(views, 1.5, 1);
    double log_odds = 400;
    for (double height : {40.0, 80.0})
      for (const auto& [length, width] : std::vector<std::pair<double, double>>{
               {1400, 900}, {1400, 600}, {1400, 400}, {900, 900}, {600, 900}, {900, 500}, {600, 500}})
        Keep(Box(0, {length, width, height}), log_odds--);
    Keep(Box(0, {500, 300, 200}), 100);
  }
  PlacedObject Box(double z, std::vector<double> dimensions_mm) const {
    PlacedObject o;
    o.model = knowledge.Find("box");
    o.placement << 0, 0, z, 0, 0, 0;
    o.dimensions_mm = std::move(dimensions_mm);
    return o;
  }
  void Keep(PlacedObject object, double log_odds) {
    Hypothesis h;
    h.object = std::move(object);
    h.log_odds = log_odds;
    h.determined.assign(3, true);
    h.views = {0, 1, 2, 3};
    data.items.Keep(std::move(h), SceneItems::kGround);
  }
};

TEST(ReseatOnPlates, SeatsAPartOnTheLikeliestReadingsOfAPlateOnly) {
  Stacked scene;
  const int plates = scene.data.items.size() - 1;
  ASSERT_EQ(plates, 14);
  ReseatOnPlates(scene.data);
  bool on_the_best = false;
  int seated = 0;
  for (const SceneItem& item : scene.data.items) {
    if (item.support_item < 0) continue;
    ++seated;
    on_the_best |= item.support_item == 0 && std::abs(item.h.object.dimensions_mm[2] - 160) < 2;
  }
  EXPECT_TRUE(on_the_best);
  EXPECT_GE(seated, 1);
  EXPECT_LE(seated, 8) << "four of either height";
}

}  // namespace
}  // namespace vss
