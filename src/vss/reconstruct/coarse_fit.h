// Brings a part from where identification left it to within a pixel: its visible contour is drawn to the
// straight segments and arcs of the line images. Every contour sample is drawn to all lines near it at once,
// weighted by distance, with a width that shrinks (expectation maximisation; Granger, Pennec: Multi-scale
// EM-ICP, ECCV 2002), so that the two edges of a thin plate move together before each settles on its own
// line.
#pragma once
#include <span>

#include "vss/identify/contour.h"

namespace vss {

struct CoarseFitOptions {
  double start_width_px = 2;  // lines up to three times that far are looked at
  double end_width_px = 0.7;
  double position_sigma_mm = 15;  // how far the start may be off
  double yaw_sigma_rad = 0.02;
  double tilt_sigma_rad = 0;  // 0: the part does not lean
  double dimension_sigma_mm = 10;
};

struct CoarseFit {
  PlacedObject object;
  int num_samples = 0;  // contour samples seen
  double cost =
      0;  // mean over the samples of 1 - the best line's weight at the end width: 0 perfect, 1 nothing fits
  double start_cost = 1;  // that of the start
};

// For each view, for each of its segments and then arcs: mean squared distance (px^2) of the nearest of a
// part's curves that run along it; infinite where none does.
using LineDistances = std::vector<std::vector<double>>;
LineDistances DistancesToLines(const PlacedObject& part, std::span<const View> views, const Occluders* others,
                               const CoarseFitOptions& options);

// `others`: the solids of the other parts; `claimed`: the least of the other parts' distances, so that the
// part keeps off lines that are theirs. Height and, unless asked for, tilt stay as they are; so does
// everything where no better place is found.
CoarseFit FitToLines(const PlacedObject& start, std::span<const View> views, const Occluders* others,
                     const LineDistances& claimed, const CoarseFitOptions& options);

// d ideal / d point in world (2 x 3); the point lies before the camera.
Eigen::Matrix<double, 2, 3> IdealByWorld(const View& view, const Eigen::Vector3d& point_in_world);

}  // namespace vss
