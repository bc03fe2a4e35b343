#include "vss/feature/edge_points.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

namespace vss {
namespace {

constexpr int kPad = 2;       // the filter's reach
constexpr int kBorderPx = 2;  // points nearer to the border would be made of repeated pixels

// ---- noise ----

constexpr int kBlockPx = 16;                           // pixels a block of the noise estimate, along a row
constexpr int kBlockRowStep = 4;                       // every fourth row is looked at
constexpr double kMaskNorm = 6.0;                      // root of the mask's sum of squares
constexpr double kMeanAbsNormal = 0.7978845608028654;  // E|x| of a standard normal

template <class Pixel>
float MeanAbsMask(const Pixel* up, const Pixel* mid, const Pixel* down, int begin, int end) {
  std::int64_t sum = 0;
  for (int u = begin; u < end; ++u) {
    const int l = up[u - 1] - 2 * mid[u - 1] + down[u - 1];
    const int c = up[u] - 2 * mid[u] + down[u];
    const int r = up[u + 1] - 2 * mid[u + 1] + down[u + 1];
    sum += std::abs(l - 2 * c + r);
  }
  return static_cast<float>(double(sum) / (end - begin));
}

template <class Pixel>
const Pixel* Row(const GreyView& image, int v) {
  return reinterpret_cast<const Pixel*>(static_cast<const std::uint8_t*>(image.data) +
                                        v * image.stride_bytes);
}

float Median(std::vector<float>& values) {
  if (values.empty()) return 0;
  auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <class Pixel>
float TileSigma(const GreyView& image, int u0, int v0, std::vector<float>& means) {
  means.clear();
  const int u1 = std::min(u0 + NoiseMap::kTilePx, image.width - 1),
            v1 = std::min(v0 + NoiseMap::kTilePx, image.height - 1);
  for (int v = std::max(v0, 1); v < v1; v += kBlockRowStep)
    for (int u = std::max(u0, 1); u < u1; u += kBlockPx)
      means.push_back(MeanAbsMask(Row<Pixel>(image, v - 1), Row<Pixel>(image, v), Row<Pixel>(image, v + 1), u,
                                  std::min(u + kBlockPx, u1)));
  return static_cast<float>(Median(means) / (kMaskNorm * kMeanAbsNormal));
}

// ---- gradient and its maxima, row by row ----

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
    magnitude[u] = Value((x < 0 ? -x : x) + (y < 0 ? -y : y));
  }
}

// flags[u]: whether the magnitude has a maximum here along the axis nearer to the gradient. The sum of
// absolute values stands for the length: along a straight edge's profile they are proportional.
template <class Value>
[[gnu::always_inline]] inline void FlagMaxima(const Value* __restrict up, const Value* __restrict mid,
                                              const Value* __restrict down, const Value* __restrict gx,
                                              const Value* __restrict gy, const Value* __restrict threshold,
                                              int width, std::uint8_t* __restrict flags) {
  for (int u = 0; u < width; ++u) {
    const Value x = gx[u] < 0 ? Value(-gx[u]) : gx[u], y = gy[u] < 0 ? Value(-gy[u]) : gy[u];
    const Value before = x >= y ? mid[u - 1] : up[u], after = x >= y ? mid[u + 1] : down[u];
    flags[u] = std::uint8_t((mid[u] > threshold[u]) & (mid[u] > before) & (mid[u] >= after));
  }
}

template <class Pixel, class Value>
struct RowFunctions {
  void (*down)(const Pixel* const*, int, Value*, Value*);
  void (*across)(const Value*, const Value*, int, Value*, Value*, Value*);
  void (*flag)(const Value*, const Value*, const Value*, const Value*, const Value*, const Value*, int,
               std::uint8_t*);
};

#define VSS_ROW_FUNCTIONS(NAME, ATTRIBUTE)                                                              \
  template <class Pixel, class Value>                                                                   \
  struct NAME {                                                                                         \
    ATTRIBUTE static void Down(const Pixel* const* r, int w, Value* s, Value* d) {                      \
      FilterDown<Pixel, Value>(r, w, s, d);                                                             \
    }                                                                                                   \
    ATTRIBUTE static void Across(const Value* s, const Value* d, int w, Value* x, Value* y, Value* m) { \
      FilterAcross<Value>(s, d, w, x, y, m);                                                            \
    }                                                                                                   \
    ATTRIBUTE static void Flag(const Value* a, const Value* b, const Value* c, const Value* x,          \
                               const Value* y, const Value* t, int w, std::uint8_t* f) {                \
      FlagMaxima<Value>(a, b, c, x, y, t, w, f);                                                        \
    }                                                                                                   \
    static RowFunctions<Pixel, Value> Get() { return {Down, Across, Flag}; }                            \
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
  buffers.flags.assign(std::size_t(width) + 8, 0);
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

template <class Value>
void FillThreshold(const NoiseMap& noise, int v, double factor, int width, Value* threshold) {
  const float* tiles = &noise.sigma[std::size_t(v / NoiseMap::kTilePx) * noise.columns];
  for (int u0 = 0, i = 0; u0 < width; u0 += NoiseMap::kTilePx, ++i) {
    const double t = std::min(factor * tiles[i], double(std::numeric_limits<Value>::max()));
    std::fill(threshold + u0, threshold + std::min(u0 + NoiseMap::kTilePx, width), static_cast<Value>(t));
  }
}

struct Profile {
  double before, at, after;  // gradient along the direction at the point
};

// Offset of the maximum (px, in -0.5 to 0.5) by the parabola through the three values.
double ParabolaOffset(const Profile& p) {
  const double bend = p.before - 2 * p.at + p.after;
  if (!(bend < 0)) return 0;
  return std::clamp(0.5 * (p.before - p.after) / bend, -0.5, 0.5);
}

// Variance of the Gaussian through the three values, px^2 along the axis.
double ProfileVariance(const Profile& p) {
  constexpr double kWidest = 25.0;  // px^2: an edge of 5 px blur, the widest that is of use
  const double ratio = p.before * p.after / (p.at * p.at);
  if (!(p.before > 0 && p.after > 0 && ratio < 1))
    return p.before > 0 && p.after > 0 ? kWidest : kGradientVariance;
  return std::min(kWidest, -1.0 / std::log(ratio));
}

template <class Value>
EdgePoint PointAt(const Rows<Value>& r, const int (&ring)[3], int u, int v, double length) {
  const Value *gx = r.gx[ring[1]], *gy = r.gy[ring[1]];
  const double x = gx[u], y = gy[u];
  const bool horizontal = std::abs(x) >= std::abs(y);
  auto along = [&](double gx_there, double gy_there) { return (gx_there * x + gy_there * y) / length; };
  const Profile p = horizontal ? Profile{along(gx[u - 1], gy[u - 1]), length, along(gx[u + 1], gy[u + 1])}
                               : Profile{along(r.gx[ring[0]][u], r.gy[ring[0]][u]), length,
                                         along(r.gx[ring[2]][u], r.gy[ring[2]][u])};
  const double offset = ParabolaOffset(p);
  const double cosine = (horizontal ? std::abs(x) : std::abs(y)) / length;
  return {static_cast<float>(u + (horizontal ? offset : 0)),
          static_cast<float>(v + (horizontal ? 0 : offset)),
          static_cast<float>(x),
          static_cast<float>(y),
          static_cast<float>(ProfileVariance(p) * cosine * cosine),
          static_cast<std::uint16_t>(u),
          static_cast<std::uint16_t>(v)};
}

template <class Value>
void CollectRow(const Rows<Value>& r, const int (&ring)[3], const std::uint8_t* flags, int v, int width,
                std::vector<EdgePoint>& points) {
  for (int u0 = 0; u0 < width; u0 += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, flags + u0, 8);
    if (eight == 0) continue;
    for (int u = std::max(u0, kBorderPx); u < std::min(u0 + 8, width - kBorderPx); ++u) {
      if (!flags[u]) continue;
      const double x = r.gx[ring[1]][u], y = r.gy[ring[1]][u], length = std::sqrt(x * x + y * y);
      if (length > r.threshold[u]) points.push_back(PointAt(r, ring, u, v, length));
    }
  }
}

// ---- texture: how large the gradient is where no edges are ----

constexpr double kMeanAbsSum = 2 * kMeanAbsNormal;  // E(|x| + |y|) of two standard normals
constexpr double kQuietShare = 0.3;  // of a tile's blocks: edges may cross seven tenths of them

template <class Value>
void CollectBlocks(const Value* magnitude, int width, std::vector<std::vector<float>>& blocks) {
  for (int u = kBorderPx; u + kBlockPx <= width - kBorderPx; u += kBlockPx) {
    std::int64_t sum = 0;
    for (int i = 0; i < kBlockPx; ++i) sum += magnitude[u + i];
    blocks[std::size_t(u / NoiseMap::kTilePx)].push_back(static_cast<float>(sum) / kBlockPx);
  }
}

// Ends a row of tiles.
void AppendTexture(std::vector<std::vector<float>>& blocks, std::vector<float>& raw) {
  for (auto& b : blocks) {
    float quiet = raw.empty() ? 0 : raw.back();
    if (!b.empty()) {
      auto at = b.begin() + std::ptrdiff_t(kQuietShare * double(b.size()));
      std::nth_element(b.begin(), at, b.end());
      quiet = static_cast<float>(*at / kMeanAbsSum);
    }
    raw.push_back(quiet);
    b.clear();
  }
}

// The median over the 3x3 tiles around each, not below `floor`.
void MedianOfTiles(const std::vector<float>& raw, int columns, int rows, float floor,
                   std::vector<float>& around, std::vector<float>& out) {
  out.resize(raw.size());
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      around.clear();
      for (int j = std::max(0, y - 1); j <= std::min(rows - 1, y + 1); ++j)
        for (int i = std::max(0, x - 1); i <= std::min(columns - 1, x + 1); ++i)
          around.push_back(raw[std::size_t(j) * columns + i]);
      out[std::size_t(y) * columns + x] = std::max(floor, Median(around));
    }
}

