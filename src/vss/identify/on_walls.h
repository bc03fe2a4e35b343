// Parts whose end no line shows, brought up to the part that they are welded to.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/hypothesis.h"

namespace vss {

inline constexpr double kReachOfEndsPx = 12;  // an end that no line shows is found that far off

// What a hypothesis becomes where it slides along its own lines, as they allow without moving off them, until
// an upright face of it lies on one of `walls` (solids that are known) that it sinks into or ends short of.
std::vector<Hypothesis> OnWalls(const Hypothesis& hypothesis, std::span<const WorldSolid> walls,
                                const SeedContext& context);

}  // namespace vss
