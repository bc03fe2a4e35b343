#include "vss/calibrate/cube.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "vss/base/median.h"
#include "vss/calibrate/cube_geometry.h"
#include "vss/calibrate/cube_start.h"
#include "vss/calibrate/maps.h"

namespace vss {
namespace {

using cube::Geometry;
using cube::VisibleEdge;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// What is known of the classes beforehand: how far their edges may lie off together (estimated within this
// sigma), and how far each edge may lie off by itself at full contrast. Measured on rendered and real cubes:
// chamfer and light move edges by up to 0.1 px; a contact shadow pulls edges on the floor by 0.1 to 0.4 px,
// unevenly; uprights suffer from low contrast.
struct ClassPrior {
  const char* name;
  double bias_sigma_px, edge_sigma_px;
};
constexpr ClassPrior kPriors[kNumCubeEdgeClasses] = {{"top, against the floor", 0.1, 0.02},
                                                     {"top, against a side", 0.1, 0.02},
                                                     {"upright, against the floor", 0.15, 0.04},
                                                     {"upright, between sides", 0.15, 0.04},
                                                     {"floor", 0.4, 0.15}};
constexpr double kSampleSpacingPx = 4, kSampleHalfLengthPx = 2;
constexpr double kClearancePx =
    5.5;  // to other edges of the cube: the window of a sample sees one edge alone
constexpr double kMinSampleSigmaPx = 0.02;  // model error of a sample, whatever its noise
constexpr int kMinSamples = 20;             // in all pictures together
constexpr double kMinAgreement = 0.4;       // of the samples that a cube would show

struct Observation {
  int picture = 0, edge = 0;
  CubeEdgeClass edge_class = CubeEdgeClass::kTopOuter;
  Vector3d point;    // world, on the model edge
  Vector2d outward;  // img, unit
  Vector2d seen;     // img
  double sigma_px = 0, contrast = 0, weight = 0, residual_px = 0;
};

struct Rig {
  const Intrinsics& lens;
  const Geometry& geometry;
  const std::vector<CubePicture>& pictures;
};

// The unknowns of a camera: its pose at the middle of its stops, where rotation and translation are least
// entangled.
struct Unknowns {
  RigidTransform cam_from_world;  // at gantry displacement `middle`
  Vector3d middle;
  Matrix3d axes;
  double bias_px[kNumCubeEdgeClasses] = {};
  double scale = 1;  // of the cube about the middle of its base
  Vector3d base = Vector3d::Zero();

  RigidTransform At(const Vector3d& gantry) const {
    RigidTransform t = cam_from_world;
    t.translation -= t.rotation * (axes * (gantry - middle));
    return t;
  }
};

double DistanceToSegment(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const Vector2d d = b - a;
  const double s = std::clamp(d.dot(p - a) / std::max(1e-12, d.squaredNorm()), 0.0, 1.0);
  return (p - a - s * d).norm();
}

// Samples along every visible edge, each measured across.
std::vector<Observation> Measure(const Rig& rig, const Unknowns& x, double reach_px) {
  std::vector<Observation> observations;
  for (std::size_t k = 0; k < rig.pictures.size(); ++k) {
    const RigidTransform pose = x.At(rig.pictures[k].gantry_mm);
    const auto edges = VisibleEdges(rig.geometry, pose.Inverse().translation);
    std::vector<std::pair<Vector2d, Vector2d>> ends(edges.size());
    std::vector<bool> projected(edges.size(), false);
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const auto& e = rig.geometry.edge[edges[i].edge];
      const auto a = rig.lens.Project(pose * rig.geometry.corner[e.from]),
                 b = rig.lens.Project(pose * rig.geometry.corner[e.to]);
      projected[i] = a && b;
      if (projected[i]) ends[i] = {*a, *b};
    }
    for (std::size_t i = 0; i < edges.size(); ++i) {
      if (!projected[i]) continue;
      const auto& e = rig.geometry.edge[edges[i].edge];
      const Vector3d from = rig.geometry.corner[e.from], to = rig.geometry.corner[e.to];
      Vector3d inner = Vector3d::Zero();
      for (int c : rig.geometry.face[edges[i].inner_face].corner) inner += 0.25 * rig.geometry.corner[c];
      const auto inner_img = rig.lens.Project(pose * inner);
      const double length = (ends[i].second - ends[i].first).norm();
      const int samples = static_cast<int>(length / kSampleSpacingPx);
      for (int s = 0; s < samples; ++s) {
        const Vector3d point = from + (s + 0.5) / samples * (to - from);
        const auto p = rig.lens.Project(pose * point),
                   q = rig.lens.Project(pose * (point + 0.5 / samples * (to - from)));
        if (!p || !q || !inner_img) continue;
        bool clear = true;
        for (std::size_t j = 0; j < edges.size() && clear; ++j)
          clear =
              j == i || !projected[j] || DistanceToSegment(*p, ends[j].first, ends[j].second) > kClearancePx;
        if (!clear) continue;
        const Vector2d along = (*q - *p).normalized();
        Vector2d outward(-along.y(), along.x());
        if (outward.dot(*p - *inner_img) < 0) outward = -outward;
        const auto offset =
            MeasureEdge(rig.pictures[k].image.view(), *p, outward, reach_px, kSampleHalfLengthPx);
        if (!offset) continue;
        observations.push_back({static_cast<int>(k), edges[i].edge, edges[i].edge_class, point, outward,
                                *p + offset->offset_px * outward,
                                std::max(kMinSampleSigmaPx, offset->sigma_px), offset->contrast, 0, 0});
      }
    }
  }
  return observations;
}

// Residual of an observation, and by pose (6), scale (1) and axes (9, row by row).
bool Residual(const Rig& rig, const Unknowns& x, const Observation& o, double& r,
              Eigen::Matrix<double, 1, 16>* j) {
  const Vector3d point = x.base + x.scale * (o.point - x.base);
  const RigidTransform pose = x.At(rig.pictures[o.picture].gantry_mm);
  Eigen::Matrix<double, 2, 3> by_point;
  const auto img = rig.lens.Project(pose * point, j ? &by_point : nullptr);
  if (!img) return false;
  r = o.outward.dot(o.seen - *img) - x.bias_px[static_cast<int>(o.edge_class)];
  if (!j) return true;
  const Eigen::RowVector3d n = o.outward.transpose() * by_point;
  const Vector3d travel = rig.pictures[o.picture].gantry_mm - x.middle;
  const Vector3d rotated = x.cam_from_world.rotation * (point - x.axes * travel);
  j->leftCols<3>() = -n * CrossMatrix(rotated);
  j->segment<3>(3) = n;
  (*j)[6] = n * (x.cam_from_world.rotation * (o.point - x.base));
  const Eigen::RowVector3d by_moved = -n * x.cam_from_world.rotation;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) (*j)[7 + 3 * a + b] = by_moved[a] * travel[b];
  return true;
}

