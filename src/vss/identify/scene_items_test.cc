#include "vss/identify/scene_items.h"

#include <gtest/gtest.h>

namespace vss {
namespace {

constexpr double kMmPerPx = 2;

class Stack : public testing::Test {
 protected:
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  SceneItems items{kMmPerPx};

  // Adds a plate that stands on item `support`; whether it was kept.
  bool Keep(double x, double y, double z, double yaw, std::vector<double> dimensions_mm, int support) {
    Hypothesis h;
    h.object.model = knowledge.Find("box");
    h.object.placement << x, y, z, yaw, 0, 0;
    h.object.dimensions_mm = std::move(dimensions_mm);
    const int before = items.size();
    items.Keep(std::move(h), support);
    return items.size() > before;
  }
};

TEST_F(Stack, APlateIsNotCutInLayersByTheShadowsAroundIt) {
  constexpr double kYaw = 0.8;
  ASSERT_TRUE(Keep(0, 0, 0, kYaw, {1350, 1067, 6}, SceneItems::kGround));
  EXPECT_FALSE(Keep(0, 0, 6, kYaw, {1332, 1055, 13}, 0)) << "all around";
  const double off = 250;  // flush with three sides
  EXPECT_FALSE(Keep(off * std::cos(kYaw), off * std::sin(kYaw), 6, kYaw, {838, 1055, 13}, 0));
}

TEST_F(Stack, APlateThatEndsInsideTheOneBelowStandsOnIt) {
  ASSERT_TRUE(Keep(0, 0, 0, 0.8, {1350, 1067, 20}, SceneItems::kGround));
  EXPECT_TRUE(Keep(0, 0, 20, 0.8, {1345, 400, 20}, 0)) << "flush with two ends only";
  EXPECT_TRUE(Keep(100, 0, 20, 0.8 + 0.1, {900, 700, 20}, 0));
}

}  // namespace
}  // namespace vss
