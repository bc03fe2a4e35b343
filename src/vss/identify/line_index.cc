#include "vss/identify/line_index.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vss {

using Eigen::Vector2d;

LineIndex::LineIndex(const View& view, double reach_px) {
  Vector2d lo(0, 0), hi(view.camera->width_px, view.camera->height_px);
  auto add = [&](const Vector2d& start, const Vector2d& end, int arc) {
    ViewLine l;
    l.start = start;
    l.end = end;
    l.arc = arc;
    l.length_px = (end - start).norm();
    l.direction = (end - start) / std::max(l.length_px, 1e-9);
    l.normal = {-l.direction.y(), l.direction.x()};
    l.ray_start = view.RayOfIdeal(start);
    l.ray_end = view.RayOfIdeal(end);
    l.plane_normal = l.ray_start.cross(l.ray_end).normalized();
    lines_.push_back(l);
    slim_.push_back({start, l.direction, l.length_px});
    lo = lo.cwiseMin(start).cwiseMin(end);
    hi = hi.cwiseMax(start).cwiseMax(end);
  };
  for (const auto& s : view.lines->segments) add(s.ideal_start, s.ideal_end, -1);
  num_segments_ = static_cast<int>(lines_.size());
  for (std::size_t i = 0; i < view.lines->arcs.size(); ++i) {
    const auto& a = view.lines->arcs[i];
    constexpr double kSagittaPx = 0.05;  // a chord may leave its arc by this
    const double radius = std::max(1.0, a.ideal_axes.minCoeff());
    const double step = 2 * std::acos(std::max(0.0, 1 - kSagittaPx / radius));
    const double turn = a.ideal_to_rad - a.ideal_from_rad;
    const int pieces = std::clamp(static_cast<int>(turn / step) + 1, 4, 400);
    const Eigen::Rotation2Dd r(a.ideal_angle_rad);
    auto at = [&](int k) {
      const double t = a.ideal_from_rad + turn * k / pieces;
      return Vector2d(a.ideal_center +
                      r * Vector2d(a.ideal_axes.x() * std::cos(t), a.ideal_axes.y() * std::sin(t)));
    };
    for (int k = 0; k < pieces; ++k) add(at(k), at(k + 1), static_cast<int>(i));
  }
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const int bin = DirectionBin(lines_[i].direction);
    for (int step : {-1, 0, 1})
      by_direction_[std::size_t((bin + step + kDirections) % kDirections)].push_back(static_cast<int>(i));
  }
  cell_px_ = std::max(16.0, 2 * reach_px);
  origin_ = lo - Vector2d::Constant(cell_px_);
  columns_ = static_cast<int>((hi.x() - origin_.x()) / cell_px_) + 3;
  rows_ = static_cast<int>((hi.y() - origin_.y()) / cell_px_) + 3;
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  const double grow = reach_px + cell_px_ * 0.7072;  // half a cell's diagonal
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const auto& l = lines_[i];
    const Vector2d a = (l.start.cwiseMin(l.end) - origin_).array() - grow,
                   b = (l.start.cwiseMax(l.end) - origin_).array() + grow;
    const int c0 = std::max(0, static_cast<int>(a.x() / cell_px_)),
              c1 = std::min(columns_ - 1, static_cast<int>(b.x() / cell_px_));
    const int r0 = std::max(0, static_cast<int>(a.y() / cell_px_)),
              r1 = std::min(rows_ - 1, static_cast<int>(b.y() / cell_px_));
    for (int r = r0; r <= r1; ++r)
      for (int c = c0; c <= c1; ++c) {
        const Vector2d center = origin_ + cell_px_ * Vector2d(c + 0.5, r + 0.5);
        const double along = std::clamp((center - l.start).dot(l.direction), 0.0, l.length_px);
        if ((center - l.start - along * l.direction).norm() <= grow)
          cells_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
                 static_cast<std::size_t>(c)]
              .push_back(static_cast<int>(i));
      }
  }
}

int LineIndex::DirectionBin(const Vector2d& direction) {
  double angle = std::atan2(direction.y(), direction.x());
  if (angle < 0) angle += kPi;
  return std::min(kDirections - 1, static_cast<int>(angle / kPi * kDirections));
}

const std::vector<int>& LineIndex::Cell(const Vector2d& ideal) const {
  static const std::vector<int> kNone;
  const int c = static_cast<int>((ideal.x() - origin_.x()) / cell_px_),
            r = static_cast<int>((ideal.y() - origin_.y()) / cell_px_);
  if (ideal.x() < origin_.x() || ideal.y() < origin_.y() || c >= columns_ || r >= rows_) return kNone;
  return cells_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
                static_cast<std::size_t>(c)];
}

LineHit LineIndex::Nearest(const Vector2d& ideal, const Vector2d& tangent, double max_distance_px,
                           double min_cosine, double slack_px) const {
  LineHit best;
  double best_distance = max_distance_px;
  for (int i : Cell(ideal)) {
    const Slim& l = slim_[static_cast<std::size_t>(i)];
    const double cosine = l.direction.dot(tangent);
    if (std::abs(cosine) < min_cosine) continue;
    const Vector2d d = ideal - l.start;
    const double along = d.dot(l.direction);
    if (along < -slack_px || along > l.length_px + slack_px) continue;
    const double distance = l.direction.y() * d.x() - l.direction.x() * d.y();
    if (std::abs(distance) >= best_distance) continue;
    best_distance = std::abs(distance);
    best = {i, distance * (cosine > 0 ? 1.0 : -1.0)};
  }
  return best;
}

}  // namespace vss
