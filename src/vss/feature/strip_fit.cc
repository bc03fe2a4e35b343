#include "vss/feature/strip_fit.h"

#include <algorithm>
#include <cmath>

#include "vss/feature/normal_equations.h"
#include "vss/feature/strip_pixels.h"
#include "vss/feature/strip_sums.h"

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr int kMinColumns = 4;
constexpr int kIterations = 4;
constexpr double kRoundingVariance = 1.0 / 12;  // grey levels squared
constexpr double kMinBlurPx = 0.3, kMaxBlurPx = 5;

struct Fitted {
  StripModel model;
  Eigen::Matrix4d covariance;  // of the places, per unit variance; a in half lengths
  double residual2 = 0, weight = 0;
  int parameters = 0;
  bool linear = false, converged = false;  // the levels slope; the last step was small
};

double ResidualSigma(const Fitted& f) {
  return std::sqrt(f.residual2 / std::max(1.0, f.weight - f.parameters));
}

// What is known of the blur before the fit, in units of the residuals' squares.
struct BlurPrior {
  double blur = 0, weight = 0;
};

template <int P>
bool Solve(const StripSums<P>& s, bool levels_only, int places, Eigen::Matrix<double, P, 1>& step,
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
  const Cholesky<P> solver(h);
  if (!solver.ok()) return false;
  step = solver.Solve(g);
  return step.allFinite();
}

// What the wings add: there the model is a level, with all edges or none of them.
template <int kEdges, bool kLinear>
void AddWings(const StripWing (&wings)[2], const StripModel& m,
              StripSums<NumStripParameters<kEdges, kLinear>()>& out) {
  for (const bool bright : {false, true}) {
    const StripWing& w = wings[bright];
    if (!(w.n > 0)) continue;
    double level = m.level[0], slope = kLinear ? m.level[1] : 0;
    int constant[kEdges + 1] = {2 * kEdges}, linear[kEdges + 1] = {3 * kEdges + 1}, terms = 1;
    for (int e = 0; bright && e < kEdges; ++e, ++terms) {
      level += m.contrast[e], slope += kLinear ? m.contrast_slope[e] : 0;
      constant[terms] = 2 * kEdges + 1 + e, linear[terms] = 3 * kEdges + 2 + e;
    }
    const double r = w.grey - level * w.n - slope * w.along,
                 ra = w.grey_along - level * w.along - slope * w.along2;
    for (int i = 0; i < terms; ++i) {
      out.g[constant[i]] += r;
      if (kLinear) out.g[linear[i]] += ra;
      for (int j = 0; j < terms; ++j) {
        out.h[constant[i]][constant[j]] += w.n;
        if (!kLinear) continue;
        out.h[linear[i]][linear[j]] += w.along2;
        out.h[constant[i]][linear[j]] += w.along, out.h[linear[j]][constant[i]] += w.along;
      }
    }
  }
}

// Makes the wings count `along` in half lengths. One that is not as quiet as noise (another edge, texture,
// shade) or is saturated has nothing to tell, nor has one that is quieter than rounding alone: all its pixels
// were rounded the same way.
void PrepareWings(double half, double noise, StripWing (&wings)[2]) {
  constexpr double kMinPixels = 20;
  for (StripWing& w : wings) {
    w.along /= half, w.grey_along /= half, w.along2 /= half * half;
    const double mean_a = w.along / std::max(1.0, w.n), mean_y = w.grey / std::max(1.0, w.n),
                 aa = w.along2 - w.n * mean_a * mean_a, ay = w.grey_along - w.n * mean_a * mean_y,
                 yy = w.grey2 - w.n * mean_y * mean_y, left = yy - (aa > 0 ? ay * ay / aa : 0);
    const double variance = left / std::max(1.0, w.n - 2);
    if (w.n < kMinPixels || w.saturated || variance > std::pow(kExplainedShare * noise, 2) ||
        variance < kRoundingVariance)
      w = {};
  }
}

