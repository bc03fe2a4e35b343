#include "vss/feature/line_refine.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vss/feature/hidden_edge.h"

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr double kReachPx = 5;     // of the strip on either side
constexpr double kMarginPx = 2.5;  // an edge of usual blur has reached its levels at this distance
constexpr double kPairPx = 5.5;    // parallel edges nearer than this are fitted together
constexpr double kNearPx = kReachPx + kMarginPx + 2;

Vector2d ImgOf(const Intrinsics* lens, const Vector2d& ideal) {
  if (!lens) return ideal;
  return lens->ImgFromNormalized(lens->NormalizedFromIdeal(ideal)).value_or(ideal);
}

Vector2d IdealOf(const Intrinsics* lens, const Vector2d& img) {
  if (!lens) return img;
  const auto n = lens->NormalizedFromImg(img);
  return n ? lens->IdealFromNormalized(*n) : img;
}

double NoiseAt(const NoiseMap& noise, const GreyView& image, const Vector2d& p) {
  return noise.At(std::clamp(static_cast<int>(p.x()), 0, image.width - 1),
                  std::clamp(static_cast<int>(p.y()), 0, image.height - 1));
}

StripFrame FrameOf(const Intrinsics* lens, const LineSegment& s) {
  StripFrame f;
  const Vector2d chord = s.end - s.start;
  const double length = chord.norm();
  f.middle = 0.5 * (s.start + s.end);
  f.along = chord / length;
  f.across = {f.along.y(), -f.along.x()};
  f.from = -0.5 * length, f.to = 0.5 * length;
  if (!lens) return f;
  for (int i = 0; i < StripFrame::kNodes; ++i) {
    const double share = double(i) / (StripFrame::kNodes - 1);
    const Vector2d d = ImgOf(lens, s.ideal_start + (s.ideal_end - s.ideal_start) * share) - f.middle;
    f.node[i] = f.along.dot(d), f.difference[i] = f.across.dot(d);
  }
  for (int k = 1; k < StripFrame::kNodes; ++k)
    for (int i = StripFrame::kNodes - 1; i >= k; --i)
      f.difference[i] = (f.difference[i] - f.difference[i - 1]) / (f.node[i] - f.node[i - k]);
  return f;
}

Vector2d InFrame(const StripFrame& f, const Vector2d& p) {
  const Vector2d d = p - f.middle;
  const double a = f.along.dot(d);
  return {a, f.across.dot(d) - f.Sag(std::clamp(a, f.from, f.to))};
}

// Segments by the cells that they cross, for neighbourhood queries.
constexpr int kCellPx = 32;

struct Grid {
  int columns, rows;
};

template <class Visit>
void ForCells(const Grid& grid, const LineSegment& s, double margin, const Visit& visit) {
  const double u0 = std::min(s.start.x(), s.end.x()) - margin, u1 = std::max(s.start.x(), s.end.x()) + margin;
  const double v0 = std::min(s.start.y(), s.end.y()) - margin, v1 = std::max(s.start.y(), s.end.y()) + margin;
  const Vector2d d = s.end - s.start;
  const double length = std::max(d.norm(), 1e-9), reach = margin + 0.75 * kCellPx;
  auto cell = [](double x, int n) { return std::clamp(static_cast<int>(x / kCellPx), 0, n - 1); };
  for (int y = cell(v0, grid.rows); y <= cell(v1, grid.rows); ++y)
    for (int x = cell(u0, grid.columns); x <= cell(u1, grid.columns); ++x) {
      const Vector2d centre((x + 0.5) * kCellPx, (y + 0.5) * kCellPx), e = centre - s.start;
      if (std::abs(d.x() * e.y() - d.y() * e.x()) / length <= reach) visit(std::size_t(y) * grid.columns + x);
    }
}

