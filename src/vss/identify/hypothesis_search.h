// The search for objects among the lines that nothing explains yet: seeds, completed, fitted and weighed.
#pragma once
#include <vector>

#include "vss/identify/explained.h"
#include "vss/identify/scene_data.h"

namespace vss {

// Adds hypotheses of all kinds on the ground or on the top of an item to the items, from the lines that
// nothing of `known` explains.
void AddHypotheses(int support, const Explained& known, SceneData& data);

// Of all seeds of a kind from one edge of the world, the few that fit best.
std::vector<Hypothesis> Promising(std::vector<Hypothesis> seeds, const SeedContext& context, int threads);

// The search looks at some pictures, the decision at many.
void WeighInAllViews(Hypothesis& h, const SeedContext& context);

}  // namespace vss
