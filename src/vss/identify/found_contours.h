// How often a contour that is there is found, and what the grey values say where no line was.
#pragma once
#include <Eigen/Core>

#include "vss/identify/contour.h"
#include "vss/identify/placed_object.h"

namespace vss {

// A contour that is there is found this often: an outline or convex edge, and one inside (concave).
inline constexpr double kDetectStrong = 0.8;
inline constexpr double kDetectWeak = 0.65;
inline constexpr double kDetectCovered = 0.55;  // under a flange
// Where a part touches its support both sides lie in the contact shadow.
inline constexpr double kDetectContact = 0.7;
// The pieces of contour of which the grey values were measured.
inline constexpr double kPiecePx = 8;
// A piece where the grey values show no more of a step than anywhere (typical of the picture = 1).
inline constexpr double kEmptyStep = 1.5;

// Does the solid itself roof over the point, as a flange the web below it? Little light gets there.
bool IsCovered(const WorldSolid& solid, const Eigen::Vector3d& point_in_world);

// Height (world, mm) of the highest point of a contour; infinite for a limb.
double TopOf(const WorldSolid& solid, ContourSample::Source source, int index);

// How often a contour that is there is found. `lowest_z_mm`: of the solid's lowest point in the world.
double DetectOf(const WorldSolid& solid, ContourSample::Source source, int index, double lowest_z_mm);

// Without a line, what the grey values say: the logarithm of the odds that a contour is there. `strength`: of
// the step, typical of the picture = 1; `weak`: a contour that is hollow or in contact; `visible_px`: how
// much of it shows.
double StepLogOdds(double strength, bool weak, double visible_px);

}  // namespace vss
