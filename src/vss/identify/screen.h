// What can hide in one picture: the triangles of bodies as the picture shows them.
#pragma once
#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "vss/identify/view.h"

namespace vss {

using Triangle3d = std::array<Eigen::Vector3d, 3>;  // world, mm

// Does the segment eye + s * d, s in (0, limit), meet the triangle?
bool Meets(const Eigen::Vector3d& eye, const Eigen::Vector3d& d, double limit, const Triangle3d& t);
// Is the front of the triangle turned to `eye`?
bool Toward(const Triangle3d& t, const Eigen::Vector3d& eye);

// Triangles in `ideal` px, where the inverse depth is an affine function of the place.
class Screen {
 public:
  static constexpr int kNobody = -1;

  // Adds those triangles of a body that are turned to the view's camera.
  void Add(const View& view, std::span<const Triangle3d> triangles, int owner = kNobody);
  bool Empty() const { return bodies_.empty(); }

  // Does anything but what `except` owns hide the point, which projects to `ideal` at `depth`, from more than
  // `margin` (a share of the distance) before it?
  bool Hides(const Eigen::Vector2d& ideal, double depth, double margin, const Eigen::Vector3d& eye,
             const Eigen::Vector3d& point, int except = kNobody) const;

 private:
  struct Triangle {
    Eigen::Vector2d lo, hi;
    Eigen::Vector3d share[3];  // barycentric coordinates as affine functions of the place
    Eigen::Vector3d inverse_depth;
  };
  struct Body {
    Eigen::Vector2d lo, hi;  // of its triangles
    int owner;
    std::size_t end, near_end;  // behind its last triangle
  };
  void AddTriangle(const View& view, const Triangle3d& triangle, Body& body);

  std::vector<Body> bodies_;
  std::vector<Triangle> triangles_;
  std::vector<Triangle3d> near_;  // those that reach behind the camera
};

}  // namespace vss
