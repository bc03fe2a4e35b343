#include "vss/reconstruct/adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace vss {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kLoosening = 100;  // of the prior of a camera that was found to have moved

// The circles at the two ends of a cylinder.
std::array<const WorldSolid::Circle*, 2> Rims(const WorldSolid& solid, int face) {
  std::array<const WorldSolid::Circle*, 2> rims{nullptr, nullptr};
  std::size_t n = 0;
  for (const auto& c : solid.circles)
    if (c.cylinder_face == face && n < 2) rims[n++] = &c;
  return rims;
}

// Where a sample is on the solid as it stands now. A limb stays where it was on the cylinder's circumference.
Vector3d SamplePoint(const WorldSolid& solid, const ContourSample& s) {
  if (s.source == ContourSample::Source::kEdge) {
    const auto& e = solid.edges[static_cast<std::size_t>(s.index)];
    return (1 - s.t) * solid.vertices[static_cast<std::size_t>(e.start)].point +
           s.t * solid.vertices[static_cast<std::size_t>(e.end)].point;
  }
  if (s.source == ContourSample::Source::kCircle) {
    const auto& c = solid.circles[static_cast<std::size_t>(s.index)];
    return c.center.point + c.radius_mm * (c.axis_u * std::cos(s.t) + c.axis_v * std::sin(s.t));
  }
  const auto rims = Rims(solid, s.index);
  const Vector3d axis = solid.faces[static_cast<std::size_t>(s.index)].axis_direction;
  const Vector3d at = rims[0]->center.point + s.t * (rims[1]->center.point - rims[0]->center.point);
  Vector3d out = s.point_in_world - at;
  out -= axis * axis.dot(out);
  return at + out.normalized() * rims[0]->radius_mm;
}

// d img / d intrinsics (fx fy cx cy, distortion): 2 x n.
MatrixXd ImgByIntrinsics(const Intrinsics& k, const Vector3d& p, const Vector2d& img, int n) {
  constexpr double kStep = 1e-5;  // of a distortion coefficient
  MatrixXd j = MatrixXd::Zero(2, n);
  j(0, 0) = (img.x() - k.cx_px) / k.fx_px;
  j(1, 1) = (img.y() - k.cy_px) / k.fy_px;
  j(0, 2) = j(1, 3) = 1;
  for (int i = 4; i < n; ++i) {
    Intrinsics moved = k;
    moved.distortion[static_cast<std::size_t>(i - 4)] += kStep;
    if (const auto at = moved.Project(p)) j.col(i) = (*at - img) / kStep;
  }
  return j;
}

// A shadow makes the dark side of an edge wider: it pulls towards the bright side, whichever that is.
bool PulledByShadow(const ObservationGroup& group) {
  return group.edge_class == ContourClass::kContact || group.edge_class == ContourClass::kShadowed;
}

// How far, along the observation's normal, a bias of one pixel moves the contour there.
double BiasShift(const AdjustedPart& part, const ObservationGroup& group, const WorldSolid& solid,
                 const Observation& o, const Eigen::RowVector3d& normal_by_world) {
  const auto rim = part.rim_mm_per_px.find(group.BiasKey());
  double shift = 1;
  if (rim != part.rim_mm_per_px.end()) {
    const auto& circle = solid.circles[static_cast<std::size_t>(o.sample.index)];
    shift = rim->second * normal_by_world.dot((o.sample.point_in_world - circle.center.point).normalized());
  }
  return PulledByShadow(group) ? std::copysign(shift, o.contrast) : shift;
}

}  // namespace

Adjustment::Adjustment(std::span<const View> views, std::vector<AdjustedPart> parts_in,
                       std::vector<AdjustedCamera> cameras_in, std::vector<AdjustedStop> stops_in,
                       const AdjustmentOptions& o)
    : parts(std::move(parts_in)),
      cameras(std::move(cameras_in)),
      stops(std::move(stops_in)),
      systematic_px{o.free_systematic_px, o.contact_systematic_px, o.round_systematic_px,
                    o.limb_systematic_px, o.shadowed_systematic_px},
      options(o),
      views_(views.begin(), views.end()) {
  camera_of_view_.assign(views.size(), -1);
  stop_of_view_.assign(views.size(), -1);
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (int v : cameras[c].views) camera_of_view_[static_cast<std::size_t>(v)] = static_cast<int>(c);
  for (std::size_t s = 0; s < stops.size(); ++s)
    for (int v : stops[s].views) stop_of_view_[static_cast<std::size_t>(v)] = static_cast<int>(s);
  for (const auto& c : cameras) changed_.push_back(*c.camera);
}

