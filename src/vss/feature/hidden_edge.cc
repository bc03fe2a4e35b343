#include "vss/feature/hidden_edge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vss/feature/normal_equations.h"
#include "vss/feature/strip_sums.h"

namespace vss {
namespace {

constexpr int kBins = StripProfile::kBins;
static_assert(kBins % kStripLanes == 0);

// The profile as a strip of one column, a pixel a bin; bins without pixels have no weight.
struct Bins {
  alignas(64) float along[kBins] = {}, across[kBins], grey[kBins], weight[kBins], corner[kBins],
                    residual[kBins], by_place[kBins];
  Simd simd;
  int count = 0;  // of those with pixels

  StripSamples Samples() {
    return {along,    across,   grey,  weight, corner,
            residual, by_place, kBins, false,  std::numeric_limits<float>::infinity()};
  }
};

double Phi(double x) { return 0.5 * std::erfc(-x * M_SQRT1_2); }

// Mean grey values: the fit's model, whose darker level counts as 0, and the mean residual.
void FillBins(const StripProfile& p, Bins& out) {
  for (int k = 0; k < kBins; ++k) {
    const double t = p.low + (k + 0.5) * StripProfile::kBinPx;
    out.across[k] = static_cast<float>(t), out.corner[k] = 1;
    out.grey[k] = out.weight[k] = 0;
    if (!(p.count[k] > 0)) continue;
    ++out.count;
    out.grey[k] = static_cast<float>(p.contrast * Phi((t - p.offset) / p.blur)) + p.sum[k] / p.count[k];
    out.weight[k] = p.count[k];
  }
}

struct Pair {
  double place[2], contrast[2], level, blur;
};

// Weighted sum of squared residuals; `h` and `g` of Gauss-Newton: places, level, contrasts, and the blur.
double Sum(Bins& bins, const Pair& m, Eigen::Matrix<double, 6, 6>& h, Eigen::Matrix<double, 6, 1>& g) {
  constexpr int kParameter[6] = {0, 2, 4, 5, 6, 7};  // of the strip's, whose edges' slopes have no part
  StripModel model{};
  for (int e = 0; e < 2; ++e)
    model.offset[e] = static_cast<float>(m.place[e]), model.contrast[e] = static_cast<float>(m.contrast[e]);
  model.level[0] = static_cast<float>(m.level), model.blur = static_cast<float>(m.blur);
  StripSums<NumStripParameters<2, false>()> sums;
  AccumulateStrip<2, false>(bins.Samples(), model, 1, bins.simd, sums);
  for (int i = 0; i < 6; ++i) {
    g[i] = sums.g[kParameter[i]];
    for (int j = 0; j < 6; ++j) h(i, j) = sums.h[kParameter[i]][kParameter[j]];
  }
  return sums.residual2;
}

// Gauss-Newton from the places in `m` on, levels first; the sum of squares, or
// a negative number where it fails.
double Fit(Bins& bins, double blur, Pair& m) {
  constexpr int kSteps = 7;
  constexpr double kBlurSpread = 0.15;  // of the fit's blur, which the second edge may have widened
  constexpr double kMaxStepPx = 0.7;
  constexpr double kLastStepPx = 0.005;  // a step so small changes the sum by less than a ten-thousandth
  Eigen::Matrix<double, 6, 6> h;
  Eigen::Matrix<double, 6, 1> g;
  bool close = false;
  for (int i = 0;; ++i) {
    const double sum = Sum(bins, m, h, g);
    if (i == kSteps || close) return sum;
    const double prior = h.diagonal().head<2>().sum() * kBlurSpread;
    h(5, 5) += prior, g[5] += prior * (blur - m.blur);
    h.diagonal() *= 1 + 1e-6;
    if (i == 0) h(0, 0) += 1e12, h(1, 1) += 1e12, h(5, 5) += 1e12;
    const Cholesky<6> solver(h);
    if (!solver.ok()) return -1;
    const Eigen::Matrix<double, 6, 1> step = solver.Solve(g);
    if (!step.allFinite()) return -1;
    const double largest = std::max(std::abs(step[0]), std::abs(step[1]));
    close = i > 0 && largest < kLastStepPx;
    const double scale = largest > kMaxStepPx ? kMaxStepPx / largest : 1;
    for (int e = 0; e < 2; ++e) m.place[e] += scale * step[e], m.contrast[e] += scale * step[3 + e];
    m.level += scale * step[2];
    m.blur = std::clamp(m.blur + scale * step[5], 0.5 * m.blur, 1.5 * m.blur);
    if (!(m.blur > 0.3 && m.blur < 5)) return -1;
  }
}

}  // namespace

std::optional<HiddenEdge> FindHiddenEdge(const StripProfile& p, Simd simd) {
  constexpr int kMinBins = 8;  // two more than unknowns
  Bins bins;
  bins.simd = simd;
  FillBins(p, bins);
  if (bins.count < kMinBins || !(p.pixels > 0)) return std::nullopt;
  double single = 0;
  for (int k = 0; k < kBins; ++k)
    if (p.count[k] > 0) single += double{p.sum[k]} * p.sum[k] / p.count[k];
  double best = single;
  std::optional<HiddenEdge> out;
  for (const double place : {1.6, -1.6, 3.0, -3.0}) {
    Pair m{{0, place}, {0, 0}, 0, p.blur};
    const double sum = Fit(bins, p.blur, m);
    if (sum < 0 || sum >= best) continue;
    best = sum;
    const bool first = std::abs(m.place[0]) <= std::abs(m.place[1]);
    out = HiddenEdge{{m.place[first ? 0 : 1], 0, m.contrast[first ? 0 : 1], Eigen::Matrix2d::Zero()},
                     {m.place[first ? 1 : 0], 0, m.contrast[first ? 1 : 0], Eigen::Matrix2d::Zero()},
                     0};
  }
  if (out) out->gain = p.pixels * (single - best) / std::max(1e-9, p.squares - (single - best));
  return out;
}

}  // namespace vss
