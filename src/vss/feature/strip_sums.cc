#include "vss/feature/strip_sums.h"

#include <cstdint>

namespace vss {
namespace {

using Floats = float __attribute__((vector_size(kStripLanes * sizeof(float))));
using Ints = std::int32_t __attribute__((vector_size(kStripLanes * sizeof(float))));

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

// Phi by Abramowitz and Stegun 26.2.17 (7.5e-8); BELL: its derivative.
#define VSS_PHI(PHI, BELL, X)                                                                    \
  Floats BELL, PHI;                                                                              \
  {                                                                                              \
    const Floats size_ = X < 0.0f ? -X : X;                                                      \
    const Floats half_square_ = 0.5f * X * X;                                                    \
    VSS_EXP_MINUS(BELL, half_square_)                                                            \
    const Floats k_ = 1.0f / (1.0f + 0.2316419f * size_);                                        \
    BELL = BELL * 0.39894228f;                                                                   \
    const Floats tail_ =                                                                         \
        BELL * k_ *                                                                              \
        (0.31938153f +                                                                           \
         k_ * (-0.356563782f + k_ * (1.781477937f + k_ * (-1.821255978f + k_ * 1.330274429f)))); \
    PHI = X < 0.0f ? tail_ : 1.0f - tail_;                                                       \
  }

// How much of the edge a corner leaves at each pixel: Phi of the depth behind the corner's line, which is
// `at` + `by_along` a + `by_across` t.
[[gnu::always_inline]] inline void Corner(const StripSamples& in, float at, float by_along, float by_across) {
  for (std::size_t i = 0; i < in.count; i += kStripLanes) {
    Floats a, t, left;
    __builtin_memcpy(&a, in.along + i, sizeof a);
    __builtin_memcpy(&t, in.across + i, sizeof t);
    __builtin_memcpy(&left, in.corner + i, sizeof left);
    const Floats x = at + by_along * a + by_across * t;
    VSS_PHI(phi, bell, x)
    left = left * phi;
    __builtin_memcpy(in.corner + i, &left, sizeof left);
  }
}

template <int kEdges, bool kLinear>
[[gnu::always_inline]] inline void Accumulate(const StripSamples& in, const StripModel& m, int stride,
                                              StripSums<NumStripParameters<kEdges, kLinear>()>& out) {
  constexpr int P = NumStripParameters<kEdges, kLinear>();
  Floats h[P * (P + 1) / 2], g[P], residual2{}, total{};
  for (auto& x : h) x = Floats{};
  for (auto& x : g) x = Floats{};
  const std::size_t step = std::size_t(stride) * kStripLanes;
  const float inverse_blur = 1.0f / m.blur;
  for (std::size_t i = 0; i < in.count; i += step) {
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
      VSS_PHI(whole, bell, x)
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
    if (stride == 1) {
      __builtin_memcpy(in.residual + i, &r, sizeof r);
      __builtin_memcpy(in.by_place + i, &j[0], sizeof r);
    }
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
    for (int l = 0; l < kStripLanes; ++l) s += double{x[l]};
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

enum class Level { kPortable, kAvx2, kAvx512 };

Level LevelOf([[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  static const bool avx512 = __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
                             __builtin_cpu_supports("avx512dq");
  static const bool avx2 = __builtin_cpu_supports("avx2");
  if (avx512 && (simd == Simd::kBest || simd == Simd::kAvx512)) return Level::kAvx512;
  if (avx2 && simd != Simd::kPortable) return Level::kAvx2;
#endif
  return Level::kPortable;
}

// One set of functions an instruction set.
#define VSS_KERNELS(NAME, ATTRIBUTE)                                                                    \
  struct NAME {                                                                                         \
    template <int kEdges, bool kLinear>                                                                 \
    ATTRIBUTE static void Sum(const StripSamples& in, const StripModel& m, int stride,                  \
                              StripSums<NumStripParameters<kEdges, kLinear>()>& out) {                  \
      Accumulate<kEdges, kLinear>(in, m, stride, out);                                                  \
    }                                                                                                   \
    ATTRIBUTE static void Multiply(const StripSamples& in, float at, float by_along, float by_across) { \
      Corner(in, at, by_along, by_across);                                                              \
    }                                                                                                   \
  }
VSS_KERNELS(Portable, );
#if defined(__x86_64__)
VSS_KERNELS(Avx2, __attribute__((target("avx2"))));
VSS_KERNELS(Avx512, __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,prefer-vector-width=512"))));
#else
using Avx2 = Portable;
using Avx512 = Portable;
#endif
#undef VSS_KERNELS

}  // namespace

void MultiplyCorner(const StripSamples& in, float at, float by_along, float by_across, Simd simd) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512)
    Avx512::Multiply(in, at, by_along, by_across);
  else if (level == Level::kAvx2)
    Avx2::Multiply(in, at, by_along, by_across);
  else
    Portable::Multiply(in, at, by_along, by_across);
}

template <int kEdges, bool kLinear>
void AccumulateStrip(const StripSamples& in, const StripModel& model, int stride, Simd simd,
                     StripSums<NumStripParameters<kEdges, kLinear>()>& out) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512)
    Avx512::Sum<kEdges, kLinear>(in, model, stride, out);
  else if (level == Level::kAvx2)
    Avx2::Sum<kEdges, kLinear>(in, model, stride, out);
  else
    Portable::Sum<kEdges, kLinear>(in, model, stride, out);
}

template void AccumulateStrip<1, false>(const StripSamples&, const StripModel&, int, Simd,
                                        StripSums<NumStripParameters<1, false>()>&);
template void AccumulateStrip<1, true>(const StripSamples&, const StripModel&, int, Simd,
                                       StripSums<NumStripParameters<1, true>()>&);
template void AccumulateStrip<2, false>(const StripSamples&, const StripModel&, int, Simd,
                                        StripSums<NumStripParameters<2, false>()>&);
template void AccumulateStrip<2, true>(const StripSamples&, const StripModel&, int, Simd,
                                       StripSums<NumStripParameters<2, true>()>&);

}  // namespace vss
