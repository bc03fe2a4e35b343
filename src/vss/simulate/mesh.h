// A simulated scene as polygons: what the pictures are drawn from, and what throws shadows.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "vss/simulate/simulated_scene.h"

namespace vss {

// All in world, mm.
struct SceneMesh {
  // What shading asks: material, normal, and where the texture lies.
  struct Surface {
    int part = -1;  // index into the scene's parts; -1: ground and clutter
    Material material;
    bool is_cylinder = false;
    Eigen::Vector3d axis_point = Eigen::Vector3d::Zero(), axis_direction = Eigen::Vector3d::UnitZ();
    double outward = 1;  // cylinder: -1 for a bore
    Eigen::Vector3d texture_u = Eigen::Vector3d::UnitX(), texture_v = Eigen::Vector3d::UnitY();
    Eigen::Vector2d texture_shift = Eigen::Vector2d::Zero();  // mm
  };
  // normal . p = offset; polygons of one plane share its number.
  struct Plane {
    Eigen::Vector3d normal;  // outward, unit
    double offset = 0;
    int surface = 0;
    // Shadows on it are computed as if it were this plane: facets of one cylinder share a few.
    int shadow_plane = 0;
    double shadow_from_mm = 0.05;  // bodies throw shadows on it from this height above it on; see Shadows
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // of a ball around its polygons
    double radius_mm = 0;                              // infinite for the ground
  };
  // Convex.
  struct Polygon {
    int plane = 0;
    int num_corners = 3;                     // or 4
    std::array<Eigen::Vector3d, 4> corners;  // counter-clockwise seen from outside

    std::span<const Eigen::Vector3d> Corners() const { return {corners.data(), std::size_t(num_corners)}; }
  };
  // A closed body that throws a shadow: triangles alone, coarser where it is round. Neighbours share corners
  // to the bit.
  struct Caster {
    std::vector<std::array<Eigen::Vector3d, 3>> triangles;
    std::vector<Eigen::Vector3d> normals;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // of a ball around it
    double radius_mm = 0;
  };

  std::vector<Surface> surfaces;  // 0: the ground
  std::vector<Plane> planes;      // 0: the ground, z = 0
  std::vector<Polygon> polygons;  // paint on the ground first (its planes are the ground's), then solids
  std::vector<Caster> casters;
};

SceneMesh MakeMesh(const SimulatedScene& scene);

}  // namespace vss
