// The sums of Gauss-Newton over a strip's pixels, with whatever vector
// instructions the processor has.
#pragma once
#include <cstddef>
#include <cstdint>

#include "vss/feature/edge_points.h"

namespace vss {

// Pixels that are worked on at once: one sum a lane, so that every instruction
// set gives the same bits.
inline constexpr int kStripLanes = 16;

// The pixels as the sums see them.
struct StripSamples {
  float *along, *across, *grey, *weight, *corner, *residual, *by_place;
  std::size_t count;  // a multiple of kStripLanes
  bool dark_corners;
  float saturated;
};

template <int kEdges, bool kLinear>
constexpr int NumStripParameters() {
  return 2 * kEdges + 1 + kEdges + (kLinear ? 1 + kEdges : 0) + 1;
}

// Order of parameters: o, k of each edge; b, c of each edge; with kLinear their
// slopes; blur.
struct StripModel {
  float offset[2], slope[2];                       // along counted in half lengths
  float level[2], contrast[2], contrast_slope[2];  // level[1]: its slope
  float blur;
};

template <int P>
struct StripSums {
  double h[P][P], g[P], residual2, weight;
};

// What the corner leaves of the edge at each pixel is multiplied by Phi of the
// depth behind the corner's line, which is `at` + `by_along` a + `by_across` t.
void MultiplyCorner(const StripSamples& in, float at, float by_along, float by_across, Simd simd);

// `stride`: every so many lots of kStripLanes pixels take part. With 1,
// residual and by_place (the model's derivative by the first edge's place) of
// every pixel are filled in too. Instantiated for one edge and two.
template <int kEdges, bool kLinear>
void AccumulateStrip(const StripSamples& in, const StripModel& model, int stride, Simd simd,
                     StripSums<NumStripParameters<kEdges, kLinear>()>& out);

// How kStripLanes places lie to an ellipse: see ArcCurve::Place.
struct ArcPlaces {
  alignas(64) float distance[kStripLanes], around[kStripLanes], normal_u[kStripLanes], normal_v[kStripLanes],
      curvature[kStripLanes], by[5][kStripLanes];
};

// An ellipse for them.
struct ArcShape {
  float cs, sn, a, b;  // of its angle; semi-axes
};

// `u`, `v`: kStripLanes places from the ellipse's centre. Curvature and derivatives farther than `reach` from
// the contour are left out (zero).
void PlaceOnArc(const float* u, const float* v, const ArcShape& shape, float reach, Simd simd,
                ArcPlaces& out);

// What of the contour takes part: the range of AroundEllipse's numbers from `from` on, `length` long, and of
// t in each of its kArcSectors equal parts what lies from `low` to `high`.
inline constexpr int kArcSectors = 64;
struct ArcWindows {
  float from, length, reach;  // of t, either side
  float low[kArcSectors], high[kArcSectors];
};

// Places for kStripLanes pixels of ArcSamples; those that take no part get the weight zero.
struct ArcLot {
  float *t, *by[5], *bend, *weight;
  std::uint8_t* sector;
};

// Fills `out` from what PlaceOnArc found; `scale`: px as taken of t for each px of distance. How many take
// part.
int KeepOnArc(const ArcPlaces& places, const float* scale, const ArcWindows& windows, Simd simd,
              const ArcLot& out);

// The pixels about an arc: t across the contour towards the bright side (px), its derivatives by the
// ellipse's five parameters, half the contour's curvature (positive: the bright side lies outside), the place
// in the picture over the longer axis.
struct ArcSamples {
  const float *t, *by[5], *bend, *u, *v, *grey, *weight;
  float *residual, *by_place;
  std::size_t count;  // a multiple of kStripLanes
  float saturated;
};

// Order of parameters: the ellipse's, level, contrast, blur; with kLinear the level's slopes along u and v,
// the contrast's.
template <bool kLinear>
constexpr int NumArcParameters() {
  return kLinear ? 12 : 8;
}

struct ArcModel {
  float moved[5];  // of the ellipse, since t was taken
  float level[3], contrast[3];
  float blur;
};

// Fills in residual and by_place (the model's derivative by t), too.
template <bool kLinear>
void AccumulateArc(const ArcSamples& in, const ArcModel& model, Simd simd,
                   StripSums<NumArcParameters<kLinear>()>& out);

}  // namespace vss
