#include "vss/feature/edge_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace vss {
namespace {

constexpr int kPad = 2;       // the filter's reach
constexpr int kBorderPx = 2;  // points nearer to the border would be made of repeated pixels

template <class Pixel>
const Pixel* Row(const GreyView& image, int v) {
  return reinterpret_cast<const Pixel*>(static_cast<const std::uint8_t*>(image.data) +
                                        v * image.stride_bytes);
}

// ---- filters of one row ----

// For 8 bit pixels all values fit 16 bits: |gx|, |gy| <= 48 * 255.
template <class Pixel>
struct Filter;
template <>
struct Filter<std::uint8_t> {
  using Value = std::int16_t;
};
template <>
struct Filter<std::uint16_t> {
  using Value = std::int32_t;
};

template <class Value>
[[gnu::always_inline]] inline Value Abs(Value x) {
  return x < 0 ? Value(-x) : x;
}

// |response| to the mask (1 -2 1)^T (1 -2 1), which is blind to straight edges
// along the axes and to shading.
template <class Pixel, class Value>
[[gnu::always_inline]] inline void FilterMask(const Pixel* __restrict up, const Pixel* __restrict mid,
                                              const Pixel* __restrict down, int width, Value* __restrict bend,
                                              Value* __restrict out) {
  for (int u = 0; u < width; ++u) bend[u] = Value(Value(up[u]) - 2 * Value(mid[u]) + Value(down[u]));
  out[0] = out[width - 1] = 0;
  for (int u = 1; u < width - 1; ++u) out[u] = Abs(Value(bend[u - 1] - 2 * bend[u] + bend[u + 1]));
}

template <class Pixel, class Value>
[[gnu::always_inline]] inline void FilterDown(const Pixel* const* r, int width, Value* __restrict smooth,
                                              Value* __restrict slope) {
  const Pixel* __restrict a = r[0];
  const Pixel* __restrict b = r[1];
  const Pixel* __restrict c = r[2];
  const Pixel* __restrict d = r[3];
  const Pixel* __restrict e = r[4];
  for (int u = 0; u < width; ++u) {
    smooth[u] = Value(Value(a[u]) + Value(e[u]) + 4 * (Value(b[u]) + Value(d[u])) + 6 * Value(c[u]));
    slope[u] = Value(Value(e[u]) - Value(a[u]) + 2 * (Value(d[u]) - Value(b[u])));
  }
}

template <class Value>
[[gnu::always_inline]] inline void FilterAcross(const Value* __restrict smooth, const Value* __restrict slope,
                                                int width, Value* __restrict gx, Value* __restrict gy,
                                                Value* __restrict magnitude) {
  for (int u = 0; u < width; ++u) {
    const Value x = Value(smooth[u + 2] - smooth[u - 2] + 2 * (smooth[u + 1] - smooth[u - 1]));
    const Value y = Value(slope[u - 2] + slope[u + 2] + 4 * (slope[u - 1] + slope[u + 1]) + 6 * slope[u]);
    gx[u] = x;
    gy[u] = y;
    magnitude[u] = Value(Abs(x) + Abs(y));
  }
}

// flags[u]: whether the magnitude has a maximum here along the axis nearer to
// the gradient, and the gradient's length may be above the threshold. The sum
// of absolute values stands for the length in the comparison: along a straight
// edge's profile they are proportional. 7/8 max + 1/2 min stands for it at the
// threshold: within 3 %.
template <class Value>
[[gnu::always_inline]] inline void FlagMaxima(const Value* __restrict up, const Value* __restrict mid,
                                              const Value* __restrict down, const Value* __restrict gx,
                                              const Value* __restrict gy, const Value* __restrict threshold,
                                              int width, std::uint8_t* __restrict flags) {
  for (int u = 0; u < width; ++u) {
    const Value x = Abs(gx[u]), y = Abs(gy[u]);
    const Value large = x >= y ? x : y, small = x >= y ? y : x;
    const Value length = Value(large - (large >> 3) + (small >> 1));
    const Value left = mid[u - 1], right = mid[u + 1], above = up[u], below = down[u], here = mid[u];
    const Value before = x >= y ? left : above, after = x >= y ? right : below;
    flags[u] = (length > threshold[u]) & (here > before) & (here >= after) ? 1 : 0;
  }
}

// Three rows of gradient, the middle one being that of the points.
template <class Value>
struct GradientRows {
  const Value *gx[3], *gy[3];
};

// Points that are worked on at once.
constexpr int kLot = 16;

struct PointLot {
  float x[kLot], y[kLot], length[kLot];                                           // of the gradient
  float before_x[kLot], before_y[kLot], after_x[kLot], after_y[kLot], row[kLot];  // its neighbours
};

// The gradients at `n` places of the middle row, and before and after each along the axis nearer to it; what
// is left of the lot is filled with anything. `row`: 1 where that axis is v.
template <class Value>
[[gnu::always_inline]] inline void TakeLot(const GradientRows<Value>& r, const std::uint32_t* at, int n,
                                           PointLot& lot) {
  for (int i = 0; i < kLot; ++i) {
    const std::size_t u = at[i < n ? i : 0];
    const float x = static_cast<float>(r.gx[1][u]), y = static_cast<float>(r.gy[1][u]);
    const bool upright = std::abs(x) < std::abs(y);
    const Value *before_x = upright ? r.gx[0] + u : r.gx[1] + u - 1,
                *before_y = upright ? r.gy[0] + u : r.gy[1] + u - 1,
                *after_x = upright ? r.gx[2] + u : r.gx[1] + u + 1,
                *after_y = upright ? r.gy[2] + u : r.gy[1] + u + 1;
    lot.x[i] = x, lot.y[i] = y, lot.length[i] = std::sqrt(x * x + y * y);
    lot.before_x[i] = static_cast<float>(*before_x), lot.before_y[i] = static_cast<float>(*before_y);
    lot.after_x[i] = static_cast<float>(*after_x), lot.after_y[i] = static_cast<float>(*after_y);
    lot.row[i] = upright ? 1.0f : 0.0f;
  }
}

// Edge points at the `n` places `at` of a row v: along the axis that is nearer to the gradient, the maximum
// of the parabola through the three gradients along the direction at the point (in -0.5 to 0.5 px).
template <class Value>
[[gnu::always_inline]] inline void MeasurePoints(const GradientRows<Value>& r, const std::uint32_t* at, int n,
                                                 std::uint32_t v, EdgePoint* out) {
  PointLot lot;
  for (int first = 0; first < n; first += kLot) {
    const int taken = std::min(kLot, n - first);
    TakeLot(r, at + first, taken, lot);
    float nu[kLot], nv[kLot], offset[kLot], ratio[kLot];
    for (int i = 0; i < kLot; ++i) {
      const float x = lot.x[i] / lot.length[i], y = lot.y[i] / lot.length[i], here = lot.length[i];
      const float before = lot.before_x[i] * x + lot.before_y[i] * y,
                  after = lot.after_x[i] * x + lot.after_y[i] * y, bend = before - 2 * here + after;
      const float most = 0.5f * (before - after) / bend, low = most < -0.5f ? -0.5f : most,
                  high = low > 0.5f ? 0.5f : low, product = before * after / (here * here);
      nu[i] = x, nv[i] = y;
      offset[i] = bend < 0 ? high : 0.0f;
      ratio[i] = (before > 0) & (after > 0) ? product : 0.0f;
    }
    for (int i = 0; i < taken; ++i) {
      const std::uint32_t u = at[first + i];
      out[first + i] = {static_cast<float>(u) + (1.0f - lot.row[i]) * offset[i],
                        static_cast<float>(v) + lot.row[i] * offset[i],
                        nu[i],
                        nv[i],
                        lot.length[i],
                        ratio[i],
                        u,
                        v};
    }
  }
}

template <class Pixel, class Value>
struct RowFunctions {
  void (*mask)(const Pixel*, const Pixel*, const Pixel*, int, Value*, Value*);
  void (*down)(const Pixel* const*, int, Value*, Value*);
  void (*across)(const Value*, const Value*, int, Value*, Value*, Value*);
  void (*flag)(const Value*, const Value*, const Value*, const Value*, const Value*, const Value*, int,
               std::uint8_t*);
  void (*points)(const GradientRows<Value>&, const std::uint32_t*, int, std::uint32_t, EdgePoint*);
};

#define VSS_ROW_FUNCTIONS(NAME, ATTRIBUTE)                                                                  \
  template <class Pixel, class Value>                                                                       \
  struct NAME {                                                                                             \
    ATTRIBUTE static void Mask(const Pixel* a, const Pixel* b, const Pixel* c, int w, Value* t, Value* o) { \
      FilterMask<Pixel, Value>(a, b, c, w, t, o);                                                           \
    }                                                                                                       \
    ATTRIBUTE static void Down(const Pixel* const* r, int w, Value* s, Value* d) {                          \
      FilterDown<Pixel, Value>(r, w, s, d);                                                                 \
    }                                                                                                       \
    ATTRIBUTE static void Across(const Value* s, const Value* d, int w, Value* x, Value* y, Value* m) {     \
      FilterAcross<Value>(s, d, w, x, y, m);                                                                \
    }                                                                                                       \
    ATTRIBUTE static void Flag(const Value* a, const Value* b, const Value* c, const Value* x,              \
                               const Value* y, const Value* t, int w, std::uint8_t* f) {                    \
      FlagMaxima<Value>(a, b, c, x, y, t, w, f);                                                            \
    }                                                                                                       \
    ATTRIBUTE static void Points(const GradientRows<Value>& r, const std::uint32_t* at, int n,              \
                                 std::uint32_t v, EdgePoint* out) {                                         \
      MeasurePoints<Value>(r, at, n, v, out);                                                               \
    }                                                                                                       \
    static RowFunctions<Pixel, Value> Get() { return {Mask, Down, Across, Flag, Points}; }                  \
  }
VSS_ROW_FUNCTIONS(Portable, );
#if defined(__x86_64__)
VSS_ROW_FUNCTIONS(Avx2, __attribute__((target("avx2"))));
VSS_ROW_FUNCTIONS(Avx512, __attribute__((target("avx512f,avx512bw,avx512vl,prefer-vector-width=512"))));
#endif
#undef VSS_ROW_FUNCTIONS

template <class Pixel, class Value>
RowFunctions<Pixel, Value> Choose([[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  const bool avx512 = __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  if (avx512 && (simd == Simd::kBest || simd == Simd::kAvx512)) return Avx512<Pixel, Value>::Get();
  if (__builtin_cpu_supports("avx2") && simd != Simd::kPortable) return Avx2<Pixel, Value>::Get();
#endif
  return Portable<Pixel, Value>::Get();
}

template <class Value>
void Replicate(Value* row, int width) {
  for (int i = 1; i <= kPad; ++i) {
    row[-i] = row[0];
    row[width - 1 + i] = row[width - 1];
  }
}

// Rows of gradient in a ring of three.
template <class Value>
struct Rows {
  Value *smooth, *slope, *threshold;
  Value *gx[3], *gy[3], *magnitude[3];
};

template <class Value>
Rows<Value> Layout(EdgeBuffers& buffers, int width) {
  constexpr int kRows = 12;
  const std::size_t stride = std::size_t(width) + 2 * kPad + 64 / sizeof(Value);
  buffers.rows.resize((stride * kRows * sizeof(Value) + 3) / 4);
  Value* at = reinterpret_cast<Value*>(buffers.rows.data()) + kPad;
  auto next = [&] {
    Value* row = at;
    at += stride;
    return row;
  };
  Rows<Value> r;
  r.smooth = next(), r.slope = next(), r.threshold = next();
  for (int i = 0; i < 3; ++i) r.gx[i] = next(), r.gy[i] = next(), r.magnitude[i] = next();
  return r;
}

template <class Pixel, class Value>
void GradientRow(const GreyView& image, const RowFunctions<Pixel, Value>& filter, const Rows<Value>& r, int v,
                 int slot) {
  const Pixel* rows[5];
  for (int i = 0; i < 5; ++i) rows[i] = Row<Pixel>(image, std::clamp(v + i - 2, 0, image.height - 1));
  filter.down(rows, image.width, r.smooth, r.slope);
  Replicate(r.smooth, image.width);
  Replicate(r.slope, image.width);
  filter.across(r.smooth, r.slope, image.width, r.gx[slot], r.gy[slot], r.magnitude[slot]);
}

// ---- noise and texture: how large mask and gradient are where no edges are
// ----

constexpr int kBlockPx = 16;      // pixels of a block, along a row
constexpr int kBlockRowStep = 4;  // every fourth row is looked at
constexpr int kTileBlocks = NoiseMap::kTilePx / kBlockPx * (NoiseMap::kTilePx / kBlockRowStep);
constexpr double kMaskNorm = 6.0;                      // root of the mask's sum of squares
constexpr double kMeanAbsNormal = 0.7978845608028654;  // E|x| of a standard normal
constexpr double kMeanAbsSum = 2 * kMeanAbsNormal;     // E(|x| + |y|) of two standard normals
constexpr double kQuietShare = 0.3;  // of a tile's blocks: edges may cross seven tenths of them

static_assert(kTileBlocks <= TileValues::kRanked);

// Means of a row's blocks go to the tiles that they lie in; those of the first
// and last `border` pixels count for nothing.
template <class Value>
void CollectBlocks(const Value* values, int width, int border, int place, TileValues& blocks) {
  for (int u0 = 0, i = 0; u0 < width; u0 += kBlockPx, ++i) {
    const int begin = std::max(u0, border), end = std::min(u0 + kBlockPx, width - border);
    std::int32_t sum = 0;
    std::int64_t total = 0;
    if constexpr (sizeof(Value) == 2) {
      for (int u = begin; u < end; ++u) sum += values[u];
      total = sum;
    } else {
      for (int u = begin; u < end; ++u) total += values[u];
    }
    constexpr int kPerRow = NoiseMap::kTilePx / kBlockPx;
    if (end > begin)
      blocks.At(place * kPerRow + i % kPerRow, i / kPerRow) = static_cast<float>(total) / (end - begin);
  }
}

// Ends a row of tiles.
void AppendQuantiles(const TileValues& blocks, double share, double per_sigma, std::vector<float>& of_row,
                     std::vector<float>& raw) {
  TileQuantiles(blocks, share, of_row);
  for (const float mean : of_row) {
    const bool none = mean == TileValues::kNoValue;
    const float before = raw.empty() ? 0.0f : raw.back();
    raw.push_back(none ? before : mean / static_cast<float>(per_sigma));
  }
}

// The median over the 3x3 tiles around each, not below `floor`.
void MedianOfTiles(const std::vector<float>& raw, int columns, int rows, float floor, EdgeBuffers& b,
                   std::vector<float>& out) {
  out.clear();
  for (int y = 0; y < rows; ++y) {
    b.around.Clear(columns);
    for (int j = std::max(0, y - 1); j <= std::min(rows - 1, y + 1); ++j)
      for (int i = -1; i <= 1; ++i)
        for (int x = std::max(0, -i); x < std::min(columns, columns - i); ++x)
          b.around.At(3 * (j - y + 1) + i + 1, x) = raw[std::size_t(j) * columns + x + i];
    TileQuantiles(b.around, 0.5, b.of_row);
    for (const float median : b.of_row) out.push_back(std::max(floor, median));
  }
}

template <class Pixel>
void MeasureTiles(const GreyView& image, EdgeBuffers& b, const NoiseMap& noise) {
  using Value = typename Filter<Pixel>::Value;
  const auto filter = Choose<Pixel, Value>(b.simd);
  const Rows<Value> r = Layout<Value>(b, image.width);
  b.raw_sigma.clear(), b.raw_texture.clear();
  for (int y = 0; y < noise.rows; ++y) {
    b.noise_blocks.Clear(noise.columns), b.texture_blocks.Clear(noise.columns);
    int place = 0;
    for (int v = y * NoiseMap::kTilePx + 2; v < std::min((y + 1) * NoiseMap::kTilePx, image.height - 1);
         v += kBlockRowStep, ++place) {
      filter.mask(Row<Pixel>(image, v - 1), Row<Pixel>(image, v), Row<Pixel>(image, v + 1), image.width,
                  r.smooth, r.slope);
      CollectBlocks(r.slope, image.width, 1, place, b.noise_blocks);
      GradientRow(image, filter, r, v, 0);
      CollectBlocks(r.magnitude[0], image.width, kBorderPx, place, b.texture_blocks);
    }
    AppendQuantiles(b.noise_blocks, 0.5, kMaskNorm * kMeanAbsNormal, b.of_row, b.raw_sigma);
    AppendQuantiles(b.texture_blocks, kQuietShare, kMeanAbsSum, b.of_row, b.raw_texture);
  }
}

// ---- maxima of the gradient, row by row ----

// Edge points weaker than so many sigmas of the texture around them wander with it and make no lines: of
// texture alone no more than one pixel in twenty is stronger.
constexpr double kTextureSigmas = 2.5;

template <class Value>
void FillThreshold(const NoiseMap& noise, int v, double noise_sigmas, int width, Value* threshold) {
  const std::size_t first = noise.Tile(0, v);
  for (int u0 = 0, i = 0; u0 < width; u0 += NoiseMap::kTilePx, ++i) {
    const double t = std::max(noise_sigmas * kGradientNoise * noise.sigma[first + i],
                              kTextureSigmas * noise.texture[first + i]);
    std::fill(threshold + u0, threshold + std::min(u0 + NoiseMap::kTilePx, width),
              static_cast<Value>(std::min(t, double(std::numeric_limits<Value>::max()))));
  }
}

// The places of a row's flags, in order, counted from `first` on.
std::size_t ListFlags(const std::uint8_t* flags, int width, int first, std::uint32_t* out) {
  std::size_t n = 0;
  for (int u0 = 0; u0 < width; u0 += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, flags + u0, 8);
    for (; eight != 0; eight &= eight - 1)
      out[n++] = static_cast<std::uint32_t>(first + u0 + std::countr_zero(eight) / 8);
  }
  return n;
}

template <class Pixel>
void FindPoints(const GreyView& image, const NoiseMap& noise, double noise_sigmas, EdgeBuffers& b,
                std::vector<EdgePoint>& points) {
  using Value = typename Filter<Pixel>::Value;
  const auto filter = Choose<Pixel, Value>(b.simd);
  const int w = image.width, h = image.height;
  const Rows<Value> r = Layout<Value>(b, w);
  b.flags.assign(std::size_t(w) + 16, 0);
  b.flagged.resize(std::size_t(w));
  GradientRow(image, filter, r, kBorderPx - 1, (kBorderPx - 1) % 3);
  GradientRow(image, filter, r, kBorderPx, kBorderPx % 3);
  for (int v = kBorderPx; v < h - kBorderPx; ++v) {
    GradientRow(image, filter, r, v + 1, (v + 1) % 3);
    if (v == kBorderPx || v % NoiseMap::kTilePx == 0) FillThreshold(noise, v, noise_sigmas, w, r.threshold);
    const int ring[3] = {(v + 2) % 3, v % 3, (v + 1) % 3};
    constexpr int k = kBorderPx;
    filter.flag(r.magnitude[ring[0]] + k, r.magnitude[ring[1]] + k, r.magnitude[ring[2]] + k,
                r.gx[ring[1]] + k, r.gy[ring[1]] + k, r.threshold + k, w - 2 * k, b.flags.data());
    const std::size_t n = ListFlags(b.flags.data(), w - 2 * k, k, b.flagged.data()), before = points.size();
    if (n == 0) continue;
    points.resize(before + n);
    GradientRows<Value> rows;
    for (int i = 0; i < 3; ++i) rows.gx[i] = r.gx[ring[i]], rows.gy[i] = r.gy[ring[i]];
    filter.points(rows, b.flagged.data(), static_cast<int>(n), static_cast<std::uint32_t>(v),
                  &points[before]);
  }
}

}  // namespace

float ProfileVariance(const EdgePoint& p) {
  constexpr float kWidest = 25;               // px^2: an edge of 5 px blur, the widest that is of use
  constexpr float kWidestRatio = 0.9607894f;  // exp(-1 / kWidest)
  const float cosine = std::abs(p.nu) >= std::abs(p.nv) ? p.nu : p.nv;
  const float along_axis = !(p.profile_ratio > 0)            ? static_cast<float>(kGradientVariance)
                           : p.profile_ratio >= kWidestRatio ? kWidest
                                                             : -1.0f / std::log(p.profile_ratio);
  return along_axis * cosine * cosine;
}

void EstimateNoise(const GreyView& image, float min_sigma, EdgeBuffers& b, NoiseMap& noise) {
  noise.columns = (image.width + NoiseMap::kTilePx - 1) / NoiseMap::kTilePx;
  noise.rows = (image.height + NoiseMap::kTilePx - 1) / NoiseMap::kTilePx;
  if (image.bits == 8)
    MeasureTiles<std::uint8_t>(image, b, noise);
  else
    MeasureTiles<std::uint16_t>(image, b, noise);
  MedianOfTiles(b.raw_sigma, noise.columns, noise.rows, min_sigma, b, noise.sigma);
  MedianOfTiles(b.raw_texture, noise.columns, noise.rows, 0, b, noise.texture);
  for (std::size_t i = 0; i < noise.texture.size(); ++i)
    noise.texture[i] = std::max(noise.texture[i], static_cast<float>(kGradientNoise * noise.sigma[i]));
  const auto middle = b.raw_sigma.begin() + std::ptrdiff_t(b.raw_sigma.size() / 2);
  std::nth_element(b.raw_sigma.begin(), middle, b.raw_sigma.end());
  noise.median_sigma = std::max(min_sigma, *middle);
}

void FindEdgePoints(const GreyView& image, const NoiseMap& noise, double threshold_sigmas,
                    EdgeBuffers& buffers, std::vector<EdgePoint>& points) {
  points.clear();
  if (image.width <= 2 * kBorderPx || image.height <= 2 * kBorderPx) return;
  if (image.bits == 8)
    FindPoints<std::uint8_t>(image, noise, threshold_sigmas, buffers, points);
  else
    FindPoints<std::uint16_t>(image, noise, threshold_sigmas, buffers, points);
}

}  // namespace vss
