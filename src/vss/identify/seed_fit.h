// An object fitted to a few edges of the world that were taken for contours of it.
#pragma once
#include <optional>
#include <span>

#include "vss/identify/contour_targets.h"
#include "vss/identify/hypothesis.h"

namespace vss {

// How far (in pixels' size) the edges of a seed may miss its world lines.
inline constexpr double kSeedTolerancePx = 1.5;

// The contours that a seed is laid on.
struct SeedTargets {
  std::span<const EdgeTarget> edges;
  std::span<const CircleTarget> circles;
  bool trust_ends = true;  // of the edges: else it is left open where they end
};

// `usual`: the object on its support, its dimensions as usual; the fit starts at `near` (world, mm) with
// `yaw_rad`. Empty where the targets cannot be met to within the tolerance, or by dimensions out of range.
std::optional<Hypothesis> FitSeed(const PlacedObject& usual, double yaw_rad, const Eigen::Vector3d& near,
                                  const SeedTargets& targets, double mm_per_px);

// Sets an open dimension of an object that was seeded; the rest of its state follows so that the seed's edges
// stay where they are. `open_direction`: of the hypothesis.
void MoveDimension(PlacedObject& object, const Eigen::MatrixXd& open_direction, std::size_t dimension,
                   double value_mm);

}  // namespace vss
