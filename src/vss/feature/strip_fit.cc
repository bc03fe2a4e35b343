#include "vss/feature/strip_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr int kLanes = 16;  // pixels that are worked on at once: one sum a lane, so that every instruction
                            // set gives the same bits
constexpr int kMinColumns = 4;
constexpr int kIterations = 3;
constexpr double kMinBlurPx = 0.3, kMaxBlurPx = 5;

// ---- pixels ----

struct Window {
  double low, high;  // of t
};

// What the neighbours leave of the window at place `a`; empty (low > high) where too little.
Window Clip(double a, Window window, std::span<const StripNeighbour> neighbours, double margin) {
  for (const auto& n : neighbours) {
    const Vector2d d = n.to - n.from;
    const double length = d.norm();
    if (!(length > 0)) continue;
    const double da = d.x() / length, dt = d.y() / length;
    const double reach = margin / std::max(std::abs(da), 1e-3);  // half of what the neighbour spoils, along t
    const double position = std::abs(da) > 1e-3 ? (a - n.from.x()) / da : 0;
    if (std::abs(da) <= 1e-3) {
      if (std::abs(a - n.from.x()) > margin) continue;
    } else if (position < -margin || position > length + margin) {
      // The neighbour has ended before this column: only its end's surroundings count.
      const Vector2d end = position < 0 ? n.from : n.to;
      if (std::abs(a - end.x()) > margin) continue;
      if (end.y() > 0)
        window.high = std::min(window.high, end.y() - margin);
      else
        window.low = std::max(window.low, end.y() + margin);
      continue;
    }
    if (std::abs(da) <= 0.2) {  // steep: it crosses the column's whole height nearby
      const double low = std::min(n.from.y(), n.to.y()) - margin,
                   high = std::max(n.from.y(), n.to.y()) + margin;
      const double near = std::abs(a - (n.from.x() + n.to.x()) / 2) - std::abs(d.x()) / 2;
      if (near > margin) continue;
      if (low < 0 && high > 0) return {1, -1};
      if (low >= 0)
        window.high = std::min(window.high, low);
      else
        window.low = std::max(window.low, high);
      continue;
    }
    const double t = n.from.y() + position * dt;
    if (t > 0)
      window.high = std::min(window.high, t - reach);
    else
      window.low = std::max(window.low, t + reach);
  }
  return window;
}

template <class Pixel>
void TakeColumn(const GreyView& image, const StripFrame& f, bool steep, int major,
                std::span<const StripNeighbour> neighbours, const StripSettings& settings, double side_px,
                Window window, StripBuffers& b) {
  // On the column (a row for steep edges) t runs linearly with the pixel; `rate`: of t, `drift`: of a.
  const double along_major = steep ? f.along.y() : f.along.x(),
               along_minor = steep ? f.along.x() : f.along.y();
  const double across_minor = steep ? f.across.x() : f.across.y();
  const double middle_major = steep ? f.middle.y() : f.middle.x(),
               middle_minor = steep ? f.middle.x() : f.middle.y();
  double a = (major - middle_major) / along_major;
  a = (major - middle_major - f.Sag(a) * (steep ? f.across.y() : f.across.x())) / along_major;
  if (a < f.from || a > f.to) return;
  const int centre = static_cast<int>(std::lround(middle_minor + a * along_minor + f.Sag(a) * across_minor));
  const Vector2d d = (steep ? Vector2d(centre, major) : Vector2d(major, centre)) - f.middle;
  const double a0 = f.along.dot(d), slope = f.SagSlope(a0);
  const double t0 = f.across.dot(d) - f.Sag(a0);
  const double rate = across_minor - slope * along_minor, drift = along_minor;
  window = Clip(a, window, neighbours, settings.margin_px);
  if (window.high < side_px || window.low > -side_px) return;
  double first = (window.low - t0) / rate, last = (window.high - t0) / rate;
  if (first > last) std::swap(first, last);
  const int size = steep ? image.width : image.height;
  const int begin = std::max(centre + static_cast<int>(std::ceil(first)), 0),
            end = std::min(centre + static_cast<int>(std::floor(last)), size - 1);
  if (end - begin < 2) return;
  const auto* base = static_cast<const std::uint8_t*>(image.data);
  for (int i = begin; i <= end; ++i) {
    const auto* row = reinterpret_cast<const Pixel*>(base + (steep ? major : i) * image.stride_bytes);
    b.along.push_back(static_cast<float>(a0 + drift * (i - centre)));
    b.across.push_back(static_cast<float>(t0 + rate * (i - centre)));
    b.grey.push_back(static_cast<float>(row[steep ? i : major]));
  }
  b.column_start.push_back(static_cast<std::uint32_t>(b.grey.size()));
  b.column_along.push_back(static_cast<float>(a));
}

