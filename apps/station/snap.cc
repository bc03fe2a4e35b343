#include "snap.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "vss/feature/ellipse_fit.h"
#include "workspace.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

constexpr double kHandSigmaPx = 1;                // how well a hand draws
constexpr double kStepAcrossPx = 0.25;            // of the profile's samples
constexpr double kLeastContrast = 1.0 / 255 * 4;  // of the full range: fainter steps are noise
constexpr double kRimReachPx = 5,
                 kRimReachAgainPx = 2;  // to both sides of the drawn rim, and of its first fit
constexpr double kRimGapPx = 8;         // a rim goes on beyond so much where no edge is seen
constexpr double kRimRmsPx = 0.7;       // what lies farther from every ellipse is no rim
constexpr double kRimSeen =
    0.4;  // of the rim between the first and the last click: as much as a drawn line needs
constexpr double kRimTurnRad = 0.1;   // three points that turn by less are a straight line
constexpr double kDownwards = -0.05;  // of a ray's unit vector: flatter rays meet the ground too far away
constexpr int kRimPoints = 48;        // that stand for a whole ellipse

double Bilinear(const GreyView& image, const Vector2d& p) {
  const double u = std::clamp(p.x(), 0.0, image.width - 1.001),
               v = std::clamp(p.y(), 0.0, image.height - 1.001);
  const int i = int(u), k = int(v);
  const double a = u - i, b = v - k;
  return (1 - a) * (1 - b) * image.At(i, k) + a * (1 - b) * image.At(i + 1, k) +
         (1 - a) * b * image.At(i, k + 1) + a * b * image.At(i + 1, k + 1);
}

// Grey value step at offset d across the line: mean of the two px above less mean of the two px below.
double StepAt(const GreyView& image, const Vector2d& p, const Vector2d& n, double d) {
  double sum = 0;
  for (double s = 0.5; s <= 2; s += 0.5)
    sum += Bilinear(image, p + (d + s) * n) - Bilinear(image, p + (d - s) * n);
  return sum / 4;
}

struct EdgePoint {
  double along, offset, step;
};

// The place of the strongest step of the sign `sign` across the line, by a parabola.
std::optional<EdgePoint> FindAcross(const GreyView& image, const Vector2d& p, const Vector2d& n, double along,
                                    double center, double reach, int sign, double least) {
  const int count = int(reach / kStepAcrossPx);
  std::vector<double> steps;
  for (int i = -count; i <= count; ++i)
    steps.push_back(sign * StepAt(image, p, n, center + i * kStepAcrossPx));
  const auto at = std::max_element(steps.begin(), steps.end()) - steps.begin();
  if (steps[std::size_t(at)] < least || at == 0 || at + 1 == std::ptrdiff_t(steps.size()))
    return std::nullopt;
  const double a = steps[std::size_t(at) - 1], b = steps[std::size_t(at)], c = steps[std::size_t(at) + 1];
  const double shift = a - 2 * b + c < 0 ? 0.5 * (a - c) / (a - 2 * b + c) : 0;
  return EdgePoint{along, center + (double(at - count) + shift) * kStepAcrossPx, sign * b};
}

struct StraightFit {
  double offset = 0, slope = 0, rms = 0, step = 0;
  int num = 0;
};

// offset(along) by least squares, three rounds without what lies far off.
StraightFit FitStraight(std::vector<EdgePoint> points, double length) {
  StraightFit fit;
  for (int round = 0; round < 3 && points.size() >= 2; ++round) {
    double s = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, step = 0;
    for (const auto& p : points)
      s += 1, sx += p.along, sy += p.offset, sxx += p.along * p.along, sxy += p.along * p.offset,
          step += p.step;
    const double det = s * sxx - sx * sx;
    if (det < 1e-9 * length) break;
    fit.slope = (s * sxy - sx * sy) / det;
    fit.offset = (sy - fit.slope * sx) / s;
    fit.step = step / s;
    double sum = 0;
    for (const auto& p : points) sum += std::pow(p.offset - fit.offset - fit.slope * p.along, 2);
    fit.rms = std::sqrt(sum / s);
    fit.num = int(points.size());
    const double limit = std::max(0.3, 2.5 * fit.rms);
    std::erase_if(points, [&](const EdgePoint& p) {
      return std::abs(p.offset - fit.offset - fit.slope * p.along) > limit;
    });
  }
  return fit;
}

}  // namespace

