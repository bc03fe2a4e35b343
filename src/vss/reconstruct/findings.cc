#include "vss/reconstruct/findings.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "vss/base/median.h"
#include "vss/reconstruct/edge_bow.h"

namespace vss {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kFarPx = 0.5;  // an edge that lies farther off in most pictures does not belong to the part
constexpr std::size_t kEnoughViews = 3;  // to say so
constexpr double kBowChiSquare = 18.4;   // two degrees of freedom, 1 in 10000
constexpr double kStraightShare = 1e-3;  // of its length a mill's section may be off straight (EN 10034)
constexpr double kOutlyingSigmas = 4.5;  // 1 in 100000: of some hundred unknowns and dozens of views

std::string Place(const Vector3d& p) { return fmt::format("({:.0f}, {:.0f}, {:.0f})", p.x(), p.y(), p.z()); }

// "the edge from (0, 0, 20) to (1200, 0, 20)"
std::string NameOf(const WorldSolid& solid, ContourSample::Source source, int index) {
  const auto i = static_cast<std::size_t>(index);
  if (source == ContourSample::Source::kEdge) {
    const auto& e = solid.edges[i];
    return fmt::format("the edge from {} to {}",
                       Place(solid.vertices[static_cast<std::size_t>(e.start)].point),
                       Place(solid.vertices[static_cast<std::size_t>(e.end)].point));
  }
  if (source == ContourSample::Source::kCircle)
    return fmt::format("the rim around {}", Place(solid.circles[i].center.point));
  return fmt::format("the limb of the cylinder around {}", Place(solid.faces[i].axis_point));
}

EdgeResidual ResidualOf(const ObservationGroup& g) {
  EdgeResidual e;
  const auto& s = g.observations[0].sample;
  e.source = s.source;
  e.index = s.index;
  e.limb_side = s.limb_side;
  e.view = g.view;
  e.edge_class = g.edge_class;
  e.mean_px = -g.mean_px;
  double sum = 0, n = 0;
  for (const auto& o : g.observations)
    if (o.weight > 0) sum += o.residual_px * o.residual_px, ++n;
  e.rms_px = n > 0 ? std::sqrt(sum / n) : 0;
  e.num_points = static_cast<int>(n);
  e.used = g.weight > 0 && n > 0;
  return e;
}

// Root mean square of the edges' means; remarks on edges that lie off in most of their pictures.
void Summarise(const WorldSolid& solid, ReconstructedPart& part) {
  double sum = 0, n = 0;
  std::map<std::tuple<ContourSample::Source, int, int>, std::vector<double>> by_edge;
  for (const auto& e : part.edges) {
    by_edge[{e.source, e.index, e.limb_side}].push_back(std::abs(e.mean_px));
    if (!e.used) continue;
    sum += e.mean_px * e.mean_px;
    ++n;
  }
  part.residual_px = n > 0 ? std::sqrt(sum / n) : 0;
  for (const auto& [key, means] : by_edge)
    if (means.size() >= kEnoughViews && Median(means) > kFarPx)
      part.remarks.push_back(
          fmt::format("{} lies {:.2f} px off in the middle of {} pictures: the part is bent there or of "
                      "another kind",
                      NameOf(solid, std::get<0>(key), std::get<1>(key)), Median(means), means.size()));
}

void AddStraightness(const EdgeBow& bow, const WorldSolid& solid, ReconstructedPart& part) {
  const auto& e = solid.edges[static_cast<std::size_t>(bow.edge)];
  const double length = (solid.vertices[static_cast<std::size_t>(e.end)].point -
                         solid.vertices[static_cast<std::size_t>(e.start)].point)
                            .norm();
  const double size = bow.bow_mm.norm();
  const Vector3d direction = size > 0 ? Vector3d(bow.bow_mm / size) : Vector3d::UnitZ();
  const double sigma = std::sqrt(direction.dot(bow.covariance * direction));
  if (sigma > kStraightShare * length) return;  // nothing is known of it
  part.straightness.push_back({bow.edge, size, sigma, bow.chi_square, bow.num_views});
  if (bow.chi_square < kBowChiSquare || size < kStraightShare * length) return;
  part.remarks.push_back(
      fmt::format("{} is bent: its middle lies {:.1f} mm (+- {:.1f}) off straight in {} pictures",
                  NameOf(solid, ContourSample::Source::kEdge, bow.edge), size, sigma, bow.num_views));
}

std::string MovedSentence(const CameraCorrection& r) {
  const bool one = r.views.size() == 1;
  return fmt::format(
      "{} {} does not stand where its calibration says: turned by {:.2f} mrad and moved by {:.1f} mm "
      "(chi-square {:.1f} per degree of freedom); it was adjusted, calibrate it again",
      one ? "the picture of camera" : "camera", r.camera, r.rotation_rad.norm() * 1e3, r.shift_mm.norm(),
      r.significance);
}

// x, y, z and the dimensions: what is said in mm.
std::string UnknownName(const ReconstructedPart& part, Eigen::Index i) {
  static const char* const places[] = {"x", "y", "z"};
  if (i < 3) return places[i];
  return part.dimensions[static_cast<std::size_t>(i - kPlacementSize)].name;
}

// Takes unknown i of part p into `influence` where it would change most: in its own sigmas, but what
// contradicts the other views comes first.
void Consider(const ReconstructedPart& part, int p, Eigen::Index i, const Adjustment::Change& change,
              double& most, ViewInfluence& influence) {
  constexpr double kAlone = 3;      // what the other views know so much less says nothing of this one
  constexpr double kMatters = 0.3;  // of its sigma: less changes nothing
  const bool in_mm = i < 3 || i >= kPlacementSize;
  const double own = std::sqrt(std::max(0.0, part.covariance(i, i))), sigma = change.sigma[i];
  if (!in_mm || !part.observable[static_cast<std::size_t>(i)] || !(own > 0) || !(sigma > 0)) return;
  const double in_own = std::abs(change.step[i]) / own, in_sigmas = std::abs(change.step[i]) / sigma;
  const bool outlying = in_sigmas > kOutlyingSigmas && in_own > kMatters && sigma < kAlone * own;
  if (influence.outlying && !outlying) return;
  if (outlying == influence.outlying && in_own <= most) return;
  most = in_own;
  influence.part = p;
  influence.unknown = UnknownName(part, i);
  influence.change_mm = change.step[i];
  influence.sigma_mm = sigma;
  influence.outlying = outlying;
}

}  // namespace

