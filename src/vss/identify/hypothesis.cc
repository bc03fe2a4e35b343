#include "vss/identify/hypothesis.h"

#include <algorithm>
#include <cmath>

namespace vss {

bool IsSlanted(const Hypothesis& h, const SeedContext& context) {
  return h.first_line >= 0 &&
         context.lines[std::size_t(h.first_line)].kind == WorldLine::Direction::kInclined;
}

bool InRange(const PlacedObject& o, double slack_mm) {
  const auto defs = o.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i)
    if (o.dimensions_mm[i] < defs[i].min_mm - slack_mm || o.dimensions_mm[i] > defs[i].max_mm + slack_mm)
      return false;
  return true;
}

bool Allowed(const PlacedObject& o) {
  for (double v : o.model->Violations(o.dimensions_mm))
    if (v > 2.0) return false;
  return true;
}

bool SamePlace(const PlacedObject& a, const PlacedObject& b, double near_mm) {
  if ((a.placement.head<2>() - b.placement.head<2>()).norm() > near_mm) return false;
  const WorldSolid sa = PlaceSolid(a, false), sb = PlaceSolid(b, false);
  for (const auto& v : sa.vertices) {
    bool found = false;
    for (const auto& w : sb.vertices) found |= (v.point - w.point).squaredNorm() < near_mm * near_mm;
    if (!found) return false;
  }
  for (std::size_t i = 0; i < sa.circles.size(); ++i)
    if (std::abs(sa.circles[i].radius_mm - sb.circles[i].radius_mm) > near_mm ||
        (sa.circles[i].center.point - sb.circles[i].center.point).norm() > near_mm)
      return false;
  return true;
}

double RoughLogOdds(const PlacedObject& object, std::span<const int> views, const SeedContext& context,
                    const Claims* claims) {
  const WeighOptions options{.spacing_px = 12,
                             .max_samples = 8,
                             .rough = true,
                             .prior_log_odds = PriorLogOdds(object, context.mm_per_px)};
  return Weigh(PlaceSolid(object, false), views, context.scene, options, context.others, claims).log_odds;
}

double FullLogOdds(const PlacedObject& object, std::span<const int> views, const SeedContext& context) {
  const WeighOptions options{.grey = true, .prior_log_odds = PriorLogOdds(object, context.mm_per_px)};
  return Weigh(PlaceSolid(object, false), views, context.scene, options, context.others, context.claims)
      .Score();
}

}  // namespace vss
