// Simulated scenes for the reconstruction benchmark: with noise alone, against the Cramer-Rao bound; with all
// that disturbs and cameras off by errors drawn from a calibration's covariance, against the regions given.
#pragma once
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCore>

#include "reconstruct_survey.h"
#include "vss/simulate/random_scene.h"
#include "vss/simulate/simulate.h"

namespace vss::benchmark {

struct Rendered {
  std::vector<GreyImage> images;
  std::vector<LineImage> lines;
  std::vector<View> views;
  std::vector<GreyView> pictures;
};

// `cameras`: what is known of the scene's cameras, in their order.
inline Rendered Render(const SimulatedScene& scene, const std::vector<Camera>& cameras) {
  Rendered r;
  r.images.resize(scene.pictures.size());
  OrStop(RenderPictures(scene, 1, {},
                        [&](int i, const RenderedPicture& p) { r.images[std::size_t(i)] = p.image; }));
  r.lines.resize(r.images.size());
  std::vector<Eigen::Vector3d> stops;
  for (std::size_t i = 0; i < r.images.size(); ++i) {
    const ScenePicture& p = scene.pictures[i];
    const Camera& camera = cameras[std::size_t(p.camera)];
    const auto at = std::find(stops.begin(), stops.end(), *p.gantry_mm);
    const int stop = static_cast<int>(at - stops.begin());
    if (at == stops.end()) stops.push_back(*p.gantry_mm);
    r.lines[i] = DetectLines(r.images[i].view(), &camera.intrinsics, {});
    r.views.push_back(MakeView(static_cast<int>(i), camera, Gantry{}.CamFromWorld(camera, *p.gantry_mm), stop,
                               &r.lines[i]));
    r.pictures.push_back(r.images[i].view());
  }
  return r;
}

inline std::vector<IdentifiedPart> PartsOf(const SimulatedScene& scene) {
  std::vector<IdentifiedPart> out;
  for (const auto& part : scene.parts) {
    IdentifiedPart p;
    p.object = part.object;
    for (std::size_t i = 0; i < scene.parts.size(); ++i)
      if (scene.parts[i].id == part.stands_on) p.stands_on = static_cast<int>(i);
    out.push_back(std::move(p));
  }
  return out;
}

// --- noise alone ---

inline constexpr double kNoise = 6;  // grey levels: well above the rounding to 8 bit and the renderer's edges

// Even light from above, plain surfaces, one grey for all parts, the ground darker; parts on the ground only.
inline SimulatedScene DrawPlainScene(std::uint64_t seed, const KnowledgeBase& knowledge) {
  RandomSceneOptions options;
  options.seed = seed;
  options.layout = Layout::kMixed;
  options.num_parts = 4;
  options.clutter = false;
  options.rig.stops = {2, 1};
  SimulatedScene scene = OrStop(DrawRandomScene(options, knowledge));
  std::erase_if(scene.parts, [](const auto& p) { return p.stands_on != "ground"; });
  scene.ground = {0.1, 0, 0, 0};
  for (auto& p : scene.parts) p.material = {0.45, 0, 0, 0};
  scene.lamps.clear();
  scene.ambient = 1;
  scene.shadows = false;  // which darken the floor towards a foot as no step does
  for (auto& c : scene.cameras) c.read_noise = kNoise, c.shot_noise = 0, c.vignetting = 0;
  return scene;
}

// The unknowns of a part that stands upright on known ground; a pipe's yaw is nothing.
inline std::vector<int> UnknownsOf(const PlacedObject& object) {
  std::vector<int> unknowns{0, 1};
  if (object.model->kind() != "pipe") unknowns.push_back(3);
  for (std::size_t i = 0; i < object.dimensions_mm.size(); ++i)
    unknowns.push_back(kPlacementSize + static_cast<int>(i));
  return unknowns;
}

inline std::vector<GreyImage> Pictures(const SimulatedScene& scene) {
  std::vector<GreyImage> images(scene.pictures.size());
  OrStop(RenderPictures(scene, 1, {},
                        [&](int i, const RenderedPicture& p) { images[std::size_t(i)] = p.image; }));
  return images;
}

// Cramer-Rao bound of all parts' unknowns together, part by part in their order: the inverse of Fisher's
// information J^T J / sigma^2, where J holds what each pixel of the pictures without noise changes by with
// each unknown: rendered with the unknown a little less and a little more.
inline Eigen::MatrixXd CramerRaoBound(SimulatedScene scene) {
  constexpr double kStepMm = 1.5;     // a quarter of a pixel: the difference still follows the derivative
  constexpr int kRoundingLevels = 1;  // smaller differences are those of rounding to 8 bits
  for (auto& c : scene.cameras) c.read_noise = 0;
  std::vector<Eigen::SparseVector<double>> columns;
  for (auto& part : scene.parts) {
    const Eigen::VectorXd state = part.object.State();
    const auto& dims = part.object.dimensions_mm;
    const double longest_mm = *std::max_element(dims.begin(), dims.end());
    for (int unknown : UnknownsOf(part.object)) {
      const double step = unknown == 3 ? kStepMm / (longest_mm / 2) : kStepMm;
      const auto at = [&](double by) {
        Eigen::VectorXd x = state;
        x[unknown] += by;
        part.object.SetState(x);
        return Pictures(scene);
      };
      const auto less = at(-step), more = at(step);
      const Eigen::Index pixels = Eigen::Index(less[0].width()) * less[0].height();
      Eigen::SparseVector<double> column(pixels * Eigen::Index(less.size()));
      Eigen::Index k = 0;
      for (std::size_t i = 0; i < less.size(); ++i)
        for (int v = 0; v < less[i].height(); ++v)
          for (int u = 0; u < less[i].width(); ++u, ++k) {
            const int difference = more[i].view().At(u, v) - less[i].view().At(u, v);
            if (std::abs(difference) > kRoundingLevels) column.insertBack(k) = difference / (2 * step);
          }
      columns.push_back(std::move(column));
    }
    part.object.SetState(state);
  }
  const auto n = static_cast<Eigen::Index>(columns.size());
  Eigen::MatrixXd information(n, n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b <= a; ++b)
      information(a, b) = information(b, a) =
          columns[std::size_t(a)].dot(columns[std::size_t(b)]) / (kNoise * kNoise);
  return information.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
}

// The bound as a sigma of every part's unknowns, and of its vertices' coordinates as a sum of variances.
inline nlohmann::json NoiseBound(std::uint64_t seed, const KnowledgeBase& knowledge) {
  const SimulatedScene scene = DrawPlainScene(seed, knowledge);
  const Eigen::MatrixXd all = CramerRaoBound(scene);
  nlohmann::json out = nlohmann::json::array();
  Eigen::Index at = 0;
  for (const auto& part : scene.parts) {
    const std::vector<int> unknowns = UnknownsOf(part.object);
    const auto size = static_cast<Eigen::Index>(unknowns.size());
    const Eigen::MatrixXd bound = all.block(at, at, size, size);
    at += size;
    nlohmann::json found;
    for (Eigen::Index i = 0; i < size; ++i) found["sigmas"].push_back(std::sqrt(bound(i, i)));
    double variance = 0;
    for (const auto& v : PlaceSolid(part.object).vertices) {
      const Eigen::MatrixXd j = Eigen::MatrixXd(v.by_state)(Eigen::all, unknowns);
      variance += (j * bound * j.transpose()).trace();
    }
    found["vertices"] = variance;
    out.push_back(found);
  }
  return out;
}

// Errors of each unknown (place, yaw, dimensions) with the sigma that is given, and of the vertices, squared,
// in sum.
inline nlohmann::json NoiseTrial(std::uint64_t seed, const KnowledgeBase& knowledge) {
  const SimulatedScene scene = DrawPlainScene(seed, knowledge);
  std::vector<Camera> cameras;
  for (const auto& c : scene.cameras) cameras.push_back(c.camera);
  const Rendered noisy = Render(scene, cameras);
  const auto truth = PartsOf(scene);
  std::mt19937 random(static_cast<unsigned>(seed));
  ReconstructOptions options;
  options.adjust_cameras = options.allow_tilt = false;
  options.ground_sigma_mm = 1e-3;
  options.free_bias_px = options.contact_bias_px = options.round_bias_px = options.shadowed_bias_px = 1e-3;
  const auto result =
      OrStop(ReconstructScene(noisy.views, noisy.pictures, Moved(truth, 3, 0.2, random), options, 1, {}));
  nlohmann::json out = nlohmann::json::array();
  for (std::size_t p = 0; p < truth.size(); ++p) {
    const auto& part = result.parts[p];
    bool all = true;
    for (const auto& d : part.dimensions) all &= d.observable;
    nlohmann::json found = {{"kind", truth[p].object.model->kind()}, {"observable", all}};
    for (int unknown : UnknownsOf(truth[p].object)) {
      found["unknowns"].push_back(unknown);
      found["errors"].push_back(part.object.State()[unknown] - truth[p].object.State()[unknown]);
      found["sigmas"].push_back(std::sqrt(part.covariance(unknown, unknown)));
    }
    double squares = 0;
    const auto is = PlaceSolid(part.object, false), should = PlaceSolid(truth[p].object, false);
    for (std::size_t k = 0; k < is.vertices.size(); ++k)
      squares += (is.vertices[k].point - should.vertices[k].point).squaredNorm();
    found["vertices"] = squares;
    out.push_back(found);
  }
  return out;
}

// --- calibration errors ---

// fx fy cx cy, distortion, rotation, translation: the order of CalibrationQuality.
inline Camera Disturbed(Camera camera, const Eigen::VectorXd& by) {
  auto& k = camera.intrinsics;
  const int d = k.num_distortion;
  k.fx_px += by[0], k.fy_px += by[1], k.cx_px += by[2], k.cy_px += by[3];
  for (int i = 0; i < d; ++i) k.distortion[std::size_t(i)] += by[4 + i];
  auto& place = *camera.cam_from_world;
  place.rotation = RotationFromVector(by.segment<3>(4 + d)) * place.rotation;
  place.translation += by.segment<3>(7 + d);
  return camera;
}

inline Eigen::VectorXd Draw(const Eigen::MatrixXd& covariance, std::mt19937& random) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  std::normal_distribution<double> normal;
  Eigen::VectorXd z(covariance.rows());
  for (auto& x : z) x = normal(random);
  return eigen.eigenvectors() * (eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * z);
}

