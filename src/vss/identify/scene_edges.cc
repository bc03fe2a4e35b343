#include "vss/identify/scene_edges.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Calibration errors grow with the picture: this many px, plus a share of its width.
constexpr double kBaseTolerancePx = 1.2;
constexpr double kToleranceShare = 1.0 / 2000;

// The lines of the pictures themselves tell how well they agree on an edge of the world: with no more
// tolerance than that, two edges that lie close are not taken for one.
double NarrowPx(std::span<const WorldLine> lines, const SceneIndex& index, const IdentifyOptions& options) {
  constexpr double kTolerances = 3;    // times the rms distance
  constexpr double kLeastShare = 0.4;  // of what is usual: shadows pull edges, corners are rounded
  const double agreement = AgreementPx(lines);
  if (options.tolerance_px > 0 || agreement <= 0) return index.tolerance_px;
  return std::clamp(kTolerances * agreement, kLeastShare * index.tolerance_px, index.tolerance_px);
}

// One edge of the world, to within half a pixel?
bool Same(const WorldLine& a, const WorldLine& b, double mm_per_px) {
  const double near = 0.5 * mm_per_px;
  const bool turned = a.Unit().dot(b.Unit()) < 0;
  return (a.start - (turned ? b.end : b.start)).norm() < 2 * near &&
         (a.end - (turned ? b.start : b.end)).norm() < 2 * near &&
         a.Unit().cross(b.start - a.start).norm() < near;
}

// In the plan; lines that are the Same() have their middles in each other's with a reach of a pixel's size.
Eigen::AlignedBox2d AroundMiddle(const WorldLine& l, double reach_mm) {
  const Vector2d middle = (l.start + l.end).head<2>() / 2;
  return {middle.array() - reach_mm, middle.array() + reach_mm};
}

// Is it found in a fair share of the pictures that look at it? Two pictures agree on many a line of
// texture; an edge that starts a part is seen more often, though other parts hide it from some.
bool WellShown(const WorldLine& l, std::span<const View> views) {
  constexpr double kLeastShare = 0.25;
  const Vector3d middle = (l.start + l.end) / 2;
  const auto lookers =
      std::count_if(views.begin(), views.end(), [&](const View& v) { return v.Shows(middle); });
  return l.num_views >= kLeastShare * double(lookers);
}

// How far lines lie from their edges, as the edges of the world tell.
double SigmaPx(std::span<const WorldLine> lines, const SceneIndex& index) {
  constexpr double kOfAgreement = 2;  // edges that are nearest to the truth agree best, most not so well
  constexpr double kLeastShare = 0.15;
  const double agreement = AgreementPx(lines);
  if (agreement <= 0) return index.sigma_px;
  return std::clamp(kOfAgreement * agreement, kLeastShare * index.tolerance_px, index.sigma_px);
}

}  // namespace

double TolerancePx(std::span<const View> views, const IdentifyOptions& options) {
  if (options.tolerance_px > 0) return options.tolerance_px;
  double width = 0;
  for (const auto& v : views) width = std::max<double>(width, v.camera->width_px);
  return kBaseTolerancePx + kToleranceShare * width;
}

SceneEdges FindSceneEdges(SceneIndex& index, const IdentifyOptions& options, int threads,
                          const Progress& progress) {
  constexpr double kBelowGroundPx = 20;
  const auto views = index.views;
  WorldLineOptions line_options{index.tolerance_px, -kBelowGroundPx * index.mm_per_px, options.max_height_mm,
                                kSureLinePx};
  progress.Report("world lines", 0, 1);
  const std::vector<WorldLine> wide = FindWorldLines(views, index.lines, line_options, threads, progress);
  line_options.tolerance_px = NarrowPx(wide, index, options);
  line_options.min_length_px = 0;
  SceneEdges edges;
  edges.lines = FindWorldLines(views, index.lines, line_options, threads, progress);
  index.SetWorldLines(edges.lines);
  index.sigma_px = SigmaPx(edges.lines, index);
  // Edges whose lines are pulled this way and that, and that agree with more tolerance only.
  BoxGrid middles(2 * index.mm_per_px);
  for (const auto& l : edges.lines) middles.Add(AroundMiddle(l, 0));
  std::vector<int> near;
  for (const auto& l : wide) {
    middles.Find(AroundMiddle(l, index.mm_per_px), near);
    if (std::none_of(near.begin(), near.end(),
                     [&](int k) { return Same(edges.lines[std::size_t(k)], l, index.mm_per_px); }))
      edges.lines.push_back(l);
  }
  std::erase_if(edges.lines, [&](const WorldLine& l) { return MovesWithLamps(l, views); });
  for (const auto& l : edges.lines) edges.well_shown.push_back(WellShown(l, views));
  edges.circles = FindWorldCircles(views, line_options);
  progress.Report("world lines", 1, 1);
  return edges;
}

}  // namespace vss
