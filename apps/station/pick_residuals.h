// How far picked lines lie from the contours that they were assigned to, with derivatives: what a fit by hand
// makes small.
#pragma once
#include <array>
#include <vector>

#include "manual_fit.h"

namespace vss::station {

// All picks, whitened by what a line is sure to and what it is off beyond its noise.
struct PickResiduals {
  std::vector<double> r;
  std::vector<Eigen::RowVectorXd> j;  // by the object's whole state
  std::vector<double> pick_rms_px;  // of each pick: RMS distance from its contour; infinite behind the camera
  double overshoot = 0;             // whitened squares: segments that reach beyond their edges
  int unseen = 0;                   // picks whose contour lies behind the camera
};
PickResiduals ResidualsOf(const FitQuestion& question, const PlacedObject& object,
                          const std::vector<View>& views);

// The derivatives by the state that points (ideal, px) of a contour would add as residuals, were a line
// picked there: an edge's two ends, or points of a rim. Empty where the contour lies behind the camera.
std::vector<Eigen::RowVectorXd> RowsOfContour(const WorldSolid& solid, bool is_circle, int contour,
                                              const View& view, const std::vector<Eigen::Vector2d>& points);

}  // namespace vss::station
