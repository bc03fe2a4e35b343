#include "vss/feature/line_refine.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vss/feature/hidden_edge.h"
#include "vss/feature/strip_frame.h"
#include "vss/feature/strip_surroundings.h"

namespace vss {
namespace {

using Eigen::Vector2d;

double NoiseAt(const NoiseMap& noise, const GreyView& image, const Vector2d& p) {
  return noise.At(std::clamp(static_cast<int>(p.x()), 0, image.width - 1),
                  std::clamp(static_cast<int>(p.y()), 0, image.height - 1));
}

// Sub-pixel part of the strip's ends that corners and the raw end's own error
// may spoil.
double EndMargin(double length) { return std::clamp(0.12 * length, 0.5, 2.5); }

struct Gate {
  double max_move_px = 1;  // of the middle
  double max_turn = 2;     // the ends may move by so many times more
  double min_contrast_share = 0.3, max_contrast_share = 3;
};

// Whether the model explains the pixels down to their noise: more is texture, in which likelihood may run
// off.
bool IsExplained(const StripFit& fit, double noise) { return fit.residual_sigma < kExplainedShare * noise; }

// Whether the fit stays near the raw segment. Where the model explains the pixels down to the noise, an edge
// may have moved as far as a blurred one's points wander; one close beside another was drawn towards it.
bool Passes(const StripFit& fit, const StripEdge& edge, const StripFrame& f, double raw_contrast,
            double blur_px, double noise, bool beside) {
  constexpr double kBesidePx = 2;
  Gate gate;
  if (!fit.ok) return false;
  const bool explained = IsExplained(fit, noise);
  gate.max_move_px = beside ? kBesidePx : explained ? SameEdgePx(blur_px) : gate.max_move_px;
  if (!explained) gate.max_turn = 1;
  const double middle = 0.5 * (f.from + f.to), a = edge.offset + edge.slope * f.from,
               b = edge.offset + edge.slope * f.to;
  if (std::abs(edge.offset + edge.slope * middle) > gate.max_move_px ||
      std::max(std::abs(a), std::abs(b)) > gate.max_turn * gate.max_move_px)
    return false;
  return edge.contrast > gate.min_contrast_share * raw_contrast &&
         edge.contrast < gate.max_contrast_share * raw_contrast;
}

void Apply(const Intrinsics* lens, const StripFrame& f, const StripFit& fit, const StripEdge& edge,
           LineSegment& s) {
  auto img = [&](double a) {
    return Vector2d(f.middle + a * f.along + (f.Sag(a) + edge.offset + edge.slope * a) * f.across);
  };
  s.start = img(f.from), s.end = img(f.to);
  s.ideal_start = IdealOf(lens, s.start), s.ideal_end = IdealOf(lens, s.end);
  s.contrast = edge.contrast;
  constexpr double kPixelVariance = 1.0 / 12;
  s.blur_px = std::sqrt(std::max(0.0, fit.blur_px * fit.blur_px - kPixelVariance));
  s.rms_distance_px = fit.rms_px;
  // The covariance at the middle of the columns that took part, where offset
  // and angle are all but uncorrelated.
  const double at = 0.5 * (fit.from + fit.to);
  const auto& c = edge.covariance;
  s.sigma_offset_px = std::sqrt(std::max(0.0, c(0, 0) + 2 * at * c(0, 1) + at * at * c(1, 1)));
  s.sigma_angle_rad = std::sqrt(std::max(0.0, c(1, 1)));
  s.num_points = fit.num_columns;
}

// What is known of the lens's blur once the first fits are done.
struct KnownBlur {
  double blur_px = 0;  // lens and pixel; 0: not known
};
constexpr double kBlurSpread = 0.12;  // share by which the blur differs over a
                                      // picture: depth, field curvature

struct Attempt {
  StripFit fit;
  int index = 0;        // which of the fit's edges is the segment
  bool hidden = false;  // the other one is a line that only this fit has seen
};

double StartBlur(const LineSegment& s, const KnownBlur& known) {
  return known.blur_px > 0 ? known.blur_px : std::clamp(std::hypot(s.blur_px, 0.29), 0.6, 2.0);
}

StripSettings SettingsFor(const RefineContext& x, const StripFrame& frame, const LineSegment& s,
                          const KnownBlur& known, const Corners& corners) {
  StripSettings settings;
  settings.reach_px = kStripReachPx, settings.wide_px = kStripWidePx, settings.margin_px = kStripMarginPx;
  settings.noise_sigma = NoiseAt(x.noise, x.image, frame.middle);
  settings.start_blur_px = StartBlur(s, known);
  settings.blur_sigma_px = kBlurSpread * known.blur_px;
  settings.corners = std::span(corners.at, corners.count);
  settings.dark_corners = corners.dark;
  return settings;
}

Attempt FitWith(const RefineContext& x, const StripFrame& frame, const StripEdge& main,
                const StripEdge* partner, const StripSettings& settings, RefineBuffers& b) {
  StripEdge edges[2] = {main, partner ? *partner : StripEdge{}};
  Attempt out;
  if (partner && edges[1].offset < edges[0].offset) std::swap(edges[0], edges[1]), out.index = 1;
  out.fit =
      FitStrip(x.image, frame, std::span(edges, partner ? 2 : 1), b.neighbours, settings, x.simd, b.strip);
  return out;
}

StripFrame Trimmed(StripFrame frame, const Corners& corners) {
  const double margin = EndMargin(frame.to - frame.from);
  if (!corners.at_start) frame.from += margin;
  if (!corners.at_end) frame.to -= margin;
  return frame;
}

Attempt FirstFit(const RefineContext& x, const StripFrame& frame, const LineSegment& s,
                 const Surroundings& around, const KnownBlur& known, const Corners& corners,
                 RefineBuffers& b) {
  StripSettings settings = SettingsFor(x, frame, s, known, corners);
  const StripEdge* partner = around.partner >= 0 ? &around.partner_edge : nullptr;
  Attempt out;
  for (const double share : {1.0, 0.6, 0.3}) {
    // Where too little is left between the neighbours, nearer to them; in the
    // end what there is.
    settings.margin_px = share * kStripMarginPx;
    out = FitWith(x, frame, {0, 0, s.contrast, Eigen::Matrix2d::Zero()}, partner, settings, b);
    if (out.fit.ok) break;
  }
  return out;
}

constexpr double kMaxCoherence = 60;  // twenty bins of t, and texture along the
                                      // edge may double or treble each

// Pixels that fit badly in the same way all along the edge tell of another one
// close beside it that was not found by itself (the side of a thin plate). The
// fit with the best place for it, or the fit as it was, whose profile b.strip
// still holds.
Attempt WithHiddenEdge(const RefineContext& x, const StripFrame& frame, const LineSegment& s,
                       const KnownBlur& known, const Corners& corners, const Attempt& single,
                       RefineBuffers& b) {
  constexpr double kMinGain = 25;  // of the sum of squared residuals over their
                                   // variance, for three or four more parameters
  constexpr double kMinHiddenShare = 0.05;
  const auto hidden = FindHiddenEdge(b.strip.profile, x.simd);
  if (!hidden || hidden->gain < kMinGain) return single;
  const StripSettings settings = SettingsFor(x, frame, s, known, corners);
  Attempt two = FitWith(x, frame, hidden->main, &hidden->other, settings, b);
  const StripEdge &main = two.fit.edges[two.index], &other = two.fit.edges[1 - two.index];
  two.hidden = true;
  if (!Passes(two.fit, main, frame, s.contrast, settings.start_blur_px, settings.noise_sigma, false) ||
      std::abs(main.offset) > std::abs(other.offset) ||
      std::abs(other.contrast) < kMinHiddenShare * main.contrast ||
      std::abs(main.offset - other.offset) < settings.start_blur_px)
    return single;
  if (!single.fit.ok) return two;
  const double before = std::pow(single.fit.residual_sigma, 2), after = std::pow(two.fit.residual_sigma, 2);
  return 2 * settings.reach_px * two.fit.num_columns * (before / after - 1) < kMinGain ? single : two;
}

// The edge beside segment `s` that its fit saw, as long as that.
LineSegment HiddenSegment(const Intrinsics* lens, const StripFrame& f, const Attempt& attempt,
                          const LineSegment& s) {
  LineSegment out = s;
  StripEdge edge = attempt.fit.edges[1 - attempt.index];
  const bool turned = edge.contrast < 0;
  edge.contrast = std::abs(edge.contrast);
  Apply(lens, f, attempt.fit, edge, out);
  if (turned) std::swap(out.start, out.end), std::swap(out.ideal_start, out.ideal_end);
  return out;
}

constexpr float kNotFitted = 1e9f, kFitted = 1e8f;  // coherence of no fit; the most of one

// The lens's blur (and the pixel's) from the segments that were fitted, or 0: a low quantile, since
// what disturbs an edge makes it wider.
double BlurOf(const RefineContext& x, const std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr double kMinContrast = 10;  // of the noise
  constexpr int kMinColumns = 12;
  constexpr std::size_t kMinSegments = 4;
  constexpr double kQuantile = 0.35;
  auto& sorted = b.strip.sorted;
  sorted.clear();
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const LineSegment& s = segments[i];
    if (b.coherence[i] <= kFitted && s.num_points >= kMinColumns && s.blur_px > 0.2 &&
        s.contrast > kMinContrast * NoiseAt(x.noise, x.image, 0.5 * (s.start + s.end)))
      sorted.push_back(static_cast<float>(std::hypot(s.blur_px, 0.28867513)));
  }
  if (sorted.size() < kMinSegments) return 0;
  const auto at = sorted.begin() + std::ptrdiff_t(kQuantile * double(sorted.size()));
  std::nth_element(sorted.begin(), at, sorted.end());
  return *at;
}

enum class Look { kFirst, kLast, kAgain };

// Fits segment `i` at its place in b.before; whether the fit counts. At the first look those with another
// close beside them wait until the lens's blur is known, which tells the two apart.
bool RefineOne(const RefineContext& x, std::size_t i, Look look, LineSegment& out, RefineBuffers& b) {
  const LineSegment& raw = b.before[i];
  const StripFrame whole = FrameOf(x.lens, raw);
  const KnownBlur known{b.blur_px};
  b.grid.FindNearby(b.before, i, kNearPx);
  const double blur = StartBlur(raw, known), noise = NoiseAt(x.noise, x.image, whole.middle);
  const Surroundings around = Survey(whole, blur, raw.contrast, b.before, b);
  const bool paired = around.partner >= 0;
  if (look == Look::kFirst && paired) return false;
  const Corners corners = FindCorners(x.lens, raw, b.before, whole, b);
  const StripFrame frame = Trimmed(whole, corners);
  Attempt attempt = FirstFit(x, frame, raw, around, known, corners, b);
  auto passes = [&] {
    return Passes(attempt.fit, attempt.fit.edges[attempt.index], whole, raw.contrast, blur, noise, paired);
  };
  const bool fits = passes();
  if (look == Look::kLast && !paired && attempt.fit.profiled &&
      (!fits || attempt.fit.coherence > kMaxCoherence)) {
    attempt.fit.ok = fits;
    attempt = WithHiddenEdge(x, frame, raw, known, corners, attempt, b);
  }
  out = raw;
  if (!passes() || (look == Look::kAgain && !IsExplained(attempt.fit, noise))) return false;
  Apply(x.lens, whole, attempt.fit, attempt.fit.edges[attempt.index], out);
  b.coherence[i] = std::min(static_cast<float>(attempt.fit.coherence), kFitted);
  if (attempt.hidden) b.hidden.push_back(HiddenSegment(x.lens, whole, attempt, raw));
  return true;
}

}  // namespace