template <int kEdges, bool kLinear>
bool Iterate(const StripSamples& samples, const StripWing (&wings)[2], const BlurPrior& prior, Simd simd,
             int iterations, bool levels_first, Fitted& f) {
  constexpr int P = NumStripParameters<kEdges, kLinear>();
  StripSums<P> sums;
  Eigen::Matrix<double, P, 1> step;
  Eigen::Matrix<double, P, P> information;
  constexpr double kMaxStepPx = 1.0;
  constexpr double kCloseStep = 0.05;      // px: after it all pixels take part
  constexpr double kSmallStep = 0.02;      // px: after it the next step would be lost in the noise
  constexpr std::size_t kEnoughLots = 40;  // of kStripLanes pixels, to come close
  int stride = std::max(1, static_cast<int>(samples.count / (kStripLanes * kEnoughLots)));
  for (int i = 0;; ++i) {
    if (i + 1 >= iterations) stride = 1;
    AccumulateStrip<kEdges, kLinear>(samples, f.model, stride, simd, sums);
    AddWings<kEdges, kLinear>(wings, f.model, sums);
    sums.h[P - 1][P - 1] += prior.weight;
    sums.g[P - 1] += prior.weight * (prior.blur - f.model.blur);
    if (!Solve<P>(sums, levels_first && i == 0, 2 * kEdges, step, information)) return false;
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
    const double change = levels_first && i == 0 ? kMaxStepPx : std::max(largest, std::abs(step[P - 1]));
    f.converged = stride == 1 && change < kSmallStep;
    if (f.converged || (stride == 1 && i + 1 >= iterations)) break;
    if (change < kCloseStep) stride = 1;
  }
  const Cholesky<P> solver(information);
  if (!solver.ok()) return false;
  f.covariance.setZero();
  f.covariance.template topLeftCorner<2 * kEdges, 2 * kEdges>() =
      solver.template InverseOfFirst<2 * kEdges>();
  f.residual2 = sums.residual2, f.weight = sums.weight, f.parameters = P;
  return f.covariance.allFinite();
}

// Whether slopes of the levels explain more of the pixels than their number would of noise (Akaike 1974),
// places, levels and blur being left free to follow.
template <int kEdges>
bool SlopesTell(const StripSamples& samples, const StripWing (&wings)[2], const BlurPrior& prior, Simd simd,
                const StripModel& model) {
  constexpr int P = NumStripParameters<kEdges, true>(), kConstant = 3 * kEdges + 1, kSlopes = 1 + kEdges;
  StripSums<P> sums;
  AccumulateStrip<kEdges, true>(samples, model, 1, simd, sums);
  AddWings<kEdges, true>(wings, model, sums);
  // The blur changes places with the slopes, which come last: what they gain is then what is left of them.
  int order[P];
  for (int i = 0; i < P; ++i) order[i] = i < kConstant ? i : i == kConstant ? P - 1 : i - 1;
  sums.h[P - 1][P - 1] += prior.weight;
  sums.g[P - 1] += prior.weight * (prior.blur - model.blur);
  Eigen::Matrix<double, P, P> h;
  Eigen::Matrix<double, P, 1> g;
  for (int i = 0; i < P; ++i) {
    g[i] = sums.g[order[i]];
    for (int j = 0; j < P; ++j) h(i, j) = sums.h[order[i]][order[j]] * (i == j ? 1 + 1e-9 : 1.0);
  }
  const Cholesky<P> solver(h);
  if (!solver.ok()) return false;
  const double variance = std::max(sums.residual2 / std::max(1.0, sums.weight - P), kRoundingVariance);
  return solver.Forward(g).template tail<kSlopes>().squaredNorm() > 2 * kSlopes * variance;
}

using IterateFunction = bool (*)(const StripSamples&, const StripWing (&)[2], const BlurPrior&, Simd, int,
                                 bool, Fitted&);

IterateFunction IterateFor(int edges, bool linear) {
  if (edges == 1) return linear ? IterateFunction(Iterate<1, true>) : IterateFunction(Iterate<1, false>);
  return linear ? IterateFunction(Iterate<2, true>) : IterateFunction(Iterate<2, false>);
}

