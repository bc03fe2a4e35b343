// Faces of solids that parts may lie against each other with.
#pragma once
#include <Eigen/Core>
#include <optional>

#include "vss/knowledge/object_model.h"

namespace vss {

// Of its triangles' corners; the face must have some.
Eigen::Vector3d MiddleOf(const SolidFace& face);
// Plane, and upright to within a degree? The face of a solid in the world.
bool IsUpright(const SolidFace& face);
// How far (mm) `face` must go along its normal until its middle lies on `wall`, less than 0 where it is sunk
// into it; empty where the two are not upright, not turned against each other to 3 degrees, or the middle
// would come to lie beside the wall.
std::optional<double> WayToWall(const SolidFace& face, const SolidFace& wall);

}  // namespace vss
