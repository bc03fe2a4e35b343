// Faces of solids that parts may lie against each other with.
#pragma once
#include <Eigen/Core>

#include "vss/knowledge/object_model.h"

namespace vss {

// Of its triangles' corners; the face must have some.
Eigen::Vector3d MiddleOf(const SolidFace& face);
// Plane, and upright to within a degree? The face of a solid in the world.
bool IsUpright(const SolidFace& face);
// Does a point in the face's plane lie on the face?
bool LiesOn(const SolidFace& face, const Eigen::Vector3d& point);

}  // namespace vss