LineSegment SnapToEdge(const GreyView& image, const Intrinsics& lens, const LineSegment& drawn,
                       double reach_px) {
  LineSegment line = drawn;
  Straighten(lens, line);
  const Vector2d chord = line.ideal_end - line.ideal_start;
  const double length = chord.norm();
  const Vector2d along = chord / length, n(-along.y(), along.x());
  const double least = kLeastContrast * image.MaxValue();
  auto img = [&](const Vector2d& ideal) {
    return lens.ImgFromNormalized(lens.NormalizedFromIdeal(ideal)).value_or(ideal);
  };
  auto collect = [&](const StraightFit& about, double reach, int sign) {
    std::vector<EdgePoint> points;
    for (double t = 1; t < length - 0.5; t += 1) {
      const Vector2d ideal = line.ideal_start + t * along;
      if (auto p = FindAcross(image, img(ideal), n, t, about.offset + about.slope * t, reach, sign, least))
        points.push_back(*p);
    }
    return points;
  };
  // Which way the step goes: the sign along which it is stronger over the whole line.
  StraightFit best;
  for (int sign : {1, -1}) {
    const auto points = collect({}, reach_px, sign);
    const StraightFit fit = FitStraight(points, length);
    if (fit.num * std::abs(fit.step) > best.num * std::abs(best.step)) best = fit;
  }
  const int sign = best.step > 0 ? 1 : -1;
  if (best.num >= 3) best = FitStraight(collect(best, 2, sign), length);
  line.sigma_offset_px = kHandSigmaPx;
  line.sigma_angle_rad = 2 * kHandSigmaPx / length;
  if (best.num < std::max(3.0, 0.4 * length)) {
    line.contrast = 0;
    return line;
  }
  line.ideal_start += best.offset * n;
  line.ideal_end += (best.offset + best.slope * length) * n;
  line.start = img(line.ideal_start);
  line.end = img(line.ideal_end);
  line.contrast = std::abs(best.step);
  line.num_points = best.num;
  line.rms_distance_px = best.rms;
  line.sigma_offset_px = std::max(0.02, best.rms / std::sqrt(double(best.num)) * 2);
  line.sigma_angle_rad = line.sigma_offset_px * std::sqrt(12.0) / length;
  // The bright side lies to the left of start -> end as seen on the screen: against n = (-dy, dx), which is
  // the right.
  if (best.step > 0) {
    std::swap(line.start, line.end);
    std::swap(line.ideal_start, line.ideal_end);
  }
  return line;
}

namespace {

// The circle through three points; empty where they lie on a straight line.
std::optional<Ellipse> CircleThrough(const std::array<Vector2d, 3>& p) {
  const Vector2d a = p[1] - p[0], b = p[2] - p[0];
  const double cross = a.x() * b.y() - a.y() * b.x();
  if (std::abs(cross) < kRimTurnRad * a.norm() * b.norm()) return std::nullopt;
  const Vector2d to_center = Vector2d(b.y() * a.squaredNorm() - a.y() * b.squaredNorm(),
                                      a.x() * b.squaredNorm() - b.x() * a.squaredNorm()) /
                             (2 * cross);
  return Ellipse{p[0] + to_center, Vector2d::Constant(to_center.norm()), 0};
}

// The rim as drawn, in ideal px. A cone over a horizontal circle cuts every horizontal plane in a circle, so
// the ground serves for rims at any height.
std::optional<Ellipse> DrawnRim(const View& view, const std::array<Vector2d, 3>& ideal) {
  const auto flat = CircleThrough(ideal);
  if (!flat) return std::nullopt;
  std::array<Vector2d, 3> on_ground;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d ray = view.RayOfIdeal(ideal[i]);
    if (ray.z() > kDownwards) return flat;
    on_ground[i] = (view.center_in_world - view.center_in_world.z() / ray.z() * ray).head<2>();
  }
  const auto circle = CircleThrough(on_ground);
  if (!circle) return flat;
  std::vector<Vector2d> seen;
  for (int k = 0; k < kRimPoints; ++k) {
    const Vector2d p = circle->PointAt(2 * kPi * k / kRimPoints);
    const auto q = view.ProjectIdeal({p.x(), p.y(), 0});
    if (!q) return flat;
    seen.push_back(*q);
  }
  const auto fit = FitEllipse(seen);
  return fit ? fit->ellipse : *flat;
}