void TakePixels(const GreyView& image, const StripFrame& f, std::span<const StripNeighbour> neighbours,
                const StripSettings& settings, double side_px, Window window, StripBuffers& b) {
  b.along.clear(), b.across.clear(), b.grey.clear(), b.column_along.clear();
  b.column_start.assign(1, 0);
  const bool steep = std::abs(f.along.y()) > std::abs(f.along.x());
  const Vector2d p = f.middle + f.from * f.along, q = f.middle + f.to * f.along;
  const double low = steep ? std::min(p.y(), q.y()) : std::min(p.x(), q.x()),
               high = steep ? std::max(p.y(), q.y()) : std::max(p.x(), q.x());
  const double spare = 2 + std::max(std::abs(f.Sag(f.from)), std::abs(f.Sag(f.to)));
  const int size = steep ? image.height : image.width;
  const int begin = std::max(0, static_cast<int>(std::floor(low - spare))),
            end = std::min(size - 1, static_cast<int>(std::ceil(high + spare)));
  for (int major = begin; major <= end; major += settings.column_step) {
    if (image.bits == 8)
      TakeColumn<std::uint8_t>(image, f, steep, major, neighbours, settings, side_px, window, b);
    else
      TakeColumn<std::uint16_t>(image, f, steep, major, neighbours, settings, side_px, window, b);
  }
  b.weight.assign(b.grey.size(), 1.0f);
}

// How much of the edge is left at each pixel: 1 but near the corners.
void FillCorners(const StripFrame& f, const StripSettings& settings, StripBuffers& b) {
  b.corner.assign(b.grey.size(), 1.0f);
  constexpr double kFar = 4;  // blurs
  for (const auto& c : settings.corners) {
    const Vector2d side = settings.dark_corners ? Vector2d(-c.bright) : c.bright;
    const double along = side.dot(f.along), across = side.dot(f.across), at = side.dot(f.middle - c.point);
    for (std::size_t i = 0; i < b.grey.size(); ++i) {
      const double a = b.along[i], t = b.across[i] + f.Sag(a);
      const double depth = (at + a * along + t * across) / settings.start_blur_px;
      if (depth < kFar) b.corner[i] *= depth < -kFar ? 0.0f : static_cast<float>(0.5 * std::erfc(-depth * M_SQRT1_2));
    }
  }
}

// ---- normal equations ----

using Floats = float __attribute__((vector_size(kLanes * sizeof(float))));
using Ints = std::int32_t __attribute__((vector_size(kLanes * sizeof(float))));