std::vector<View> Adjustment::AdjustedViews() const {
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    auto& k = changed_[c].intrinsics;
    k = cameras[c].camera->intrinsics;
    if (cameras[c].num_intrinsics == 0) continue;
    const VectorXd d = cameras[c].value.tail(cameras[c].num_intrinsics);
    k.fx_px += d[0], k.fy_px += d[1], k.cx_px += d[2], k.cy_px += d[3];
    for (Eigen::Index i = 4; i < d.size(); ++i) k.distortion[static_cast<std::size_t>(i - 4)] += d[i];
  }
  std::vector<View> out = views_;
  for (std::size_t v = 0; v < out.size(); ++v) {
    View& view = out[v];
    const auto c = static_cast<std::size_t>(camera_of_view_[v]);
    view.camera = &changed_[c];
    view.center_in_world *= 1 + scale;
    view.center_in_world += cameras[c].value.segment<3>(3);
    if (stop_of_view_[v] >= 0)
      view.center_in_world += stops[static_cast<std::size_t>(stop_of_view_[v])].value;
    view.cam_from_world.rotation =
        RotationFromVector(cameras[c].value.head<3>()) * view.cam_from_world.rotation;
    view.cam_from_world.translation = -(view.cam_from_world.rotation * view.center_in_world);
  }
  return out;
}

Adjustment::Layout Adjustment::MakeLayout() const {
  Layout l;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    l.part.push_back(l.size);
    l.size += parts[p].object.StateSize();
    l.bias.emplace_back();
    for (const auto& [contour, value] : parts[p].bias_px) l.bias.back()[contour] = l.size++;
  }
  l.ground = l.size;
  l.size += kGroundSize;
  l.pull = l.size++;
  for (const auto& c : cameras) {
    l.camera.push_back(l.size);
    l.size += kCameraPlaceSize + c.num_intrinsics;
  }
  for (std::size_t s = 0; s < stops.size(); ++s) {
    l.stop.push_back(l.size);
    l.size += 3;
  }
  if (!options.known_lengths.empty()) l.scale = l.size++;
  return l;
}

void Adjustment::UpdateResiduals() {
  const auto views = AdjustedViews();
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object, false));
  for (auto& group : groups) {
    auto& part = parts[static_cast<std::size_t>(group.part)];
    const auto& view = views[static_cast<std::size_t>(group.view)];
    const double bias =
        part.bias_px[group.BiasKey()] + (group.edge_class == ContourClass::kContact ? ground.pull_px : 0);
    for (auto& o : group.observations) {
      o.sample.point_in_world = SamplePoint(solids[static_cast<std::size_t>(group.part)], o.sample);
      Eigen::Matrix<double, 2, 3> by_cam;
      const auto img =
          view.camera->intrinsics.Project(view.cam_from_world * o.sample.point_in_world, &by_cam);
      const double shift = img ? BiasShift(part, group, solids[static_cast<std::size_t>(group.part)], o,
                                           o.normal.transpose() * by_cam * view.cam_from_world.rotation)
                               : 0;
      o.residual_px = img ? o.normal.dot(*img - o.measured) + bias * shift : 0;
      if (!img) o.weight = 0;
    }
  }
}

Adjustment::Term Adjustment::TermOf(const ObservationGroup& group, const WorldSolid& solid,
                                    const std::vector<View>& views) const {
  const auto p = static_cast<std::size_t>(group.part), v = static_cast<std::size_t>(group.view);
  const auto c = static_cast<std::size_t>(camera_of_view_[v]);
  const View& view = views[v];
  const auto& k = view.camera->intrinsics;
  const int state = parts[p].object.StateSize(), intrinsics = cameras[c].num_intrinsics;
  const bool has_stop = stop_of_view_[v] >= 0;
  std::vector<int> at;
  for (int i = 0; i < state; ++i) at.push_back(layout_.part[p] + i);
  for (int i = 0; i < kCameraPlaceSize + intrinsics; ++i) at.push_back(layout_.camera[c] + i);
  at.push_back(layout_.bias[p].at(group.BiasKey()));
  if (has_stop)
    for (int i = 0; i < 3; ++i) at.push_back(layout_.stop[static_cast<std::size_t>(stop_of_view_[v])] + i);
  if (layout_.scale >= 0) at.push_back(layout_.scale);
  const bool is_pulled = group.edge_class == ContourClass::kContact;
  if (is_pulled) at.push_back(layout_.pull);
  const auto n = static_cast<Eigen::Index>(at.size());
  MatrixXd a = MatrixXd::Zero(n, n);
  VectorXd u = VectorXd::Zero(n), g = VectorXd::Zero(n), j(n);
  double sum = 0, mean = 0;
  for (const auto& o : group.observations) {
    if (o.weight <= 0) continue;
    const Vector3d q = view.cam_from_world * o.sample.point_in_world;
    Eigen::Matrix<double, 2, 3> by_cam;
    const auto img = k.Project(q, &by_cam);
    if (!img) continue;
    const Eigen::RowVector3d n_by_cam = o.normal.transpose() * by_cam;
    const Eigen::RowVector3d n_by_world = n_by_cam * view.cam_from_world.rotation;
    j.head(state) = (n_by_world * SampleByState(solid, o.sample)).transpose();
    j.segment<3>(state) = -(n_by_cam * CrossMatrix(q)).transpose();
    j.segment<3>(state + 3) = -n_by_world.transpose();
    if (intrinsics > 0)
      j.segment(state + kCameraPlaceSize, intrinsics) =
          (o.normal.transpose() * ImgByIntrinsics(k, q, *img, intrinsics)).transpose();
    Eigen::Index next = state + kCameraPlaceSize + intrinsics;
    const double shift = BiasShift(parts[p], group, solid, o, n_by_world);
    j[next++] = shift;
    if (has_stop) {
      j.segment<3>(next) = -n_by_world.transpose();
      next += 3;
    }
    if (layout_.scale >= 0) j[next++] = -n_by_world.dot(views_[v].center_in_world);
    if (is_pulled) j[next] = shift;
    const double w = o.weight;
    a.selfadjointView<Eigen::Lower>().rankUpdate(j, w);
    u += w * j;
    g -= w * o.residual_px * j;
    sum += w;
    mean += w * o.residual_px;
  }
  const double s2 = group.systematic_px * group.systematic_px;
  const double share = s2 / (1 + s2 * sum);
  a.selfadjointView<Eigen::Lower>().rankUpdate(u, -share);
  g += share * mean * u;
  return {std::move(at), group.weight * a, group.weight * g};
}