struct Range {
  double from = 0, to = 0;
};

// Parameter angles from the first click to the last, by way of the second.
Range ClickedRange(const Ellipse& e, const std::array<Vector2d, 3>& ideal) {
  const double first = e.ParameterOf(ideal[0]);
  const auto turn = [&](const Vector2d& p) {
    const double t = std::remainder(e.ParameterOf(p) - first, 2 * kPi);
    return t < 0 ? t + 2 * kPi : t;
  };
  const double second = turn(ideal[1]), third = turn(ideal[2]);
  return second <= third ? Range{first, first + third} : Range{first + third, first + 2 * kPi};
}

Vector2d NormalAt(const Ellipse& e, double t) {  // unit, outwards
  return (Eigen::Rotation2Dd(e.angle_rad) * Vector2d(std::cos(t) / e.axes.x(), std::sin(t) / e.axes.y()))
      .normalized();
}

struct RimPoint {
  double t;
  Vector2d ideal;
  double step;
};

// Edge points all round the ellipse, some 1 px apart.
std::vector<RimPoint> RimPoints(const GreyView& image, const Intrinsics& lens, const Ellipse& e, double reach,
                                int sign) {
  const int count = std::max(kRimPoints, int(2 * kPi * e.axes.mean()));
  std::vector<RimPoint> points;
  for (int k = 0; k < count; ++k) {
    const double t = 2 * kPi * k / count;
    const Vector2d ideal = e.PointAt(t), n = NormalAt(e, t),
                   img = lens.ImgFromNormalized(lens.NormalizedFromIdeal(ideal)).value_or(ideal);
    if (img.x() < 1 || img.y() < 1 || img.x() > image.width - 2 || img.y() > image.height - 2) continue;
    if (const auto p = FindAcross(image, img, n, t, 0, reach, sign, kLeastContrast * image.MaxValue()))
      points.push_back({t, ideal + p->offset * n, p->step});
  }
  return points;
}

// Points within `range`, and on beyond it on both sides as long as the next one is near.
std::vector<RimPoint> Followed(const std::vector<RimPoint>& all, const Ellipse& e, const Range& range,
                               bool beyond) {
  const double span = range.to - range.from, gap = kRimGapPx / std::max(1.0, e.axes.mean()),
               middle = range.from + span / 2;
  std::vector<RimPoint> sorted;
  for (RimPoint p : all) {
    p.t = middle + std::remainder(p.t - middle, 2 * kPi);
    sorted.push_back(p);
  }
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.t < b.t; });
  double low = range.from, high = range.to;
  if (beyond) {
    for (const auto& p : sorted)
      if (p.t > high && p.t - high < gap) high = p.t;
    for (auto p = sorted.rbegin(); p != sorted.rend(); ++p)
      if (p->t < low && low - p->t < gap) low = p->t;
  }
  std::erase_if(sorted, [&](const RimPoint& p) { return p.t < low || p.t > high; });
  return sorted;
}

struct RimFit {
  EllipseFit fit;
  std::vector<RimPoint> points;
  double step = 0;
};

// Three rounds without what lies far off.
std::optional<RimFit> FitRim(std::vector<RimPoint> points) {
  std::optional<RimFit> out;
  for (int round = 0; round < 3; ++round) {
    std::vector<Vector2d> at;
    double step = 0;
    for (const auto& p : points) at.push_back(p.ideal), step += p.step;
    const auto fit = FitEllipse(at);
    if (!fit) return out;
    out = RimFit{*fit, points, step / double(points.size())};
    const double limit = std::max(0.3, 2.5 * fit->rms_px);
    std::erase_if(points,
                  [&](const RimPoint& p) { return std::abs(fit->ellipse.Distance(p.ideal)) > limit; });
  }
  return out;
}