// exp(-y), y >= 0, to 2e-7 relative: powers of two and a polynomial of the rest.
#define VSS_EXP_MINUS(OUT, Y)                                                                                \
  {                                                                                                          \
    const Floats scaled_ = (Y < 80.0f ? Y : 80.0f) * -1.44269504f;                                           \
    const Ints whole_ = __builtin_convertvector(scaled_ - 0.5f, Ints);                                       \
    const Floats rest_ = (scaled_ - __builtin_convertvector(whole_, Floats)) * 0.69314718f;                  \
    const Floats p_ =                                                                                        \
        1.0f +                                                                                               \
        rest_ * (1.0f + rest_ * (0.5f + rest_ * (0.16666667f + rest_ * (0.041666667f +                       \
                                                                        rest_ * (0.0083333333f +             \
                                                                                 rest_ * 0.0013888889f))))); \
    const Ints power_ = (whole_ + 127) << 23;                                                                \
    OUT = p_ * (Floats)power_;                                                                               \
  }

template <int kEdges, bool kLinear>
constexpr int NumParameters() {
  return 2 * kEdges + (1 + kEdges) * (kLinear ? 2 : 1) + 1;
}

// Order of parameters: o, k of each edge; b, c of each edge; with kLinear their slopes; blur.
struct Model {
  float offset[2], slope[2];                       // along counted in half lengths
  float level[2], contrast[2], contrast_slope[2];  // level[1]: its slope
  float blur;
};

template <int P>
struct Sums {
  double h[P][P], g[P], residual2, weight;
};

// The pixels as the sums see them.
struct Samples {
  const float *along, *across, *grey, *weight, *corner;
  std::size_t count;  // a multiple of kLanes
  bool dark_corners;
  float saturated;
};

template <int kEdges, bool kLinear>
[[gnu::always_inline]] inline void Accumulate(const Samples& in, const Model& m, Sums<NumParameters<kEdges, kLinear>()>& out) {
  constexpr int P = NumParameters<kEdges, kLinear>();
  Floats h[P * (P + 1) / 2], g[P], residual2{}, total{};
  for (auto& x : h) x = Floats{};
  for (auto& x : g) x = Floats{};
  const float inverse_blur = 1.0f / m.blur;
  for (std::size_t i = 0; i < in.count; i += kLanes) {
    Floats a, t, y, w, left;
    __builtin_memcpy(&a, in.along + i, sizeof a);
    __builtin_memcpy(&t, in.across + i, sizeof t);
    __builtin_memcpy(&y, in.grey + i, sizeof y);
    __builtin_memcpy(&w, in.weight + i, sizeof w);
    __builtin_memcpy(&left, in.corner + i, sizeof left);
    Floats j[P];
    Floats model = m.level[0] + m.level[1] * a;
    Floats blur_derivative{};
    int at = 2 * kEdges;
    j[at++] = Floats{} + 1.0f;
    for (int e = 0; e < kEdges; ++e) {
      const Floats x = (t - m.offset[e] - m.slope[e] * a) * inverse_blur;
      const Floats ax = x < 0.0f ? -x : x;
      const Floats half_square = 0.5f * x * x;
      Floats bell;
      VSS_EXP_MINUS(bell, half_square)
      // Phi by Abramowitz and Stegun 26.2.17 (7.5e-8).
      const Floats k = 1.0f / (1.0f + 0.2316419f * ax);
      bell = bell * 0.39894228f;
      const Floats tail =
          bell * k *
          (0.31938153f + k * (-0.356563782f + k * (1.781477937f + k * (-1.821255978f + k * 1.330274429f))));
      const Floats whole = x < 0.0f ? tail : 1.0f - tail;
      const Floats phi = in.dark_corners ? 1.0f - (1.0f - whole) * left : whole * left;
      const Floats c = m.contrast[e] + m.contrast_slope[e] * a;
      model = model + c * phi;
      const Floats by_place = c * bell * left * -inverse_blur;
      j[2 * e] = by_place;
      j[2 * e + 1] = by_place * a;
      blur_derivative = blur_derivative + by_place * x;
      j[at++] = phi;
    }
    if (kLinear)
      for (int e = 0; e <= kEdges; ++e) j[at++] = j[2 * kEdges + e] * a;
    j[P - 1] = blur_derivative;
    // A saturated pixel tells only that the light was not less.
    w = (y >= in.saturated) & (model >= in.saturated) ? Floats{} : w;
    const Floats r = y - model, wr = w * r;
    residual2 = residual2 + wr * r;
    total = total + w;
    int k = 0;
    for (int p = 0; p < P; ++p) {
      g[p] = g[p] + wr * j[p];
      const Floats wj = w * j[p];
      for (int q = p; q < P; ++q, ++k) h[k] = h[k] + wj * j[q];
    }
  }
  auto sum = [](const Floats& x) {
    double s = 0;
    for (int l = 0; l < kLanes; ++l) s += double{x[l]};
    return s;
  };
  int k = 0;
  for (int p = 0; p < P; ++p) {
    out.g[p] = sum(g[p]);
    for (int q = p; q < P; ++q, ++k) out.h[p][q] = out.h[q][p] = sum(h[k]);
  }
  out.residual2 = sum(residual2);
  out.weight = sum(total);
}

