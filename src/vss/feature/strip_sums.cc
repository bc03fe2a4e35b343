#include "vss/feature/strip_sums.h"

#include <cstdint>

namespace vss {
namespace {

using Floats = float __attribute__((vector_size(kStripLanes * sizeof(float))));
using Doubles = double __attribute__((vector_size(kStripLanes / 2 * sizeof(double))));
using Ints = std::int32_t __attribute__((vector_size(kStripLanes * sizeof(float))));

// exp(-y), y >= 0, to 2e-7 relative, by powers of two and a polynomial of the rest; not below exp(-25), since
// products of smaller ones are denormal, which is slow.
// smaller ones are denormal, which is slow: powers of two and a polynomial of
// the rest.
#define VSS_EXP_MINUS(OUT, Y)                                                                                \
  {                                                                                                          \
    const Floats scaled_ = (Y < 25.0f ? Y : 25.0f) * -1.44269504f;                                           \
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

// OUT = 1 / sqrt(X), X > 0: a first guess from the bits and Newton's steps, to 2e-7 relative.
#define VSS_INVERSE_ROOT(OUT, X)                                              \
  Floats OUT;                                                                 \
  {                                                                           \
    const Ints bits_ = 0x5f375a86 - ((Ints)(X) >> 1);                         \
    OUT = (Floats)bits_;                                                      \
    for (int i_ = 0; i_ < 3; ++i_) OUT = OUT * (1.5f - 0.5f * (X)*OUT * OUT); \
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

namespace portable {
#define VSS_KERNEL
#include "vss/feature/strip_kernels.inc"
#undef VSS_KERNEL
}  // namespace portable
#if defined(__x86_64__)
namespace avx2 {
#define VSS_KERNEL __attribute__((target("avx2")))
#include "vss/feature/strip_kernels.inc"
#undef VSS_KERNEL
}  // namespace avx2
namespace avx512 {
#define VSS_KERNEL __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,prefer-vector-width=512")))
#include "vss/feature/strip_kernels.inc"
#undef VSS_KERNEL
}  // namespace avx512
#else
namespace avx2 = portable;
namespace avx512 = portable;
#endif

}  // namespace

void MultiplyCorner(const StripSamples& in, float at, float by_along, float by_across, Simd simd) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512)
    avx512::Multiply(in, at, by_along, by_across);
  else if (level == Level::kAvx2)
    avx2::Multiply(in, at, by_along, by_across);
  else
    portable::Multiply(in, at, by_along, by_across);
}

void PlaceOnArc(const float* u, const float* v, const ArcShape& shape, float reach, Simd simd,
                ArcPlaces& out) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512)
    avx512::Place(u, v, shape, reach, out);
  else if (level == Level::kAvx2)
    avx2::Place(u, v, shape, reach, out);
  else
    portable::Place(u, v, shape, reach, out);
}

int KeepOnArc(const ArcPlaces& places, const float* scale, const ArcWindows& windows, Simd simd,
              const ArcLot& out) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512) return avx512::Keep(places, scale, windows, out);
  if (level == Level::kAvx2) return avx2::Keep(places, scale, windows, out);
  return portable::Keep(places, scale, windows, out);
}

template <int kEdges, bool kLinear>
void AccumulateStrip(const StripSamples& in, const StripModel& model, int stride, Simd simd,
                     StripSums<NumStripParameters<kEdges, kLinear>()>& out) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512)
    avx512::Sum<kEdges, kLinear>(in, model, stride, out);
  else if (level == Level::kAvx2)
    avx2::Sum<kEdges, kLinear>(in, model, stride, out);
  else
    portable::Sum<kEdges, kLinear>(in, model, stride, out);
}

template void AccumulateStrip<1, false>(const StripSamples&, const StripModel&, int, Simd,
                                        StripSums<NumStripParameters<1, false>()>&);
template void AccumulateStrip<1, true>(const StripSamples&, const StripModel&, int, Simd,
                                       StripSums<NumStripParameters<1, true>()>&);
template void AccumulateStrip<2, false>(const StripSamples&, const StripModel&, int, Simd,
                                        StripSums<NumStripParameters<2, false>()>&);
template void AccumulateStrip<2, true>(const StripSamples&, const StripModel&, int, Simd,
                                       StripSums<NumStripParameters<2, true>()>&);

template <bool kLinear>
void AccumulateArc(const ArcSamples& in, const ArcModel& model, Simd simd,
                   StripSums<NumArcParameters<kLinear>()>& out) {
  const Level level = LevelOf(simd);
  if (level == Level::kAvx512)
    avx512::SumArc<kLinear>(in, model, out);
  else if (level == Level::kAvx2)
    avx2::SumArc<kLinear>(in, model, out);
  else
    portable::SumArc<kLinear>(in, model, out);
}

template void AccumulateArc<false>(const ArcSamples&, const ArcModel&, Simd,
                                   StripSums<NumArcParameters<false>()>&);
template void AccumulateArc<true>(const ArcSamples&, const ArcModel&, Simd,
                                  StripSums<NumArcParameters<true>()>&);

}  // namespace vss
