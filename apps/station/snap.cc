#include "snap.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "workspace.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

constexpr double kHandSigmaPx = 1;        // how well a hand draws
constexpr double kStepAcrossPx = 0.25;    // of the profile's samples
constexpr double kLeastContrast = 1.0 / 255 * 4;  // of the full range: fainter steps are noise

double Bilinear(const GreyView& image, const Vector2d& p) {
  const double u = std::clamp(p.x(), 0.0, image.width - 1.001), v = std::clamp(p.y(), 0.0, image.height - 1.001);
  const int i = int(u), k = int(v);
  const double a = u - i, b = v - k;
  return (1 - a) * (1 - b) * image.At(i, k) + a * (1 - b) * image.At(i + 1, k) + (1 - a) * b * image.At(i, k + 1) + a * b * image.At(i + 1, k + 1);
}

// Grey value step at offset d across the line: mean of the two px above less mean of the two px below.
double StepAt(const GreyView& image, const Vector2d& p, const Vector2d& n, double d) {
  double sum = 0;
  for (double s = 0.5; s <= 2; s += 0.5) sum += Bilinear(image, p + (d + s) * n) - Bilinear(image, p + (d - s) * n);
  return sum / 4;
}

struct EdgePoint {
  double along, offset, step;
};

// The place of the strongest step of the sign `sign` across the line, by a parabola.
std::optional<EdgePoint> FindAcross(const GreyView& image, const Vector2d& p, const Vector2d& n, double along, double center, double reach, int sign, double least) {
  const int count = int(reach / kStepAcrossPx);
  std::vector<double> steps;
  for (int i = -count; i <= count; ++i) steps.push_back(sign * StepAt(image, p, n, center + i * kStepAcrossPx));
  const auto at = std::max_element(steps.begin(), steps.end()) - steps.begin();
  if (steps[std::size_t(at)] < least || at == 0 || at + 1 == std::ptrdiff_t(steps.size())) return std::nullopt;
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
    for (const auto& p : points) s += 1, sx += p.along, sy += p.offset, sxx += p.along * p.along, sxy += p.along * p.offset, step += p.step;
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
    std::erase_if(points, [&](const EdgePoint& p) { return std::abs(p.offset - fit.offset - fit.slope * p.along) > limit; });
  }
  return fit;
}

}  // namespace

LineSegment SnapToEdge(const GreyView& image, const Intrinsics& lens, const LineSegment& drawn, double reach_px) {
  LineSegment line = drawn;
  Straighten(lens, line);
  const Vector2d chord = line.ideal_end - line.ideal_start;
  const double length = chord.norm();
  const Vector2d along = chord / length, n(-along.y(), along.x());
  const double least = kLeastContrast * image.MaxValue();
  auto img = [&](const Vector2d& ideal) { return lens.ImgFromNormalized(lens.NormalizedFromIdeal(ideal)).value_or(ideal); };
  auto collect = [&](const StraightFit& about, double reach, int sign) {
    std::vector<EdgePoint> points;
    for (double t = 1; t < length - 0.5; t += 1) {
      const Vector2d ideal = line.ideal_start + t * along;
      if (auto p = FindAcross(image, img(ideal), n, t, about.offset + about.slope * t, reach, sign, least)) points.push_back(*p);
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
  // The bright side lies to the left of start -> end as seen on the screen: against n = (-dy, dx), which is the right.
  if (best.step > 0) {
    std::swap(line.start, line.end);
    std::swap(line.ideal_start, line.ideal_end);
  }
  return line;
}

}  // namespace vss::station
