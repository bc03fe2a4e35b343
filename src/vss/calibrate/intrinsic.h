// Intrinsic calibration: from the marks of one camera's board pictures to its lens, with an account of how
// good it is.
#pragma once
#include <string>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/calibrate/board_solver.h"
#include "vss/feature/marks.h"

namespace vss {

struct CalibrationOptions {
  bool opencv = false;         // output model: OpenCV's instead of Weng's
  bool choose_terms = true;    // further terms where the hold-out and their sigma say so
  bool bow = false;            // estimate the board's bow whatever the hold-out says
  double outlier_sigmas = 6;   // a mark farther off than this is dropped
  double max_residual_px = 2;  // a calibration with a larger residual is refused
  double min_tilt_deg = 5;     // boards less than this apart in orientation count as one
};
std::span<const ParameterOf<CalibrationOptions>> CalibrationParameters();

// One board picture as the calibration sees it.
struct BoardPicture {
  std::string file;  // as named in the job
  int width_px = 0, height_px = 0;
  BoardMarks board;
  std::string why_unusable;  // a sentence; empty: usable
};

struct DroppedMark {
  std::string file;
  int column = 0, row = 0;
  double distance_px = 0;
};

struct ViewQuality {
  std::string file;
  bool used = false;
  std::string why_not;
  int num_marks = 0, num_dropped = 0;
  double rms_px = 0;
  double tilt_deg = 0;     // between the board's normal and the optical axis
  double blur_px = 0;      // median sigma of the edge profiles: sharpness
  double distance_mm = 0;  // to the middle of the board
};

// A grid over the picture, row by row: columns x rows values.
struct PictureMap {
  int columns = 0, rows = 0;
  std::vector<double> value;
  double rms = 0, max = 0;
};

struct ModelChoice {
  std::string term;
  double holdout_px = 0, value = 0, sigma = 0;
  bool taken = false;
};

struct IntrinsicResult {
  Intrinsics intrinsics;
  // fx, fy, cx, cy, then the file's distortion coefficients (see CalibrationQuality).
  Eigen::MatrixXd covariance;
  int width_px = 0, height_px = 0;
  BoardSolution solution;
  BoardProblemOptions problem;
  std::vector<BoardView> views;      // as solved: dropped marks out, disc centres corrected
  std::vector<int> picture_of_view;  // index into `quality`
  std::vector<ViewQuality> quality;  // one a picture
  int num_by_codes = 0;              // views in which a coded board's markers were read
  std::vector<DroppedMark> dropped;
  std::vector<ModelChoice> choices;
  double holdout_px = 0;  // views that took no part, both ways
  PictureMap
      halves_difference_px;   // of the maps that the odd and the even views give, after the best rotation
  PictureMap uncertainty_px;  // predicted standard deviation of a ray, after the best rotation
  PictureMap coverage;        // marks a cell
  double covered_share = 0;
  std::vector<std::string> warnings;  // what the user should mend
  std::vector<std::string> findings;  // what was decided and why
  std::string next_view;              // what to photograph next
};

// `pixel_pitch_mm`: u and v from the data sheet, zero where not known. Errors name the camera, the cause and
// the remedy.
Result<IntrinsicResult> CalibrateIntrinsics(const std::string& camera, const TargetSpec& target,
                                            const std::vector<BoardPicture>& pictures,
                                            const Eigen::Vector2d& pixel_pitch_mm,
                                            const CalibrationOptions& options);

// Difference of two lenses over the picture: rays after the best rotation between them, in px of `a` at its
// centre. `in_b_from_a`: the rotation found, where wanted.
PictureMap LensDifference(const Intrinsics& a, const Intrinsics& b, int width_px, int height_px,
                          Eigen::Matrix3d* b_from_a = nullptr);

// The lens of another model whose rays are nearest over the whole picture (the camera's axes stay, so a pose
// stays valid), and how near.
struct ConvertedLens {
  Intrinsics intrinsics;
  double rms_px = 0, max_px = 0;
  Eigen::MatrixXd by_source;  // d (fx, fy, cx, cy, distortion) of the result by that of the source
};
Result<ConvertedLens> ConvertLens(const Intrinsics& from, LensModel model, int width_px, int height_px);

// A lens is sound where every pixel has a ray and every such ray its pixel again. The error says where it is
// not.
Status CheckLens(const Intrinsics& lens, int width_px, int height_px);

}  // namespace vss
