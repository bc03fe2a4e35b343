// An arc at its place of maximum likelihood.
//
// Model: grey = b + c Phi((t + bend s^2) / s) with t (px) the distance across the contour towards the bright
// side, s the blur of lens and pixel, `bend` half the contour's curvature: a blurred disc's half level lies
// s^2 / (2 R) within its contour. Levels b, c are constant, or linear over the picture where that explains
// the pixels better. Gauss-Newton on centre, axes, angle, levels and blur.
#pragma once
#include "vss/feature/line_scene.h"

namespace vss {

// Lets `arc` go on as far as edge points lie on its ellipse; whether it grew.
bool ExtendArc(const Scene& scene, EllipticalArc& arc);

struct ArcMove {
  bool moved = false;      // else the arc is as it was
  bool explained = false;  // the fit left no more than noise, its levels being constant
};

// Moves `arc` to its place, with covariance.
ArcMove MoveArc(const Scene& scene, EllipticalArc& arc);

}  // namespace vss