template <int kEdges, bool kLinear>
struct Normal {
  using Out = Sums<NumParameters<kEdges, kLinear>()>;
  using Function = void (*)(const Samples&, const Model&, Out&);
#define VSS_ACCUMULATE(NAME, ATTRIBUTE) \
  ATTRIBUTE static void NAME(const Samples& in, const Model& m, Out& out) { Accumulate<kEdges, kLinear>(in, m, out); }
  VSS_ACCUMULATE(Portable, )
#if defined(__x86_64__)
  VSS_ACCUMULATE(Avx2, __attribute__((target("avx2"))))
  VSS_ACCUMULATE(Avx512,
                 __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,prefer-vector-width=512"))))
#endif
#undef VSS_ACCUMULATE
  static Function Choose([[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
    const bool avx512 = __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
                        __builtin_cpu_supports("avx512dq");
    if (avx512 && (simd == Simd::kBest || simd == Simd::kAvx512)) return Avx512;
    if (__builtin_cpu_supports("avx2") && simd != Simd::kPortable) return Avx2;
#endif
    return Portable;
  }
};

// ---- the fit ----

struct Fitted {
  Model model;
  Eigen::Matrix4d covariance;  // of the places, per unit variance; a in half lengths
  double residual2 = 0, weight = 0;
  int parameters = 0;
};

// What is known of the blur before the fit, in units of the residuals' squares.
struct BlurPrior {
  double blur = 0, weight = 0;
};

template <int P>
bool Solve(const Sums<P>& s, bool levels_only, int places, Eigen::Matrix<double, P, 1>& step,
           Eigen::Matrix<double, P, P>& information) {
  Eigen::Matrix<double, P, 1> g;
  for (int i = 0; i < P; ++i) {
    g[i] = s.g[i];
    for (int j = 0; j < P; ++j) information(i, j) = s.h[i][j];
  }
  Eigen::Matrix<double, P, P> h = information;
  h.diagonal() *= 1 + 1e-9;
  constexpr double kHold = 1e12;
  for (int i = 0; levels_only && i < P; ++i)
    if (i < places || i == P - 1) h(i, i) += kHold;
  const Eigen::LDLT<Eigen::Matrix<double, P, P>> solver(h);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return false;
  step = solver.solve(g);
  return step.allFinite();
}

template <int kEdges, bool kLinear>
bool Iterate(const Samples& samples, const BlurPrior& prior, Simd simd, int iterations, bool levels_first, Fitted& f) {
  constexpr int P = NumParameters<kEdges, kLinear>();
  const auto accumulate = Normal<kEdges, kLinear>::Choose(simd);
  Sums<P> sums;
  Eigen::Matrix<double, P, 1> step;
  Eigen::Matrix<double, P, P> information;
  constexpr double kMaxStepPx = 1.0;
  for (int i = 0; i <= iterations; ++i) {
    accumulate(samples, f.model, sums);
    sums.h[P - 1][P - 1] += prior.weight;
    sums.g[P - 1] += prior.weight * (prior.blur - f.model.blur);
    if (!Solve<P>(sums, levels_first && i == 0, 2 * kEdges, step, information)) return false;
    if (i == iterations) break;
    int at = 0;
    double largest = 0;
    for (int e = 0; e < kEdges; ++e)
      largest = std::max({largest, std::abs(step[2 * e]), std::abs(step[2 * e + 1])});
    const double scale = largest > kMaxStepPx ? kMaxStepPx / largest : 1.0;
    for (int e = 0; e < kEdges; ++e) {
      f.model.offset[e] += float(scale * step[at++]);
      f.model.slope[e] += float(scale * step[at++]);
    }
    f.model.level[0] += float(scale * step[at++]);
    for (int e = 0; e < kEdges; ++e) f.model.contrast[e] += float(scale * step[at++]);
    if (kLinear) {
      f.model.level[1] += float(scale * step[at++]);
      for (int e = 0; e < kEdges; ++e) f.model.contrast_slope[e] += float(scale * step[at++]);
    }
    const double blur =
        f.model.blur + std::clamp(scale * step[P - 1], -0.5 * f.model.blur, 0.5 * f.model.blur);
    f.model.blur = static_cast<float>(std::clamp(blur, kMinBlurPx, kMaxBlurPx));
  }
  const Eigen::Matrix<double, P, P> inverse =
      information.ldlt().solve(Eigen::Matrix<double, P, P>::Identity());
  f.covariance.setZero();
  f.covariance.template topLeftCorner<2 * kEdges, 2 * kEdges>() =
      inverse.template topLeftCorner<2 * kEdges, 2 * kEdges>();
  f.residual2 = sums.residual2, f.weight = sums.weight, f.parameters = P;
  return f.covariance.allFinite();
}

using IterateFunction = bool (*)(const Samples&, const BlurPrior&, Simd, int, bool, Fitted&);

IterateFunction IterateFor(int edges, bool linear) {
  if (edges == 1) return linear ? IterateFunction(Iterate<1, true>) : IterateFunction(Iterate<1, false>);
  return linear ? IterateFunction(Iterate<2, true>) : IterateFunction(Iterate<2, false>);
}

float MedianOf(std::vector<float>& values) {
  auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct PixelModel {
  double residual, by_place;  // of the first edge
};

PixelModel ModelAt(const StripBuffers& b, const Model& m, bool dark_corners, std::size_t i) {
  const double a = b.along[i], left = b.corner[i];
  PixelModel out{b.grey[i] - m.level[0] - m.level[1] * a, 0};
  for (int e = 0; e < 2; ++e) {
    const double contrast = m.contrast[e] + m.contrast_slope[e] * a;
    if (contrast == 0) continue;
    const double x = (b.across[i] - m.offset[e] - m.slope[e] * a) / m.blur;
    const double whole = 0.5 * std::erfc(-x * M_SQRT1_2);
    out.residual -= contrast * (dark_corners ? 1 - (1 - whole) * left : whole * left);
    if (e == 0) out.by_place = -contrast * left * std::exp(-0.5 * x * x) * (0.3989422804 / m.blur);
  }
  return out;
}

// Each column's own place about the line (px), of the first edge: one step of its matched filter. And the coherence of the
// residuals: their sums over the columns at equal t, squared, over what noise of this size would give.
double PlaceColumns(StripBuffers& b, const Model& m, bool dark_corners, double low) {
  constexpr int kBins = 32;
  constexpr double kBinPx = 0.5;
  constexpr double kMinShare = 0.3;  // of the information of the best column; a corner takes it from others
  double bin[kBins] = {}, count[kBins] = {}, total = 0, pixels = 0, most = 0;
  b.column_place.clear();
  b.sorted.clear();
  for (std::size_t c = 0; c + 1 < b.column_start.size(); ++c) {
    double numerator = 0, denominator = 0;
    for (auto i = b.column_start[c]; i < b.column_start[c + 1]; ++i) {
      const PixelModel p = ModelAt(b, m, dark_corners, i);
      numerator += p.by_place * p.residual;
      denominator += p.by_place * p.by_place;
      const int k = std::clamp(static_cast<int>((b.across[i] - low) / kBinPx), 0, kBins - 1);
      bin[k] += p.residual, count[k] += 1, total += p.residual * p.residual, pixels += 1;
    }
    b.column_place.push_back(denominator > 0 ? static_cast<float>(numerator / denominator) : 0.0f);
    b.sorted.push_back(static_cast<float>(denominator));
    most = std::max(most, denominator);
  }
  for (std::size_t c = 0; c < b.column_place.size(); ++c)
    if (b.sorted[c] < kMinShare * most) b.column_place[c] = 0;
  double coherence = 0;
  for (int k = 0; k < kBins; ++k)
    if (count[k] > 0) coherence += bin[k] * bin[k] / count[k];
  return total > 0 ? coherence / (total / pixels) : 0;
}

// Gives columns that lie off (a scratch, a crossing) no weight; how many remain.
int DropOutliers(StripBuffers& b, double expected_sigma) {
  constexpr double kSigmas = 4;
  b.sorted.clear();
  for (const float e : b.column_place) b.sorted.push_back(std::abs(e));
  const double limit = kSigmas * std::max(expected_sigma, 1.4826 * MedianOf(b.sorted));
  int kept = 0;
  for (std::size_t c = 0; c < b.column_place.size(); ++c) {
    const bool good = std::abs(b.column_place[c]) <= limit;
    kept += good;
    for (auto i = b.column_start[c]; i < b.column_start[c + 1]; ++i) b.weight[i] = good ? 1.0f : 0.0f;
  }
  return kept;
}

// By how much the variance of a mean over the columns exceeds that of independent ones (texture,
// compression), at least 1.
double Correlation(const StripBuffers& b) {
  constexpr int kBlock = 8, kMinBlocks = 4;
  double sum2 = 0, blocks2 = 0, block = 0;
  int n = 0, blocks = 0, in_block = 0;
  for (std::size_t c = 0; c < b.column_place.size(); ++c) {
    if (b.weight[b.column_start[c]] == 0) continue;
    const double e = b.column_place[c];
    sum2 += e * e, ++n, block += e;
    if (++in_block == kBlock) blocks2 += block * block, block = 0, in_block = 0, ++blocks;
  }
  if (blocks < kMinBlocks || !(sum2 > 0)) return 1;
  // Two degrees of freedom of the blocks went into the line itself.
  return std::max(1.0, (blocks2 / (blocks - 2) / kBlock) / (sum2 / n));
}

Model StartModel(std::span<const StripEdge> start, const StripBuffers& b, double half, double blur) {
  Model m{};
  m.blur = static_cast<float>(std::clamp(blur, kMinBlurPx, kMaxBlurPx));
  double darkest = 0, sum = 0;
  for (std::size_t i = 0; i < b.grey.size(); ++i) {
    double x = 0;
    for (const auto& e : start) x += e.contrast * (b.across[i] > e.offset + e.slope * b.along[i] ? 1.0 : 0.0);
    sum += b.grey[i] - x;
  }
  darkest = sum / double(b.grey.size());
  m.level[0] = static_cast<float>(darkest);
  for (std::size_t e = 0; e < start.size(); ++e) {
    m.offset[e] = static_cast<float>(start[e].offset);
    m.slope[e] = static_cast<float>(start[e].slope * half);
    m.contrast[e] = static_cast<float>(start[e].contrast);
  }
  return m;
}

}  // namespace

StripFit FitStrip(const GreyView& image, const StripFrame& frame, std::span<const StripEdge> start,
                  std::span<const StripNeighbour> neighbours, const StripSettings& settings, Simd simd,
                  StripBuffers& b) {
  StripFit out;
  const int edges = static_cast<int>(start.size());
  const double side_px = std::min(
      settings.reach_px, 1.5 * settings.start_blur_px);  // a side that is shorter cannot show its level
  const Window window{start.front().offset - settings.reach_px, start.back().offset + settings.reach_px};
  TakePixels(image, frame, neighbours, settings, side_px, window, b);
  const int columns = static_cast<int>(b.column_along.size());
  if (columns < kMinColumns) return out;
  const double half = std::max({std::abs(b.column_along.front()), std::abs(b.column_along.back()), 1.0f});
  Fitted f;
  f.model = StartModel(start, b, half, settings.start_blur_px);
  FillCorners(frame, settings, b);
  for (auto& a : b.along) a = static_cast<float>(a / half);
  const std::size_t padded = (b.grey.size() + kLanes - 1) / kLanes * kLanes;
  for (auto* v : {&b.along, &b.across, &b.grey, &b.weight, &b.corner}) v->resize(padded, 0.0f);
  constexpr int kLinearColumns = 24;  // fewer columns cannot tell a slope of the levels from noise
  const bool linear = columns >= kLinearColumns;
  const Samples samples{b.along.data(), b.across.data(), b.grey.data(), b.weight.data(), b.corner.data(), padded, settings.dark_corners,
                        static_cast<float>(image.MaxValue())};
  const auto iterate = IterateFor(edges, linear);
  BlurPrior prior;
  if (settings.blur_sigma_px > 0)
    prior = {settings.start_blur_px, std::pow(settings.noise_sigma / settings.blur_sigma_px, 2)};
  if (!iterate(samples, prior, simd, kIterations + (edges > 1 ? 2 : 0), edges > 1, f))
    return out;
  out.coherence = PlaceColumns(b, f.model, settings.dark_corners, window.low);
  const double pixel_sigma =
      std::max(settings.noise_sigma, std::sqrt(f.residual2 / std::max(1.0, f.weight - f.parameters)));
  const double column_sigma = pixel_sigma * std::sqrt(2 * std::sqrt(M_PI) * f.model.blur) /
                              std::max(1e-6, double{std::abs(f.model.contrast[0])});
  int kept = DropOutliers(b, column_sigma);
  if (kept < std::max(kMinColumns, columns / 2)) return out;
  if (kept < columns) {
    for (std::size_t i = b.column_start.back(); i < padded; ++i) b.weight[i] = 0;
    if (!iterate(samples, prior, simd, 1, false, f)) return out;
    out.coherence = PlaceColumns(b, f.model, settings.dark_corners, window.low);
  }
  double rms2 = 0;
  out.from = b.column_along.front(), out.to = b.column_along.back();
  for (std::size_t c = 0; c < b.column_place.size(); ++c)
    if (b.weight[b.column_start[c]] != 0) rms2 += double{b.column_place[c]} * b.column_place[c];
  out.rms_px = std::sqrt(rms2 / kept);
  out.residual_sigma = std::sqrt(f.residual2 / std::max(1.0, f.weight - f.parameters));
  const double variance = std::max(out.residual_sigma * out.residual_sigma, 1.0 / 12) * Correlation(b);
  for (int e = 0; e < edges; ++e) {
    out.edges[e].offset = f.model.offset[e], out.edges[e].slope = f.model.slope[e] / half,
    out.edges[e].contrast = f.model.contrast[e];
    out.edges[e].covariance = variance * f.covariance.block<2, 2>(2 * e, 2 * e);
    out.edges[e].covariance.row(1) /= half;
    out.edges[e].covariance.col(1) /= half;
  }
  out.blur_px = f.model.blur;
  out.num_columns = kept;
  out.ok = out.blur_px < kMaxBlurPx;
  return out;
}

}  // namespace vss