void AddEdgeFindings(const Adjustment& a, Reconstruction& out) {
  for (const auto& g : a.groups) {
    auto& part = out.parts[static_cast<std::size_t>(g.part)];
    out.num_observations += static_cast<int>(g.observations.size());
    part.edges.push_back(ResidualOf(g));
    if (part.edges.back().used && (part.views.empty() || part.views.back() != g.view))
      part.views.push_back(g.view);
  }
  std::vector<WorldSolid> solids;
  for (std::size_t p = 0; p < out.parts.size(); ++p) {
    auto& part = out.parts[p];
    solids.push_back(PlaceSolid(part.object, false));
    Summarise(solids[p], part);
    if (part.views.empty())
      out.warnings.push_back(
          fmt::format("part {} ({}): no picture shows an edge of it that could be measured; its values are "
                      "those of identification",
                      p + 1, part.object.model->kind()));
  }
  for (const auto& bow : EdgeBows(a)) {
    const auto p = static_cast<std::size_t>(bow.part);
    AddStraightness(bow, solids[p], out.parts[p]);
  }
}

void AddCameraFindings(const Adjustment& a, const std::vector<double>& significance, Reconstruction& out) {
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const auto& camera = a.cameras[c];
    CameraCorrection r;
    r.camera = camera.camera->id;
    r.views = camera.views;
    r.rotation_rad = camera.value.head<3>();
    r.shift_mm = camera.value.segment<3>(3);
    const VectorXd sigma = a.CameraCovariance(static_cast<int>(c)).diagonal().cwiseMax(0).cwiseSqrt();
    r.rotation_sigma_rad = sigma.head<3>();
    r.shift_sigma_mm = sigma.segment<3>(3);
    r.significance = c < significance.size() ? significance[c] : 0;
    r.moved = camera.loosened;
    if (r.moved) out.warnings.push_back(MovedSentence(r));
    out.cameras.push_back(std::move(r));
  }
  for (std::size_t s = 0; s < a.stops.size(); ++s)
    out.stops.push_back({a.stops[s].stop, a.stops[s].value,
                         a.StopCovariance(static_cast<int>(s)).diagonal().cwiseMax(0).cwiseSqrt()});
}

