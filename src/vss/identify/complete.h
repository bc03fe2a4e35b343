// Seeds completed: the dimensions that a seed leaves open, from the lines of all pictures.
#pragma once
#include <optional>
#include <vector>

#include "vss/identify/contour_targets.h"
#include "vss/identify/hypothesis.h"
#include "vss/identify/kind_template.h"

namespace vss {

// A seed with its open dimensions picked.
struct Completion {
  Hypothesis h;             // log_odds: roughly
  std::vector<bool> known;  // dimensions told by the seed or picked
};
// The best few ways to complete a seed.
std::vector<Completion> Complete(const KindTemplate& kind, const SeedContext& context,
                                 const Hypothesis& seed);
// Many seeds complete to one object: of those that agree to within half a pixel in every corner, and in what
// is known of them, the best.
std::vector<Completion> Distinct(std::vector<Completion> completions, double mm_per_px);
// The object with those dimensions that are not `fixed` such that its rim lies on the target; empty where
// they cannot.
std::optional<PlacedObject> LaidOnCircle(PlacedObject object, const std::vector<bool>& fixed,
                                         const CircleTarget& target, double mm_per_px);

// Fits and weighs a completion.
Hypothesis Finish(const SeedContext& context, const Completion& completion);

}  // namespace vss
