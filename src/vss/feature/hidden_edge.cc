#include "vss/feature/hidden_edge.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

struct Bin {
  double t, grey, weight;
};

struct Bins {
  Bin bin[StripProfile::kBins];
  int count = 0;
};

double Phi(double x) { return 0.5 * std::erfc(-x * M_SQRT1_2); }

// Mean grey values: the fit's model, whose darker level counts as 0, and the
// mean residual.
Bins BinsOf(const StripProfile& p) {
  Bins out;
  for (int k = 0; k < StripProfile::kBins; ++k) {
    if (!(p.count[k] > 0)) continue;
    const double t = p.low + (k + 0.5) * StripProfile::kBinPx;
    const double grey = p.contrast * Phi((t - p.offset) / p.blur) + double{p.sum[k]} / double{p.count[k]};
    out.bin[out.count++] = {t, grey, double{p.count[k]}};
  }
  return out;
}

struct Pair {
  double place[2], contrast[2], level, blur;
};

// Weighted sum of squared residuals; `h` and `g` of Gauss-Newton: places,
// level, contrasts, and the blur.
double Sum(const Bins& bins, const Pair& m, Eigen::Matrix<double, 6, 6>& h, Eigen::Matrix<double, 6, 1>& g) {
  h.setZero(), g.setZero();
  double sum = 0;
  for (int i = 0; i < bins.count; ++i) {
    const Bin& b = bins.bin[i];
    Eigen::Matrix<double, 6, 1> j;
    double r = b.grey - m.level;
    j[2] = 1, j[5] = 0;
    for (int e = 0; e < 2; ++e) {
      const double x = (b.t - m.place[e]) / m.blur, phi = Phi(x);
      r -= m.contrast[e] * phi;
      j[e] = -m.contrast[e] * std::exp(-0.5 * x * x) * (0.3989422804 / m.blur);
      j[3 + e] = phi;
      j[5] += j[e] * x;
    }
    h.selfadjointView<Eigen::Lower>().rankUpdate(j, b.weight);
    g += b.weight * r * j;
    sum += b.weight * r * r;
  }
  return sum;
}

// Gauss-Newton from the places in `m` on, levels first; the sum of squares, or
// a negative number where it fails.
double Fit(const Bins& bins, double blur, Pair& m) {
  constexpr int kSteps = 7;
  constexpr double kBlurSpread = 0.15;  // of the fit's blur, which the second edge may have widened
  constexpr double kMaxStepPx = 0.7;
  Eigen::Matrix<double, 6, 6> h;
  Eigen::Matrix<double, 6, 1> g;
  double sum = 0;
  for (int i = 0;; ++i) {
    sum = Sum(bins, m, h, g);
    if (i == kSteps) return sum;
    const double prior = h.diagonal().head<2>().sum() * kBlurSpread;
    h(5, 5) += prior, g[5] += prior * (blur - m.blur);
    h.diagonal() *= 1 + 1e-6;
    if (i == 0) h(0, 0) += 1e12, h(1, 1) += 1e12, h(5, 5) += 1e12;
    const Eigen::Matrix<double, 6, 1> step = h.selfadjointView<Eigen::Lower>().ldlt().solve(g);
    if (!step.allFinite()) return -1;
    const double largest = std::max(std::abs(step[0]), std::abs(step[1]));
    const double scale = largest > kMaxStepPx ? kMaxStepPx / largest : 1;
    for (int e = 0; e < 2; ++e) m.place[e] += scale * step[e], m.contrast[e] += scale * step[3 + e];
    m.level += scale * step[2];
    m.blur = std::clamp(m.blur + scale * step[5], 0.5 * m.blur, 1.5 * m.blur);
    if (!(m.blur > 0.3 && m.blur < 5)) return -1;
  }
}

}  // namespace

std::optional<HiddenEdge> FindHiddenEdge(const StripProfile& p) {
  constexpr int kMinBins = 8;  // two more than unknowns
  const Bins bins = BinsOf(p);
  if (bins.count < kMinBins || !(p.pixels > 0)) return std::nullopt;
  double single = 0;
  for (int k = 0; k < StripProfile::kBins; ++k)
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
