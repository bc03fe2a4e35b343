#include "vss/identify/weigh.h"

#include <cmath>
#include <functional>
#include <map>

#include "vss/identify/found_contours.h"

namespace vss {
namespace {

// What is lower than this, in pixels' size, is compared with its own outline painted on the support.
constexpr double kPaintPx = 12;

// The solid pressed flat onto its support, with those of its contours that stand above it by more than
// `elevated_mm`, and by no more than `most_mm`.
WorldSolid Painted(const WorldSolid& solid, double lowest_z, double elevated_mm, double most_mm) {
  WorldSolid flat = solid;
  for (auto& v : flat.vertices) v.point.z() = lowest_z;
  for (auto& f : flat.faces)
    for (auto& t : f.triangles)
      for (auto& p : t) p.z() = lowest_z;
  auto counts = [&](double top) { return top > lowest_z + elevated_mm && top <= lowest_z + most_mm; };
  for (std::size_t i = 0; i < solid.edges.size(); ++i)
    if (!counts(TopOf(solid, ContourSample::Source::kEdge, int(i)))) flat.edges[i].weight = 0;
  for (std::size_t i = 0; i < solid.circles.size(); ++i) {
    flat.circles[i].center.point.z() = lowest_z;
    if (!counts(solid.circles[i].center.point.z())) flat.circles[i].weight = 0;
  }
  return flat;
}

void AppendMatches(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                   const SceneIndex& scene, std::vector<ContourMatch>& out) {
  std::map<std::pair<int, int>, std::pair<int, double>> lines;
  for (const auto& m : in_view.samples) {
    if (m.line < 0 || m.lost != 0) continue;
    auto& l = lines[{m.line, m.contour}];
    ++l.first;
    l.second += m.distance_px;
  }
  for (const auto& [key, l] : lines) {
    const auto& contour = measured.contours[std::size_t(key.second)];
    if (l.first < 2 || contour.source == ContourSample::Source::kLimb) continue;
    const int arc = scene.lines[std::size_t(in_view.view)].lines()[std::size_t(key.first)].arc;
    out.push_back({in_view.view, arc < 0 ? key.first : arc, contour.index,
                   contour.source == ContourSample::Source::kCircle, l.second / l.first});
  }
}

// Adds up over the pictures what they say of each contour.
std::vector<EdgeEvidence> WeighEdges(const MeasuredContours& measured, const SceneIndex& scene, bool rough,
                                     const Claims* claims) {
  std::vector<EdgeEvidence> edges(measured.contours.size());
  std::vector<int> votes(measured.contours.size());
  for (const auto& in_view : measured.views) {
    std::function<bool(std::size_t)> taken;
    if (claims)
      taken = [&](std::size_t i) {
        return (*claims)[std::size_t(in_view.view)][std::size_t(in_view.samples[i].line)];
      };
    for (const auto& c : VoteOf(measured, in_view, {}, taken, scene, rough).contours) {
      auto& e = edges[std::size_t(c.contour)];
      ++e.views;
      e.visible_px += c.visible_px;
      if (c.open_px <= 0) continue;
      e.supported_px += c.supported_px;
      e.empty_px += c.empty_px;
      e.rms_px += c.squared;
      e.log_odds += c.ends + IndependentPieces(c.open_px) * c.per_piece;
      ++votes[std::size_t(c.contour)];
    }
  }
  for (std::size_t k = 0; k < edges.size(); ++k) {
    EdgeEvidence& e = edges[k];
    if (e.views == 0) continue;
    e.source = measured.contours[k].source;
    e.index = measured.contours[k].index;
    // Pictures of one edge fail together (its contrast is what it is): n pictures count as sqrt(n).
    e.rms_px = e.supported_px > 0 ? std::sqrt(e.rms_px / e.supported_px) : 0;
    e.log_odds = votes[k] > 0 ? e.log_odds / std::sqrt(double(e.views)) : 0;
  }
  return edges;
}

Evidence WeighContours(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                       const WeighOptions& options, const Occluders* others, const Claims* claims) {
  const MeasuredContours measured = MeasureContours(solid, views, scene, options, others);
  Evidence out;
  out.views = int(measured.views.size());
  const std::vector<EdgeEvidence> edges = WeighEdges(measured, scene, options.rough, claims);
  std::vector<double> by_contour;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const EdgeEvidence& e = edges[k];
    by_contour.push_back(e.log_odds);
    if (e.views == 0) continue;
    out.log_odds += e.log_odds;
    if (measured.contours[k].elevated) out.elevated_log_odds += e.log_odds;
    out.visible_px += e.visible_px;
    out.supported_px += e.supported_px;
    out.edges.push_back(e);
  }
  if (options.keep_matches)
    for (const auto& in_view : measured.views) AppendMatches(measured, in_view, scene, out.matches);
  const double open_ledges = OpenLedges(measured, by_contour);
  out.log_odds += open_ledges;
  out.elevated_log_odds += open_ledges;
  out.log_odds += options.prior_log_odds;
  out.elevated_log_odds += kElevatedPrior * options.prior_log_odds;
  return out;
}

}  // namespace

std::pair<double, double> HeightsOf(const WorldSolid& solid) {
  double low = INFINITY, high = -INFINITY;
  auto take = [&](double z) { low = std::min(low, z), high = std::max(high, z); };
  for (const auto& v : solid.vertices) take(v.point.z());
  for (const auto& c : solid.circles) take(c.center.point.z());
  return {low, high};
}

PaintedEvidence WeighPainted(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                             const WeighOptions& options, const Occluders* others, const Claims* claims) {
  const auto [low, high] = HeightsOf(solid);
  WeighOptions bare = options;
  bare.rings = options.grey || options.rings;
  bare.keep_matches = bare.grey = false;
  bare.prior_log_odds = 0;
  const double most_mm = kPaintPx * scene.mm_per_px;
  const WorldSolid flat = Painted(solid, low, kElevatedPx * ClutterPixelMm(scene.mm_per_px), most_mm);
  PaintedEvidence out;
  for (const auto& e : WeighContours(flat, views, scene, bare, others, claims).edges) {
    const double log_odds = std::max(0.0, e.log_odds);
    if (high - low <= most_mm) out.all += log_odds;
    if (e.source == ContourSample::Source::kEdge) out.edges += log_odds;
  }
  return out;
}

Evidence Weigh(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
               const WeighOptions& options, const Occluders* others, const Claims* claims) {
  Evidence out = WeighContours(solid, views, scene, options, others, claims);
  if (options.rough || out.log_odds <= 0) return out;  // hopeless either way
  const auto [low, high] = HeightsOf(solid);
  if (high - low <= kPaintPx * scene.mm_per_px)
    out.elevated_log_odds -= WeighPainted(solid, views, scene, options, others, claims).all;
  return out;
}

}  // namespace vss