struct EdgeState {
  std::vector<double> residual, contrast;
  double middle_px = 0, spread_px = 0, sigma_px = 0, trust = 1;
};

// What is typical of each edge of each picture, and how far it may lie off as a whole: shading moves an edge
// by its own slope over the edge's contrast, so an edge of a tenth of the picture's best contrast may be off
// by ten times as much.
std::map<std::pair<int, int>, EdgeState> EdgeStates(const std::vector<Observation>& observations) {
  constexpr double kMaxFactor = 20;
  std::map<std::pair<int, int>, EdgeState> edges;
  std::map<std::pair<int, int>, CubeEdgeClass> class_of;
  std::map<int, double> best_contrast;
  for (const Observation& o : observations) {
    EdgeState& e = edges[{o.picture, o.edge}];
    e.residual.push_back(o.residual_px), e.contrast.push_back(o.contrast);
    class_of[{o.picture, o.edge}] = o.edge_class;
  }
  for (auto& [key, e] : edges)
    best_contrast[key.first] = std::max(best_contrast[key.first], Median(e.contrast));
  for (auto& [key, e] : edges) {
    e.middle_px = Median(e.residual);
    std::vector<double> deviation;
    for (double r : e.residual) deviation.push_back(std::abs(r - e.middle_px));
    e.spread_px = 1.4826 * Median(deviation);
    const double factor =
        std::clamp(best_contrast[key.first] / std::max(1e-9, Median(e.contrast)), 1.0, kMaxFactor);
    e.sigma_px = factor * kPriors[static_cast<int>(class_of[key])].edge_sigma_px;
  }
  // How far edges really lie off, in their sigmas: most tell what the few may not. An edge beyond that loses
  // its say (Cauchy).
  constexpr double kMinScale = 0.3, kMaxScale = 1;
  const auto off = [](const EdgeState& e) {
    return std::abs(e.middle_px) / std::hypot(e.sigma_px, e.spread_px / std::sqrt(double(e.residual.size())));
  };
  std::vector<double> all;
  for (const auto& entry : edges) all.push_back(off(entry.second));
  const double scale = std::clamp(1.4826 * Median(all), kMinScale, kMaxScale);
  for (auto& entry : edges) {
    const double z = off(entry.second) / (2 * scale);
    entry.second.trust = 1 / (1 + z * z);
  }
  return edges;
}

// Weights: a sample's own noise, and what its edge may be off as a whole, shared by its samples; wrong
// samples let go (Tukey).
void Weigh(const Rig& rig, const Unknowns& x, std::vector<Observation>& observations, double max_px) {
  for (Observation& o : observations) {
    o.residual_px = 1e9;
    Residual(rig, x, o, o.residual_px, nullptr);
  }
  const auto edges = EdgeStates(observations);
  for (Observation& o : observations) {
    const EdgeState& e = edges.at({o.picture, o.edge});
    const double limit = std::clamp(4.7 * std::max(e.spread_px, 2 * o.sigma_px) + std::abs(e.middle_px), 0.3,
                                    std::max(0.3, max_px));
    const double z = o.residual_px / limit, tukey = std::abs(z) < 1 ? (1 - z * z) * (1 - z * z) : 0;
    o.weight = e.trust * tukey / (o.sigma_px * o.sigma_px + e.residual.size() * e.sigma_px * e.sigma_px);
  }
}

struct NormalEquations {
  MatrixXd a;
  VectorXd b;
};

// Columns: pose 6, biases, then the scale where it is estimated.
NormalEquations Build(const Rig& rig, const Unknowns& x, const std::vector<Observation>& observations,
                      bool with_scale) {
  const int n = 6 + kNumCubeEdgeClasses + with_scale;
  NormalEquations e{MatrixXd::Zero(n, n), VectorXd::Zero(n)};
  for (int c = 0; c < kNumCubeEdgeClasses; ++c) {
    const double w = 1 / (kPriors[c].bias_sigma_px * kPriors[c].bias_sigma_px);
    e.a(6 + c, 6 + c) += w, e.b[6 + c] -= w * x.bias_px[c];
  }
  for (const Observation& o : observations) {
    if (o.weight == 0) continue;
    double r;
    Eigen::Matrix<double, 1, 16> j;
    if (!Residual(rig, x, o, r, &j)) continue;
    VectorXd row = VectorXd::Zero(n);
    row.head<6>() = j.head<6>().transpose();
    row[6 + static_cast<int>(o.edge_class)] = 1;
    if (with_scale) row[n - 1] = j[6];
    e.a += o.weight * row * row.transpose(), e.b += o.weight * r * row;
  }
  return e;
}