double Adjustment::PriorScale(const AdjustedCamera& camera) const {
  return (camera.prior_from_calibration ? 1 : camera_scale) * (camera.loosened ? kLoosening : 1);
}

void Adjustment::AddPriors(bool shared_free) {
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto& part = parts[p];
    const VectorXd x = part.object.State();
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const double w = 1 / (part.prior_sigma[i] * part.prior_sigma[i]);
      h_(layout_.part[p] + i, layout_.part[p] + i) += w;
      g_[layout_.part[p] + i] += w * (part.prior_value[i] - x[i]);
    }
    for (const auto& [contour, at] : layout_.bias[p]) {
      const double w = std::pow(part.bias_sigma_px.at(contour), -2);
      h_(at, at) += w;
      g_[at] -= w * part.bias_px.at(contour);
    }
  }
  for (const auto& known : options.known_lengths) {
    const auto p = static_cast<std::size_t>(known.part), i = static_cast<std::size_t>(known.dimension);
    const int at = layout_.part[p] + kPlacementSize + known.dimension;
    const double w = 1 / (known.sigma_mm * known.sigma_mm);
    h_(at, at) += w;
    g_[at] += w * (known.value_mm - parts[p].object.dimensions_mm[i]);
  }
  if (!shared_free) return;
  if (layout_.scale >= 0) {
    const double w = 1 / (options.scale_sigma * options.scale_sigma);
    h_(layout_.scale, layout_.scale) += w;
    g_[layout_.scale] -= w * scale;
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const double prior_scale = PriorScale(cameras[c]);
    const MatrixXd w = (prior_scale * prior_scale * cameras[c].prior_covariance)
                           .ldlt()
                           .solve(MatrixXd::Identity(cameras[c].value.size(), cameras[c].value.size()));
    const auto n = cameras[c].value.size();
    h_.block(layout_.camera[c], layout_.camera[c], n, n) += w;
    g_.segment(layout_.camera[c], n) -= w * cameras[c].value;
  }
  const double sigma = options.stop_sigma_mm * stop_scale;
  for (std::size_t s = 0; s < stops.size(); ++s) {
    h_.diagonal().segment<3>(layout_.stop[s]).array() += 1 / (sigma * sigma);
    g_.segment<3>(layout_.stop[s]) -= stops[s].value / (sigma * sigma);
  }
}

std::vector<bool> Adjustment::Pinned(bool shared_free) const {
  std::vector<bool> pinned(static_cast<std::size_t>(layout_.size));
  for (std::size_t p = 0; p < parts.size(); ++p)
    for (std::size_t i = 0; i < parts[p].free.size(); ++i)
      pinned[static_cast<std::size_t>(layout_.part[p]) + i] = !parts[p].free[i];
  for (int i = 0; i < kGroundSize; ++i) pinned[static_cast<std::size_t>(layout_.ground + i)] = !ground.free;
  pinned[static_cast<std::size_t>(layout_.pull)] = !ground.pull_free;
  const int first_shared = layout_.pull + 1;
  for (int i = first_shared; i < layout_.size && !shared_free; ++i)
    pinned[static_cast<std::size_t>(i)] = true;
  return pinned;
}

