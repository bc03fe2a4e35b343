// Dimensions that keep all ranges and constraints: usual values, and the search for them.
#pragma once
#include <optional>
#include <span>

#include "vss/knowledge/definition.h"

namespace vss {

// How far a constraint is from being kept (mm; 0 or less: kept), and in which direction of the dimensions it
// gets worse.
struct ConstraintGap {
  int constraint = 0;
  double distance_mm = 0;
  Gradient by_dimension;
};
std::vector<ConstraintGap> ConstraintGaps(const Definition& definition,
                                          std::span<const double> dimensions_mm);

// Whether no gap is above 0; faster.
bool KeepsAllConstraints(const Definition& definition, std::span<const double> dimensions_mm);

// Known values as they are, usual ones for the rest, shifted where a constraint asks for it. Where the known
// values leave no way to keep them all, the nearest.
std::vector<double> UsualDimensions(const Definition& definition,
                                    std::span<const std::optional<double>> known);

// The dimensions near `dimensions_mm` that keep ranges and constraints, as far as a projection onto them
// finds some.
std::vector<double> NearestAllowed(const Definition& definition, std::vector<double> dimensions_mm);

// An error at the constraint that cannot be kept: alone within the ranges, or together with the others.
Status CheckConstraintsCanHold(const Definition& definition);

}  // namespace vss