Grid BuildGrid(const GreyView& image, const std::vector<LineSegment>& segments, RefineBuffers& b) {
  const Grid grid{image.width / kCellPx + 1, image.height / kCellPx + 1};
  b.cell_start.assign(std::size_t(grid.columns) * grid.rows + 1, 0);
  for (const auto& s : segments) ForCells(grid, s, 0, [&](std::size_t c) { ++b.cell_start[c + 1]; });
  for (std::size_t c = 0; c + 1 < b.cell_start.size(); ++c) b.cell_start[c + 1] += b.cell_start[c];
  b.cell_items.resize(b.cell_start.back());
  for (std::size_t i = segments.size(); i-- > 0;)
    ForCells(grid, segments[i], 0,
             [&](std::size_t c) { b.cell_items[--b.cell_start[c + 1]] = static_cast<std::uint32_t>(i); });
  // Filling moved every start one to the left of where it stands.
  for (std::size_t c = 0; c + 1 < b.cell_start.size(); ++c) b.cell_start[c] = b.cell_start[c + 1];
  b.cell_start.back() = static_cast<std::uint32_t>(b.cell_items.size());
  b.seen.assign(segments.size(), 0);
  b.stamp = 0;
  return grid;
}

// Indices of the other segments whose cells lie within `margin` of segment `i`,
// ascending.
void FindNearby(const Grid& grid, const std::vector<LineSegment>& segments, std::size_t i, double margin,
                RefineBuffers& b) {
  b.nearby.clear();
  const std::uint32_t stamp = ++b.stamp;
  ForCells(grid, segments[i], margin, [&](std::size_t c) {
    for (auto k = b.cell_start[c]; k < b.cell_start[c + 1]; ++k) {
      const auto j = b.cell_items[k];
      if (j == i || b.seen[j] == stamp) continue;
      b.seen[j] = stamp;
      b.nearby.push_back(j);
    }
  });
  std::sort(b.nearby.begin(), b.nearby.end());
}

struct Surroundings {
  int partner = -1;  // a parallel edge so near that both are fitted together
  StripEdge partner_edge{};
};

Surroundings Survey(const StripFrame& f, const std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr double kParallel = 0.12;   // slope
  constexpr double kMinOverlap = 0.5;  // of the segment's length
  Surroundings out;
  double nearest = kPairPx;
  b.neighbours.clear();
  std::size_t partner_place = 0;
  for (const auto j : b.nearby) {
    const Vector2d p = InFrame(f, segments[j].start), q = InFrame(f, segments[j].end);
    const double low = std::min(p.x(), q.x()), high = std::max(p.x(), q.x());
    if (high < f.from - kNearPx || low > f.to + kNearPx || std::min(p.y(), q.y()) > kNearPx ||
        std::max(p.y(), q.y()) < -kNearPx)
      continue;
    b.neighbours.push_back({p, q});
    const double slope = (q.y() - p.y()) / (q.x() - p.x());
    const double overlap = std::min(high, f.to) - std::max(low, f.from);
    const double at = p.y() - slope * p.x();
    if (!(std::abs(slope) < kParallel) || overlap < kMinOverlap * (f.to - f.from) ||
        std::abs(at) >= nearest || std::abs(at) < 0.7)
      continue;
    nearest = std::abs(at);
    out.partner = static_cast<int>(j);
    const bool same = q.x() > p.x();
    out.partner_edge = {at, slope, same ? segments[j].contrast : -segments[j].contrast,
                        Eigen::Matrix2d::Zero()};
    partner_place = b.neighbours.size() - 1;
  }
  if (out.partner >= 0) b.neighbours.erase(b.neighbours.begin() + std::ptrdiff_t(partner_place));
  return out;
}

// Sub-pixel part of the strip's ends that corners and the raw end's own error
// may spoil.
double EndMargin(double length) { return std::clamp(0.12 * length, 0.5, 2.5); }

struct Gate {
  double max_move_px = 1,
         max_move_beside_px = 2;  // the raw place of an edge is drawn towards one close beside it
  double min_contrast_share = 0.3, max_contrast_share = 3;
};

bool Passes(const StripFit& fit, const StripEdge& edge, const StripFrame& f, double raw_contrast,
            bool beside) {
  const Gate gate;
  if (!fit.ok) return false;
  const double a = edge.offset + edge.slope * f.from, b = edge.offset + edge.slope * f.to;
  if (std::max(std::abs(a), std::abs(b)) > (beside ? gate.max_move_beside_px : gate.max_move_px))
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
  int index = 0;  // which of the fit's edges is the segment
};

