// Straight edges of the world, each found in the line images of several pictures.
//
// Two lines of two pictures always meet in one line of space; what makes it an edge is that it is horizontal
// or vertical (man-made and standing on the ground) or that a third picture agrees. After Hofer, Maurer,
// Bischof, "Efficient 3D scene abstraction using line segments" (CVIU 2017), with known cameras and the
// horizontal and vertical as further witnesses.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/base/progress.h"
#include "vss/identify/line_index.h"
#include "vss/identify/view.h"

namespace vss {

struct LineRef {
  int view = 0, line = 0;
  bool operator==(const LineRef&) const = default;
};

struct WorldLine {
  enum class Direction { kHorizontal, kVertical, kInclined };
  Direction kind = Direction::kHorizontal;
  Eigen::Vector3d start, end;  // world, mm
  std::vector<LineRef> lines;  // sorted
  int num_views = 0, num_stops = 0;
  double rms_px = 0;
  // How an offset of the line by d (mm) shows in its pictures: mean squared distance = d^T * px2_per_mm2 * d
  // (px^2).
  Eigen::Matrix3d px2_per_mm2 = Eigen::Matrix3d::Zero();

  Eigen::Vector3d Unit() const { return (end - start).normalized(); }
  double Length() const { return (end - start).norm(); }
};

struct WorldLineOptions {
  double tolerance_px = 1.5;
  double min_height_mm = -50, max_height_mm = 3000;
  double min_length_px = 0;  // shorter lines start no edge
};

// How well lines of several pictures agree on the edges that they show: the rms distance (px) of the better
// ones. 0 where there are too few to say.
double AgreementPx(std::span<const WorldLine> lines);

std::vector<WorldLine> FindWorldLines(std::span<const View> views, std::span<const LineIndex> indices,
                                      const WorldLineOptions& options, int threads, const Progress& progress);

// What one picture alone may show at one height: its segments of at least `min_length_px`, on the horizontal
// plane `z_mm` (world). In the picture's order, whatever the height; a segment that is no line there (it
// rises to the horizon) has no length.
std::vector<WorldLine> LevelLines(const View& view, const LineIndex& index, double z_mm,
                                  double min_length_px);

}  // namespace vss