void Apply(const VectorXd& step, bool with_scale, Unknowns& x) {
  x.cam_from_world.rotation = RotationFromVector(step.head<3>()) * x.cam_from_world.rotation;
  x.cam_from_world.translation += step.segment<3>(3);
  for (int c = 0; c < kNumCubeEdgeClasses; ++c) x.bias_px[c] += step[6 + c];
  if (with_scale) x.scale += step[step.size() - 1];
}

struct Fit {
  Unknowns x;
  std::vector<Observation> observations;
  double rms_px = 0,
         agreement = 0;  // agreement: share of the possible samples that fit, the top's edges twice
  int used = 0;
};

// Gauss-Newton on fixed samples.
bool Solve(const Rig& rig, Fit& fit, bool with_scale, double max_px) {
  constexpr int kIterations = 8;
  for (int i = 0; i < kIterations; ++i) {
    Weigh(rig, fit.x, fit.observations, max_px);
    const auto e = Build(rig, fit.x, fit.observations, with_scale);
    const VectorXd step = e.a.ldlt().solve(e.b);
    if (!step.allFinite() || step.head<3>().norm() > 0.5) return false;
    Apply(step, with_scale, fit.x);
    if (step.head<3>().norm() < 1e-9 && step.segment<3>(3).norm() < 1e-6) break;
  }
  return true;
}

Unknowns StartOf(const RigidTransform& at_zero, const std::vector<CubePicture>& pictures,
                 const CubeSpec& spec, const Matrix3d& axes) {
  Unknowns x;
  x.middle.setZero();
  for (const auto& p : pictures) x.middle += p.gantry_mm / static_cast<double>(pictures.size());
  x.axes = axes;
  x.cam_from_world = at_zero;
  x.cam_from_world.translation -= at_zero.rotation * (axes * x.middle);
  x.base = spec.position_mm;
  return x;
}

// How many samples the edges that are seen from there have.
double PossibleSamples(const Rig& rig, const RigidTransform& pose) {
  double possible = 0;
  for (const auto& v : VisibleEdges(rig.geometry, pose.Inverse().translation)) {
    const auto& e = rig.geometry.edge[v.edge];
    const auto a = rig.lens.Project(pose * rig.geometry.corner[e.from]),
               b = rig.lens.Project(pose * rig.geometry.corner[e.to]);
    if (a && b) possible += (*b - *a).norm() / kSampleSpacingPx;
  }
  return possible;
}

std::optional<Fit> Refine(const Rig& rig, const Unknowns& start, const std::vector<double>& reaches) {
  Fit fit;
  fit.x = start;
  for (double reach : reaches) {
    fit.observations = Measure(rig, fit.x, reach);
    if (static_cast<int>(fit.observations.size()) < kMinSamples) return std::nullopt;
    if (!Solve(rig, fit, false, reach)) return std::nullopt;
  }
  double sum = 0, possible = 0, agree = 0;
  for (const Observation& o : fit.observations) {
    if (o.weight == 0) continue;
    sum += o.residual_px * o.residual_px, ++fit.used;
  }
  if (fit.used < kMinSamples) return std::nullopt;
  fit.rms_px = std::sqrt(sum / fit.used);
  for (const auto& picture : rig.pictures) possible += PossibleSamples(rig, fit.x.At(picture.gantry_mm));
  for (const Observation& o : fit.observations) agree += o.weight > 0 && std::abs(o.residual_px) < 1;
  fit.agreement = possible > 0 ? agree / possible : 0;
  return fit;
}

// Pose covariance and the lens's leverage, at gantry displacement zero.
void FillCovariance(const Rig& rig, const Fit& fit, CubeResult& result) {
  const auto e = Build(rig, fit.x, fit.observations, false);
  double chi2 = 0;
  for (const Observation& o : fit.observations) chi2 += o.weight * o.residual_px * o.residual_px;
  const double scale = std::max(1.0, chi2 / std::max(1, fit.used - 6));
  const MatrixXd covariance = e.a.inverse() * scale;
  const int n = 4 + rig.lens.num_distortion;
  MatrixXd mixed = MatrixXd::Zero(e.a.rows(), n);
  for (const Observation& o : fit.observations) {
    if (o.weight == 0) continue;
    double r;
    Eigen::Matrix<double, 1, 16> j;
    Residual(rig, fit.x, o, r, &j);
    VectorXd row = VectorXd::Zero(e.a.rows());
    row.head<6>() = j.head<6>().transpose();
    row[6 + static_cast<int>(o.edge_class)] = 1;
    mixed += o.weight * row * (-o.outward.transpose() * RayJacobian(rig.lens, o.seen));
  }
  const MatrixXd by_lens = -e.a.ldlt().solve(mixed);
  // To displacement zero: t0 = t + R axes middle, so dt0 = dt + w x (R axes middle).
  Eigen::Matrix<double, 6, 6> shift = Eigen::Matrix<double, 6, 6>::Identity();
  shift.bottomLeftCorner<3, 3>() = -CrossMatrix(fit.x.cam_from_world.rotation * (fit.x.axes * fit.x.middle));
  result.covariance = shift * covariance.topLeftCorner<6, 6>() * shift.transpose();
  result.by_lens = shift * by_lens.topRows<6>();
  for (int c = 0; c < kNumCubeEdgeClasses; ++c) {
    result.bias_px[c] = fit.x.bias_px[c];
    result.bias_sigma_px[c] = std::sqrt(covariance(6 + c, 6 + c));
  }
}

