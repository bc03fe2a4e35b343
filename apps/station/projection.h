// Parts drawn into pictures: edges, rims and limbs as polylines, what is seen and what is hidden.
#pragma once
#include <vector>

#include "part_json.h"
#include "vss/identify/contour.h"

namespace vss::station {

struct ContourPiece {
  ContourSample::Source source = ContourSample::Source::kEdge;
  int index = 0;
  bool hidden = false;
  std::vector<Eigen::Vector2d> points;  // px, img; two or more
};

// Pieces of the whole contour that lie in the picture (or just beyond its border).
std::vector<ContourPiece> ProjectContour(const WorldSolid& solid, const View& view,
                                         const Occluders& occluders);

// The outline of the solid where the plane through `point` (world) with `normal` cuts it.
std::vector<ContourPiece> ProjectCut(const WorldSolid& solid, const Eigen::Vector3d& point,
                                     const Eigen::Vector3d& normal, const View& view,
                                     const Occluders& occluders);

// The small drawing of an object at `dimensions`, seen slantwise from above: pieces in a square of `size` px.
struct ObjectDrawing {
  std::vector<ContourPiece> pieces;
  std::vector<Eigen::Vector2d> vertices;
};
ObjectDrawing DrawObject(const ObjectModel& model, std::span<const double> dimensions, int resting_pose,
                         double size_px);

Json PiecesToJson(const std::vector<ContourPiece>& pieces);

}  // namespace vss::station
