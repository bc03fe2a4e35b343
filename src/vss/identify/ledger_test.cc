#include "vss/identify/ledger.h"

#include <gtest/gtest.h>

#include <map>

#include "vss/camera/camera.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// Four cameras three metres above a plate, each with the exact line image of what is there.
struct Scene {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  std::vector<Camera> cameras;
  std::vector<LineImage> lines;
  std::vector<View> views;

  explicit Scene(std::span<const PlacedObject> there) {
    for (const Vector3d& place : {Vector3d(-900, -400, 3000), Vector3d(900, -300, 3000),
                                  Vector3d(-700, 500, 3000), Vector3d(800, 600, 3000)}) {
      Camera c;
      c.width_px = c.height_px = 512;
      c.intrinsics.fx_px = c.intrinsics.fy_px = 500;
      c.intrinsics.cx_px = c.intrinsics.cy_px = 255.5;
      const Vector3d forward = -place.normalized(), right = forward.cross(Vector3d::UnitY()).normalized();
      RigidTransform t;
      t.rotation.row(0) = right.transpose();
      t.rotation.row(1) = forward.cross(right).transpose();
      t.rotation.row(2) = forward.transpose();
      t.translation = -(t.rotation * place);
      c.cam_from_world = t;
      cameras.push_back(c);
    }
    lines.resize(cameras.size());
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      views.push_back(MakeView(int(i), cameras[i], *cameras[i].cam_from_world, int(i), &lines[i]));
      for (const auto& object : there) Draw(object, i);
    }
  }

  // Each visible edge is one segment.
  void Draw(const PlacedObject& object, std::size_t view) {
    std::map<int, std::pair<ContourSample, ContourSample>> ends;
    for (const auto& s : SampleContour(PlaceSolid(object, false), views[view], 2, 3)) {
      if (!s.visible) continue;
      ends.try_emplace(s.index, s, s);
      ends.at(s.index).second = s;
    }
    for (const auto& [edge, pair] : ends) {
      LineSegment l;
      l.start = l.ideal_start = pair.first.ideal;
      l.end = l.ideal_end = pair.second.ideal;
      lines[view].segments.push_back(l);
    }
  }

  // A line of the world, as paint or a shadow draws it.
  void Draw(const Vector3d& start, const Vector3d& end) {
    for (std::size_t i = 0; i < views.size(); ++i) {
      LineSegment l;
      l.start = l.ideal_start = *views[i].ProjectIdeal(start);
      l.end = l.ideal_end = *views[i].ProjectIdeal(end);
      lines[i].segments.push_back(l);
    }
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
