// Hypotheses fitted to the lines, and moved to where they explain more.
#pragma once
#include <optional>
#include <vector>

#include "vss/identify/hypothesis.h"

namespace vss {

// The object moved, its dimensions too, so that its contours lie on those of `goal` (a solid of the same
// model) that stand at `from_z_mm` (world) and above; its height and tilt are held, as are dimensions that
// none of them shows. Empty where there is no such place.
std::optional<PlacedObject> MovedTo(const WorldSolid& goal, double from_z_mm, PlacedObject object);

// The object lifted from its support onto one at `support_z_mm`, its contours above that staying where they
// are as far as its dimensions allow; empty where the dimensions' ranges forbid it.
std::optional<Hypothesis> Reseat(const Hypothesis& hypothesis, const SeedContext& context,
                                 double support_z_mm);

// Fits the object to the lines (z and tilt held) where that explains more, and weighs it.
void RefineAndWeigh(Hypothesis& hypothesis, const SeedContext& context);

// Ways in which the object may slide though it stays on the lines that it is fitted to, the easiest first: the
// dimension that changes most by 1 mm.
std::vector<Eigen::VectorXd> WeakDirections(const Hypothesis& hypothesis, const SeedContext& context);

// What a hypothesis becomes where it slides along its own lines, as they allow without moving off them (an
// end that is not where it was thought to be), to where further contours meet lines: those that explain more.
std::vector<Hypothesis> Slides(const Hypothesis& hypothesis, const SeedContext& context);

}  // namespace vss
