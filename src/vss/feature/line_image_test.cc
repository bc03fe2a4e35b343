#include "vss/feature/line_image.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "vss/feature/line_pictures.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {
namespace {

using Eigen::Vector2d;

class RectangleTest : public testing::TestWithParam<int> {};

TEST_P(RectangleTest, HasFourSidesInTheirPlacesWithTheBrightSideOnTheLeft) {
  const TestRectangle r;
  const LineImage lines = LinesOf(Render(200, 180, GetParam(), 1, [&](int u, int v) { return r.At(u, v); }));
  ASSERT_EQ(lines.segments.size(), 4u);
  const auto corners = r.Corners();
  for (int i = 0; i < 4; ++i) {
    const Vector2d from = corners[std::size_t(i)], to = corners[std::size_t(i + 1) % 4];
    const auto hit = std::find_if(lines.segments.begin(), lines.segments.end(), [&](const LineSegment& s) {
      return (s.start - from).norm() < 4 && (s.end - to).norm() < 4;
    });
    ASSERT_NE(hit, lines.segments.end());
    EXPECT_LT(std::abs(AcrossPx(from, to, hit->start)), 0.1);
    EXPECT_LT(std::abs(AcrossPx(from, to, hit->end)), 0.1);
    EXPECT_NEAR(hit->contrast, GetParam() == 8 ? 80 : 8000, GetParam() == 8 ? 8 : 800);
    EXPECT_NEAR(hit->blur_px, kTestBlurPx, 0.2);
  }
}
INSTANTIATE_TEST_SUITE_P(Bits, RectangleTest, testing::Values(8, 16));

TEST(DetectLines, FindsAStraightEdgeOfADistortingLensAsOneSegment) {
  Intrinsics lens{LensModel::kOpenCv, 300, 300, 199.5, 149.5, {-0.25, 0.03}, 2, 0};
  const Vector2d a(-20, 20), b(420, 35);  // ideal: near the upper border, where the lens bends most
  const GreyImage image = Render(400, 300, 8, 1, [&](int u, int v) {
    const auto n = lens.NormalizedFromImg(Vector2d(u, v));
    return 60 + 80 * TestStep(AcrossPx(a, b, lens.IdealFromNormalized(*n)));
  });
  const LineImage lines = LinesOf(image, &lens);
  ASSERT_EQ(lines.segments.size(), 1u);
  const LineSegment& s = lines.segments[0];
  EXPECT_LT(std::abs(AcrossPx(a, b, s.ideal_start)), 0.05);
  EXPECT_LT(std::abs(AcrossPx(a, b, s.ideal_end)), 0.05);
  EXPECT_GT((s.end - s.start).norm(), 380);
}

TEST(DetectLines, FindsACircleAsAnArcAllTheWayRound) {
  const GreyImage image = Render(
      200, 200, 8, 1, [&](int u, int v) { return 60 + 80 * TestStep(50 - std::hypot(u - 99.3, v - 101.2)); });
  const LineImage lines = LinesOf(image);
  ASSERT_EQ(lines.arcs.size(), 1u);
  EXPECT_TRUE(lines.segments.empty());
  const EllipticalArc& arc = lines.arcs[0];
  EXPECT_NEAR(arc.center.x(), 99.3, 0.05);
  EXPECT_NEAR(arc.center.y(), 101.2, 0.05);
  EXPECT_NEAR(arc.axes.x(), 50, 0.1);
  EXPECT_NEAR(arc.axes.y(), 50, 0.1);
  EXPECT_TRUE(arc.bright_inside);
  EXPECT_NEAR(arc.to_rad - arc.from_rad, 2 * kPi, 1e-6);
}

TEST(DetectLines, PutsEllipsesWhereTheyAreAndKnowsHowWell) {
  constexpr double kAngle = 0.4, kLong = 30, kShort = 20;
  double squares = 0, center2 = 0;
  constexpr int kPictures = 20;
  for (int i = 0; i < kPictures; ++i) {
    const Vector2d center(50.3 + 0.05 * i, 51.2 - 0.03 * i);
    const GreyImage image = Render(
        104, 104, 8, 2,
        [&](int u, int v) {
          double sum = 0;
          constexpr int kSub = 4;
          for (int k = 0; k < kSub * kSub; ++k) {
            const Vector2d d =
                Vector2d(u + (k % kSub + 0.5) / kSub - 0.5, v + (k / kSub + 0.5) / kSub - 0.5) - center;
            const double x = std::cos(kAngle) * d.x() + std::sin(kAngle) * d.y(),
                         y = -std::sin(kAngle) * d.x() + std::cos(kAngle) * d.y();
            sum += std::hypot(x / kLong, y / kShort) < 1 ? 1.0 : 0.0;
          }
          return 60 + 80 * sum / (kSub * kSub);
        },
        unsigned(i));
    const LineImage lines = LinesOf(image);
    ASSERT_EQ(lines.arcs.size(), 1u);
    EXPECT_TRUE(lines.segments.empty());
    const EllipticalArc& a = lines.arcs[0];
    Eigen::Matrix<double, 5, 1> e;
    e << a.center - center, a.axes.x() - kLong, a.axes.y() - kShort, a.angle_rad - kAngle;
    squares += e.dot(a.covariance.inverse() * e) / 5;
    center2 += e.head<2>().squaredNorm() / 2;
  }
  EXPECT_LT(std::sqrt(center2 / kPictures), 0.02);  // px; from edge points alone .05
  EXPECT_GT(squares / kPictures, 0.4);
  EXPECT_LT(squares / kPictures, 2.0);
}

TEST(DetectLines, FindsAWeakEdgeThatAStrongOneHides) {
  // A dark plate (90), a band of its shadow (50) and the floor (170): the gradient has one crest.
  const Vector2d along(std::cos(0.2), std::sin(0.2)), across(-along.y(), along.x()), middle(60.2, 59.6);
  constexpr double kBandPx = 2.5;
  const LineImage lines = LinesOf(Render(120, 120, 8, 1, [&](int u, int v) {
    const double t = across.dot(Vector2d(u, v) - middle);
    return 90 - 40 * TestStep(t) + 120 * TestStep(t - kBandPx);
  }));
  ASSERT_EQ(lines.segments.size(), 2u);
  for (const double at : {0.0, kBandPx}) {
    const auto s = std::find_if(lines.segments.begin(), lines.segments.end(), [&](const LineSegment& l) {
      return std::abs(across.dot(0.5 * (l.start + l.end) - middle) - at) < 0.1;
    });
    ASSERT_NE(s, lines.segments.end()) << at;
    // Bright to the left of start -> end: the plate for the one, the floor for the other.
    EXPECT_EQ(along.dot(s->end - s->start) > 0, at == 0) << at;
    EXPECT_NEAR(s->contrast, at == 0 ? 40 : 120, 8);
    EXPECT_GT((s->end - s->start).norm(), 90);
  }
}

TEST(DetectLines, FindsNoLinesInNoise) {
  for (const int bits : {8, 16}) {
    const LineImage lines = LinesOf(Render(256, 256, bits, 10, [](int, int) { return 120; }));
    EXPECT_TRUE(lines.segments.empty());
    EXPECT_TRUE(lines.arcs.empty());
    EXPECT_NEAR(lines.noise_sigma, bits == 8 ? 10 : 1000, bits == 8 ? 1 : 100);
  }
}

TEST(DetectLines, HasNothingToSayOfPicturesWithoutEdges) {
  EXPECT_TRUE(DetectLines({}, nullptr, {}).segments.empty());
  for (const int size : {1, 2, 3, 5, 16, 65}) {
    EXPECT_TRUE(LinesOf(Render(size, 1, 8, 0, [](int, int) { return 7; })).segments.empty());
    EXPECT_TRUE(LinesOf(Render(size, size, 8, 0, [](int, int) { return 255; })).segments.empty());
    EXPECT_TRUE(LinesOf(Render(size, size, 16, 0, [](int, int) { return 655.35; })).segments.empty());
    EXPECT_TRUE(
        LinesOf(Render(size, size, 8, 0, [](int u, int v) { return (u + v) % 2 * 255; })).segments.empty());
  }
}

TEST(DetectLines, GivesOnlyFiniteNumbersWhateverThePicture) {
  std::mt19937 random(11);
  for (const int bits : {8, 16})
    for (int i = 0; i < 60; ++i) {
      const int width = 1 + int(random() % 90), height = 1 + int(random() % 90), kind = i % 4;
      const double cell = 1 + random() % 20, most = bits == 8 ? 255 : 655.35;
      const LineImage lines = LinesOf(Render(width, height, bits, kind == 0 ? 60 : 0, [&](int u, int v) {
        if (kind == 1) return std::fmod(std::floor(u / cell) + std::floor(v / cell), 2) * most;  // saturated
        if (kind == 2) return u < cell ? 0.0 : most;
        if (kind == 3) return std::hypot(u - cell, v - cell) < 2 * cell ? most : 0.0;
        return 120.0;
      }));
      EXPECT_TRUE(IsFinite(lines)) << width << " x " << height << ", kind " << kind;
    }
}

TEST(DetectLines, ReadsRowsThatAreFartherApartThanTheyAreWide) {
  const TestRectangle r;
  const GreyImage image = Render(200, 180, 8, 2, [&](int u, int v) { return r.At(u, v); });
  std::vector<std::uint8_t> padded(311 * 180, 77);
  for (int v = 0; v < 180; ++v) std::copy_n(image.view().Row8(v), 200, padded.begin() + 311 * v);
  const LineImage lines = DetectLines({padded.data(), 200, 180, 311, 8}, nullptr, {});
  EXPECT_EQ(LineImageToJson(lines), LineImageToJson(LinesOf(image)));
}

TEST(DetectLines, GivesTheSameBytesWithAWorkspaceThatHasSeenOtherPictures) {
  const TestRectangle r;
  const GreyImage image = Render(200, 180, 8, 3, [&](int u, int v) { return r.At(u, v); });
  const GreyImage other = Render(333, 77, 16, 3, [&](int u, int v) { return r.At(u, v + 40); });
  LineWorkspace workspace;
  const std::string first = LineImageToJson(DetectLines(image.view(), nullptr, {}, &workspace));
  DetectLines(other.view(), nullptr, {}, &workspace);
  EXPECT_EQ(LineImageToJson(DetectLines(image.view(), nullptr, {}, &workspace)), first);
  EXPECT_EQ(LineImageToJson(LinesOf(image)), first);
}

TEST(LineImageToJson, WritesTheContractsFields) {
  LineImage lines{"a.png", 20, 10, 1.5, true, {}, {}};
  LineSegment s;
  s.start = {1.25, 2}, s.end = {9, 2.5}, s.ideal_start = {1.26, 2}, s.ideal_end = {9.01, 2.5},
  s.sigma_offset_px = 0.02, s.contrast = 41;
  lines.segments = {s};
  EllipticalArc arc;
  arc.center = {10, 5}, arc.axes = {4, 3}, arc.angle_rad = RadFromDeg(12.5), arc.to_rad = 2 * kPi;
  lines.arcs = {arc};
  const auto j = nlohmann::json::parse(LineImageToJson(lines));
  EXPECT_EQ(j["format"], "vss-lines/1");
  EXPECT_EQ(j["image"], "a.png");
  EXPECT_EQ(j["width"], 20);
  EXPECT_EQ(j["height"], 10);
  EXPECT_EQ(j["segments"][0]["start"], nlohmann::json({1.25, 2.0}));
  EXPECT_EQ(j["segments"][0]["ideal_end"], nlohmann::json({9.01, 2.5}));
  EXPECT_EQ(j["segments"][0]["sigma_px"], 0.02);
  EXPECT_EQ(j["arcs"][0]["angle"], 12.5);
  EXPECT_EQ(j["arcs"][0]["to"], 360.0);
  EXPECT_EQ(j["arcs"][0]["bright"], "outside");
  lines.lens_known = false;
  EXPECT_FALSE(nlohmann::json::parse(LineImageToJson(lines))["segments"][0].contains("ideal_start"));
}

TEST(LineParameters, NamesEveryOptionWithItsRange) {
  LineOptions options;
  EXPECT_TRUE(*SetParameter(LineParameters(), "lines.min_length_px", 20, options));
  EXPECT_EQ(options.min_length_px, 20);
  EXPECT_FALSE(SetParameter(LineParameters(), "lines.min_length_px", -1, options).has_value());
}

}  // namespace
}  // namespace vss