void Adjustment::Pin(bool shared_free) {
  const auto pinned = Pinned(shared_free);
  for (Eigen::Index i = 0; i < layout_.size; ++i) {
    if (!pinned[static_cast<std::size_t>(i)]) continue;
    h_.row(i).setZero();
    h_.col(i).setZero();
    h_(i, i) = 1;
    g_[i] = 0;
  }
}

void Adjustment::Build(bool shared_free) {
  BuildUnpinned(shared_free);
  Pin(shared_free);
}

void Adjustment::BuildUnpinned(bool shared_free) {
  layout_ = MakeLayout();
  h_ = MatrixXd::Zero(layout_.size, layout_.size);
  g_ = VectorXd::Zero(layout_.size);
  const auto views = AdjustedViews();
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object));
  for (const auto& group : groups) {
    if (group.weight <= 0) continue;
    const Term term = TermOf(group, solids[static_cast<std::size_t>(group.part)], views);
    for (std::size_t x = 0; x < term.at.size(); ++x) {
      g_[term.at[x]] += term.g[static_cast<Eigen::Index>(x)];
      for (std::size_t y = 0; y <= x; ++y)
        h_(std::max(term.at[x], term.at[y]), std::min(term.at[x], term.at[y])) +=
            term.h(static_cast<Eigen::Index>(x), static_cast<Eigen::Index>(y));
    }
  }
  AddPriors(shared_free);
  AddTies();
}

void Adjustment::Apply(const VectorXd& step) {
  for (std::size_t p = 0; p < parts.size(); ++p) {
    auto& part = parts[p];
    VectorXd x = part.object.State() + step.segment(layout_.part[p], part.object.StateSize());
    const auto defs = part.object.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i) {
      double& d = x[kPlacementSize + static_cast<int>(i)];
      if (defs[i].min_mm > 0) d = std::max(d, 0.5 * defs[i].min_mm);
    }
    part.object.SetState(x);
    for (const auto& [contour, at] : layout_.bias[p]) part.bias_px[contour] += step[at];
  }
  ground.value += step.segment<kGroundSize>(layout_.ground);
  ground.pull_px += step[layout_.pull];
  for (std::size_t c = 0; c < cameras.size(); ++c)
    cameras[c].value += step.segment(layout_.camera[c], cameras[c].value.size());
  for (std::size_t s = 0; s < stops.size(); ++s) stops[s].value += step.segment<3>(layout_.stop[s]);
  if (layout_.scale >= 0) scale += step[layout_.scale];
}

double Adjustment::Solve(int max_steps, bool shared_free) {
  shared_free &= options.adjust_cameras;
  PrepareBiases();
  double moved = 0;
  for (int k = 0; k < max_steps; ++k) {
    UpdateResiduals();
    UpdateWeights();
    UpdateSystematics();
    Build(shared_free);
    std::vector<WorldSolid> before;
    for (const auto& p : parts) before.push_back(PlaceSolid(p.object, false));
    Apply(h_.selfadjointView<Eigen::Lower>().ldlt().solve(g_));
    moved = 0;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const auto after = PlaceSolid(parts[p].object, false);
      for (std::size_t i = 0; i < after.vertices.size(); ++i)
        moved = std::max(moved, (after.vertices[i].point - before[p].vertices[i].point).norm());
    }
    constexpr double kSmallMm = 1e-3;
    if (moved < kSmallMm) break;
  }
  UpdateResiduals();
  UpdateWeights();
  return moved;
}

// With x the free unknowns and y the held ones, H_xx dx = -H_xy dy: errors of the held ones move the solution
// by -H_xx^-1 H_xy times them.
void Adjustment::ComputeCovariance() {
  BuildUnpinned(options.adjust_cameras);
  by_held_ = MatrixXd::Zero(layout_.size, 0);
  const auto pinned = Pinned(options.adjust_cameras);
  const MatrixXd unpinned = h_.selfadjointView<Eigen::Lower>();
  Pin(options.adjust_cameras);
  const auto solver = h_.selfadjointView<Eigen::Lower>().ldlt();
  covariance_ = solver.solve(MatrixXd::Identity(layout_.size, layout_.size));
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (parts[p].held_covariance.isZero(0)) continue;
    const auto size = parts[p].held_covariance.rows();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(parts[p].held_covariance);
    const MatrixXd errors = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
    MatrixXd coupling = unpinned.middleCols(layout_.part[p], size) * errors;
    for (Eigen::Index i = 0; i < layout_.size; ++i)
      if (pinned[static_cast<std::size_t>(i)]) coupling.row(i).setZero();
    const auto before = by_held_.cols();
    by_held_.conservativeResize(Eigen::NoChange, before + size);
    by_held_.rightCols(size) = -solver.solve(coupling);
    by_held_.middleRows(layout_.part[p], size).rightCols(size) += errors;
  }
}

}  // namespace vss
