#include "vss/reconstruct/edge_profile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace vss {
namespace {

using Eigen::Vector2d;

// A 16 bit picture of steps along parallel curves, seen through a lens of the given blur and a square pixel
// (by 5 x 5 samples), without noise unless `noise` > 0.
GreyImage Render(double angle_rad, const std::vector<std::pair<double, double>>& steps, double blur,
                 double noise, unsigned seed) {
  GreyImage image(64, 64, 16);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Vector2d n(std::cos(angle_rad), std::sin(angle_rad));
  for (int v = 0; v < 64; ++v)
    for (int u = 0; u < 64; ++u) {
      double sum = 0;
      for (int a = 0; a < 5; ++a)
        for (int b = 0; b < 5; ++b) {
          const Vector2d p(u + (a - 2) / 5.0, v + (b - 2) / 5.0);
          double g = 6000;
          for (const auto& [at, contrast] : steps)
            g += contrast * 0.5 *
                 std::erfc(-((p - Vector2d(31.3, 32.1)).dot(n) - at) / (blur * std::sqrt(2.0)));
          sum += g / 25;
        }
      image.Row16(v)[u] =
          static_cast<std::uint16_t>(std::clamp(std::lround(sum + noise * normal(random)), 0L, 65535L));
    }
  return image;
}

ProfileRequest Request(double angle_rad) {
  ProfileRequest r;
  r.curve = {{31.3, 32.1}, {std::cos(angle_rad), std::sin(angle_rad)}, 0};
  r.search_px = 1.5;
  r.reach_minus_px = r.reach_plus_px = 5;
  return r;
}

TEST(EdgeProfile, FindsAStepToAHundredthOfAPixelAtAnyAngleAndPlace) {
  for (double angle = 0.03; angle < 6.2; angle += 0.31)
    for (double at : {-0.8, -0.3, 0.0, 0.45, 0.9}) {
      const GreyImage image = Render(angle, {{at, 9000}}, 0.55, 0, 1);
      const auto fit = FitProfile(image.view(), Request(angle), 0);
      ASSERT_TRUE(fit) << angle << " " << at;
      EXPECT_NEAR(fit->offset_px, at, 0.01) << angle;
      EXPECT_NEAR(fit->contrast, 9000, 200);
    }
}

TEST(EdgeProfile, KeepsTheTwoEdgesOfAThinPlateApart) {
  for (double gap : {2.0, 3.0, 4.0})
    for (double at : {-0.4, 0.3}) {
      const double angle = 0.4;
      const GreyImage image = Render(angle, {{at, 5000}, {at + gap + 0.1, -3000}}, 0.55, 0, 1);
      ProfileRequest r = Request(angle);
      const ProfileCurve other{r.curve.point + gap * r.curve.normal, r.curve.normal, 0};
      r.neighbours = {&other, 1};
      const auto fit = FitProfile(image.view(), r, 0);
      ASSERT_TRUE(fit) << gap;
      EXPECT_NEAR(fit->offset_px, at, 0.03) << gap;
    }
}

TEST(EdgeProfile, SigmaIsTheScatterOfNoisyPictures) {
  double sum = 0, sum2 = 0, sigma = 0;
  constexpr int kRuns = 300;
  for (int i = 0; i < kRuns; ++i) {
    const GreyImage image = Render(0.7, {{0.2, 6000}}, 0.6, 300, static_cast<unsigned>(i));
    const auto fit = FitProfile(image.view(), Request(0.7), 0);
    ASSERT_TRUE(fit);
    sum += fit->offset_px / kRuns;
    sum2 += fit->offset_px * fit->offset_px / kRuns;
    sigma += fit->sigma_px / kRuns;
  }
  EXPECT_NEAR(sum, 0.2, 0.01);
  EXPECT_NEAR(std::sqrt(sum2 - sum * sum) / sigma, 1.0, 0.15);
}

// The bright side is beyond the sensor's limit, by an unknown amount: the edge lies before the place where
// the limit is reached, and its sigma says how well that is known.
TEST(EdgeProfile, AnOverexposedSideLeavesAnHonestEdge) {
  constexpr int kRuns = 60;
  for (double bright : {70e3, 100e3, 130e3}) {
    double squared = 0, sigma = 0;
    for (int i = 0; i < kRuns; ++i) {
      const double at = 0.6 * std::sin(i);
      const GreyImage image = Render(0.1 * i, {{at, bright - 6000}}, 0.6, 300, static_cast<unsigned>(i));
      const auto fit = FitProfile(image.view(), Request(0.1 * i), 0);
      ASSERT_TRUE(fit) << bright << " " << i;
      EXPECT_TRUE(fit->saturated);
      squared += std::pow((fit->offset_px - at) / fit->sigma_px, 2) / kRuns;
      sigma += fit->sigma_px / kRuns;
    }
    EXPECT_LT(squared, 2) << bright;
    EXPECT_LT(sigma, 0.25) << bright;
  }
}

TEST(EdgeProfile, InEvenLightNoiseMovesAnEdgeLess) {
  const auto scatter = [](double slope_sigma) {
    ProfileRequest r = Request(0.7);
    r.search_px = 0.8;
    r.reach_minus_px = r.reach_plus_px = 2.8;
    r.slope_sigma = slope_sigma;
    constexpr int kRuns = 200;
    double square = 0;
    for (int i = 0; i < kRuns; ++i) {
      const auto fit =
          FitProfile(Render(0.7, {{0.2, 6000}}, 0.6, 200, static_cast<unsigned>(i)).view(), r, 0);
      if (fit) square += std::pow(fit->offset_px - 0.2, 2) / kRuns;
    }
    return std::sqrt(square);
  };
  EXPECT_LT(scatter(0.003), 0.6 * scatter(kAnySlope));
}

TEST(EdgeProfile, TellsTheSlopesThatThePixelsHaveWhateverWasBelievedBefore) {
  for (double believed : {kAnySlope, 0.01}) {
    ProfileRequest r = Request(0.7);
    r.slope_sigma = believed;
    double mean = 0, sigma = 0;
    constexpr int kRuns = 50;
    for (int i = 0; i < kRuns; ++i) {
      GreyImage image = Render(0.7, {{0.2, 6000}}, 0.6, 60, static_cast<unsigned>(i));
      const Vector2d n(std::cos(0.7), std::sin(0.7));
      for (int v = 0; v < 64; ++v)
        for (int u = 0; u < 64; ++u)  // brighter by 120 a pixel on the plus side: 0.02 of the contrast
          image.Row16(v)[u] = static_cast<std::uint16_t>(
              image.Row16(v)[u] + 120 * std::max(0.0, (Vector2d(u, v) - r.curve.point).dot(n) - 0.2));
      const auto fit = FitProfile(image.view(), r, 0);
      ASSERT_TRUE(fit);
      mean += fit->slope[1] / kRuns, sigma += fit->slope_sigma[1] / kRuns;
    }
    EXPECT_NEAR(mean, 0.02, 0.003) << believed;
    EXPECT_LT(sigma, 0.01) << believed;
  }
}

TEST(EdgeProfile, FindsNothingInNoise) {
  int found = 0;
  for (unsigned i = 0; i < 100; ++i)
    found += FitProfile(Render(0.7, {}, 0.6, 300, i).view(), Request(0.7), 0).has_value();
  EXPECT_LE(found, 3);
}

}  // namespace
}  // namespace vss
