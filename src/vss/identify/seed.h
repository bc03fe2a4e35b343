// Seeds: an object laid on a few edges of the world.
//
// A seed is a pair of parallel world lines taken for a pair of parallel contour edges of one face that is
// seen from above, a slanted and a vertical one taken for edges of an upright face (of a thin plate often
// only one of the parallel ones is found), or a world circle taken for a rim. It fixes place and most
// dimensions by least squares (the vertices of an extruded solid are linear in them); dimensions that it
// leaves open are voted for by all lines of all pictures.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/hypothesis.h"
#include "vss/identify/kind_template.h"

namespace vss {

// Two of a context's lines, parallel and beside each other.
struct LinePair {
  int first, second;
};
// How far the edges of a pair may lie side by side, mm; infinite where the dimensions do not bound it.
double FarthestPairMm(std::span<const KindTemplate> kinds);
// All pairs of which the level ones lie no farther apart than that.
std::vector<LinePair> ParallelPairs(const SeedContext& context, double farthest_mm);

// Seeds of one template on a support at height `support_z_mm`: placed, with the dimensions that the seed
// tells. `pairs`: of the context.
std::vector<Hypothesis> Seeds(const KindTemplate& kind, const SeedContext& context,
                              std::span<const LinePair> pairs, double support_z_mm);

// How well a seed with its open dimensions as usual fits the lines: to choose which to complete.
double RoughScore(const Hypothesis& seed, const SeedContext& context);

}  // namespace vss
