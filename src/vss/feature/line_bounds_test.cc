// What the line detector promises of any picture: time, memory, the same bytes, no allocation; and edges that
// are hard to see or to tell apart.
#include <gtest/gtest.h>
#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <new>
#include <thread>

#include "vss/feature/line_pictures.h"
#include "vss/feature/line_scene.h"

namespace {

// Every allocation of this program is counted.
std::atomic<std::size_t> allocations{0};
std::atomic<std::ptrdiff_t> live_bytes{0}, most_bytes{0};

void* Allocate(std::size_t size, std::size_t alignment) {
  void* p = alignment > alignof(std::max_align_t)
                ? std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)
                : std::malloc(size > 0 ? size : 1);
  if (p == nullptr) throw std::bad_alloc();
  ++allocations;
  const auto live = live_bytes += static_cast<std::ptrdiff_t>(malloc_usable_size(p));
  for (auto most = most_bytes.load(); live > most && !most_bytes.compare_exchange_weak(most, live);) continue;
  return p;
}

void Free(void* p) {
  if (p == nullptr) return;
  live_bytes -= static_cast<std::ptrdiff_t>(malloc_usable_size(p));
  std::free(p);
}

}  // namespace

void* operator new(std::size_t size) { return Allocate(size, 0); }
void* operator new[](std::size_t size) { return Allocate(size, 0); }
void* operator new(std::size_t size, std::align_val_t a) { return Allocate(size, std::size_t(a)); }
void* operator new[](std::size_t size, std::align_val_t a) { return Allocate(size, std::size_t(a)); }
void operator delete(void* p) noexcept { Free(p); }
void operator delete[](void* p) noexcept { Free(p); }
void operator delete(void* p, std::size_t) noexcept { Free(p); }
void operator delete[](void* p, std::size_t) noexcept { Free(p); }
void operator delete(void* p, std::align_val_t) noexcept { Free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { Free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { Free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { Free(p); }

namespace vss {
namespace {

using Eigen::Vector2d;

// Rectangles and noise on a grid of 97 x 113 px, by arithmetic that is done at once.
GreyImage Tiled(int width, int height) {
  GreyImage image(width, height, 8);
  unsigned state = 1;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      state = state * 1664525u + 1013904223u;
      const unsigned noise = (state >> 24 & 7) + (state >> 20 & 7) + (state >> 16 & 7);
      image.Row8(v)[u] = static_cast<std::uint8_t>(60 + noise + ((u / 97 + v / 113) % 5 == 0 ? 60 : 0));
    }
  return image;
}

struct Cost {
  double ns_per_pixel, bytes_per_pixel;
  std::size_t segments;
};

Cost CostOf(const GreyImage& image) {
  const double pixels = double(image.width()) * image.height();
  const auto before = live_bytes.load();
  most_bytes = before;
  const std::clock_t start = std::clock();
  const LineImage lines = LinesOf(image);
  return {1e9 * double(std::clock() - start) / CLOCKS_PER_SEC / pixels, double(most_bytes - before) / pixels,
          lines.segments.size()};
}

TEST(DetectLines, NeedsTimeInProportionToThePixelsAndFewBytesBesideThem) {
  constexpr double kMaxBytes = 12;
  const Cost small = CostOf(Tiled(1500, 1500)), large = CostOf(Tiled(6000, 6000));
  EXPECT_GT(large.segments, 13 * small.segments);
  EXPECT_LT(small.bytes_per_pixel, kMaxBytes);
  EXPECT_LT(large.bytes_per_pixel, kMaxBytes);
  constexpr double kSlack = 2.5;  // caches, and a busy machine
  EXPECT_LT(large.ns_per_pixel, kSlack * small.ns_per_pixel);
  RecordProperty("bytes_per_pixel", std::to_string(large.bytes_per_pixel));
  RecordProperty("ns_per_pixel", std::to_string(large.ns_per_pixel));
}

TEST(DetectLines, NeedsTimeAndMemoryInProportionToThePixelsOfNoise) {
  auto noise = [](int size) { return CostOf(Render(size, size, 8, 10, [](int, int) { return 120; })); };
  const Cost small = noise(400), large = noise(1600);
  EXPECT_EQ(small.segments + large.segments, 0u);
  EXPECT_LT(large.bytes_per_pixel, 12);
  constexpr double kSlack = 3;
  EXPECT_LT(large.ns_per_pixel, kSlack * small.ns_per_pixel);
}

TEST(DetectLines, AllocatesNothingWhereWorkspaceAndLinesAreKept) {
  const TestRectangle r;
  const GreyImage image = Render(300, 200, 8, 2, [&](int u, int v) {
    return std::max(r.At(u, v), 60 + 80 * TestStep(20 - std::hypot(u - 240.3, v - 101.2)));
  });
  const Intrinsics lens{LensModel::kOpenCv, 300, 300, 149.5, 99.5, {-0.05}, 1, 0};
  LineWorkspace workspace;
  LineImage lines;
  for (const Intrinsics* known : {static_cast<const Intrinsics*>(nullptr), &lens}) {
    DetectLines(image.view(), known, {}, workspace, lines);
    const std::string first = LineImageToJson(lines);
    const std::size_t before = allocations;
    DetectLines(image.view(), known, {}, workspace, lines);
    EXPECT_EQ(allocations - before, 0u);
    EXPECT_EQ(LineImageToJson(lines), first);
    EXPECT_GE(lines.segments.size(), 4u);
    EXPECT_EQ(lines.arcs.size(), 1u);
  }
}

TEST(DetectLines, GivesTheSameBytesInAnyNumberOfThreadsAndWithEveryInstructionSet) {
  GreyImage image = Tiled(700, 500);
  for (int v = 200; v < 300; ++v)
    for (int u = 300; u < 400; ++u)
      if (std::hypot(u - 350.3, v - 250.1) < 40) image.Row8(v)[u] = 220;
  ASSERT_GE(LinesOf(image).arcs.size(), 1u);
  const std::string expected = LineImageToJson(LinesOf(image));
  ASSERT_GT(expected.size(), 5000u);
  std::vector<std::string> got(4);
  std::vector<std::thread> threads;
  for (auto& mine : got) threads.emplace_back([&] { mine = LineImageToJson(LinesOf(image)); });
  for (auto& t : threads) t.join();
  for (const Simd simd : {Simd::kPortable, Simd::kAvx2, Simd::kAvx512}) {
    LineWorkspace workspace;
    workspace.buffers().edges.simd = simd;
    got.push_back(LineImageToJson(DetectLines(image.view(), nullptr, {}, &workspace)));
  }
  for (const auto& one : got) EXPECT_EQ(one, expected);
}

TEST(DetectLines, TakesPicturesOfAnyShape) {
  for (const auto& [width, height] : {std::pair{70000, 24}, {24, 70000}}) {
    const GreyImage image =
        Render(width, height, 8, 1, [&](int u, int v) { return std::max(u, v) % 97 < 48 ? 60.0 : 140.0; });
    const LineImage lines = LinesOf(image);
    EXPECT_TRUE(IsFinite(lines));
    double farthest = 0;
    for (const auto& s : lines.segments) {
      EXPECT_GE(std::min({s.start.x(), s.start.y(), s.end.x(), s.end.y()}), -1);
      EXPECT_LE(std::max(s.start.x(), s.end.x()), width);
      EXPECT_LE(std::max(s.start.y(), s.end.y()), height);
      farthest = std::max({farthest, s.start.x(), s.start.y()});
    }
    EXPECT_GT(farthest, 69000);
    EXPECT_NEAR(double(lines.segments.size()), 2 * 70000 / 97.0, 20);
  }
}

TEST(DetectLines, FindsNoLinesInACheckerboardOfSinglePixelsOrInSaturation) {
  for (const int bits : {8, 16}) {
    const double most = bits == 8 ? 255 : 655.35;
    for (const double low : {0.0, most}) {
      const GreyImage image =
          Render(300, 200, bits, 0, [&](int u, int v) { return (u + v) % 2 ? most : low; });
      const LineImage lines = LinesOf(image);
      EXPECT_TRUE(lines.segments.empty());
      EXPECT_TRUE(lines.arcs.empty());
    }
  }
}

// The segment that lies on the edge from `from` to `to` over at least four fifths of it, or null.
const LineSegment* WholeEdge(const LineImage& lines, const Vector2d& from, const Vector2d& to) {
  constexpr double kWhole = 0.8, kMaxOffPx = 1.5;
  const Vector2d d = (to - from).normalized();
  const double length = (to - from).norm();
  for (const auto& s : lines.segments) {
    if (std::max(std::abs(AcrossPx(from, to, s.start)), std::abs(AcrossPx(from, to, s.end))) > kMaxOffPx)
      continue;
    const double a = d.dot(s.start - from), b = d.dot(s.end - from);
    if (std::min(b, length) - std::max(a, 0.0) > kWhole * length) return &s;
  }
  return nullptr;
}

TEST(DetectLines, FindsBothEdgesOfThinBarsAtTheirTruePlaces) {
  constexpr double kMaxErrorPx = 0.1;
  int edges = 0;
  for (const double width : {2.0, 2.5, 3.0, 4.0})
    for (const double angle : {0.0, 0.2, 0.7, 1.3}) {
      const TestRectangle bar{{100.3, 90.7}, 60, width / 2, angle};
      const LineImage lines = LinesOf(Render(200, 180, 8, 1, [&](int u, int v) { return bar.At(u, v); }));
      const auto corner = bar.Corners();
      for (const int i : {1, 3}) {
        const Vector2d from = corner[std::size_t(i)], to = corner[std::size_t(i + 1) % 4];
        const LineSegment* s = WholeEdge(lines, from, to);
        ASSERT_NE(s, nullptr) << "width " << width << " angle " << angle << " edge " << i;
        EXPECT_LT(std::abs(AcrossPx(from, to, 0.5 * (s->start + s->end))), kMaxErrorPx)
            << "width " << width << " angle " << angle << " edge " << i;
        ++edges;
      }
    }
  EXPECT_EQ(edges, 32);
}

TEST(DetectLines, FindsMostEdgesWholeThatAreFourTimesAsStrongAsTheNoise) {
  constexpr double kMinShare = 0.7;
  int whole = 0, edges = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const TestRectangle r{{100.3 + 0.1 * seed, 90.7}, 60, 30, 0.15 * seed, 60, 100};
    const LineImage lines = LinesOf(Render(
        200, 180, 8, 10, [&](int u, int v) { return r.At(u, v); }, seed));
    const auto corner = r.Corners();
    for (std::size_t i = 0; i < 4; ++i, ++edges)
      whole += WholeEdge(lines, corner[i], corner[(i + 1) % 4]) != nullptr;
  }
  EXPECT_GE(whole, kMinShare * edges) << whole << " of " << edges;
}

// Share of the bright side at t px from an edge of that blur (lens and pixel).
double Step(double t, double blur_px) { return 0.5 * std::erfc(-t / (std::sqrt(2.0) * blur_px)); }

// Distance (px) of a place from an edge across a picture of 200 x 180 px, towards its bright side.
double FromEdge(double u, double v) { return std::cos(0.4) * (u - 97.3) + std::sin(0.4) * (v - 88.6); }

TEST(DetectLines, FindsAWeakBlurredEdgeOnceAndWhole) {
  constexpr double kContrast = 40, kNoise = 5, kBlurPx = 1.5;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const LineImage lines = LinesOf(Render(
        200, 180, 8, kNoise, [&](int u, int v) { return 100 + kContrast * Step(FromEdge(u, v), kBlurPx); },
        seed));
    ASSERT_EQ(lines.segments.size(), 1u) << "seed " << seed;
    const LineSegment& s = lines.segments[0];
    EXPECT_GT((s.end - s.start).norm(), 180);
    EXPECT_LT(std::abs(FromEdge(s.start.x(), s.start.y())), 0.4);
    EXPECT_LT(std::abs(FromEdge(s.end.x(), s.end.y())), 0.4);
  }
}

TEST(DetectLines, KnowsThatSaturationHidesAnEdgesPlace) {
  constexpr double kBlurPx = 0.8;
  for (const double bright : {220.0, 400.0}) {
    const LineImage lines = LinesOf(Render(
        200, 180, 8, 2, [&](int u, int v) { return 80 + (bright - 80) * Step(FromEdge(u, v), kBlurPx); }));
    ASSERT_EQ(lines.segments.size(), 1u);
    const LineSegment& s = lines.segments[0];
    const Vector2d middle = 0.5 * (s.start + s.end);
    EXPECT_LT(std::abs(FromEdge(middle.x(), middle.y())), 3 * s.sigma_offset_px) << bright;
    if (bright < 255) {
      EXPECT_LT(s.sigma_offset_px, 0.01);
    }
  }
}

// A bright ellipse of 12 x 9 px, or its half below the longer axis, seen through a window of `wide_px`.
struct SmallEllipse {
  Vector2d center;
  double turn_rad;
  bool half;

  bool Has(const Vector2d& p) const {
    const Vector2d d = p - center;
    const double x = std::cos(turn_rad) * d.x() + std::sin(turn_rad) * d.y(),
                 y = -std::sin(turn_rad) * d.x() + std::cos(turn_rad) * d.y();
    return std::hypot(x / 12, y / 9) < 1 && (!half || y > 0);
  }
  double At(int u, int v, double wide_px) const {
    constexpr int kSub = 5;
    int inside = 0;
    for (int k = 0; k < kSub * kSub; ++k)
      inside += Has({u + wide_px * (k % kSub - 2) / kSub, v + wide_px * (k / kSub - 2) / kSub});
    return double(inside) / (kSub * kSub);
  }
};

// How many of 24 such ellipses are found within 2 px, whole ones as such.
int NumSmallEllipsesFound(bool half, double noise, double wide_px) {
  int found = 0;
  for (int i = 0; i < 24; ++i) {
    const SmallEllipse e{{50.3 + 0.1 * i, 51.2}, 0.3 * i, half};
    const LineImage lines = LinesOf(Render(
        100, 100, 8, noise, [&](int u, int v) { return 60 + 80 * e.At(u, v, wide_px); }, unsigned(i)));
    found += std::count_if(lines.arcs.begin(), lines.arcs.end(), [&](const EllipticalArc& a) {
      return (a.center - e.center).norm() < 2 && (half || a.to_rad - a.from_rad > 6.28);
    });
  }
  return found;
}

TEST(DetectLines, FindsMostSmallArcsBesideTheirChord) { EXPECT_GE(NumSmallEllipsesFound(true, 2, 3), 20); }

TEST(DetectLines, FindsMostSmallBlurredEllipsesInNoiseAllTheWayRound) {
  EXPECT_GE(NumSmallEllipsesFound(false, 5, 5), 18);
}

}  // namespace
}  // namespace vss
