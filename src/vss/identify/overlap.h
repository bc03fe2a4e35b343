// Do two solids share room?
#pragma once
#include "vss/identify/placed_object.h"

namespace vss {

// A solid prepared for many questions.
struct Volume {
  Eigen::AlignedBox3d box;
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
  // Of each triangle what the crossing of a ray upwards asks for; those that such a ray only grazes are left
  // out.
  struct Crossing {
    Eigen::Vector3d corner, edge1, edge2, across;  // across: the ray's direction x edge2
    double det = 0;
    Eigen::Vector2d lo, hi;  // seen along the ray: no other ray meets the triangle
  };
  std::vector<Crossing> crossings;
  double mm3 = 0;
  double wall_mm = 0;  // mean thickness

  bool Contains(const Eigen::Vector3d& point) const;
};
Volume MakeVolume(const WorldSolid& solid);

// The share of the smaller solid's volume that both fill, 0 to 1, on a fixed grid of sample points. Solids
// that sink into each other by less than `touch_mm` only touch: 0.
double SharedVolume(const Volume& a, const Volume& b, double touch_mm);
// Is that more than `share`? Asks no further than it must.
bool SharesMoreThan(const Volume& a, const Volume& b, double touch_mm, double share);

}  // namespace vss
