// The search for objects among the lines that nothing explains yet: seeds, completed, fitted and weighed.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/explained.h"
#include "vss/identify/scene_data.h"

namespace vss {

// Adds hypotheses of all kinds on the ground or on the top of an item to the items, from the lines that
// nothing of `known` explains.
void AddHypotheses(int support, const Explained& known, SceneData& data);

// Hypotheses of the scene's templates on a support at a height, seeded from lines of which at least one is
// among `own` (of the scene's pictures; of one picture from pairs of those, where there are any), or from any
// where none of those is an edge of the world; of circles from any. However little speaks for them; in no
// particular order.
std::vector<Hypothesis> HypothesesOn(std::span<const LineRef> own, double support_z_mm, SceneData& data);

// Of all seeds of a kind from one edge of the world, the few that fit best.
std::vector<Hypothesis> Promising(std::vector<Hypothesis> seeds, const SeedContext& context, int threads);

// The search looks at some pictures, the decision at many.
void WeighInAllViews(Hypothesis& h, const SeedContext& context);

}  // namespace vss