// The arc of the picture on which those points of ideal px lie, in their order.
std::optional<EllipticalArc> ArcThrough(const Intrinsics& lens, const std::vector<Vector2d>& ideal) {
  std::vector<Vector2d> img;
  for (const auto& p : ideal) img.push_back(lens.ImgFromNormalized(lens.NormalizedFromIdeal(p)).value_or(p));
  const auto fit = FitEllipse(img);
  if (!fit) return std::nullopt;
  const Ellipse& e = fit->ellipse;
  EllipticalArc arc;
  arc.center = e.center, arc.axes = e.axes, arc.angle_rad = e.angle_rad;
  double at = e.ParameterOf(img.front()), low = at, high = at;
  for (const auto& p : img) {
    at += std::remainder(e.ParameterOf(p) - at, 2 * kPi);
    low = std::min(low, at), high = std::max(high, at);
  }
  if ((high - low) * e.axes.mean() > 2 * kPi * e.axes.mean() - kRimGapPx) low = 0, high = 2 * kPi;
  arc.from_rad = low, arc.to_rad = std::min(high, low + 2 * kPi);
  if (!StraightenArc(lens, arc)) return std::nullopt;
  return arc;
}

}  // namespace

bool StraightenArc(const Intrinsics& lens, EllipticalArc& arc) {
  const Ellipse img{arc.center, arc.axes, arc.angle_rad};
  std::vector<Vector2d> ideal;
  for (int k = 0; k <= kRimPoints; ++k) {
    const auto n =
        lens.NormalizedFromImg(img.PointAt(arc.from_rad + (arc.to_rad - arc.from_rad) * k / kRimPoints));
    if (!n) return false;
    ideal.push_back(lens.IdealFromNormalized(*n));
  }
  const auto fit = FitEllipse(ideal);
  if (!fit) return false;
  const Ellipse& e = fit->ellipse;
  arc.ideal_center = e.center, arc.ideal_axes = e.axes, arc.ideal_angle_rad = e.angle_rad;
  arc.ideal_from_rad = e.ParameterOf(ideal.front());
  double at = arc.ideal_from_rad;
  for (const auto& p : ideal) at += std::remainder(e.ParameterOf(p) - at, 2 * kPi);
  arc.ideal_to_rad = at;
  return true;
}

Result<EllipticalArc> SnapToRim(const GreyView& image, const View& view,
                                const std::array<Vector2d, 3>& clicked) {
  const Intrinsics& lens = view.camera->intrinsics;
  std::array<Vector2d, 3> ideal;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto n = lens.NormalizedFromImg(clicked[i]);
    ideal[i] = n ? lens.IdealFromNormalized(*n) : clicked[i];
  }
  const auto drawn = DrawnRim(view, ideal);
  if (!drawn || drawn->axes.x() > image.width + image.height)
    return UsageError(
        "these three points lie on a straight line; click three points of a curve, or draw a line");
  const Range range = ClickedRange(*drawn, ideal);
  // Which way the step goes: the sign with the stronger edge between the clicks.
  std::optional<RimFit> best;
  for (int sign : {1, -1}) {
    auto fit = FitRim(Followed(RimPoints(image, lens, *drawn, kRimReachPx, sign), *drawn, range, false));
    if (fit && (!best || double(fit->points.size()) * std::abs(fit->step) >
                             double(best->points.size()) * std::abs(best->step)))
      best = std::move(fit);
  }
  const double clicked_px = (range.to - range.from) * drawn->axes.mean();
  if (best && best->fit.rms_px<kRimRmsPx&& double(best->points.size())> kRimSeen * clicked_px) {
    const Ellipse first = best->fit.ellipse;
    auto again = FitRim(Followed(RimPoints(image, lens, first, kRimReachAgainPx, best->step > 0 ? 1 : -1),
                                 first, ClickedRange(first, ideal), true));
    if (again && again->fit.rms_px < kRimRmsPx) best = std::move(again);
    std::vector<Vector2d> along;
    for (const auto& p : best->points)
      along.push_back(best->fit.ellipse.PointAt(best->fit.ellipse.ParameterOf(p.ideal)));
    if (auto arc = ArcThrough(lens, along)) {
      arc->contrast = std::abs(best->step);
      arc->bright_inside = best->step < 0;
      arc->num_points = int(best->points.size());
      arc->rms_distance_px = best->fit.rms_px;
      return *arc;
    }
  }
  std::vector<Vector2d> along;
  for (int k = 0; k <= kRimPoints; ++k)
    along.push_back(drawn->PointAt(range.from + (range.to - range.from) * k / kRimPoints));
  auto arc = ArcThrough(lens, along);
  if (!arc) return UsageError("these three points describe no rim; click three points of one curve");
  arc->num_points = 1;
  arc->rms_distance_px = kHandSigmaPx;
  return *arc;
}

}  // namespace vss::station
