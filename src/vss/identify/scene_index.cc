#include "vss/identify/scene_index.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "vss/base/parallel.h"
#include "vss/identify/edge_response.h"
#include "vss/identify/found_contours.h"
#include "vss/identify/views_that_see.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Least chance of a line where nothing is, whatever the density says.
constexpr double kMinChance = 0.04;
// A line speaks for a contour so far beyond its own ends.
constexpr double kEndSlackPx = 0.5;

int Bin(const Vector2d& tangent) {
  double a = std::atan2(tangent.y(), tangent.x());
  if (a < 0) a += kPi;
  return std::min(SceneIndex::kDirectionBins - 1, static_cast<int>(a / kPi * SceneIndex::kDirectionBins));
}

// Where a view may show what lies between two heights; all the plane where it looks to the horizon.
Eigen::AlignedBox2d FootprintOf(const View& view) {
  constexpr double kLeastFall = 0.05, kFar = 1e9;
  Eigen::AlignedBox2d all;
  for (const auto corner : {Eigen::AlignedBox2d::BottomLeft, Eigen::AlignedBox2d::BottomRight,
                            Eigen::AlignedBox2d::TopLeft, Eigen::AlignedBox2d::TopRight}) {
    const Vector3d ray = view.RayOfIdeal(view.maybe_inside.corner(corner));
    if (!(ray.z() < -kLeastFall)) return {Vector2d::Constant(-kFar), Vector2d::Constant(kFar)};
    for (const double z : {SceneIndex::kLowestMm, SceneIndex::kHighestMm}) {
      const double along = std::max(0.0, (z - view.center_in_world.z()) / ray.z());
      all.extend(Vector2d((view.center_in_world + along * ray).head<2>()));
    }
  }
  return all;
}

}  // namespace

std::vector<int> SceneIndex::ViewsNear(const Eigen::AlignedBox3d& box) const {
  std::vector<int> near;
  if (box.min().z() < kLowestMm || box.max().z() > kHighestMm || footprints.size() != int(views.size())) {
    near.resize(views.size());
    std::iota(near.begin(), near.end(), 0);
    return near;
  }
  footprints.Find({Vector2d(box.min().head<2>()), Vector2d(box.max().head<2>())}, near);
  return near;
}

std::vector<int> ViewsThatSee(const WorldSolid& solid, const SceneIndex& scene, int most) {
  Eigen::AlignedBox3d box;
  for (const auto& v : solid.vertices) box.extend(v.point);
  for (const auto& c : solid.circles)
    for (const Vector3d& corner : {Vector3d(c.axis_u + c.axis_v), Vector3d(c.axis_u - c.axis_v)}) {
      box.extend(Vector3d(c.center.point + c.radius_mm * corner));  // of the square around the circle
      box.extend(Vector3d(c.center.point - c.radius_mm * corner));
    }
  return ViewsThatSee(solid, scene.views, scene.ViewsNear(box), most);
}

double SceneIndex::ChanceHit(int view, const Vector2d& tangent) const {
  return std::clamp(
      density[static_cast<std::size_t>(view)][static_cast<std::size_t>(Bin(tangent))] * 2 * tolerance_px,
      kMinChance, 0.5);
}

void SceneIndex::SetWorldLines(std::span<const WorldLine> all) {
  constexpr int kEstablishedViews = 4;      // two pictures always meet somewhere, a third may by chance
  constexpr double kEstablishedRms = 0.35;  // of the tolerance: more is a mixture of two edges
  world_lines.clear();
  axes.clear();
  world_of_line.assign(views.size(), {});
  for (std::size_t v = 0; v < views.size(); ++v) world_of_line[v].assign(lines[v].lines().size(), -1);
  for (const auto& l : all) {
    if (l.rms_px > kEstablishedRms * tolerance_px) continue;
    if (MovesWithLamps(l, views)) {
      for (const auto& r : l.lines)
        world_of_line[static_cast<std::size_t>(r.view)][static_cast<std::size_t>(r.line)] = kShadow;
      continue;
    }
    if (l.num_views < kEstablishedViews) continue;
    for (const auto& r : l.lines)
      world_of_line[static_cast<std::size_t>(r.view)][static_cast<std::size_t>(r.line)] =
          static_cast<int>(world_lines.size());
    world_lines.push_back(l);
    axes.push_back({l.start, l.Unit(), l.px2_per_mm2});
  }
}

