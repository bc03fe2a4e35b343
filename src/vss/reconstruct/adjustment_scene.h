// A scene for the adjustment's tests: exact observations of known parts, with normal noise.
#pragma once
#include <Eigen/Cholesky>
#include <map>
#include <random>

#include "vss/knowledge/object_model.h"
#include "vss/reconstruct/adjustment.h"

namespace vss::test {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Two cameras on a carriage, four stops, a box and a tee that stands on it.
struct Scene {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box", "tee"}, ".");
  std::vector<Camera> cameras;
  std::vector<View> views;
  std::vector<AdjustedPart> parts;

  Scene() {
    for (double side : {-1.0, 1.0}) {
      Camera c;
      c.id = side < 0 ? "left" : "right";
      c.width_px = c.height_px = 512;
      c.intrinsics.fx_px = c.intrinsics.fy_px = 520;
      c.intrinsics.cx_px = c.intrinsics.cy_px = 255.5;
      // Looks down, tilted inwards.
      const Eigen::Matrix3d down = Eigen::Vector3d(1, -1, -1).asDiagonal();
      c.cam_from_world = RigidTransform{RotationFromVector({0, 0.35 * side, 0}) * down, Vector3d::Zero()};
      c.cam_from_world->translation = -c.cam_from_world->rotation * Vector3d(side * 1000, 0, 3000);
      cameras.push_back(c);
    }
    for (int stop = 0; stop < 4; ++stop)
      for (const auto& c : cameras)
        views.push_back(MakeView(static_cast<int>(views.size()), c,
                                 Gantry{}.CamFromWorld(c, {100.0 * stop, 400.0 * stop - 600, 0}), stop,
                                 nullptr));
    Add("box", {30, -80, 0, 0.3, 0, 0}, {900, 500, 60}, -1);
    Add("tee", {60, -60, 60, 0.7, 0, 0}, {600, 160, 220, 25, 30}, 0);
  }

  void Add(const std::string& kind, const Eigen::Matrix<double, 6, 1>& placement, std::vector<double> dims,
           int on) {
    AdjustedPart p;
    p.object = {knowledge.Find(kind), 0, placement, std::move(dims)};
    p.stands_on = on;
    const int n = p.object.StateSize();
    p.free.assign(static_cast<std::size_t>(n), true);
    p.free[4] = p.free[5] = false;
    p.prior_value = p.object.State();
    p.prior_sigma = VectorXd::Constant(n, 1000);
    parts.push_back(p);
  }

  Adjustment Make() const {
    AdjustmentOptions options;
    options.ground_sigma_mm = options.contact_sigma_mm = 0.01;
    options.bias_px.fill(1e-3);  // the simulation has none
    options.short_edge_bias = 0;
    PriorOptions priors{5e-5, 0.1, 0, 0};
    return Adjustment(views, parts, MakeCameras(views, priors), MakeStops(views), options);
  }
};

// Exact observations of the contour of `truth`, with normal noise.
inline void Observe(const Adjustment& truth, double sigma, std::mt19937& random,
                    std::vector<ObservationGroup>& groups) {
  std::normal_distribution<double> noise(0, sigma);
  std::vector<WorldSolid> solids;
  for (const auto& p : truth.parts) solids.push_back(PlaceSolid(p.object, false));
  const auto others = OthersOf(solids);
  const auto views = truth.AdjustedViews();
  for (std::size_t v = 0; v < views.size(); ++v) {
    std::map<std::pair<int, int>, std::size_t> index;
    for (const auto& piece : CutContour(solids, others, views[v], {})) {
      const std::pair key(piece.part, ContourKey(piece.sample));
      const auto [at, fresh] = index.insert({key, groups.size()});
      if (fresh) {
        ObservationGroup g;
        g.part = piece.part, g.view = static_cast<int>(v), g.contour = key.second;
        groups.push_back(g);
      }
      Observation o;
      o.sample = piece.sample;
      o.normal = piece.curve.normal;
      o.measured = piece.curve.point + noise(random) * piece.curve.normal;
      o.sigma_px = sigma;
      o.contrast = 50;
      groups[at->second].observations.push_back(o);
    }
  }
}

inline VectorXd Draw(const MatrixXd& covariance, std::mt19937& random) {
  std::normal_distribution<double> normal;
  VectorXd z(covariance.rows());
  for (auto& x : z) x = normal(random);
  return covariance.llt().matrixL() * z;
}

// The scene as it may truly be: cameras off by their priors, stops by 0.15 mm.
inline Adjustment DrawnTruth(const Scene& scene, std::mt19937& random) {
  Adjustment truth = scene.Make();
  for (auto& c : truth.cameras) c.value = Draw(c.prior_covariance, random);
  for (auto& s : truth.stops) s.value = Draw(Eigen::Matrix3d::Identity() * 0.15 * 0.15, random);
  return truth;
}

}  // namespace vss::test