void FillEdges(const Rig& rig, const Fit& fit, CubeResult& result) {
  std::map<std::pair<int, int>, EdgeQuality> edges;
  for (const Observation& o : fit.observations) {
    EdgeQuality& q = edges[{o.picture, o.edge}];
    q.file = rig.pictures[o.picture].file;
    q.edge_class = o.edge_class;
    ++q.num_points;
    if (o.weight == 0) continue;
    ++q.num_used;
    q.mean_px += o.residual_px, q.rms_px += o.residual_px * o.residual_px;
  }
  for (auto& entry : edges) {
    EdgeQuality& q = entry.second;
    if (q.num_used > 0) q.mean_px /= q.num_used, q.rms_px = std::sqrt(q.rms_px / q.num_used);
    result.edges.push_back(q);
  }
}

double Baseline(const std::vector<CubePicture>& pictures) {
  double longest = 0;
  for (const auto& a : pictures)
    for (const auto& b : pictures) longest = std::max(longest, (a.gantry_mm - b.gantry_mm).norm());
  return longest;
}

// The cube's size as the moves measure it: a wrong size, or a gantry that does not move what it says, shows
// here.
Status CheckScale(const std::string& camera, const Rig& rig, const Fit& fit, CubeResult& result) {
  constexpr double kMaxScaleError = 0.005, kSigmas = 5;
  if (Baseline(rig.pictures) <= 0) return {};
  Fit scaled = fit;
  if (!Solve(rig, scaled, true, 3)) return {};
  const MatrixXd covariance = Build(rig, scaled.x, scaled.observations, true).a.inverse();
  result.cube_scale = scaled.x.scale;
  result.cube_scale_sigma = std::sqrt(covariance(covariance.rows() - 1, covariance.cols() - 1));
  const double error = result.cube_scale - 1;
  if (std::abs(error) > kMaxScaleError && std::abs(error) > kSigmas * result.cube_scale_sigma)
    return InputError(
        "camera {}: by the gantry's moves the cube is {:.1f} % {} than the given size; measure the cube, and "
        "check the gantry displacements of its pictures",
        camera, 100 * std::abs(error), error > 0 ? "larger" : "smaller");
  return {};
}

// The camera's centre at each stop, by the cube alone: the stops share the rotation and the edges' biases,
// but no displacement is believed.
struct FreeStops {
  std::vector<Vector3d> centre_mm;  // world
  std::vector<bool> found;          // the cube is seen about where the displacement has it
  MatrixXd covariance;              // of all centres, 3 a stop
};

std::optional<FreeStops> PlaceStopsFreely(const Rig& rig, const Fit& fit) {
  constexpr double kHardlyKnown = 1e-6;  // 1/mm^2: a sigma of a metre
  const int stops = static_cast<int>(rig.pictures.size()), biases = 3 + 3 * stops,
            n = biases + kNumCubeEdgeClasses;
  std::vector<std::vector<CubePicture>> alone;
  std::vector<Unknowns> x(stops, fit.x);
  for (int k = 0; k < stops; ++k) {
    alone.push_back({rig.pictures[k]});
    x[k].cam_from_world = fit.x.At(rig.pictures[k].gantry_mm);
    x[k].middle = rig.pictures[k].gantry_mm;
  }
  MatrixXd a;
  std::vector<bool> found(stops);
  for (double reach : {16, 12, 8, 6, 4, 4, 3, 3, 3}) {
    a = MatrixXd::Zero(n, n);
    VectorXd b = VectorXd::Zero(n);
    for (int c = 0; c < kNumCubeEdgeClasses; ++c) {
      const double w = 1 / (kPriors[c].bias_sigma_px * kPriors[c].bias_sigma_px);
      a(biases + c, biases + c) += w, b[biases + c] -= w * x[0].bias_px[c];
    }
    for (int k = 0; k < stops; ++k) {
      const Rig one{rig.lens, rig.geometry, alone[k]};
      auto observations = Measure(one, x[k], reach);
      Weigh(one, x[k], observations, reach);
      double agree = 0;
      for (const Observation& o : observations) agree += o.weight > 0 && std::abs(o.residual_px) < 1;
      found[k] = agree >= kMinAgreement * PossibleSamples(one, x[k].cam_from_world);
      a.block<3, 3>(3 + 3 * k, 3 + 3 * k).diagonal().array() +=
          kHardlyKnown;  // where no edge is left to say it
      for (const Observation& o : observations) {
        double r;
        Eigen::Matrix<double, 1, 16> j;
        if (o.weight == 0 || !Residual(one, x[k], o, r, &j)) continue;
        VectorXd row = VectorXd::Zero(n);
        row.head<3>() = j.head<3>().transpose();
        row.segment<3>(3 + 3 * k) = j.segment<3>(3).transpose();
        row[biases + static_cast<int>(o.edge_class)] = 1;
        a += o.weight * row * row.transpose(), b += o.weight * r * row;
      }
    }
    const VectorXd step = a.ldlt().solve(b);
    if (!step.allFinite() || step.head<3>().norm() > 0.5) return std::nullopt;
    for (int k = 0; k < stops; ++k) {
      x[k].cam_from_world.rotation = RotationFromVector(step.head<3>()) * x[k].cam_from_world.rotation;
      x[k].cam_from_world.translation += step.segment<3>(3 + 3 * k);
      for (int c = 0; c < kNumCubeEdgeClasses; ++c) x[k].bias_px[c] += step[biases + c];
    }
  }
  FreeStops free;
  free.found = found;
  const Matrix3d rotation = x[0].cam_from_world.rotation;
  MatrixXd map = MatrixXd::Zero(3 * stops, n);  // C = -R^T t, so dC = R^T (w x t - dt)
  for (int k = 0; k < stops; ++k) {
    free.centre_mm.push_back(x[k].cam_from_world.Inverse().translation);
    map.block<3, 3>(3 * k, 0) = -rotation.transpose() * CrossMatrix(x[k].cam_from_world.translation);
    map.block<3, 3>(3 * k, 3 + 3 * k) = -rotation.transpose();
  }
  free.covariance = map * a.inverse() * map.transpose();
  return free;
}