inline void Show(const ReconstructedPart& part, const PlacedObject& truth, std::size_t index) {
  fmt::print("{} {}{}\n", index + 1, truth.model->kind(), part.leans ? " leans" : "");
  for (int i = 0; i < 4; ++i)
    fmt::print("   {:<14} error {:9.4f} sigma {:8.4f}\n",
               std::string(i == 3 ? "yaw" : std::string(1, "xyz"[i])),
               part.object.placement[i] - truth.placement[i], std::sqrt(part.covariance(i, i)));
  for (std::size_t i = 0; i < part.dimensions.size(); ++i) {
    const auto& d = part.dimensions[i];
    fmt::print("   {:<14} {:9.3f} error {:8.3f} sigma {:7.3f} {}\n", d.name, d.value_mm,
               d.value_mm - truth.dimensions_mm[i], d.sigma_mm, d.observable ? "" : d.origin);
  }
  const auto solid = PlaceSolid(truth, false);
  for (const auto& e : part.edges) {
    std::string where;
    if (e.source == ContourSample::Source::kEdge) {
      const auto& edge = solid.edges[static_cast<std::size_t>(e.index)];
      const auto &a = solid.vertices[static_cast<std::size_t>(edge.start)].point,
                 &b = solid.vertices[static_cast<std::size_t>(edge.end)].point;
      where = fmt::format("z {:.0f} {:.0f} length {:.0f}", a.z(), b.z(), (a - b).norm());
    }
    fmt::print("   {} {:>2} {:>2} class {} view {:>2} mean {:7.3f} rms {:6.3f} points {:>3} {} {}\n",
               static_cast<int>(e.source), e.index, e.limb_side, static_cast<int>(e.edge_class), e.view,
               e.mean_px, e.rms_px, e.num_points, e.used ? "" : "NOT USED", where);
  }
  for (const auto& r : part.remarks) fmt::print("   {}\n", r);
}

