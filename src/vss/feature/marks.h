// Marks of planar calibration targets: where the discs or corners of a regular grid are in a picture, to a
// few thousandths of a pixel, and which mark of the grid each one is. Boards that are partly out of view are
// used.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/result.h"
#include "vss/image/grey_image.h"

namespace vss {

enum class TargetPattern { kDiscs, kCheckerboard, kCharuco };

// A planar target. `columns` x `rows` marks: discs, or inner corners of a checkerboard, `pitch_mm` apart.
// Mark (column, row) lies at (column * pitch, row * pitch, 0) of the `board` frame: x along a row, y down a
// column as seen from the front, z into the board.
struct TargetSpec {
  TargetPattern pattern = TargetPattern::kDiscs;
  int columns = 0, rows = 0;
  double pitch_mm = 0;
  double diameter_mm = 0;  // kDiscs; 0: not known
  std::vector<std::array<int, 2>>
      distinguished;  // kDiscs: (column, row) of the three discs of another size; may be empty
  double distinguished_diameter_mm = 0;  // kDiscs: the size of those three
  double marker_mm = 0;                  // kCharuco: side of the markers in the white squares
  std::string dictionary = "4x4_50";     // kCharuco
  bool first_square_white =
      false;  // kCharuco: the square at the top left carries a marker (before OpenCV 4.6.0: even rows)

  Eigen::Vector2d PointOnBoard(int column, int row) const { return {column * pitch_mm, row * pitch_mm}; }
};

struct Mark {
  Eigen::Vector2d
      img;  // px: a corner, or the centre of a disc's ellipse (the disc's own centre differs, see calibrate)
  int column = 0, row = 0;    // on the board where the view is anchored, else in a frame of the view's own
  double sigma_px = 0;        // per coordinate, from the residuals of the grey-value model
  double blur_px = 0;         // sigma of the edge profile: sharpness
  double contrast = 0;        // bright minus dark, as a share of full scale
  double size_px = 0;         // kDiscs: geometric mean of the ellipse's semi-axes
  double diameter_share = 0;  // kDiscs: diameter over pitch as seen
};

// The marks of one picture. A plain grid does not tell which of its marks are seen when an edge of the board
// is out of view; that does not matter for a flat board, whose pose is free in every view.
struct BoardMarks {
  std::vector<Mark> marks;
  bool anchored = false;        // column and row are those of the board (up to half a turn for a plain grid)
  bool mirrored = false;        // the board is seen in a mirror: distinguished discs or markers say so
  bool by_codes = false;        // kCharuco: the markers said which corners are seen
  bool codes_disagree = false;  // kCharuco: markers were read, but not where the target has them
  int columns_seen = 0, rows_seen = 0;  // extent in the board's own directions
  bool columns_complete = false,
       rows_complete = false;  // there would have been room for one more at both ends
  int num_rejected = 0;        // marks of the grid that were found but could not be measured
  double polarity = 1;         // +1: dark discs on a light board
};

// The marks of `target` in `image`. An error says why there are none.
Result<BoardMarks> FindMarks(const GreyView& image, const TargetSpec& target);

// ---- The pieces, for tests and benchmarks ----

// The centre of one blurred ellipse by a grey-value model of ten parameters (centre, shape, blur,
// illumination plane, ratio of the two sides). `shape`: symmetric 2x2, the ellipse is |shape^-1 (x - centre)|
// = 1. Empty where the model does not fit.
struct DiscFit {
  Eigen::Vector2d centre;
  Eigen::Matrix2d shape;
  double sigma_px = 0, blur_px = 0, contrast = 0;
};
std::optional<DiscFit> FitDisc(const GreyView& image, const Eigen::Vector2d& centre,
                               const Eigen::Matrix2d& shape, double margin_px);

// The crossing of two blurred edges by a grey-value model of nine parameters. `arm1`, `arm2`: directions of
// the edges; `radius_px`: of the window.
struct CornerFit {
  Eigen::Vector2d corner;
  double sigma_px = 0, blur_px = 0, contrast = 0;
};
std::optional<CornerFit> FitCorner(const GreyView& image, const Eigen::Vector2d& corner,
                                   const Eigen::Vector2d& arm1, const Eigen::Vector2d& arm2,
                                   double radius_px);

}  // namespace vss