// Corners of two regions at the ends of `s`: lines that it meets with the same
// levels on both sides.
struct Corners {
  StripCorner at[2];
  std::size_t count = 0;
  bool dark = false, at_start = false, at_end = false;
};

// How segment `n` continues `s` round a corner: +1 to the left (bright inside),
// -1 to the right, 0 not at all.
int TurnAtCorner(const LineSegment& s, const LineSegment& n, bool at_end) {
  constexpr double kReachPx = 4;  // raw ends miss their corner by this at most
  constexpr double kMinLengthPx = 6;
  constexpr double kMaxContrastRatio = 1.6;
  constexpr double kMinSine = 0.35;  // 20 degrees
  const Vector2d &mine = at_end ? s.ideal_end : s.ideal_start, &its = at_end ? n.ideal_start : n.ideal_end;
  if ((mine - its).squaredNorm() > 2 * kReachPx * kReachPx ||
      std::max(s.contrast, n.contrast) > kMaxContrastRatio * std::min(s.contrast, n.contrast))
    return 0;
  const Vector2d d = s.ideal_end - s.ideal_start, e = n.ideal_end - n.ideal_start;
  if (e.norm() < kMinLengthPx) return 0;
  const double sine = (d.x() * e.y() - d.y() * e.x()) / (d.norm() * e.norm());
  if (std::abs(sine) < kMinSine) return 0;
  const Vector2d w = n.ideal_start - mine;
  const double along = (w.x() * e.y() - w.y() * e.x()) / (sine * e.norm());
  const Vector2d cross = mine + along * d.normalized();
  if (std::abs(along) > kReachPx || (cross - its).norm() > kReachPx) return 0;
  const double turn = at_end ? sine : -sine;  // on the way through the corner
  return turn < 0 ? 1 : -1;                   // v points down: a turn to the left has a negative sine
}

// The corner's line at its place: under a distorting lens the tangent there.
StripCorner CornerOf(const Intrinsics* lens, const LineSegment& n, bool at_its_start) {
  const Vector2d d = (n.ideal_end - n.ideal_start).normalized();
  constexpr double kChordPx = 8;
  const Vector2d near = at_its_start ? n.ideal_start : Vector2d(n.ideal_end - kChordPx * d);
  const Vector2d p = ImgOf(lens, near), q = ImgOf(lens, near + kChordPx * d), t = (q - p).normalized();
  return {p, {t.y(), -t.x()}};
}

// Finds the corners of `s` among b.nearby and takes their lines out of
// b.neighbours (`frame` is that of the neighbours).
Corners FindCorners(const Intrinsics* lens, const LineSegment& s, const std::vector<LineSegment>& all,
                    const StripFrame& frame, RefineBuffers& b) {
  Corners out;
  for (const bool at_end : {false, true})
    for (const auto j : b.nearby) {
      const int turn = TurnAtCorner(s, all[j], at_end);
      if (turn == 0 || (out.count > 0 && out.dark != (turn < 0))) continue;
      out.dark = turn < 0;
      out.at[out.count++] = CornerOf(lens, all[j], at_end);
      (at_end ? out.at_end : out.at_start) = true;
      const Vector2d p = InFrame(frame, all[j].start), q = InFrame(frame, all[j].end);
      std::erase_if(b.neighbours, [&](const StripNeighbour& n) { return n.from == p && n.to == q; });
      break;
    }
  return out;
}

