// The place of an edge of a few pixels, measured with all that is seen around it: no strip across it is free
// of other edges.
//
// Model (grey values proportional to light): every face that the window shows, and the background, is of one
// grey:
//   g(p) = sum_r level_r * area_r(p) + sum_j offset_j * sum_i (level_minus - level_plus) * length_i(p)
// area_r is the share of face r under the blur around pixel p (ray by ray, from the solids as they stand),
// and length_i what is seen there of piece i of contour j: the first order of what the picture changes by as
// contour j moves along its normal. The edge's own offset and, held to what is known of them, those of the
// others are fitted together with the greys.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "vss/reconstruct/contour_pieces.h"

namespace vss {

// What is seen along each ray of one picture: the front faces of solids as triangles in the camera's frame.
class FacesSeen {
 public:
  FacesSeen(std::span<const WorldSolid> solids, const View& view);

  struct Triangle {
    Eigen::Vector3d a, ab, ac;          // corner and sides, camera frame (mm)
    Eigen::AlignedBox2d in_normalized;  // x/z, y/z; everything where a corner lies behind the camera
    int face = 0;                       // one number for each face of each solid, from 1
  };
  // Those that the box may show.
  std::vector<Triangle> In(const Eigen::AlignedBox2d& normalized) const;
  // The face that is met first along (normalized, 1); 0: none.
  static int First(std::span<const Triangle> triangles, const Eigen::Vector2d& normalized);

 private:
  std::vector<Triangle> triangles_;
};

// `blur_px`: of the picture's steps; `noise`: grey levels, sigma is never better than that allows. Empty
// where the window lies outside the picture or is saturated, where no step is seen, or the edge lies farther
// than `search_px`, or a pixel, off.
std::optional<ProfileFit> FitShortEdge(const GreyView& image, const View& view, const FacesSeen& faces,
                                       const ShortEdge& edge, double blur_px, double noise, double search_px);

// How well faces of one grey each, as they stand and under the blur, explain a window of a picture.
struct GreyMisfit {
  double sum_squares = 0;  // grey levels squared
  int num_pixels = 0;
};
// `window`: px, within the picture.
GreyMisfit MisfitOfGreys(const GreyView& image, const View& view, const FacesSeen& faces,
                         const Eigen::AlignedBox2i& window, double blur_px);

}  // namespace vss
