// How much of each lamp a point of a picture sees, penumbra included.
//
// A lamp is taken for a disc of its radius, parallel to the plane that it shines on; what covers it is
// projected onto it from the point, and the covered share of the disc is the sum over the directed edges of
// the outline (edges between two faces that both look at the lamp cancel): the disc's area within the
// triangle that an edge makes with its middle where the edge crosses the disc, else the angle, which only has
// to be known where the outline enters and leaves. Discs are widened by what a pixel covers, so that the edge
// of a sharp shadow does not jag.
#pragma once
#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "vss/simulate/mesh.h"

namespace vss {

// A lamp at its place during the exposure. `overhead`: it hangs at `height_mm` above whatever point it shines
// on, which is how the light of the hall's ceiling is drawn.
struct PlacedLamp {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world, mm
  double radius_mm = 0, power = 0;
  bool overhead = false;
  double height_mm = 0;
};

class Shadows {
 public:
  Shadows(const SceneMesh& mesh, std::vector<PlacedLamp> lamps);

  // `plane` is a SceneMesh::Plane::shadow_plane. The bodies that may throw a shadow of lamp `lamp` onto
  // `plane` within `radius_mm` of `point`; indices for Covered. `radius_mm` infinite: all of them.
  void Near(int plane, int lamp, const Eigen::Vector3d& point, double radius_mm, std::vector<int>& bodies);

  // The share of the lamp that they cover at `point` of `plane`; a pixel there is `pixel_mm` wide.
  double Covered(int plane, int lamp, const Eigen::Vector3d& point, double pixel_mm,
                 const std::vector<int>& bodies);

  const std::vector<PlacedLamp>& lamps() const { return lamps_; }

 private:
  // A body as a lamp sees it above a plane, in the plane's coordinates (u, v, height above it).
  struct Body {
    struct Corner {
      Eigen::Vector2d place;
      double scale;  // by which it is further from a point of the plane when projected to the lamp's height
    };
    std::vector<std::vector<Corner>> loops;  // closed
    std::vector<Eigen::Vector2d> hull;       // of its shadow's umbra, counter-clockwise
    double penumbra_mm = 0;                  // around the hull
  };
  struct Receiver {
    Eigen::Vector3d origin, axis_u, axis_v, normal;
    Eigen::Vector3d lamp;  // in the plane's coordinates; overhead: only its height counts
    std::vector<Body> bodies;
  };
  Receiver& ReceiverOf(int plane, int lamp);
  bool MayShade(const SceneMesh::Caster& caster, const SceneMesh::Plane& plane, const PlacedLamp& lamp) const;
  static double LoopAngle(const std::vector<Body::Corner>& loop, const Eigen::Vector2d& p,
                          const Eigen::Vector2d& lamp_from_point, double radius_mm, double blur_mm);
  static bool Touches(const Body& body, const Eigen::Vector2d& p, double radius_mm);

  const SceneMesh& mesh_;
  std::vector<PlacedLamp> lamps_;
  std::vector<std::vector<std::unique_ptr<Receiver>>>
      receivers_;  // by plane, lamp; made when first asked for
};

}  // namespace vss