// A stop against the one that agrees best with all: what its displacement is off by, as the cube shows it.
struct StopCheck {
  Vector3d off_mm, sigma_mm;
  bool found = true, wrong = false;
};

std::vector<StopCheck> CheckStops(const Rig& rig, const Fit& fit, const FreeStops& free) {
  constexpr double kSigmas = 5, kMinMm = 2.0;  // less is what axes that were not calibrated may do
  const int stops = static_cast<int>(rig.pictures.size());
  std::vector<Vector3d> at_zero;
  for (int k = 0; k < stops; ++k)
    at_zero.push_back(free.centre_mm[k] - fit.x.axes * rig.pictures[k].gantry_mm);
  const auto disagreement = [&](int k) {
    if (!free.found[k]) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (int other = 0; other < stops; ++other)
      if (free.found[other]) sum += (at_zero[k] - at_zero[other]).norm();
    return sum;
  };
  int reference = 0;
  for (int k = 1; k < stops; ++k)
    if (disagreement(k) < disagreement(reference)) reference = k;
  std::vector<StopCheck> checks;
  for (int k = 0; k < stops; ++k) {
    MatrixXd difference = MatrixXd::Zero(3, 3 * stops);
    difference.block<3, 3>(0, 3 * k).setIdentity();
    difference.block<3, 3>(0, 3 * reference) -= Matrix3d::Identity();
    StopCheck c;
    c.off_mm = at_zero[k] - at_zero[reference];
    c.sigma_mm = (difference * free.covariance * difference.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
    c.found = free.found[k];
    c.wrong = !c.found || (k != reference && c.off_mm.norm() > kMinMm &&
                           c.off_mm.cwiseAbs().cwiseQuotient(c.sigma_mm).maxCoeff() > kSigmas);
    checks.push_back(c);
  }
  return checks;
}

std::string Numbers(const Vector3d& v) {
  return fmt::format("({:.1f}, {:.1f}, {:.1f})", v.x(), v.y(), v.z());
}

// Known moves, as the cube shows them against what the gantry says. `left_out`: stops whose displacement the
// others contradict, so that they must not bear on the place.
Status CheckMoves(const std::string& camera, const Rig& rig, const Fit& fit, CubeResult& result,
                  std::vector<std::size_t>& left_out) {
  constexpr double kMaxMm = 10, kMaxShare = 0.01;  // of the travel: beyond, no axes excuse a move
  if (Baseline(rig.pictures) <= 0) return {};
  const auto free = PlaceStopsFreely(rig, fit);
  if (!free) {
    result.warnings.push_back(
        fmt::format("camera {}: the gantry's moves could not be checked, since some cube pictures show too "
                    "little of it; take "
                    "the cube with its whole top in the picture",
                    camera));
    return {};
  }
  const auto checks = CheckStops(rig, fit, *free);
  for (std::size_t k = 1; k < checks.size(); ++k)
    result.moves.push_back({rig.pictures[k].file, free->centre_mm[k] - free->centre_mm[0],
                            fit.x.axes * (rig.pictures[k].gantry_mm - rig.pictures[0].gantry_mm),
                            (checks[k].sigma_mm.cwiseAbs2() + checks[0].sigma_mm.cwiseAbs2()).cwiseSqrt()});
  std::size_t num_wrong = 0;
  for (const auto& c : checks) num_wrong += c.wrong;
  const bool minority = 2 * num_wrong < checks.size();
  for (std::size_t k = 0; k < checks.size(); ++k) {
    if (!checks[k].wrong) continue;
    const Vector3d said = rig.pictures[k].gantry_mm, seen = said + fit.x.axes.inverse() * checks[k].off_mm;
    const std::string words =
        checks[k].found
            ? fmt::format(
                  "camera {}: by the cube {} was taken at gantry {} mm, but its displacement is given as {}",
                  camera, rig.pictures[k].file, Numbers(seen), Numbers(said))
            : fmt::format("camera {}: in {} the cube is nowhere near where the displacement {} mm has it",
                          camera, rig.pictures[k].file, Numbers(said));
    if (minority && checks.size() > 2) {
      left_out.push_back(k);
      result.warnings.push_back(words +
                                ", so it was left out; check the displacements of its pictures, or "
                                "calibrate the gantry's axes");
    } else if (!checks[k].found || checks[k].off_mm.norm() > kMaxMm + kMaxShare * Baseline(rig.pictures)) {
      return InputError("{}; check the displacements of its pictures, and measure the cube", words);
    } else {
      result.warnings.push_back(words + "; check the displacements, or calibrate the gantry's axes");
    }
  }
  return {};
}

Vector3d CentreAtZero(const Fit& fit) { return fit.x.At(Vector3d::Zero()).Inverse().translation; }

// From above, a cube's four places differ by a turn of the camera alone.
bool SamePlace(const Fit& a, const Fit& b, const Vector3d& cube) {
  constexpr double kSameShare = 0.02, kSameRad = 0.1;
  return (CentreAtZero(a) - CentreAtZero(b)).norm() <
             kSameShare * (CentreAtZero(a) + a.x.middle - cube).norm() &&
         VectorFromRotation(a.x.cam_from_world.rotation * b.x.cam_from_world.rotation.transpose()).norm() <
             kSameRad;
}

// The starts that are tried: good ones, those near the given place first.
std::vector<cube::Start> Trials(std::vector<cube::Start> starts, const std::optional<Vector3d>& near) {
  constexpr std::size_t kMaxNear = 12,
                        kMaxAnywhere = 24;  // a cube that shows three faces looks alike from twelve places
  constexpr double kMinScore = 0.5;         // of the best
  if (!starts.empty()) {
    const double least = kMinScore * starts[0].score;
    std::erase_if(starts, [&](const auto& s) { return s.score < least; });
  }
  const auto off = [&](const cube::Start& s) {
    return (s.cam_from_world.Inverse().translation - *near).norm();
  };
  if (near)
    std::stable_sort(starts.begin(), starts.end(),
                     [&](const auto& a, const auto& b) { return off(a) < off(b); });
  starts.resize(std::min(starts.size(), near ? kMaxNear : kMaxAnywhere));
  return starts;
}

// Of the places that fit, the one meant: near the given place, or the only one that several stops allow.
Result<Fit> Choose(const std::string& camera, std::vector<Fit> fits, const std::optional<Vector3d>& near,
                   const Vector3d& cube, CubeResult& result) {
  constexpr double kAsGood = 0.9;         // of the best agreement: as good for what edges can tell
  constexpr double kClearlyNearer = 0.9;  // of the next place's distance
  std::sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.agreement > b.agreement; });
  std::vector<Fit> good;
  for (const Fit& f : fits) {
    if (f.agreement < kAsGood * fits[0].agreement || f.rms_px > 3 * std::max(0.1, fits[0].rms_px)) continue;
    const bool known =
        std::any_of(good.begin(), good.end(), [&](const Fit& g) { return SamePlace(f, g, cube); });
    if (!known) good.push_back(f);
  }
  if (!near && good.size() > 1)
    return InputError(
        "camera {}: the cube looks alike from {} places, e.g. ({:.0f}, {:.0f}, {:.0f}) and ({:.0f}, {:.0f}, "
        "{:.0f}) mm; give camera_near = [x, y, z], or pictures from more stops of the gantry",
        camera, good.size(), CentreAtZero(good[0]).x(), CentreAtZero(good[0]).y(), CentreAtZero(good[0]).z(),
        CentreAtZero(good[1]).x(), CentreAtZero(good[1]).y(), CentreAtZero(good[1]).z());
  if (!near) return good[0];
  std::sort(good.begin(), good.end(), [&](const Fit& a, const Fit& b) {
    return (CentreAtZero(a) - *near).norm() < (CentreAtZero(b) - *near).norm();
  });
  const double off = (CentreAtZero(good[0]) - *near).norm(),
               distance = (CentreAtZero(good[0]) + good[0].x.middle - cube).norm();
  // A place given no better than those that fit lie apart says nothing either.
  double apart = INFINITY;
  for (std::size_t k = 1; k < good.size(); ++k)
    apart = std::min(apart, (CentreAtZero(good[k]) - CentreAtZero(good[0])).norm());
  if (good.size() > 1 && (off > kClearlyNearer * (CentreAtZero(good[1]) - *near).norm() || off > apart))
    return InputError(
        "camera {}: camera_near does not decide between ({:.0f}, {:.0f}, {:.0f}) and ({:.0f}, {:.0f}, "
        "{:.0f}) mm, "
        "from which the cube looks alike; give it more exactly, or add pictures from more stops of the "
        "gantry",
        camera, CentreAtZero(good[0]).x(), CentreAtZero(good[0]).y(), CentreAtZero(good[0]).z(),
        CentreAtZero(good[1]).x(), CentreAtZero(good[1]).y(), CentreAtZero(good[1]).z());
  if (off > 0.4 * distance)
    result.warnings.push_back(fmt::format(
        "camera {}: camera_near is {:.0f} mm from where the cube has the camera, ({:.0f}, {:.0f}, {:.0f}) "
        "mm at gantry [0, 0, 0]; check it",
        camera, off, CentreAtZero(good[0]).x(), CentreAtZero(good[0]).y(), CentreAtZero(good[0]).z()));
  return good[0];
}

