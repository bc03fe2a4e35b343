#include "vss/reconstruct/edge_bow.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kMinPoints = 5;  // in a picture: three tell a curve, two more its error
constexpr double kMinSpan = 0.4;       // of the edge in one picture: less says little of its middle
constexpr int kMinViews = 2;
constexpr double kKnownMm = 50;  // of a bow beforehand: so that one direction alone can be seen, too

// What one picture says: the bow across the contour there, in px, and how a bow of a millimetre in either
// direction across the edge would show.
struct Sighting {
  Vector2d px_by_mm;
  double px = 0, variance = 0;
};

// Fits a bow beside an offset and a slope, which are the edge's place, to a group's residuals.
std::optional<Sighting> See(const ObservationGroup& group, const View& view,
                            const Eigen::Matrix<double, 3, 2>& across, double systematic_px) {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Vector3d g = Vector3d::Zero();
  Vector2d px_by_mm = Vector2d::Zero();
  double sum = 0, from = 1, to = 0;
  std::size_t points = 0;
  for (const auto& o : group.observations) {
    if (o.weight <= 0) continue;
    Eigen::Matrix<double, 2, 3> by_cam;
    if (!view.camera->intrinsics.Project(view.cam_from_world * o.sample.point_in_world, &by_cam)) continue;
    const double t = o.sample.t;
    const Vector3d row(1, 2 * t - 1, 4 * t * (1 - t));
    h += o.weight * row * row.transpose();
    g -= o.weight * row * o.residual_px;  // measured less predicted
    px_by_mm +=
        o.weight * (o.normal.transpose() * by_cam * view.cam_from_world.rotation * across).transpose();
    sum += o.weight;
    from = std::min(from, t), to = std::max(to, t);
    ++points;
  }
  if (points < kMinPoints || to - from < kMinSpan) return std::nullopt;
  const Eigen::Matrix3d covariance = h.ldlt().solve(Eigen::Matrix3d::Identity());
  if (!covariance.allFinite() || !(covariance(2, 2) > 0)) return std::nullopt;
  return Sighting{px_by_mm / sum, (covariance * g)[2], covariance(2, 2) + systematic_px * systematic_px};
}

std::optional<EdgeBow> Adjust(const std::vector<Sighting>& sightings,
                              const Eigen::Matrix<double, 3, 2>& across) {
  if (static_cast<int>(sightings.size()) < kMinViews) return std::nullopt;
  Matrix2d h = Matrix2d::Identity() / (kKnownMm * kKnownMm);
  Vector2d g = Vector2d::Zero();
  for (const auto& s : sightings) {
    h += s.px_by_mm * s.px_by_mm.transpose() / s.variance;
    g += s.px_by_mm * s.px / s.variance;
  }
  const Matrix2d covariance = h.inverse();
  const Vector2d bow = covariance * g;
  double chi_square = 0;
  for (const auto& s : sightings) chi_square += std::pow(s.px - s.px_by_mm.dot(bow), 2) / s.variance;
  const double stretch =
      std::max(1.0, chi_square / std::max<double>(1, static_cast<double>(sightings.size()) - 2));
  EdgeBow out;
  out.bow_mm = across * bow;
  out.covariance = stretch * across * covariance * across.transpose();
  out.chi_square = bow.dot(h * bow) / stretch;
  out.num_views = static_cast<int>(sightings.size());
  return out;
}

}  // namespace

std::vector<EdgeBow> EdgeBows(const Adjustment& a) {
  const auto views = a.AdjustedViews();
  std::vector<WorldSolid> solids;
  for (const auto& p : a.parts) solids.push_back(PlaceSolid(p.object, false));
  std::map<std::pair<int, int>, std::vector<Sighting>> seen;
  std::map<std::pair<int, int>, Eigen::Matrix<double, 3, 2>> directions;
  for (const auto& group : a.groups) {
    const auto& sample = group.observations[0].sample;
    if (group.weight <= 0 || sample.source != ContourSample::Source::kEdge) continue;
    const auto& solid = solids[static_cast<std::size_t>(group.part)];
    const auto& edge = solid.edges[static_cast<std::size_t>(sample.index)];
    const Vector3d along = solid.vertices[static_cast<std::size_t>(edge.end)].point -
                           solid.vertices[static_cast<std::size_t>(edge.start)].point;
    const Vector3d first = along.unitOrthogonal();
    Eigen::Matrix<double, 3, 2> across;
    across << first, along.normalized().cross(first);
    const std::pair key(group.part, sample.index);
    directions[key] = across;
    const auto& view = views[static_cast<std::size_t>(group.view)];
    if (const auto sighting = See(group, view, across, group.systematic_px)) seen[key].push_back(*sighting);
  }
  std::vector<EdgeBow> out;
  for (const auto& [key, sightings] : seen) {
    auto bow = Adjust(sightings, directions[key]);
    if (!bow) continue;
    bow->part = key.first, bow->edge = key.second;
    out.push_back(*bow);
  }
  return out;
}

}  // namespace vss
