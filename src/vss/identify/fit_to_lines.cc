#include "vss/identify/fit_to_lines.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "vss/identify/line_sharing.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Eigen::Matrix<double, 2, 3> IdealByWorld(const View& view, const Vector3d& point) {
  const Vector3d p = view.cam_from_world * point;
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix<double, 2, 3> j;
  j << k.fx_px / p.z(), 0, -k.fx_px * p.x() / (p.z() * p.z()), 0, k.fy_px / p.z(),
      -k.fy_px * p.y() / (p.z() * p.z());
  return j * view.cam_from_world.rotation;
}

// The normal equations of the samples that found a line.
struct LineEquations {
  Eigen::MatrixXd ata;  // its lower triangle, until Mirror()
  Eigen::VectorXd atb;
  double sum = 0;     // px^2
  double weight = 0;  // of all samples
  int count = 0;

  explicit LineEquations(int n) : ata(Eigen::MatrixXd::Zero(n, n)), atb(Eigen::VectorXd::Zero(n)) {}

  // The sample's line lies at `distance_px`, and weighs less the farther off.
  void Add(const WorldSolid& solid, const View& view, const ContourSample& s, double distance_px,
           double reach_px) {
    const Vector2d normal(-s.ideal_tangent.y(), s.ideal_tangent.x());
    const Eigen::RowVector3d by_world = normal.transpose() * IdealByWorld(view, s.point_in_world);
    const StateColumns by_state = SampleByState(solid, s);
    const double u = distance_px / (0.5 * reach_px);
    const double w = 1 / (1 + u * u);
    const int n = int(atb.size());
    std::array<double, kMaxStateSize> j;
    for (int i = 0; i < n; ++i)
      j[std::size_t(i)] =
          by_world[0] * by_state(0, i) + by_world[1] * by_state(1, i) + by_world[2] * by_state(2, i);
    for (int k = 0; k < n; ++k) {
      const double of_column = j[std::size_t(k)];
      double* column = ata.col(k).data();
      for (int i = k; i < n; ++i) column[i] += w * j[std::size_t(i)] * of_column;
      atb[k] += w * distance_px * of_column;
    }
    sum += distance_px * distance_px;
    weight += w;
    ++count;
  }
  void Mirror() { ata.triangularView<Eigen::StrictlyUpper>() = ata.transpose(); }
};

LineEquations Linearise(const PlacedObject& object, std::span<const int> views, const SceneIndex& scene,
                        double reach_px, const Occluders* others) {
  constexpr double kMinCosine = 0.99;  // 8 degrees: it is not fitted yet
  const ContourSampling sampling{.spacing_px = 8, .min_samples = 3, .max_samples = 24, .img = false};
  const WorldSolid solid = PlaceSolid(object);
  const Numbering numbering(solid);
  LineEquations equations(object.StateSize());
  std::vector<Hit> hits;
  std::vector<double> signed_distance;
  std::vector<int> lost;
  for (int v : views) {
    const View& view = scene.views[std::size_t(v)];
    const auto samples = SampleContour(solid, view, sampling, others);
    hits.clear();
    signed_distance.clear();
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (!samples[i].visible) continue;
      const LineHit hit = scene.Match(v, samples[i], reach_px, kMinCosine);
      if (hit.line < 0) continue;
      hits.push_back(HitOf(hit, samples[i], numbering.Of(samples[i]), int(i), scene.lines[std::size_t(v)]));
      signed_distance.push_back(hit.distance_px);
    }
    lost.assign(samples.size(), 0);
    ShareLines(hits, samples, lost);
    for (std::size_t k = 0; k < hits.size(); ++k)
      if (lost[std::size_t(hits[k].sample)] == 0)
        equations.Add(solid, view, samples[std::size_t(hits[k].sample)], signed_distance[k], reach_px);
  }
  equations.Mirror();
  return equations;
}

// The step of the state.
Eigen::VectorXd Solve(LineEquations equations, const std::vector<bool>& free) {
  auto& [ata, atb, sum, weight, count] = equations;
  // A weak hold on everything (10 mm, 0.01 rad to a tenth of a sample's weight) keeps what no line moves.
  for (int i = 0; i < int(atb.size()); ++i) {
    const double scale = i >= 3 && i < kPlacementSize ? 0.01 : 10.0;
    ata(i, i) += 0.1 / (scale * scale);
    if (free[std::size_t(i)]) continue;
    ata.row(i).setZero();
    ata.col(i).setZero();
    ata(i, i) = 1;
    atb[i] = 0;
  }
  return ata.ldlt().solve(atb);
}

}  // namespace

FitToLinesResult FitToLines(PlacedObject& object, std::span<const int> views, const SceneIndex& scene,
                            const std::vector<bool>& free, double first_reach_px, double last_reach_px,
                            int iterations, const Occluders* others) {
  constexpr int kFewest = 4;         // samples
  constexpr double kStillPx = 0.01;  // a step that moves contours by less, rms, moves them no further
  FitToLinesResult result;
  const auto defs = object.model->dimensions();
  for (int it = 0; it < iterations; ++it) {
    const double share = iterations > 1 ? it / double(iterations - 1) : 1;
    const double reach = first_reach_px + share * (last_reach_px - first_reach_px);
    const LineEquations equations = Linearise(object, views, scene, reach, others);
    result.samples = equations.count;
    if (equations.count < kFewest) return result;
    result.rms_px = std::sqrt(equations.sum / equations.count);
    result.information = equations.ata;
    const Eigen::VectorXd step = Solve(equations, free);
    Eigen::VectorXd state = object.State() + step;
    if (!state.allFinite()) return {};
    for (std::size_t i = 0; i < defs.size(); ++i) {
      double& d = state[kPlacementSize + int(i)];
      d = std::clamp(d, defs[i].min_mm, defs[i].max_mm);
    }
    object.SetState(state);
    const double moved_px2 = step.dot(equations.ata * step) / equations.weight;
    if (first_reach_px == last_reach_px && moved_px2 < kStillPx * kStillPx) break;
  }
  return result;
}

}  // namespace vss
