// From marks on a planar board, seen in several views, to the lens: closed-form start, Levenberg-Marquardt
// with analytic Jacobians, the views eliminated. Zhang 2000, "A flexible new technique for camera
// calibration".
#pragma once
#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "vss/base/result.h"
#include "vss/camera/lens.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {

// One view: mark i lies at (point_in_board[i], 0) mm and was seen at img[i] px.
struct BoardView {
  std::vector<Eigen::Vector2d> point_in_board;
  std::vector<Eigen::Vector2d> img;
  bool anchored = false;  // the board's own coordinates: only then does its bow show
};

// A direction in the space of the distortion coefficients that is estimated as one parameter.
struct LensTerm {
  std::string name;
  std::array<double, 12> direction{};
};

// Which terms are estimated. The names: k1 k2 p1 p2 k3 s1 s2 of either model (OpenCV: s1 is the thin prism
// along u, s2 along v). For Weng's model p1 is g3 = 2 p1 with g1 = p1, p2 is g4 = 2 p2 with g2 = p2, s1 adds
// to g1, s2 to g2.
std::vector<LensTerm> DefaultTerms(LensModel model);
LensTerm NamedTerm(LensModel model, const std::string& name);

struct BoardProblemOptions {
  LensModel model = LensModel::kWeng;
  std::vector<LensTerm> terms;
  bool estimate_bow = false;  // z = bow_x (1 - X^2) + bow_y (1 - Y^2), X and Y from -1 to 1 over the board
  Eigen::Vector2d board_size_mm{1, 1};  // for the bow: from the first to the last mark
  int width_px = 0, height_px = 0;
  bool fix_focal = false;  // keep fx, fy as they start: to see what they matter
};

struct BoardSolution {
  Intrinsics intrinsics;
  std::vector<double> term_values;
  std::vector<RigidTransform> cam_from_board;
  Eigen::Vector2d bow_mm = Eigen::Vector2d::Zero();
  // Of fx, fy, cx, cy, the terms, the bow; from the residuals' own variance. Empty where the views do not
  // determine them.
  Eigen::MatrixXd covariance;
  std::vector<std::vector<Eigen::Vector2d>> residual_px;  // seen minus predicted, as in BoardView
  double rms_px = 0;    // sqrt(mean squared distance): the figure that OpenCV prints
  double sigma_px = 0;  // per coordinate, with the degrees of freedom
  int iterations = 0;
};

// Weights one a mark (empty: all one). An error names what makes a start impossible. `start`: instead of the
// closed form.
Result<BoardSolution> SolveBoards(const std::vector<BoardView>& views, const BoardProblemOptions& options,
                                  const std::vector<std::vector<double>>* weights = nullptr,
                                  const BoardSolution* start = nullptr);

// Only the boards' poses, with the lens as given: for hold-outs. rms_px as above.
Result<BoardSolution> SolveBoardPoses(const std::vector<BoardView>& views, const BoardProblemOptions& options,
                                      const BoardSolution& lens);

// The plane's homography: img ~ H (x, y, 1). Normalised direct linear transform. Empty for fewer than four
// marks or marks on a line.
std::optional<Eigen::Matrix3d> HomographyFromMarks(const std::vector<Eigen::Vector2d>& from,
                                                   const std::vector<Eigen::Vector2d>& to);

// Image of the disc's ellipse centre minus image of the disc's centre (px): what an ellipse's centre is wrong
// by.
Eigen::Vector2d DiscEccentricity(const Intrinsics& lens, const RigidTransform& cam_from_board,
                                 const Eigen::Vector2d& point_in_board, double radius_mm);

// How the distortion coefficients follow from the terms: num_distortion x num_terms.
Eigen::MatrixXd DistortionFromTerms(const BoardProblemOptions& options);

}  // namespace vss
