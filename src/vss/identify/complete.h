// Seeds completed: the dimensions that a seed leaves open, from the lines of all pictures.
#pragma once
#include <vector>

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
// Fits and weighs a completion.
Hypothesis Finish(const SeedContext& context, const Completion& completion);

}  // namespace vss