// Levels are constant unless their slopes tell: slopes that are not there cost a third of the angle's
// certainty. Where constant levels leave more than noise, they are not.
bool FitModel(const StripSamples& samples, const StripWing (&wings)[2], const BlurPrior& prior, double noise,
              Simd simd, int edges, bool may_slope, Fitted& f) {
  constexpr int kToComeClose = 2;
  const int levels_first = edges > 1, iterations = kIterations + 2 * levels_first;
  const auto constant = IterateFor(edges, false), linear = IterateFor(edges, true);
  if (!may_slope) return constant(samples, wings, prior, simd, iterations, levels_first, f);
  if (!constant(samples, wings, prior, simd, kToComeClose + levels_first, levels_first, f)) return false;
  f.linear = ResidualSigma(f) > kExplainedShare * noise ||
             (edges == 1 ? SlopesTell<1>(samples, wings, prior, simd, f.model)
                         : SlopesTell<2>(samples, wings, prior, simd, f.model));
  if (!f.linear && f.converged) return true;
  return (f.linear ? linear : constant)(samples, wings, prior, simd, iterations, false, f);
}

float MedianOf(std::vector<float>& values) {
  auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Each column's own place about the line (px), of the first edge: one step of
// its matched filter.
void PlaceColumns(StripBuffers& b) {
  constexpr float kMinShare = 0.3f;  // of the information of the best column; a
                                     // corner takes it from others
  const std::size_t columns = b.column_along.size();
  b.column_place.resize(columns), b.sorted.resize(columns);
  float most = 0;
  for (std::size_t c = 0; c < columns; ++c) {
    float numerator = 0, denominator = 0;
    for (auto i = b.column_start[c]; i < b.column_start[c + 1]; ++i) {
      numerator += b.by_place[i] * b.residual[i];
      denominator += b.by_place[i] * b.by_place[i];
    }
    b.column_place[c] = denominator > 0 ? numerator / denominator : 0.0f;
    b.sorted[c] = denominator;
    most = std::max(most, denominator);
  }
  for (std::size_t c = 0; c < columns; ++c)
    if (b.sorted[c] < kMinShare * most) b.column_place[c] = 0;
}

// The residuals by their distance from the line: sums over the columns.
void FillProfile(const StripModel& m, double low, StripBuffers& b) {
  StripProfile p;
  p.low = low, p.offset = m.offset[0], p.contrast = m.contrast[0], p.blur = m.blur;
  const float slope = m.slope[0];
  const float scale = static_cast<float>(1 / StripProfile::kBinPx), first = static_cast<float>(low);
  const float *along = b.along.data(), *across = b.across.data(), *residual = b.residual.data(),
              *weight = b.weight.data();
  for (std::size_t i = 0, n = b.column_start.back(); i < n; ++i) {
    const float t = across[i] - slope * along[i], r = residual[i], w = weight[i];
    const int k = std::clamp(static_cast<int>((t - first) * scale), 0, StripProfile::kBins - 1);
    p.sum[k] += w * r, p.count[k] += w;
    p.squares += w * r * r, p.pixels += w;
  }
  b.profile = p;
}

// Gives columns that lie off (a scratch, a crossing) no weight; how many
// remain.
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

// By how much the variance of a mean over the columns exceeds that of
// independent ones (texture, compression), at least 1.
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

// Sum of grey values: whole numbers, so that their order does not matter.
double SumOf(const float* grey, std::size_t n) {
  constexpr std::size_t kLanes = 8;
  double lane[kLanes] = {}, sum = 0;
  std::size_t i = 0;
  for (; i + kLanes <= n; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k) lane[k] += grey[i + k];
  for (; i < n; ++i) sum += grey[i];
  for (const double x : lane) sum += x;
  return sum;
}

// Levels from the pixels given the edges' places and contrasts.
StripModel StartModel(std::span<const StripEdge> start, const StripBuffers& b, std::size_t pixels,
                      double half, double blur) {
  StripModel m{};
  m.blur = static_cast<float>(std::clamp(blur, kMinBlurPx, kMaxBlurPx));
  double sum = SumOf(b.grey.data(), pixels);
  for (std::size_t e = 0; e < start.size(); ++e) {
    m.offset[e] = static_cast<float>(start[e].offset);
    m.slope[e] = static_cast<float>(start[e].slope * half);
    m.contrast[e] = static_cast<float>(start[e].contrast);
    const float offset = m.offset[e], slope = static_cast<float>(start[e].slope);
    const float *along = b.along.data(), *across = b.across.data();
    int bright = 0;
    for (std::size_t i = 0; i < pixels; ++i) bright += across[i] > offset + slope * along[i];
    sum -= start[e].contrast * bright;
  }
  m.level[0] = static_cast<float>(sum / double(pixels));
  return m;
}

// Pads the pixels to whole lanes, counts `along` in half lengths and fills in
// what the corners leave of the edge.
StripSamples Prepare(const GreyView& image, const StripFrame& f, const StripSettings& settings,
                     std::size_t pixels, double half, Simd simd, StripBuffers& b) {
  const std::size_t padded = (pixels + kStripLanes - 1) / kStripLanes * kStripLanes;
  if (padded + StripBuffers::kSpare > b.grey.size()) b.Grow(padded + StripBuffers::kSpare);
  const float per_half = static_cast<float>(1 / half);
  for (std::size_t i = 0; i < pixels; ++i) b.along[i] *= per_half;
  std::fill_n(b.weight.begin(), pixels, 1.0f);
  std::fill_n(b.corner.begin(), padded, 1.0f);
  for (auto* v : {&b.along, &b.across, &b.grey, &b.weight})
    std::fill(v->begin() + std::ptrdiff_t(pixels), v->begin() + std::ptrdiff_t(padded), 0.0f);
  const StripSamples in{b.along.data(),        b.across.data(),
                        b.grey.data(),         b.weight.data(),
                        b.corner.data(),       b.residual.data(),
                        b.by_place.data(),     padded,
                        settings.dark_corners, static_cast<float>(image.MaxValue())};
  for (const auto& c : settings.corners) {
    const Vector2d side = settings.dark_corners ? Vector2d(-c.bright) : c.bright;
    const double along = side.dot(f.along), across = side.dot(f.across), at = side.dot(f.middle - c.point);
    // The edge's bend within a corner's blur is nothing: its sag there stands
    // for all.
    const double corner_at = f.Bent() ? f.along.dot(c.point - f.middle) : 0;
    const double sag = f.Bent() ? across * f.Sag(corner_at) : 0;
    const double blur = settings.start_blur_px;
    MultiplyCorner(in, static_cast<float>((at + sag) / blur), static_cast<float>(along * half / blur),
                   static_cast<float>(across / blur), simd);
  }
  return in;
}

// By how much (blurs) the half contrast lies farther in where the contrast is half as large again as what
// saturation lets through: Phi(-0.43) is a third.
constexpr double kHiddenShift = 0.43;

// Whether most pixels of the bright side are saturated: how bright it is shows in the edge's lower part
// alone.
bool IsOverexposed(const StripSamples& in, const StripModel& m) {
  constexpr double kShare = 0.5;
  const float offset = m.offset[0], slope = m.slope[0], flat = 2 * m.blur;
  int bright = 0, saturated = 0;
  for (std::size_t i = 0; i < in.count; ++i) {
    const bool counts = !(in.across[i] - offset - slope * in.along[i] < flat) & (in.weight[i] != 0);
    const bool full = in.grey[i] >= in.saturated;
    bright += counts, saturated += counts & full;
  }
  return saturated > kShare * bright;
}

}  // namespace