// To look at where a region misses the truth: of place, yaw and dimensions error, sigma, whether it is called
// observable, and where a value that is not comes from.
inline nlohmann::json UnknownErrors(const ReconstructedPart& part, const PlacedObject& truth) {
  nlohmann::json out = nlohmann::json::array();
  const Eigen::VectorXd error = part.object.State() - truth.State();
  const char* const places[] = {"x", "y", "z", "yaw", "tilt x", "tilt y"};
  for (int i = 0; i < part.object.StateSize(); ++i) {
    const bool is_place = i < kPlacementSize;
    const auto d = static_cast<std::size_t>(i - kPlacementSize);
    out.push_back({{"name", is_place ? std::string(places[i]) : part.dimensions[d].name},
                   {"error", error[i]},
                   {"sigma", std::sqrt(std::max(0.0, part.covariance(i, i)))},
                   {"observable", static_cast<bool>(part.observable[static_cast<std::size_t>(i)])}});
    if (!is_place && !part.dimensions[d].observable) out.back()["origin"] = part.dimensions[d].origin;
  }
  return out;
}

// One scene of five parts in eight pictures of the calibrated rig: shadows, texture, noise; the rig truly
// stands off its files by errors of their covariance, the stops by 0.15 mm.
inline nlohmann::json CalibratedTrial(std::uint64_t seed, const KnowledgeBase& knowledge,
                                      const std::vector<Camera>& calibrated, bool show = false) {
  constexpr double kStopSigmaMm = 0.15;
  RandomSceneOptions options;
  options.seed = seed;
  options.num_parts = 5;
  options.rig.stops = {2, 1};
  SimulatedScene scene = OrStop(DrawRandomScene(options, knowledge));
  std::mt19937 random(static_cast<unsigned>(seed));
  for (std::size_t c = 0; c < scene.cameras.size(); ++c)
    scene.cameras[c].camera = Disturbed(calibrated[c], Draw(calibrated[c].quality->covariance, random));
  std::vector<double> stops_x, stops_y;
  for (const auto& p : scene.pictures) {
    if (std::find(stops_x.begin(), stops_x.end(), p.gantry_mm->x()) == stops_x.end())
      stops_x.push_back(p.gantry_mm->x());
    if (std::find(stops_y.begin(), stops_y.end(), p.gantry_mm->y()) == stops_y.end())
      stops_y.push_back(p.gantry_mm->y());
  }
  scene.pictures.clear();
  AddStops(stops_x, stops_y, kStopSigmaMm, scene);
  const Rendered r = Render(scene, calibrated);
  const auto truth = PartsOf(scene);
  ReconstructOptions reconstruct;
  reconstruct.stop_sigma_mm = kStopSigmaMm;
  reconstruct.draw_to_lines = false;  // it is measuring that is tested, from near
  reconstruct.search_px = 1.5;
  const auto result =
      OrStop(ReconstructScene(r.views, r.pictures, Moved(truth, 1, 0.05, random), reconstruct, 1, {}));
  if (show)
    for (std::size_t v = 0; v < r.images.size(); ++v) {
      const auto png = EncodePng(r.images[v].view());
      OrStop(
          WriteFileAtomically(fmt::format("scene-{}-{}.png", seed, v), std::string(png.begin(), png.end())));
    }
  nlohmann::json out = nlohmann::json::array();
  for (std::size_t p = 0; p < truth.size(); ++p) {
    const Errors e = ErrorsOf(result.parts[p], truth[p].object);
    if (show) Show(result.parts[p], truth[p].object, p);
    out.push_back({{"kind", truth[p].object.model->kind()},
                   {"leans", result.parts[p].leans},
                   {"vertex_mm", e.vertex_mm},
                   {"vertex_z", e.vertex_z},
                   {"dimension_mm", e.dimension_mm},
                   {"dimension_z", e.dimension_z},
                   {"region", e.region},
                   {"region_size", e.region_size},
                   {"not_observable", e.not_observable},
                   {"unknowns", UnknownErrors(result.parts[p], truth[p].object)}});
  }
  return {{"parts", out}};
}

}  // namespace vss::benchmark