template <class Pixel>
void FindPoints(const GreyView& image, NoiseMap& noise, double factor, EdgeBuffers& buffers,
                std::vector<EdgePoint>& points, std::vector<std::uint32_t>& row_start) {
  using Value = typename Filter<Pixel>::Value;
  const auto filter = Choose<Pixel, Value>(buffers.simd);
  const int w = image.width, h = image.height;
  Rows<Value> r = Layout<Value>(buffers, w);
  auto gradient_row = [&](int v) {
    const Pixel* rows[5];
    for (int i = 0; i < 5; ++i) rows[i] = Row<Pixel>(image, std::clamp(v + i - 2, 0, h - 1));
    filter.down(rows, w, r.smooth, r.slope);
    Replicate(r.smooth, w);
    Replicate(r.slope, w);
    filter.across(r.smooth, r.slope, w, r.gx[v % 3], r.gy[v % 3], r.magnitude[v % 3]);
  };
  auto& raw = buffers.raw_sigma;
  raw.clear();
  buffers.tile_blocks.resize(std::size_t(noise.columns));
  for (auto& b : buffers.tile_blocks) b.clear();
  row_start.assign(std::size_t(h) + 1, static_cast<std::uint32_t>(points.size()));
  for (int v = kBorderPx - 1; v < h - kBorderPx + 1; ++v) {
    gradient_row(v);
    const int middle = v - 1;
    if (middle < kBorderPx) continue;
    if (middle == kBorderPx || middle % NoiseMap::kTilePx == 0)
      FillThreshold(noise, middle, factor, w, r.threshold);
    const int ring[3] = {(middle + 2) % 3, middle % 3, (middle + 1) % 3};
    filter.flag(r.magnitude[ring[0]] + 1, r.magnitude[ring[1]] + 1, r.magnitude[ring[2]] + 1,
                r.gx[ring[1]] + 1, r.gy[ring[1]] + 1, r.threshold + 1, w - 2, buffers.flags.data() + 1);
    row_start[std::size_t(middle)] = static_cast<std::uint32_t>(points.size());
    if (middle % kBlockRowStep == 0) CollectBlocks(r.magnitude[ring[1]], w, buffers.tile_blocks);
    if ((middle + 1) % NoiseMap::kTilePx == 0) AppendTexture(buffers.tile_blocks, raw);
    CollectRow(r, ring, buffers.flags.data(), middle, w, points);
    row_start[std::size_t(middle) + 1] = static_cast<std::uint32_t>(points.size());
  }
  for (int v = std::max(kBorderPx, h - kBorderPx); v <= h; ++v)
    row_start[std::size_t(v)] = static_cast<std::uint32_t>(points.size());
  while (raw.size() < noise.sigma.size()) AppendTexture(buffers.tile_blocks, raw);
  MedianOfTiles(raw, noise.columns, noise.rows, 0, buffers.block_means, noise.texture);
  for (std::size_t i = 0; i < noise.texture.size(); ++i)
    noise.texture[i] = std::max(noise.texture[i], static_cast<float>(kGradientNoise * noise.sigma[i]));
}

}  // namespace

