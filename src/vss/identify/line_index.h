// Fast look-up of the lines of one picture near a point and of a direction, in ideal px.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "vss/identify/view.h"

namespace vss {

// One line of a picture, prepared for matching.
struct ViewLine {
  Eigen::Vector2d start, end, direction,
      normal;  // ideal px; unit; normal = direction turned by +90 degrees (u -> v)
  double length_px = 0;
  Eigen::Vector3d ray_start, ray_end;  // unit, world
  Eigen::Vector3d plane_normal;        // unit, world: the plane through the optical centre and the line
  int arc = -1;  // index of the elliptical arc of which this is a short chord; -1: a segment of its own
};

struct LineHit {
  int line = -1;  // index into the line image's segments
  double distance_px =
      0;  // signed: the line lies at +distance along the query's normal (tangent turned u -> v)
};

class LineIndex {
 public:
  LineIndex() = default;
  // `reach_px`: the largest distance that will be asked for.
  LineIndex(const View& view, double reach_px);

  // The segments, then short chords of the arcs.
  const std::vector<ViewLine>& lines() const { return lines_; }
  int num_segments() const { return num_segments_; }
  // A number for the line of which lines()[line] is a piece: all chords of an arc are one.
  int WholeOf(int line) const {
    const int arc = lines_[std::size_t(line)].arc;
    return arc < 0 ? line : num_segments_ + arc;
  }
  // The nearest line at most `max_distance_px` away whose direction differs from `tangent` by at most the
  // angle whose cosine is `min_cosine`, and that extends (within `slack_px`) beside the point. line = -1:
  // none.
  LineHit Nearest(const Eigen::Vector2d& ideal, const Eigen::Vector2d& tangent, double max_distance_px,
                  double min_cosine, double slack_px = 2) const;
  // Calls f(line) for every line whose direction differs from `tangent` by at most some 4 degrees (cosine
  // 0.998), in their order.
  template <typename F>
  void ForParallel(const Eigen::Vector2d& tangent, F&& f) const {
    constexpr double kMinCosine = 0.998;
    for (int i : by_direction_[std::size_t(DirectionBin(tangent))])
      if (std::abs(lines_[std::size_t(i)].direction.dot(tangent)) >= kMinCosine) f(lines_[std::size_t(i)]);
  }
  // Lines of any direction whose cell neighbourhood holds the point (a superset of those within reach).
  const std::vector<int>& Cell(const Eigen::Vector2d& ideal) const;

 private:
  std::vector<ViewLine> lines_;
  struct Slim {  // what a look-up asks of a line, close together in memory
    Eigen::Vector2d start, direction;
    double length_px;
  };
  std::vector<Slim> slim_;
  int num_segments_ = 0;
  double cell_px_ = 16;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<int>> cells_;
  static constexpr int kDirections = 24;  // bins of 7.5 degrees, each with those of its neighbours
  static int DirectionBin(const Eigen::Vector2d& direction);
  std::vector<std::vector<int>> by_direction_ = std::vector<std::vector<int>>(kDirections);
};

}  // namespace vss