// The place from the other stops alone; the moves and warnings stay as all stops showed them.
Result<CubeResult> WithoutStops(const std::string& camera, const Intrinsics& lens, const CubeSpec& spec,
                                const std::vector<CubePicture>& pictures,
                                const std::vector<std::size_t>& left_out, const Fit& fit,
                                const Gantry& gantry, const CubeResult& checked) {
  std::vector<CubePicture> rest;
  for (std::size_t k = 0; k < pictures.size(); ++k)
    if (std::find(left_out.begin(), left_out.end(), k) == left_out.end()) rest.push_back(pictures[k]);
  VSS_ASSIGN(CubeResult result, CalibrateFromCube(camera, lens, spec, rest, CentreAtZero(fit), gantry));
  result.moves = checked.moves;
  result.warnings.insert(result.warnings.begin(), checked.warnings.begin(), checked.warnings.end());
  return result;
}

}  // namespace

const char* NameOf(CubeEdgeClass c) { return kPriors[static_cast<int>(c)].name; }

Result<CubeResult> CalibrateFromCube(const std::string& camera, const Intrinsics& lens, const CubeSpec& spec,
                                     const std::vector<CubePicture>& pictures,
                                     const std::optional<Vector3d>& near, const Gantry& gantry,
                                     bool check_moves) {
  const Geometry geometry = cube::GeometryOf(spec);
  const Rig rig{lens, geometry, pictures};
  std::vector<Fit> fits;
  for (const auto& start : Trials(cube::FindStarts(lens, geometry, pictures, gantry.axes), near))
    if (auto fit = Refine(rig, StartOf(start.cam_from_world, pictures, spec, gantry.axes), {10, 6, 4}))
      fits.push_back(std::move(*fit));
  CubeResult result;
  if (fits.empty() || std::max_element(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) {
                        return a.agreement < b.agreement;
                      })->agreement < kMinAgreement)
    return InputError(
        "camera {}: no cube of {} mm was found where {}{} could show it; take it with its whole top in the "
        "picture, clear of the background, measure the cube, and check its place and the gantry "
        "displacements",
        camera, spec.size_mm, pictures[0].file,
        pictures.size() > 1 ? fmt::format(" and {} more", pictures.size() - 1) : "");
  VSS_ASSIGN(const Fit chosen, Choose(camera, std::move(fits), near, spec.position_mm, result));
  const auto fit = Refine(rig, chosen.x, {4, 3, 3, 3});
  if (!fit)
    return InputError(
        "camera {}: the cube's edges in {} cannot be measured; take the pictures again with more light or "
        "contrast",
        camera, pictures[0].file);
  std::vector<std::size_t> left_out;
  if (check_moves) VSS_RETURN_IF_ERROR(CheckMoves(camera, rig, *fit, result, left_out));
  if (!left_out.empty()) return WithoutStops(camera, lens, spec, pictures, left_out, *fit, gantry, result);
  result.cam_from_world = fit->x.At(Vector3d::Zero());
  result.middle_mm = fit->x.middle;
  result.rms_px = fit->rms_px;
  result.num_points = fit->used;
  FillCovariance(rig, *fit, result);
  FillEdges(rig, *fit, result);
  if (check_moves) {
    VSS_RETURN_IF_ERROR(CheckScale(camera, rig, *fit, result));
  }
  const Vector3d centre = CentreAtZero(*fit);
  result.findings.push_back(
      fmt::format("Camera {}: {} edge points of {} cube pictures fit to {:.3f} px RMS; at gantry [0, 0, 0] "
                  "the camera is at ({:.2f}, {:.2f}, {:.2f}) mm.",
                  camera, fit->used, pictures.size(), fit->rms_px, centre.x(), centre.y(), centre.z()));
  for (int c = 0; c < kNumCubeEdgeClasses; ++c)
    if (std::any_of(fit->observations.begin(), fit->observations.end(), [&](const Observation& o) {
          return static_cast<int>(o.edge_class) == c && o.weight > 0;
        }))
      result.findings.push_back(
          fmt::format("Edges {} lie {:.3f} px {} where the cube has them (sigma {:.3f} px).", kPriors[c].name,
                      std::abs(result.bias_px[c]), result.bias_px[c] < 0 ? "inside" : "outside",
                      result.bias_sigma_px[c]));
  if (result.cube_scale_sigma > 0)
    result.findings.push_back(
        fmt::format("By the gantry's moves the cube is {:.4f} (sigma {:.4f}) of its given size.",
                    result.cube_scale, result.cube_scale_sigma));
  return result;
}

