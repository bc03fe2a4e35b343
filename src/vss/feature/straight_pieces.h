// Chains cut into straight pieces, and pieces of one line joined.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace vss {

// Sums over points, from which the line of least squared distance follows.
struct LineMoments {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;

  void Add(const Eigen::Vector2d& p) {
    n += 1, x += p.x(), y += p.y(), xx += p.x() * p.x(), xy += p.x() * p.y(), yy += p.y() * p.y();
  }
  void Add(const LineMoments& m) { n += m.n, x += m.x, y += m.y, xx += m.xx, xy += m.xy, yy += m.yy; }
};

struct FittedLine {
  Eigen::Vector2d point = {0, 0}, direction = {1, 0};  // of length 1
  double rms_px = 0;                                   // distance of the points

  double Across(const Eigen::Vector2d& p) const {
    return direction.x() * (p.y() - point.y()) - direction.y() * (p.x() - point.x());
  }
  double Along(const Eigen::Vector2d& p) const { return direction.dot(p - point); }
};

// `towards`: the direction is turned to its side.
FittedLine FitLine(const LineMoments& moments, const Eigen::Vector2d& towards);

// A straight run of a chain: points [begin, end) of the chains' order; a piece joined from several has a
// `next`.
struct StraightPiece {
  std::uint32_t begin = 0, end = 0;
  std::uint32_t chain = 0;
  LineMoments moments;
  FittedLine line;
  double from = 0, to = 0;  // along the line, of the outermost points
};

// `positions[i]`: place of the chains' i-th point; those of this chain are [begin, end). `tolerance[i]` (px):
// how far it may lie off a line. Pieces are appended.
void SplitChain(std::span<const Eigen::Vector2d> positions, std::span<const float> tolerance,
                std::uint32_t chain, std::uint32_t begin, std::uint32_t end, int min_points,
                std::vector<StraightPiece>& pieces);

}  // namespace vss