StripSettings SettingsFor(const RefineContext& x, const StripFrame& frame, const LineSegment& s,
                          const KnownBlur& known, const Corners& corners) {
  StripSettings settings;
  settings.reach_px = kReachPx, settings.margin_px = kMarginPx;
  settings.noise_sigma = NoiseAt(x.noise, x.image, frame.middle);
  settings.start_blur_px =
      known.blur_px > 0 ? known.blur_px : std::clamp(std::hypot(s.blur_px, 0.29), 0.6, 2.0);
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
    settings.margin_px = share * kMarginPx;
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
  const auto hidden = FindHiddenEdge(b.strip.profile);
  if (!hidden || hidden->gain < kMinGain) return single;
  const StripSettings settings = SettingsFor(x, frame, s, known, corners);
  const Attempt two = FitWith(x, frame, hidden->main, &hidden->other, settings, b);
  const StripEdge &main = two.fit.edges[two.index], &other = two.fit.edges[1 - two.index];
  if (!Passes(two.fit, main, frame, s.contrast, false) || std::abs(main.offset) > std::abs(other.offset) ||
      std::abs(other.contrast) < kMinHiddenShare * main.contrast ||
      std::abs(main.offset - other.offset) < settings.start_blur_px)
    return single;
  if (!single.fit.ok) return two;
  const double before = std::pow(single.fit.residual_sigma, 2), after = std::pow(two.fit.residual_sigma, 2);
  return 2 * settings.reach_px * two.fit.num_columns * (before / after - 1) < kMinGain ? single : two;
}

// The lens's blur from the segments that were fitted: a low quantile, since
// what disturbs an edge makes it wider.
KnownBlur BlurOf(const RefineContext& x, const std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr double kMinContrast = 10;  // of the noise
  constexpr int kMinColumns = 12;
  constexpr float kFitted = 1e8f;
  constexpr std::size_t kMinSegments = 4;
  constexpr double kQuantile = 0.35;
  auto& sorted = b.strip.sorted;
  sorted.clear();
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const LineSegment& s = segments[i];
    if (b.coherence[i] < kFitted && s.num_points >= kMinColumns && s.blur_px > 0.2 &&
        s.contrast > kMinContrast * NoiseAt(x.noise, x.image, 0.5 * (s.start + s.end)))
      sorted.push_back(static_cast<float>(std::hypot(s.blur_px, 0.28867513)));
  }
  if (sorted.size() < kMinSegments) return {};
  const auto at = sorted.begin() + std::ptrdiff_t(kQuantile * double(sorted.size()));
  std::nth_element(sorted.begin(), at, sorted.end());
  return {*at};
}

}  // namespace

void RefinePlaces(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr float kNotFitted = 1e9f;
  b.before = segments;
  const Grid grid = BuildGrid(x.image, b.before, b);
  b.sound.assign(segments.size(), 0);
  b.coherence.assign(segments.size(), kNotFitted);
  KnownBlur known;
  // Edges with another close beside them are fitted once the lens's blur is
  // known, which tells the two apart.
  for (const int pass : {0, 1}) {
    for (std::size_t i = 0; i < segments.size(); ++i) {
      if (b.sound[i]) continue;
      const LineSegment& raw = b.before[i];
      const StripFrame whole = FrameOf(x.lens, raw);
      FindNearby(grid, b.before, i, kNearPx, b);
      const Surroundings around = Survey(whole, b.before, b);
      const bool paired = around.partner >= 0;
      if (pass == 0 && paired) continue;
      const Corners corners = FindCorners(x.lens, raw, b.before, whole, b);
      const StripFrame frame = Trimmed(whole, corners);
      Attempt attempt = FirstFit(x, frame, raw, around, known, corners, b);
      const bool fits = Passes(attempt.fit, attempt.fit.edges[attempt.index], whole, raw.contrast, paired);
      if (pass == 1 && !paired && attempt.fit.profiled && (!fits || attempt.fit.coherence > kMaxCoherence)) {
        attempt.fit.ok = fits;
        attempt = WithHiddenEdge(x, frame, raw, known, corners, attempt, b);
      }
      segments[i] = raw;
      if (!Passes(attempt.fit, attempt.fit.edges[attempt.index], whole, raw.contrast, paired)) continue;
      Apply(x.lens, whole, attempt.fit, attempt.fit.edges[attempt.index], segments[i]);
      b.coherence[i] = static_cast<float>(attempt.fit.coherence);
    }
    if (pass == 1) break;
    known = BlurOf(x, segments, b);
    constexpr double kUsual = 1.4;  // a blur within this factor of the lens's needs no second look
    for (std::size_t i = 0; i < segments.size(); ++i) {
      const double ratio =
          known.blur_px > 0 ? std::hypot(segments[i].blur_px, 0.28867513) / known.blur_px : 1.0;
      b.sound[i] = ratio < kUsual && ratio > 1 / kUsual && b.coherence[i] < kMaxCoherence;
    }
  }
}

