// Inside of marks: what the finders of discs, corners and coded squares share.
#pragma once
#include <functional>
#include <vector>

#include "vss/feature/marks.h"

namespace vss::marks {

// Grey values as a share of full scale, smoothed and sampled; detection works on it, measuring on the picture
// itself.
struct FloatImage {
  int width = 0, height = 0;
  std::vector<float> value;
  float At(int u, int v) const { return value[std::size_t(v) * width + u]; }
  float& At(int u, int v) { return value[std::size_t(v) * width + u]; }
  bool Inside(double u, double v, double margin) const {
    return u >= margin && v >= margin && u <= width - 1 - margin && v <= height - 1 - margin;
  }
  double Sample(double u, double v) const;  // bilinear; (u, v) inside
};
FloatImage ToFloat(const GreyView& image);
FloatImage Halved(const FloatImage& image);  // mean of 2x2: pixel (u, v) covers 2u + 0.5, 2v + 0.5
FloatImage Smoothed(const FloatImage& image, double sigma_px);

BoardMarks FindDiscs(const GreyView& image, const TargetSpec& target);
BoardMarks FindCorners(const GreyView& image, const TargetSpec& target);
// Which marks of the coded board the corners are; `marks` in lattice coordinates of the view's own.
void AnchorByMarkers(const GreyView& image, const TargetSpec& target, BoardMarks& board);

// A quarter-turn of the lattice, right-handed, then a shift.
struct Placement {
  int quarter_turns = 0, column = 0, row = 0;
  std::array<int, 2> operator()(int c, int r) const;
};

// Finds which marks of the board are seen from the board's ends: an end of the board is where marks would
// still be in the picture, but are not. Sets columns_seen, rows_seen, complete and anchored, and moves the
// labels.
void AnchorByEnds(int width, int height, const TargetSpec& target, BoardMarks& board);

// Largest change of place, over the neighbours of each mark, in px: step vectors to the next column and row.
struct LocalSteps {
  Eigen::Vector2d column, row;
  bool has_column = false, has_row = false;
};
std::vector<LocalSteps> StepsOf(const std::vector<Mark>& marks);

}  // namespace vss::marks