MatrixXd JointCovariance(const MatrixXd& lens, const CubeResult& cube) {
  const int n = static_cast<int>(lens.rows());
  MatrixXd joint(n + 6, n + 6);
  joint.topLeftCorner(n, n) = lens;
  joint.bottomLeftCorner(6, n) = cube.by_lens * lens;
  joint.topRightCorner(n, 6) = joint.bottomLeftCorner(6, n).transpose();
  joint.bottomRightCorner(6, 6) = cube.covariance + cube.by_lens * lens * cube.by_lens.transpose();
  return 0.5 * (joint + joint.transpose());
}

namespace {

void DescribeAxes(const std::vector<int>& columns, GantryAxes& result) {
  for (int d : columns) {
    const Vector3d axis = result.axes.col(d);
    const double off_rad = std::acos(std::clamp(axis.normalized()[d], -1.0, 1.0));
    result.findings.push_back(
        fmt::format("Gantry axis {}: a millimetre of displacement moves the cameras by {:.5f} mm (sigma "
                    "{:.5f}), {:.2f} mrad "
                    "off the world's axis.",
                    "xyz"[d], axis.norm(), result.sigma(d, d), 1e3 * off_rad));
  }
  for (std::size_t a = 0; a < columns.size(); ++a)
    for (std::size_t b = a + 1; b < columns.size(); ++b) {
      const double cosine =
          result.axes.col(columns[a]).normalized().dot(result.axes.col(columns[b]).normalized());
      result.findings.push_back(fmt::format("Gantry axes {} and {} are {:.4f} degrees apart.",
                                            "xyz"[columns[a]], "xyz"[columns[b]],
                                            DegFromRad(std::acos(std::clamp(cosine, -1.0, 1.0)))));
    }
}

}  // namespace