// ---- ends ----

namespace {

double Sample(const GreyView& image, const Vector2d& p) {
  const double u = std::clamp(p.x(), 0.0, image.width - 1.001),
               v = std::clamp(p.y(), 0.0, image.height - 1.001);
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const double a = u - iu, b = v - iv;
  return (1 - b) * ((1 - a) * image.At(iu, iv) + a * image.At(iu + 1, iv)) +
         b * ((1 - a) * image.At(iu, iv + 1) + a * image.At(iu + 1, iv + 1));
}

// Difference of the two sides of the line at a place of it (ideal).
double StepAt(const RefineContext& x, const Vector2d& at, const Vector2d& along) {
  const Vector2d left(along.y(), -along.x());
  double sum = 0;
  for (const double side : {1.25, 2.25})
    sum +=
        Sample(x.image, ImgOf(x.lens, at + side * left)) - Sample(x.image, ImgOf(x.lens, at - side * left));
  return sum / 2;
}

bool Inside(const GreyView& image, const Vector2d& p, double border) {
  return p.x() >= border && p.y() >= border && p.x() <= image.width - 1 - border &&
         p.y() <= image.height - 1 - border;
}

// How far (px, ideal, outward positive) the edge goes on beyond its raw end:
// the cut that explains the steps seen best as full contrast before it and none
// behind (the largest cumulated sum of step minus half a contrast).
double FreeEnd(const RefineContext& x, const Vector2d& end, const Vector2d& outward, const Vector2d& along,
               double contrast, double length) {
  constexpr double kInsidePx = 5, kStepPx = 0.5;
  constexpr double kGiveUpPx = 4;  // so much of missing edge ends the search
  const double inside = std::min(kInsidePx, length / 2), most = std::max(8.0, 0.5 * length);
  double sum = 0, best = 0, cut = -inside;
  for (double a = -inside; a < most; a += kStepPx) {
    const Vector2d p = end + a * outward;
    if (!Inside(x.image, ImgOf(x.lens, p), 0)) break;
    sum += kStepPx * (StepAt(x, p, along) / contrast - 0.5);
    if (sum > best) best = sum, cut = a + 0.5 * kStepPx;
    if (sum < best - 0.5 * kGiveUpPx) break;
  }
  return cut;
}

struct Meeting {
  int other = -1;
  Vector2d at = {0, 0};
  double miss_px = 1e9;        // of both ends, when it is a corner
  bool at_others_end = false;  // a corner, not somewhere on the other
};

// Where the line of segment `i`, near its end, meets the line of another
// segment that is there.
Meeting FindMeeting(const std::vector<LineSegment>& all, std::size_t i, bool at_end,
                    const std::vector<std::uint32_t>& nearby) {
  constexpr double kReachPx = 5;     // an end lies no farther from its corner:
                                     // rounding of the corner, and what cuts leave
  constexpr double kMinSine = 0.17;  // 10 degrees
  const LineSegment& s = all[i];
  const Vector2d end = at_end ? s.ideal_end : s.ideal_start, d = (s.ideal_end - s.ideal_start).normalized();
  Meeting best;
  for (const auto j : nearby) {
    const LineSegment& o = all[j];
    const Vector2d e = o.ideal_end - o.ideal_start;
    const double length = e.norm();
    if (!(length > 0)) continue;
    const Vector2d f = e / length;
    const double sine = d.x() * f.y() - d.y() * f.x();
    if (std::abs(sine) < kMinSine) continue;
    const Vector2d w = o.ideal_start - end;
    const double along = (w.x() * f.y() - w.y() * f.x()) / sine;  // of the crossing, from the end
    const Vector2d cross = end + along * d;
    const double on_other = (cross - o.ideal_start).dot(f);
    const double beyond = std::max({0.0, -on_other, on_other - length});
    if (std::abs(along) > kReachPx || beyond > kReachPx) continue;
    const double cost = std::abs(along) + beyond;
    const bool corner = std::min(std::abs(on_other), std::abs(on_other - length)) < kReachPx;
    if (cost < best.miss_px) best = {static_cast<int>(j), cross, cost, corner};
  }
  return best;
}

void SetEnd(const Intrinsics* lens, LineSegment& s, bool at_end, const Vector2d& ideal) {
  (at_end ? s.ideal_end : s.ideal_start) = ideal;
  (at_end ? s.end : s.start) = ImgOf(lens, ideal);
}

void MarkBorders(const GreyView& image, LineSegment& s) {
  constexpr double kBorderPx = 4;
  if (!Inside(image, s.start, kBorderPx)) s.start_kind = SegmentEnd::kBorder;
  if (!Inside(image, s.end, kBorderPx)) s.end_kind = SegmentEnd::kBorder;
}

// Whether `s` tells of the same edge as the longer `o`: the same polarity,
// lying along it.
bool Repeats(const LineSegment& s, const LineSegment& o) {
  constexpr double kMinCosine = 0.9, kMaxBlurs = 1.3, kMinDistancePx = 1.0, kOvershootPx = 3;
  const Vector2d d = s.ideal_end - s.ideal_start, e = o.ideal_end - o.ideal_start;
  const double length = e.norm();
  if (d.squaredNorm() >= e.squaredNorm() || d.dot(e) < kMinCosine * d.norm() * length) return false;
  const double limit = std::max(kMinDistancePx, kMaxBlurs * std::hypot(o.blur_px, 0.29));
  for (const Vector2d& p : {s.ideal_start, s.ideal_end}) {
    const Vector2d w = p - o.ideal_start;
    const double along = w.dot(e) / length;
    if (std::abs(w.x() * e.y() - w.y() * e.x()) > limit * length || along < -kOvershootPx ||
        along > length + kOvershootPx)
      return false;
  }
  return true;
}

void DropRepeated(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  const Grid grid = BuildGrid(x.image, segments, b);
  b.sound.assign(segments.size(), 1);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    FindNearby(grid, segments, i, kNearPx, b);
    for (const auto j : b.nearby)
      if (Repeats(segments[i], segments[j])) b.sound[i] = 0;
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < segments.size(); ++i)
    if (b.sound[i]) segments[kept++] = segments[i];
  segments.resize(kept);
}

}  // namespace