void EstimateNoise(const GreyView& image, float min_sigma, EdgeBuffers& buffers, NoiseMap& noise) {
  noise.columns = (image.width + NoiseMap::kTilePx - 1) / NoiseMap::kTilePx;
  noise.rows = (image.height + NoiseMap::kTilePx - 1) / NoiseMap::kTilePx;
  auto& raw = buffers.raw_sigma;
  raw.clear();
  for (int y = 0; y < noise.rows; ++y)
    for (int x = 0; x < noise.columns; ++x) {
      const int u = x * NoiseMap::kTilePx, v = y * NoiseMap::kTilePx;
      raw.push_back(image.bits == 8 ? TileSigma<std::uint8_t>(image, u, v, buffers.block_means)
                                    : TileSigma<std::uint16_t>(image, u, v, buffers.block_means));
    }
  MedianOfTiles(raw, noise.columns, noise.rows, min_sigma, buffers.block_means, noise.sigma);
  noise.median_sigma = std::max(min_sigma, Median(raw));
}

void FindEdgePoints(const GreyView& image, NoiseMap& noise, double threshold_sigmas, EdgeBuffers& buffers,
                    std::vector<EdgePoint>& points, std::vector<std::uint32_t>& row_start) {
  points.clear();
  if (image.width <= 2 * kBorderPx || image.height <= 2 * kBorderPx) {
    row_start.assign(std::size_t(std::max(image.height, 0)) + 1, 0);
    noise.texture = noise.sigma;
    return;
  }
  const double factor = threshold_sigmas * kGradientNoise;
  if (image.bits == 8)
    FindPoints<std::uint8_t>(image, noise, factor, buffers, points, row_start);
  else
    FindPoints<std::uint16_t>(image, noise, factor, buffers, points, row_start);
}

}  // namespace vss
