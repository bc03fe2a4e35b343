// How well the lines of the pictures speak for a placed object: predicted contours against lines found.
#pragma once
#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "vss/identify/contour.h"
#include "vss/identify/contour_vote.h"
#include "vss/identify/evidence.h"
#include "vss/identify/measured_contours.h"
#include "vss/identify/prior_log_odds.h"
#include "vss/identify/scene_index.h"

namespace vss {

struct EdgeEvidence {
  ContourSample::Source source = ContourSample::Source::kEdge;
  int index = 0;
  int views = 0;                                          // that should see it
  double visible_px = 0, supported_px = 0, empty_px = 0;  // empty: not even the grey values show a step
  double rms_px = 0;                                      // distance of what supports it
  double log_odds = 0;
};

struct Evidence {
  // Of contours above the support, less what they would explain if they were painted on it.
  double elevated_log_odds = 0;
  double log_odds = 0;  // natural logarithm, for "there is this object" against "chance"
  double visible_px = 0, supported_px = 0;
  int views = 0;  // that see part of its contour
  // The score of the whole: what paint and shadows could explain as well counts for nothing.
  double Score() const { return std::min(log_odds, elevated_log_odds); }
  std::vector<EdgeEvidence> edges;
  std::vector<ContourMatch> matches;  // only where asked for
};

// Of the solid's lowest and highest points, z in the world (mm).
std::pair<double, double> HeightsOf(const WorldSolid& solid);

Evidence Weigh(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
               const WeighOptions& options, const Occluders* others = nullptr,
               const Claims* claims = nullptr);

// What contours that stand above the support, but too low to show that, would explain if they were painted on
// it (log-odds).
struct PaintedEvidence {
  double all = 0;    // of them all, where the whole solid is that low, else 0
  double edges = 0;  // of the straight ones
};
PaintedEvidence WeighPainted(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                             const WeighOptions& options, const Occluders* others = nullptr,
                             const Claims* claims = nullptr);
// Paint must be where an object's foot would be, which is this share of what the prior asks for.
inline constexpr double kElevatedPrior = 0.5;

}  // namespace vss
