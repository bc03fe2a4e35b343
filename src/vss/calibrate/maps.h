// Maps over the picture: differences and uncertainties of lenses.
#pragma once
#include "vss/calibrate/intrinsic.h"

namespace vss {

inline constexpr int kMapCells = 16;  // a side: a lens is smooth, 16 x 16 places show all of it

// The middle of cell (i, j) of a columns x rows grid over the whole picture, corners included.
Eigen::Vector2d CellPlace(int i, int j, int columns, int rows, int width_px, int height_px);

// Predicted standard deviation (px, root of the mean over u and v) from the covariance of fx, fy, cx, cy and
// the distortion coefficients of the file, with a common rotation of the camera taken out: it is absorbed by
// the pose.
PictureMap UncertaintyMap(const Intrinsics& lens, const Eigen::MatrixXd& covariance, int width_px,
                          int height_px);

// d ray / d (fx, fy, cx, cy, distortion coefficients) at a pixel, in px at the centre (2 x n).
Eigen::MatrixXd RayJacobian(const Intrinsics& lens, const Eigen::Vector2d& img);

void Summarise(PictureMap& map);

}  // namespace vss