LineHit SceneIndex::Match(int view, const ContourSample& sample, double reach_px, double min_cosine) const {
  constexpr double kWorldReach =
      1.25;  // times the reach: how far the contour may be from the edge in all its pictures
  LineHit hit = lines[static_cast<std::size_t>(view)].Nearest(sample.ideal, sample.ideal_tangent, reach_px,
                                                              min_cosine, kEndSlackPx);
  if (hit.line < 0 || world_of_line.empty()) return hit;
  const int w = world_of_line[static_cast<std::size_t>(view)][static_cast<std::size_t>(hit.line)];
  if (w == kShadow) return {};
  if (w < 0) return hit;
  const Axis& l = axes[static_cast<std::size_t>(w)];
  const Vector3d& d = l.unit;
  const Vector3d along = sample.point_in_world - l.start, offset = along - d * d.dot(along);
  const double allowed_px = kWorldReach * reach_px;
  return offset.dot(l.px2_per_mm2 * offset) > allowed_px * allowed_px ? LineHit{} : hit;
}

bool MovesWithLamps(const WorldLine& line, std::span<const View> views) {
  constexpr int kMinViews = 3;    // two pictures always agree on some line of space
  constexpr int kMinLookers = 3;  // one picture or two may miss an edge
  constexpr int kSteps = 5;
  if (line.num_stops != 1 || line.num_views < kMinViews) return false;
  const int stop = views[static_cast<std::size_t>(line.lines.front().view)].stop;
  if (stop < 0) return false;
  int lookers = 0;
  for (const auto& v : views) {
    if (v.stop == stop || v.SurelyMisses(line.start, line.end)) continue;
    int inside = 0;
    for (int k = 0; k < kSteps; ++k)
      inside += v.Shows(line.start + (line.end - line.start) * ((k + 0.5) / kSteps));
    lookers += inside >= kSteps - 1;
  }
  return lookers >= kMinLookers;
}

SceneIndex MakeSceneIndex(std::span<const View> views, double tolerance_px, int threads) {
  constexpr double kReachFactor = 5;  // how far FitToLines may look, in tolerances
  SceneIndex scene;
  scene.views = views;
  scene.tolerance_px = tolerance_px;
  scene.sigma_px = kSigmaShare * tolerance_px;
  scene.mm_per_px = TypicalMmPerPx(views);
  scene.lines.resize(views.size());
  scene.density.resize(views.size());
  scene.typical_step.assign(views.size(), 1.0);
  constexpr double kCellMm = 1000;  // a fraction of what a picture shows
  scene.footprints = BoxGrid(kCellMm);
  for (const View& view : views) scene.footprints.Add(FootprintOf(view));
  ParallelFor(views.size(), threads, [&](std::size_t i) {
    scene.lines[i] = LineIndex(views[i], kReachFactor * tolerance_px);
    if (views[i].picture.data)
      scene.typical_step[i] = TypicalResponse(views[i].picture, kPiecePx, tolerance_px);
    auto& bins = scene.density[i];
    bins.assign(SceneIndex::kDirectionBins, 0.0);
    const double area = double(views[i].camera->width_px) * views[i].camera->height_px;
    for (const auto& l : scene.lines[i].lines())
      bins[static_cast<std::size_t>(Bin(l.direction))] += l.length_px / area;
  });
  return scene;
}

double TypicalMmPerPx(std::span<const View> views) {
  std::vector<double> sizes;
  for (const auto& v : views) {
    const Vector3d ray = v.RayOfIdeal({v.camera->width_px / 2.0, v.camera->height_px / 2.0});
    if (ray.z() > -0.05) continue;
    sizes.push_back(v.center_in_world.z() / -ray.z() / v.camera->intrinsics.fx_px);
  }
  if (sizes.empty()) return 1;
  std::nth_element(sizes.begin(), sizes.begin() + std::ptrdiff_t(sizes.size() / 2), sizes.end());
  return std::max(1e-3, sizes[sizes.size() / 2]);
}

}  // namespace vss