void AddInfluences(const Adjustment& a, Reconstruction& out) {
  std::map<int, ViewInfluence> by_view;
  for (const auto& g : a.groups) {
    if (g.weight <= 0) continue;
    ViewInfluence& v = by_view[g.view];
    v.view = g.view;
    v.rms_px += g.mean_px * g.mean_px;
    ++v.num_edges;
  }
  for (auto& [view, influence] : by_view) {
    influence.rms_px = std::sqrt(influence.rms_px / influence.num_edges);
    const auto changes = a.ChangesWithout(view);
    double most = -1;
    for (std::size_t p = 0; p < changes.size(); ++p)
      for (Eigen::Index i = 0; i < changes[p].step.size(); ++i)
        Consider(out.parts[p], static_cast<int>(p), i, changes[p], most, influence);
    if (most >= 0) out.influences.push_back(influence);
  }
}

void AddScale(const Adjustment& a, double picture_sigma_mm, Reconstruction& out) {
  const auto views = a.AdjustedViews();
  const bool gantry = !a.stops.empty();
  double longest = 0;
  for (const auto& v : views)
    for (const auto& w : views)
      if ((v.stop >= 0) == gantry && (w.stop >= 0) == gantry && (!gantry || v.camera == w.camera))
        longest = std::max(longest, (v.center_in_world - w.center_in_world).norm());
  const double place_sigma = gantry ? a.options.stop_sigma_mm * a.stop_scale : picture_sigma_mm;
  const double sigma = longest > 0 ? std::sqrt(2.0) * place_sigma / longest : INFINITY;
  if (a.options.known_lengths.empty()) {
    out.scale = {gantry ? ScaleFinding::From::kGantry : ScaleFinding::From::kPictures, 0, sigma};
    return;
  }
  out.scale = {ScaleFinding::From::kKnownLength, a.scale, a.ScaleSigma()};
  constexpr double kContradiction = 3;  // sigmas
  if (gantry && std::abs(a.scale) > kContradiction * std::hypot(sigma, a.ScaleSigma()))
    out.warnings.push_back(
        fmt::format("the known length and the gantry disagree by {:.0f} ppm (+- {:.0f}); the known length "
                    "was believed: check it, and the gantry's calibration",
                    1e6 * a.scale, 1e6 * std::hypot(sigma, a.ScaleSigma())));
}

void AddGround(const Adjustment& a, Reconstruction& out) {
  if (!a.ground.free) return;
  GroundFinding ground;
  double n = 0;
  for (const auto& p : a.parts)
    if (p.stands_on == -1) ground.at += p.object.placement.head<2>(), ++n;
  if (n > 0) ground.at /= n;
  const Eigen::Matrix3d c = a.GroundCovariance();
  const Vector3d by_value(1, ground.at.x(), ground.at.y());
  ground.height_mm = a.ground.HeightAt(ground.at.x(), ground.at.y());
  ground.sigma_mm = std::sqrt(std::max(0.0, by_value.dot(c * by_value)));
  ground.slope = a.ground.value.tail<2>();
  ground.slope_sigma = c.diagonal().tail<2>().cwiseMax(0).cwiseSqrt();
  out.warnings.push_back(fmt::format(
      "the workpiece does not stand on z = 0: under its middle the ground lies at {:.2f} mm (+- {:.2f}) and "
      "rises by {:.2f} mm (+- {:.2f}) per metre along x and {:.2f} mm (+- {:.2f}) along y; heights are given "
      "in the world as it is: check the cameras' heights where the floor should be level",
      ground.height_mm, ground.sigma_mm, 1e3 * ground.slope.x(), 1e3 * ground.slope_sigma.x(),
      1e3 * ground.slope.y(), 1e3 * ground.slope_sigma.y()));
  out.ground = ground;
}

}  // namespace vss
