#include "collect_picks.h"

#include <algorithm>
#include <cmath>

namespace vss::station {
namespace {

using Eigen::Vector2d;

constexpr double kSpacingPx = 4, kLeastCovered = 0.6;

// How well a straight line lies on the visible samples of one contour: mean distance, and how much of it they
// cover.
struct Closeness {
  double mean_px = INFINITY, covered = 0;
};
Closeness ClosenessOf(const Pick& line, const std::vector<ContourSample>& samples, double spacing_px,
                      double tolerance_px) {
  const Vector2d d = line.ideal_end - line.ideal_start;
  const double length = std::max(d.norm(), 1e-9), max_sine = std::max(0.05, 2 * tolerance_px / length);
  const Vector2d along = d / length, n(-along.y(), along.x());
  double sum = 0;
  int count = 0;
  for (const auto& s : samples) {
    const double t = along.dot(s.ideal - line.ideal_start);
    if (t < -tolerance_px || t > length + tolerance_px || std::abs(n.dot(s.ideal_tangent)) > max_sine)
      continue;
    const double distance = std::abs(n.dot(s.ideal - line.ideal_start));
    if (distance > tolerance_px) continue;
    sum += distance;
    ++count;
  }
  if (count == 0) return {};
  return {sum / count, count * spacing_px / length};
}

Closeness ArcClosenessOf(const Pick& arc, const std::vector<ContourSample>& samples, double tolerance_px) {
  double sum = 0;
  int count = 0;
  for (const auto& m : arc.ideal_points) {
    double least = INFINITY;
    for (const auto& s : samples) {
      const Vector2d n(-s.ideal_tangent.y(), s.ideal_tangent.x());
      if ((m - s.ideal).norm() < 10) least = std::min(least, std::abs(n.dot(m - s.ideal)));
    }
    if (least > tolerance_px) continue;
    sum += least;
    ++count;
  }
  if (count == 0) return {};
  return {sum / count, double(count) / double(arc.ideal_points.size())};
}

}  // namespace

VisibleContours VisibleContoursOf(const WorldSolid& solid, const View& view, const Occluders* others) {
  VisibleContours contours;
  for (const auto& s : SampleContour(solid, view, kSpacingPx, 2, others))
    if (s.visible && s.source != ContourSample::Source::kLimb)
      contours[{s.source == ContourSample::Source::kCircle, s.index}].push_back(s);
  return contours;
}

std::vector<NearContour> ContoursNear(const Pick& line, const VisibleContours& contours,
                                      double tolerance_px) {
  std::vector<NearContour> near;
  for (const auto& [key, samples] : contours) {
    if (key.first != line.is_circle) continue;
    const Closeness c = line.is_circle ? ArcClosenessOf(line, samples, tolerance_px)
                                       : ClosenessOf(line, samples, kSpacingPx, tolerance_px);
    if (c.covered >= kLeastCovered && c.mean_px <= tolerance_px) near.push_back({c.mean_px, key.second});
  }
  std::stable_sort(near.begin(), near.end(),
                   [](const NearContour& a, const NearContour& b) { return a.mean_px < b.mean_px; });
  return near;
}

std::vector<Pick> CollectPicks(const PlacedObject& object, const std::vector<View>& views,
                               const Occluders* others, double tolerance_px,
                               const std::function<bool(const Pick&)>& taken,
                               const std::function<std::vector<Pick>(int)>& lines_of) {
  constexpr double kDistinctPx = 0.7;
  const WorldSolid solid = PlaceSolid(object, false);
  std::vector<Pick> out;
  for (const auto& view : views) {
    const VisibleContours contours = VisibleContoursOf(solid, view, others);
    if (contours.empty()) continue;
    for (Pick line : lines_of(view.image)) {
      if (taken(line)) continue;
      const auto near = ContoursNear(line, contours, tolerance_px);
      if (near.empty() || (near.size() > 1 && near[1].mean_px - near[0].mean_px <= kDistinctPx)) continue;
      line.contour = near[0].contour;
      out.push_back(std::move(line));
    }
  }
  return out;
}

}  // namespace vss::station