void RefinePlaces(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  b.before = segments;
  b.grid.Build(x.image, b.before);
  b.coherence.assign(segments.size(), kNotFitted);
  b.blur_px = 0;
  b.hidden.clear();
  for (std::size_t i = 0; i < segments.size(); ++i) RefineOne(x, i, Look::kFirst, segments[i], b);
  b.moved.assign(segments.size(), 1), b.fitted.resize(segments.size());
  b.blur_px = BlurOf(x, segments, b);
  constexpr double kUsual = 1.4;  // a blur within this factor of the lens's needs no second look
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const double ratio = b.blur_px > 0 ? std::hypot(segments[i].blur_px, 0.28867513) / b.blur_px : 1.0;
    if (!(ratio < kUsual && ratio > 1 / kUsual && b.coherence[i] < kMaxCoherence))
      RefineOne(x, i, Look::kLast, segments[i], b);
    b.fitted[i] = b.coherence[i] < kNotFitted;
  }
  segments.insert(segments.end(), b.hidden.begin(), b.hidden.end());
  b.moved.resize(segments.size(), 0), b.fitted.resize(segments.size(), 1);
}

void RefineGrown(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  b.before = segments;
  b.grid.Build(x.image, b.before);
  b.coherence.assign(segments.size(), kNotFitted);
  for (std::size_t i = 0; i < segments.size(); ++i)
    if (b.moved[i] && (b.moved[i] = RefineOne(x, i, Look::kAgain, segments[i], b))) b.fitted[i] = 1;
}

}  // namespace vss
