#include "vss/identify/weigh.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "vss/base/parallel.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A contour that is there is found this often: an outline or convex edge, and one inside (concave).
constexpr double kDetectStrong = 0.8;
constexpr double kDetectWeak = 0.45;
// Least chance of a line where nothing is, whatever the density says.
constexpr double kMinChance = 0.04;
// Samples closer than this along a contour stand or fall together: one line covers them.
constexpr double kIndependentPx = 25;
constexpr double kMaxIndependent = 4;
// Directions of a predicted contour and its line may differ by this.
constexpr double kMinCosine = 0.9962;  // 5 degrees

int Bin(const Vector2d& tangent) {
  double a = std::atan2(tangent.y(), tangent.x());
  if (a < 0) a += kPi;
  return std::min(SceneIndex::kDirectionBins - 1, static_cast<int>(a / kPi * SceneIndex::kDirectionBins));
}

Eigen::Matrix<double, 2, 3> IdealByWorld(const View& view, const Vector3d& point) {
  const Vector3d p = view.cam_from_world * point;
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix<double, 2, 3> j;
  j << k.fx_px / p.z(), 0, -k.fx_px * p.x() / (p.z() * p.z()), 0, k.fy_px / p.z(),
      -k.fy_px * p.y() / (p.z() * p.z());
  return j * view.cam_from_world.rotation;
}

bool IsStrong(const WorldSolid& solid, const ContourSample& s) {
  if (s.source != ContourSample::Source::kEdge) return true;
  return solid.edges[static_cast<std::size_t>(s.index)].convex;
}
double WeightOf(const WorldSolid& solid, const ContourSample& s) {
  if (s.source == ContourSample::Source::kEdge) return solid.edges[static_cast<std::size_t>(s.index)].weight;
  if (s.source == ContourSample::Source::kCircle)
    return solid.circles[static_cast<std::size_t>(s.index)].weight;
  return 1;
}

}  // namespace

double SceneIndex::ChanceHit(int view, const Vector2d& tangent) const {
  return std::clamp(
      density[static_cast<std::size_t>(view)][static_cast<std::size_t>(Bin(tangent))] * 2 * tolerance_px,
      kMinChance, 0.5);
}

SceneIndex MakeSceneIndex(std::span<const View> views, double tolerance_px, int threads) {
  constexpr double kReachFactor = 5;  // how far FitToLines may look, in tolerances
  SceneIndex scene;
  scene.views = views;
  scene.tolerance_px = tolerance_px;
  scene.lines.resize(views.size());
  scene.density.resize(views.size());
  ParallelFor(views.size(), threads, [&](std::size_t i) {
    scene.lines[i] = LineIndex(views[i], kReachFactor * tolerance_px);
    auto& bins = scene.density[i];
    bins.assign(SceneIndex::kDirectionBins, 0.0);
    const double area = double(views[i].camera->width_px) * views[i].camera->height_px;
    for (const auto& l : scene.lines[i].lines())
      bins[static_cast<std::size_t>(Bin(l.direction))] += l.length_px / area;
  });
  return scene;
}

std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, int most) {
  std::vector<Vector3d> points;
  for (const auto& v : solid.vertices) points.push_back(v.point);
  for (const auto& e : solid.edges)
    for (double t : {0.25, 0.5, 0.75})
      points.push_back((1 - t) * solid.vertices[std::size_t(e.start)].point +
                       t * solid.vertices[std::size_t(e.end)].point);
  for (const auto& c : solid.circles)
    for (int k = 0; k < 8; ++k)
      points.push_back(c.center.point +
                       c.radius_mm * (c.axis_u * std::cos(k * kPi / 4) + c.axis_v * std::sin(k * kPi / 4)));
  std::vector<std::pair<double, int>> seen;
  for (std::size_t i = 0; i < views.size(); ++i) {
    int inside = 0;
    double size = 0;
    for (const auto& p : points) {
      if (!views[i].ProjectInside(p)) continue;
      ++inside;
      size += views[i].camera->intrinsics.fx_px / (p - views[i].center_in_world).norm();
    }
    if (inside > 0) seen.push_back({-size, static_cast<int>(i)});
  }
  std::sort(seen.begin(), seen.end());
  if (static_cast<int>(seen.size()) > most) seen.resize(static_cast<std::size_t>(most));
  std::vector<int> out;
  for (const auto& s : seen) out.push_back(s.second);
  std::sort(out.begin(), out.end());
  return out;
}