double StripProfile::Coherence() const {
  double coherence = 0;
  for (int k = 0; k < kBins; ++k)
    if (count[k] > 0) coherence += sum[k] * sum[k] / count[k];
  return squares > 0 ? coherence / (squares / pixels) : 0;
}

StripFit FitStrip(const GreyView& image, const StripFrame& frame, std::span<const StripEdge> start,
                  std::span<const StripNeighbour> neighbours, const StripSettings& settings, Simd simd,
                  StripBuffers& b) {
  StripFit out;
  const int edges = static_cast<int>(start.size());
  const double side_px =
      std::min(settings.reach_px,
               1.5 * settings.start_blur_px);  // a side that is shorter cannot show its level
  const StripWindow window{start.front().offset - settings.reach_px, start.back().offset + settings.reach_px};
  const std::size_t pixels = TakePixels(image, frame, neighbours, settings, side_px, window, b);
  const int columns = static_cast<int>(b.column_along.size());
  if (columns < kMinColumns) return out;
  const double half = std::max({std::abs(b.column_along.front()), std::abs(b.column_along.back()), 1.0f});
  Fitted f;
  f.model = StartModel(start, b, pixels, half, settings.start_blur_px);
  const StripSamples samples = Prepare(image, frame, settings, pixels, half, simd, b);
  constexpr int kLinearColumns = 24;  // fewer columns cannot tell a slope of the levels from noise
  const bool may_slope = columns >= kLinearColumns;
  BlurPrior prior;
  if (settings.blur_sigma_px > 0)
    prior = {settings.start_blur_px, std::pow(settings.noise_sigma / settings.blur_sigma_px, 2)};
  PrepareWings(half, settings.noise_sigma, b.wing);
  if (!FitModel(samples, b.wing, prior, settings.noise_sigma, simd, edges, may_slope, f)) return out;
  // Where levels that hold far from the edge do not explain the strip, it goes without them.
  if (b.wing[0].n + b.wing[1].n > 0 && ResidualSigma(f) > kExplainedShare * settings.noise_sigma) {
    b.wing[0] = b.wing[1] = {};
    const int iterations = kIterations + (edges > 1 ? 2 : 0);
    if (!IterateFor(edges, f.linear)(samples, b.wing, prior, simd, iterations, false, f)) return out;
  }
  out.overexposed = edges == 1 && IsOverexposed(samples, f.model);
  PlaceColumns(b);
  FillProfile(f.model, window.low, b);
  out.profiled = true;
  const double pixel_sigma = std::max(settings.noise_sigma, ResidualSigma(f));
  const double column_sigma = pixel_sigma * std::sqrt(2 * std::sqrt(M_PI) * f.model.blur) /
                              std::max(1e-6, double{std::abs(f.model.contrast[0])});
  const int kept = DropOutliers(b, column_sigma);
  if (kept < std::max(kMinColumns, columns / 2)) return out;
  if (kept < columns) {
    if (!IterateFor(edges, f.linear)(samples, b.wing, prior, simd, 1, false, f)) return out;
    PlaceColumns(b);
    FillProfile(f.model, window.low, b);
  }
  out.coherence = b.profile.Coherence();
  double rms2 = 0;
  out.from = b.column_along.front(), out.to = b.column_along.back();
  for (std::size_t c = 0; c < b.column_place.size(); ++c)
    if (b.weight[b.column_start[c]] != 0) rms2 += double{b.column_place[c]} * b.column_place[c];
  out.rms_px = std::sqrt(rms2 / kept);
  out.residual_sigma = ResidualSigma(f);
  const double variance =
      std::max(out.residual_sigma * out.residual_sigma, kRoundingVariance) * Correlation(b);
  for (int e = 0; e < edges; ++e) {
    out.edges[e].offset = f.model.offset[e], out.edges[e].slope = f.model.slope[e] / half,
    out.edges[e].contrast = f.model.contrast[e];
    out.edges[e].covariance = variance * f.covariance.block<2, 2>(2 * e, 2 * e);
    out.edges[e].covariance.row(1) /= half;
    out.edges[e].covariance.col(1) /= half;
    if (out.overexposed) out.edges[e].covariance(0, 0) += std::pow(kHiddenShift * f.model.blur, 2);
  }
  out.blur_px = f.model.blur;
  out.num_columns = kept;
  out.ok = out.blur_px < kMaxBlurPx;
  return out;
}

}  // namespace vss
