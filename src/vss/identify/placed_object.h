// An object of the knowledge base at a place in the world, and its solid there with derivatives.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "vss/geometry/rigid_transform.h"
#include "vss/knowledge/dual.h"
#include "vss/knowledge/object_model.h"
#include "vss/knowledge/relations.h"

namespace vss {

inline constexpr int kPlacementSize = 6;  // x, y, z (mm), yaw, tilt_x, tilt_y (rad)

// world_from_part = T(x, y, z) * Rz(yaw) * Rx(tilt_x) * Ry(tilt_y) * (rested_from_part, lifted so that its
// lowest vertex is at 0). So (x, y, z) is where the part's rested frame touches its support: z is the
// support's height. The state vector of a part is (x, y, z, yaw, tilt_x, tilt_y, dimensions...).
struct PlacedObject {
  const ObjectModel* model = nullptr;
  int resting_pose = 0;
  Eigen::Matrix<double, kPlacementSize, 1> placement = Eigen::Matrix<double, kPlacementSize, 1>::Zero();
  std::vector<double> dimensions_mm;

  int StateSize() const { return kPlacementSize + static_cast<int>(dimensions_mm.size()); }
  Eigen::VectorXd State() const;
  void SetState(const Eigen::VectorXd& state);
};

inline constexpr int kMaxStateSize = kPlacementSize + kMaxDimensions;
// Derivatives by the state, 3 x StateSize; kept in place, for solids are made by the million.
using StateColumns = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kMaxStateSize>;

// A point in `world` (mm) and its derivative by the state.
struct WorldPoint {
  Eigen::Vector3d point;
  StateColumns by_state;
};

// The solid of a PlacedObject in `world`; indices of edges, circles and faces are those of `Solid`.
struct WorldSolid {
  std::vector<WorldPoint> vertices;
  std::vector<SolidEdge> edges;
  struct Circle {
    WorldPoint center;
    Eigen::Vector3d normal;
    Eigen::Vector3d axis_u, axis_v;  // unit, span the circle's plane
    double radius_mm = 0;
    Eigen::RowVectorXd radius_by_state;
    int plane_face = 0, cylinder_face = 0;
    double weight = 1;
  };
  std::vector<Circle> circles;
  std::vector<SolidFace> faces;  // normals, axes and triangles in world
  RigidTransform world_from_part;
};
// `derivatives` false leaves by_state empty (faster).
WorldSolid PlaceSolid(const PlacedObject& object, bool derivatives = true);

// The object as relations (knowledge/relations.h) ask about it.
RelatedSolid RelatedOf(const PlacedObject& object);

}  // namespace vss