Evidence Weigh(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
               const WeighOptions& options, const Occluders* others, const Claims* claims) {
  struct Tally {
    int visible = 0, supported = 0, free_visible = 0;  // free_visible: not explained by another part
    double px = 0, chance = 0;
    bool strong = true;
    double weight = 1;
  };
  Evidence out;
  std::map<std::pair<int, int>, std::vector<std::pair<double, double>>>
      by_edge;  // (source, index) -> (log odds, view weight)
  std::map<std::pair<int, int>, EdgeEvidence> edges;
  for (int v : views) {
    const View& view = scene.views[std::size_t(v)];
    const auto samples = SampleContour(solid, view, options.spacing_px, options.min_samples, others);
    std::map<std::pair<int, int>, Tally> tallies;
    std::map<std::array<int, 3>, std::pair<int, double>> lines;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto& s = samples[i];
      if (!s.visible) continue;
      const double weight = WeightOf(solid, s);
      if (weight <= 0) continue;
      auto& t = tallies[{int(s.source), s.index}];
      t.strong = IsStrong(solid, s);
      t.weight = weight;
      const LineHit hit =
          scene.lines[std::size_t(v)].Nearest(s.ideal, s.ideal_tangent, scene.tolerance_px, kMinCosine);
      ++t.visible;
      t.px += i > 0 && samples[i - 1].source == s.source && samples[i - 1].index == s.index
                  ? std::min(40.0, (s.ideal - samples[i - 1].ideal).norm())
                  : options.spacing_px / 2;
      t.chance += scene.ChanceHit(v, s.ideal_tangent);
      const bool is_claimed = hit.line >= 0 && claims && (*claims)[std::size_t(v)][std::size_t(hit.line)];
      if (is_claimed) continue;
      ++t.free_visible;
      if (hit.line < 0) continue;
      ++t.supported;
      if (options.keep_matches) {
        auto& l = lines[{hit.line, s.index, int(s.source)}];
        ++l.first;
        l.second += std::abs(hit.distance_px);
      }
    }
    if (!tallies.empty()) ++out.views;
    for (const auto& [key, t] : tallies) {
      auto& e = edges[key];
      e.source = ContourSample::Source(key.first);
      e.index = key.second;
      e.visible_px += t.px;
      out.visible_px += t.px;
      ++e.views;
      if (t.free_visible == 0) continue;
      const double share = double(t.supported) / t.free_visible;
      const double px = t.px * t.free_visible / t.visible;
      e.supported_px += share * px;
      out.supported_px += share * px;
      const double chance = t.chance / t.visible;
      const double detect = std::max(t.strong ? kDetectStrong : kDetectWeak, chance + 0.05);
      const double independent = std::min(kMaxIndependent, px / kIndependentPx);
      by_edge[key].push_back(
          {t.weight * independent *
               (share * std::log(detect / chance) + (1 - share) * std::log((1 - detect) / (1 - chance))),
           1.0});
    }
    for (const auto& [key, l] : lines) {
      if (l.first < 2 || key[2] == int(ContourSample::Source::kLimb)) continue;
      const int arc = scene.lines[std::size_t(v)].lines()[std::size_t(key[0])].arc;
      out.matches.push_back({v, arc < 0 ? key[0] : arc, key[1], arc >= 0, l.second / l.first});
    }
  }
  for (auto& [key, e] : edges) {
    const auto& votes = by_edge[key];
    double sum = 0;
    for (const auto& [llr, w] : votes) sum += llr;
    // Pictures of one edge fail together (its contrast is what it is): n pictures count as sqrt(n), twice at
    // least.
    if (!votes.empty()) e.log_odds = sum / std::sqrt(double(votes.size()));
    out.log_odds += e.log_odds;
    out.edges.push_back(e);
  }
  return out;
}

FitToLinesResult FitToLines(PlacedObject& object, std::span<const int> views, const SceneIndex& scene,
                            const std::vector<bool>& free, double first_reach_px, double last_reach_px,
                            int iterations, const Occluders* others) {
  FitToLinesResult result;
  const int n = object.StateSize();
  const auto defs = object.model->dimensions();
  for (int it = 0; it < iterations; ++it) {
    const double share = iterations > 1 ? it / double(iterations - 1) : 1;
    const double reach = first_reach_px + share * (last_reach_px - first_reach_px);
    const WorldSolid solid = PlaceSolid(object);
    Eigen::MatrixXd ata = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd atb = Eigen::VectorXd::Zero(n);
    double sum = 0;
    int count = 0;
    for (int v : views) {
      const View& view = scene.views[std::size_t(v)];
      for (const auto& s : SampleContour(solid, view, 8, 3, others)) {
        if (!s.visible) continue;
        const LineHit hit = scene.lines[std::size_t(v)].Nearest(s.ideal, s.ideal_tangent, reach, 0.99);
        if (hit.line < 0) continue;
        const Vector2d normal(-s.ideal_tangent.y(), s.ideal_tangent.x());
        const Eigen::RowVectorXd j =
            (normal.transpose() * IdealByWorld(view, s.point_in_world)) * SampleByState(solid, s);
        const double u = hit.distance_px / (0.5 * reach);
        const double w = 1 / (1 + u * u);
        ata += w * j.transpose() * j;
        atb += w * hit.distance_px * j.transpose();
        sum += hit.distance_px * hit.distance_px;
        ++count;
      }
    }
    result.samples = count;
    if (count < 4) return result;
    result.rms_px = std::sqrt(sum / count);
    result.information = ata;
    // A weak hold on everything (10 mm, 0.01 rad to a tenth of a sample's weight) keeps what no line moves.
    for (int i = 0; i < n; ++i) {
      const double scale = i >= 3 && i < kPlacementSize ? 0.01 : 10.0;
      ata(i, i) += 0.1 / (scale * scale);
      if (free[std::size_t(i)]) continue;
      ata.row(i).setZero();
      ata.col(i).setZero();
      ata(i, i) = 1;
      atb[i] = 0;
    }
    Eigen::VectorXd state = object.State() + Eigen::VectorXd(ata.ldlt().solve(atb));
    if (!state.allFinite()) return {};
    for (std::size_t i = 0; i < defs.size(); ++i) {
      double& d = state[kPlacementSize + int(i)];
      d = std::clamp(d, defs[i].min_mm, defs[i].max_mm);
    }
    object.SetState(state);
  }
  return result;
}

}  // namespace vss