Result<GantryAxes> CalibrateGantryAxes(const std::vector<CubeJob>& jobs) {
  constexpr double kMinTravelMm = 100;  // less says nothing of a direction
  GantryAxes result;
  for (const CubeJob& job : jobs)
    for (const auto& a : *job.pictures)
      for (const auto& b : *job.pictures)
        for (int d = 0; d < 3; ++d)
          result.moved[d] = result.moved[d] || std::abs(a.gantry_mm[d] - b.gantry_mm[d]) > kMinTravelMm;
  std::vector<int> columns;  // of the axis matrix that are estimated
  for (int d = 0; d < 3; ++d)
    if (result.moved[d]) columns.push_back(d);
  if (columns.empty())
    return InputError(
        "the gantry's axes cannot be calibrated: no two cube pictures of a camera were taken more than {} mm "
        "apart",
        kMinTravelMm);
  std::vector<Geometry> geometries;
  for (const CubeJob& job : jobs) geometries.push_back(cube::GeometryOf(job.cube));
  std::vector<Unknowns> unknowns;
  for (const CubeJob& job : jobs)
    unknowns.push_back(StartOf(job.cam_from_world, *job.pictures, job.cube, Matrix3d::Identity()));
  const int own = 6 + kNumCubeEdgeClasses, shared = 3 * static_cast<int>(columns.size()),
            n = shared + own * static_cast<int>(jobs.size());
  MatrixXd a;
  for (int round = 0; round < 8; ++round) {
    a = MatrixXd::Zero(n, n);
    VectorXd b = VectorXd::Zero(n);
    for (std::size_t k = 0; k < jobs.size(); ++k) {
      const Rig rig{jobs[k].lens, geometries[k], *jobs[k].pictures};
      auto observations = Measure(rig, unknowns[k], round == 0 ? 4 : 3);
      Weigh(rig, unknowns[k], observations, 3);
      const int at = shared + own * static_cast<int>(k);
      for (int c = 0; c < kNumCubeEdgeClasses; ++c) {
        const double w = 1 / (kPriors[c].bias_sigma_px * kPriors[c].bias_sigma_px);
        a(at + 6 + c, at + 6 + c) += w, b[at + 6 + c] -= w * unknowns[k].bias_px[c];
      }
      for (const Observation& o : observations) {
        double r;
        Eigen::Matrix<double, 1, 16> j;
        if (o.weight == 0 || !Residual(rig, unknowns[k], o, r, &j)) continue;
        VectorXd row = VectorXd::Zero(n);
        for (std::size_t c = 0; c < columns.size(); ++c)
          for (int i = 0; i < 3; ++i) row[3 * c + i] = j[7 + 3 * i + columns[c]];
        row.segment<6>(at) = j.head<6>().transpose();
        row[at + 6 + static_cast<int>(o.edge_class)] = 1;
        a += o.weight * row * row.transpose(), b += o.weight * r * row;
      }
    }
    const VectorXd step = a.ldlt().solve(b);
    if (!step.allFinite())
      return InputError(
          "the gantry's axes cannot be calibrated from these cube pictures; take the cube at more stops");
    for (std::size_t c = 0; c < columns.size(); ++c)
      for (int i = 0; i < 3; ++i) result.axes(i, columns[c]) += step[3 * c + i];
    for (std::size_t k = 0; k < jobs.size(); ++k) {
      Apply(step.segment(shared + own * static_cast<int>(k), own), false, unknowns[k]);
      unknowns[k].axes = result.axes;
    }
  }
  const MatrixXd covariance = a.inverse();
  for (std::size_t c = 0; c < columns.size(); ++c)
    for (int i = 0; i < 3; ++i) result.sigma(i, columns[c]) = std::sqrt(covariance(3 * c + i, 3 * c + i));
  DescribeAxes(columns, result);
  return result;
}

Result<CubeCheck> CheckAgainstCube(const Camera& camera, const CubeSpec& spec,
                                   const std::vector<CubePicture>& pictures, const Gantry& gantry) {
  if (!camera.cam_from_world)
    return InputError(
        "camera {}: its file has no [pose], so a cube cannot check it; calibrate its place first", camera.id);
  const Geometry geometry = cube::GeometryOf(spec);
  const Rig rig{camera.intrinsics, geometry, pictures};
  const RigidTransform at_zero = gantry.CamFromWorld(camera, Vector3d::Zero());
  const auto fit = Refine(rig, StartOf(at_zero, pictures, spec, gantry.axes), {12, 8, 4, 3, 3});
  if (!fit || fit->agreement < 0.3)
    return InputError(
        "camera {}: the cube is not where the camera file has it, not even nearly; the camera or the cube "
        "has moved, so calibrate again",
        camera.id);
  CubeCheck check;
  // Residuals of the camera as it is, biases of the classes taken as found.
  Fit as_is = *fit;
  as_is.x.cam_from_world = StartOf(at_zero, pictures, spec, gantry.axes).cam_from_world;
  double sum = 0;
  for (const Observation& o : fit->observations) {
    double r;
    if (o.weight > 0 && Residual(rig, as_is.x, o, r, nullptr)) sum += r * r;
  }
  check.rms_px = std::sqrt(sum / std::max(1, fit->used));
  check.turned_mrad =
      1e3 *
      VectorFromRotation(fit->x.cam_from_world.rotation * as_is.x.cam_from_world.rotation.transpose()).norm();
  check.moved_mm =
      (fit->x.cam_from_world.Inverse().translation - as_is.x.cam_from_world.Inverse().translation).norm();
  const MatrixXd covariance = Build(rig, fit->x, fit->observations, false).a.inverse();
  check.sigma_mrad = 1e3 * std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  check.sigma_mm = std::sqrt(covariance.block<3, 3>(3, 3).trace());
  return check;
}

}  // namespace vss
