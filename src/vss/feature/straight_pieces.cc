#include "vss/feature/straight_pieces.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

constexpr int kMaxMisses =
    2;  // points in a row that may lie off before a run ends: one bad point is noise, three are a corner

struct Run {
  std::uint32_t begin, end;  // [begin, end)
  LineMoments moments;
  FittedLine line;
};

// Extends `run` towards `limit` (sign +1: its end, -1: its beginning) as long as points lie on the line.
void Grow(std::span<const Eigen::Vector2d> positions, std::span<const float> tolerance, std::uint32_t limit,
          int sign, Run& run) {
  int misses = 0;
  std::int64_t at = sign > 0 ? std::int64_t{run.end} : std::int64_t{run.begin} - 1;
  double fitted_at = run.moments.n;
  for (; sign > 0 ? at < limit : at >= std::int64_t{limit}; at += sign) {
    const Eigen::Vector2d& p = positions[std::size_t(at)];
    if (std::abs(run.line.Across(p)) > tolerance[std::size_t(at)]) {
      if (++misses > kMaxMisses) break;
      continue;
    }
    misses = 0;
    run.moments.Add(p);
    (sign > 0 ? run.end : run.begin) = static_cast<std::uint32_t>(sign > 0 ? at + 1 : at);
    if (run.moments.n >= fitted_at * 1.1) {
      run.line = FitLine(run.moments, run.line.direction);
      fitted_at = run.moments.n;
    }
  }
  run.line = FitLine(run.moments, run.line.direction);
}

bool Seed(std::span<const Eigen::Vector2d> positions, std::span<const float> tolerance, std::uint32_t begin,
          int count, Run& run) {
  run = {begin, begin + std::uint32_t(count), {}, {}};
  for (std::uint32_t i = begin; i < run.end; ++i) run.moments.Add(positions[i]);
  run.line = FitLine(run.moments, positions[run.end - 1] - positions[begin]);
  for (std::uint32_t i = begin; i < run.end; ++i)
    if (std::abs(run.line.Across(positions[i])) > 0.7 * tolerance[i]) return false;
  return true;
}

}  // namespace

FittedLine FitLine(const LineMoments& m, const Eigen::Vector2d& towards) {
  FittedLine line;
  const double mx = m.x / m.n, my = m.y / m.n;
  const double cxx = m.xx / m.n - mx * mx, cxy = m.xy / m.n - mx * my, cyy = m.yy / m.n - my * my;
  const double half = 0.5 * (cxx - cyy), root = std::sqrt(half * half + cxy * cxy);
  line.point = {mx, my};
  // Eigenvector of the larger eigenvalue, by the row that cancels nothing.
  const Eigen::Vector2d along =
      half >= 0 ? Eigen::Vector2d(half + root, cxy) : Eigen::Vector2d(cxy, root - half);
  const double length = along.norm();
  line.direction = length > 0 ? Eigen::Vector2d(along / length) : Eigen::Vector2d(1, 0);
  if (line.direction.dot(towards) < 0) line.direction = -line.direction;
  line.rms_px = std::sqrt(std::max(0.0, 0.5 * (cxx + cyy) - root));
  return line;
}

void SplitChain(std::span<const Eigen::Vector2d> positions, std::span<const float> tolerance,
                std::uint32_t chain, std::uint32_t begin, std::uint32_t end, int min_points,
                std::vector<StraightPiece>& pieces) {
  std::uint32_t free_from = begin;
  for (std::uint32_t at = begin; at + std::uint32_t(min_points) <= end;) {
    Run run;
    if (!Seed(positions, tolerance, at, min_points, run)) {
      ++at;
      continue;
    }
    Grow(positions, tolerance, end, +1, run);
    Grow(positions, tolerance, free_from, -1, run);
    StraightPiece piece{run.begin, run.end, chain, run.moments, run.line, 0, 0};
    piece.from = run.line.Along(positions[run.begin]);
    piece.to = run.line.Along(positions[run.end - 1]);
    if (piece.to > piece.from) pieces.push_back(piece);
    free_from = at = run.end;
  }
}

}  // namespace vss
