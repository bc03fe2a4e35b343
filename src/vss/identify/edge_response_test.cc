#include "vss/identify/edge_response.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;

// A blurred step: dark up to the line u cos a + v sin a = place, bright beyond.
GreyImage Step(double angle, double place, double dark, double bright) {
  GreyImage image(64, 64, 8);
  for (int v = 0; v < 64; ++v)
    for (int u = 0; u < 64; ++u) {
      const double d = u * std::cos(angle) + v * std::sin(angle) - place;
      image.Row8(v)[u] = std::uint8_t(std::lround(dark + (bright - dark) * 0.5 * std::erfc(-d / 0.8)));
    }
  return image;
}

TEST(RespondToEdge, FindsTheStepItsSideAndItsPlace) {
  const double angle = 0.4;
  const GreyImage image = Step(angle, 40, 30, 90);
  const Vector2d normal(std::cos(angle), std::sin(angle)), tangent(normal.y(), -normal.x());
  const Vector2d on_edge = 40 * normal + tangent * -3;
  const auto hit = RespondToEdge(image.view(), on_edge - normal, tangent, 8, 2);
  ASSERT_TRUE(hit);
  EXPECT_GT(hit->step, 40);
  EXPECT_NEAR(hit->offset_px, 1, 0.5);
  EXPECT_GT(hit->bright, 78);  // within 1.5 px of the edge its blur takes some of the 90
  EXPECT_LT(hit->bright, 90);
  const auto turned = RespondToEdge(image.view(), on_edge - normal, -tangent, 8, 2);
  ASSERT_TRUE(turned);
  EXPECT_NEAR(turned->step, -hit->step, 1e-9);
  EXPECT_NEAR(turned->bright, hit->bright, 1e-9);
}

TEST(RespondToEdge, IsSmallAcrossAnEdgeAndFarFromIt) {
  const GreyImage image = Step(0, 32, 30, 90);
  const auto far = RespondToEdge(image.view(), {16, 32}, {0, 1}, 8, 2);
  const auto across = RespondToEdge(image.view(), {32, 32}, {1, 0}, 8, 2);
  ASSERT_TRUE(far && across);
  EXPECT_LT(std::abs(far->step), 1);
  EXPECT_LT(std::abs(across->step), 1);
}

TEST(RespondToEdge, SaysNothingAtThePicturesBorder) {
  const GreyImage image = Step(0, 32, 30, 90);
  EXPECT_FALSE(RespondToEdge(image.view(), {2, 32}, {0, 1}, 8, 2));
  EXPECT_FALSE(RespondToEdge(image.view(), {32, 62}, {0, 1}, 8, 2));
}

TEST(TypicalResponse, IsNeverZero) {
  const GreyImage even(64, 64, 8), tiny(4, 4, 8);
  EXPECT_GT(TypicalResponse(even.view(), 8, 1.5), 0);
  EXPECT_GT(TypicalResponse(tiny.view(), 8, 1.5), 0);
}

}  // namespace
}  // namespace vss
