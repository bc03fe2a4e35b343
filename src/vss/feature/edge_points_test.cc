#include "vss/feature/edge_points.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "vss/feature/strip_fit.h"

namespace vss {
namespace {

GreyImage RandomSteps(int width, int height, int bits) {
  GreyImage image(width, height, bits);
  std::mt19937 random(3);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const int value = ((u / 13 + v / 17) % 2 == 0 ? 40 : 190) + int(random() % 9);
      if (bits == 8)
        image.Row8(v)[u] = static_cast<std::uint8_t>(value);
      else
        image.Row16(v)[u] = static_cast<std::uint16_t>(value * 200);
    }
  return image;
}

TEST(FindEdgePoints, GivesTheSameBitsWithEveryInstructionSet) {
  for (const int bits : {8, 16}) {
    const GreyImage image = RandomSteps(203, 117, bits);
    std::vector<EdgePoint> portable, other;
    NoiseMap noise;
    for (const Simd simd : {Simd::kPortable, Simd::kAvx2, Simd::kAvx512}) {
      EdgeBuffers buffers;
      buffers.simd = simd;
      EstimateNoise(image.view(), 0.3f, buffers, noise);
      FindEdgePoints(image.view(), noise, 3, buffers, simd == Simd::kPortable ? portable : other);
      if (simd == Simd::kPortable) continue;
      ASSERT_EQ(other.size(), portable.size());
      ASSERT_GT(other.size(), 500u);
      EXPECT_EQ(std::memcmp(other.data(), portable.data(), other.size() * sizeof(EdgePoint)), 0);
    }
  }
}

TEST(FitStrip, GivesTheSameBitsWithEveryInstructionSet) {
  GreyImage image(100, 40, 8);
  std::mt19937 random(5);
  for (int v = 0; v < 40; ++v)
    for (int u = 0; u < 100; ++u)
      image.Row8(v)[u] = static_cast<std::uint8_t>((v < 20 ? 150 : v == 20 ? 97 : 60) + random() % 5);
  StripFrame frame;
  frame.middle = {50, 20}, frame.from = -40, frame.to = 40;
  const StripEdge start[] = {{0, 0, 80, Eigen::Matrix2d::Zero()}};
  StripBuffers buffers;
  StripFit portable;
  for (const Simd simd : {Simd::kPortable, Simd::kAvx2, Simd::kAvx512}) {
    const StripFit fit = FitStrip(image.view(), frame, start, {}, {}, simd, buffers);
    ASSERT_TRUE(fit.ok);
    if (simd == Simd::kPortable) portable = fit;
    EXPECT_EQ(fit.edges[0].offset, portable.edges[0].offset);
    EXPECT_EQ(fit.edges[0].slope, portable.edges[0].slope);
    EXPECT_EQ(fit.blur_px, portable.blur_px);
    EXPECT_NEAR(fit.edges[0].contrast, 90, 2);
  }
}

}  // namespace
}  // namespace vss
