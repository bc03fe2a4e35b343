// The reference cube as its faces and edges, and what of it is seen from where.
#pragma once
#include <array>
#include <vector>

#include "vss/calibrate/cube.h"

namespace vss::cube {

struct Face {
  std::array<int, 4> corner;  // clockwise as seen from outside
  Eigen::Vector3d outward;    // world
};

struct Edge {
  int from = 0, to = 0;  // corners
  int face_a = 0, face_b = 0;
};

struct Geometry {
  std::array<Eigen::Vector3d, 8> corner;  // world: 0-3 on the ground, 4-7 above them
  std::array<Face, 6> face;               // 0 the top, 1-4 the sides, 5 the base
  std::array<Edge, 12> edge;
};
Geometry GeometryOf(const CubeSpec& cube);

struct VisibleEdge {
  int edge = 0;
  CubeEdgeClass edge_class = CubeEdgeClass::kTopOuter;
  int inner_face = 0;  // a visible face at the edge, the top where it is one: outward points away from it
};
std::vector<VisibleEdge> VisibleEdges(const Geometry& g, const Eigen::Vector3d& camera_in_world);

}  // namespace vss::cube
