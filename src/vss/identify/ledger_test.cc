#include "vss/identify/ledger.h"

#include <gtest/gtest.h>

#include "vss/identify/four_views.h"

namespace vss {
namespace {

using Eigen::Vector3d;

struct Scene : test::FourViews {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");

  explicit Scene(std::span<const PlacedObject> there) {
    for (const auto& object : there) Draw(object);
  }

  PlacedObject Box(double x, double y, std::vector<double> dimensions_mm) const {
    PlacedObject o;
    o.model = knowledge.Find("box");
    o.placement << x, y, 0, 0, 0, 0;
    o.dimensions_mm = std::move(dimensions_mm);
    return o;
  }
};

TEST(Ledger, APartCutInTwoExplainsLessThanTheWhole) {
  const Scene empty({});
  const PlacedObject whole = empty.Box(0, 0, {1200, 600, 60});
  const Scene scene({&whole, 1});
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  const std::vector<PlacedObject> candidates{whole, empty.Box(-300, 0, {600, 600, 60}),
                                             empty.Box(300, 0, {600, 600, 60})};
  Ledger ledger(index);
  ledger.Add(candidates, 2);
  const double one = ledger.Weigh(std::vector<int>{0})[0].log_odds;
  const auto halves = ledger.Weigh(std::vector<int>{1, 2});
  EXPECT_GT(one, 50);
  EXPECT_GT(one, halves[0].log_odds + halves[1].log_odds);
}

TEST(Ledger, ALineOnAFaceDoesNotMakeTwoPartsOfOne) {
  const Scene empty({});
  const PlacedObject whole = empty.Box(0, 0, {1200, 600, 60});
  Scene scene({&whole, 1});
  scene.Draw({0, -300, 60}, {0, 300, 60});
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  Ledger ledger(index);
  ledger.Add(std::vector<PlacedObject>{whole, empty.Box(-300, 0, {600, 600, 60}),
                                       empty.Box(300, 0, {600, 600, 60}), empty.Box(305, 0, {590, 600, 30})},
             1);
  const double one = ledger.Weigh(std::vector<int>{0})[0].log_odds;
  const auto halves = ledger.Weigh(std::vector<int>{1, 2});
  EXPECT_GT(one, halves[0].log_odds + halves[1].log_odds);
  // Beside a lower part the same edge is one, and counts.
  EXPECT_GT(ledger.Weigh(std::vector<int>{1, 3})[0].log_odds, halves[0].log_odds + 5);
}

TEST(Ledger, TheSameLinesSpeakForOnePartOnly) {
  const Scene empty({});
  const PlacedObject whole = empty.Box(0, 0, {1200, 600, 60}), same = empty.Box(1, 1, {1201, 601, 60});
  const Scene scene({&whole, 1});
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  Ledger ledger(index);
  ledger.Add(std::vector<PlacedObject>{whole, same}, 1);
  const double alone = ledger.Alone(0).log_odds;
  const auto both = ledger.Weigh(std::vector<int>{0, 1});
  EXPECT_LT(both[0].log_odds + both[1].log_odds, alone + 1);
}

TEST(Ledger, EdgesThatAPictureShowsOneBehindTheOtherAreTwo) {
  const Scene empty({});
  // The first camera sees the far top edge of the high box and the near one of the low box as one line.
  const Vector3d eye(-900, -400, 3000);
  const double far = 100, near = eye.y() + (far - eye.y()) * (eye.z() - 60) / (eye.z() - 300);
  const PlacedObject high = empty.Box(0, far - 100, {400, 200, 300}),
                     low = empty.Box(0, near + 150, {1200, 300, 60});
  const Scene scene(std::vector<PlacedObject>{high, low});
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  Ledger ledger(index);
  ledger.Add(std::vector<PlacedObject>{high, low}, 1);
  const auto both = ledger.Weigh(std::vector<int>{0, 1});
  EXPECT_GT(both[0].log_odds + both[1].log_odds,
            ledger.Alone(0).log_odds + ledger.Alone(1).log_odds - 10);
}

TEST(Ledger, WhatAnotherPartHidesDoesNotSpeakAgainstAPart) {
  const Scene empty({});
  const PlacedObject plate = empty.Box(0, 0, {1200, 600, 60});
  const Scene scene({});  // nothing is seen at all
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  const PlacedObject roof = [&] {
    PlacedObject o = empty.Box(0, 0, {3000, 3000, 50});
    o.placement[2] = 800;
    return o;
  }();
  Ledger ledger(index);
  ledger.Add(std::vector<PlacedObject>{plate, roof}, 1);
  const double open = ledger.Alone(0).log_odds;
  EXPECT_LT(open, ledger.Weigh(std::vector<int>{0, 1})[0].log_odds - 3);
}

TEST(Ledger, WhatIsNotLinkedIsWeighedAsThoughItStoodAlone) {
  constexpr double kNearMm = 50;
  const Scene empty({});
  const PlacedObject a = empty.Box(-700, -300, {300, 200, 40}), b = empty.Box(600, 300, {300, 200, 40}),
                     beside_a = empty.Box(-700, -50, {300, 200, 80});
  const Scene scene(std::vector<PlacedObject>{a, b, beside_a});
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  Ledger ledger(index);
  ledger.Add(std::vector<PlacedObject>{a, b, beside_a}, 1);
  EXPECT_EQ(ledger.Linked(0, kNearMm), std::vector<int>{2});
  EXPECT_TRUE(ledger.Linked(1, kNearMm).empty());
  const auto all = ledger.Weigh(std::vector<int>{0, 1, 2}), pair = ledger.Weigh(std::vector<int>{0, 2});
  EXPECT_EQ(all[1].log_odds, ledger.Alone(1).log_odds);
  EXPECT_EQ(all[0].log_odds, pair[0].log_odds);
  EXPECT_EQ(all[2].elevated_log_odds, pair[1].elevated_log_odds);
}

TEST(Ledger, TheOrderOfTheSetDoesNotMatter) {
  const Scene empty({});
  const PlacedObject a = empty.Box(-400, 0, {500, 300, 100}), b = empty.Box(350, 100, {600, 400, 200});
  const Scene scene(std::vector<PlacedObject>{a, b});
  const SceneIndex index = MakeSceneIndex(scene.views, 1.5, 1);
  Ledger ledger(index);
  ledger.Add(std::vector<PlacedObject>{a, b}, 1);
  const auto ab = ledger.Weigh(std::vector<int>{0, 1}), ba = ledger.Weigh(std::vector<int>{1, 0});
  EXPECT_NEAR(ab[0].log_odds, ba[1].log_odds, 1e-9);
  EXPECT_NEAR(ab[1].log_odds, ba[0].log_odds, 1e-9);
  EXPECT_GT(ab[0].log_odds, 20);
}

}  // namespace
}  // namespace vss