void RefineEnds(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr double kSureCornerPx = 3;  // ends that miss their corner by no more need no search
  b.before = segments;
  const Grid raw = BuildGrid(x.image, b.before, b);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    LineSegment& s = segments[i];
    FindNearby(raw, b.before, i, kNearPx, b);
    const Vector2d d = (s.ideal_end - s.ideal_start).normalized();
    const double length = (s.ideal_end - s.ideal_start).norm();
    double beyond[2] = {0, 0};
    for (const int e : {0, 1}) {
      const Meeting m = FindMeeting(b.before, i, e == 1, b.nearby);
      if (m.at_others_end && m.miss_px < kSureCornerPx) continue;
      beyond[e] = FreeEnd(x, e == 1 ? s.ideal_end : s.ideal_start, e == 1 ? d : -d, d, s.contrast, length);
    }
    if (beyond[0] + beyond[1] < -0.5 * length) continue;
    SetEnd(x.lens, s, false, s.ideal_start - beyond[0] * d);
    SetEnd(x.lens, s, true, s.ideal_end + beyond[1] * d);
  }
  DropRepeated(x, segments, b);
  b.before = segments;
  const Grid grid = BuildGrid(x.image, b.before, b);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    LineSegment& s = segments[i];
    FindNearby(grid, b.before, i, kNearPx, b);
    for (const bool at_end : {false, true}) {
      const Meeting m = FindMeeting(b.before, i, at_end, b.nearby);
      if (m.other < 0) continue;
      SetEnd(x.lens, s, at_end, m.at);
      (at_end ? s.end_kind : s.start_kind) = SegmentEnd::kJunction;
      (at_end ? s.end_junction : s.start_junction) = m.other;
    }
    MarkBorders(x.image, s);
  }
}

}  // namespace vss
