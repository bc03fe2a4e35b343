#include "vss/reconstruct/fit_part.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "vss/reconstruct/observability.h"

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kArcPoints = 8;  // residuals of an arc
constexpr double kPositionSigmaMm = 3000, kYawSigmaRad = 2, kTiltSigmaRad = 0.02;
constexpr double kGain = 15;           // known that many times better than before: observable
constexpr double kLostPx = 200;        // residual of a contour that is behind the camera
constexpr double kHiddenPenalty = 25;  // chi-square for a picked line whose edge would be turned away

struct ProjectedLine {
  Vector2d point, normal;
};

// The straight contour (edge or limb) as a line in the ideal picture.
std::optional<ProjectedLine> Project(const WorldSolid& solid, const View& view, const LineAssignment& a) {
  Vector3d p, q;
  if (a.source == ContourSample::Source::kEdge) {
    const auto& e = solid.edges[static_cast<std::size_t>(a.index)];
    p = solid.vertices[static_cast<std::size_t>(e.start)].point;
    q = solid.vertices[static_cast<std::size_t>(e.end)].point;
  } else {
    const auto& f = solid.faces[static_cast<std::size_t>(a.index)];
    Vector3d to_eye = view.center_in_world - f.axis_point;
    to_eye -= f.axis_direction * f.axis_direction.dot(to_eye);
    const double distance = to_eye.norm();
    if (distance <= f.radius_mm) return std::nullopt;
    const double along = f.radius_mm / distance;
    const Vector3d forward = to_eye / distance, side = f.axis_direction.cross(forward);
    const Vector3d out = forward * along + side * ((a.limb_side < 0 ? -1 : 1) * std::sqrt(1 - along * along));
    p = f.axis_point + out * f.radius_mm;
    q = p + f.axis_direction * 100.0;
  }
  const auto u = view.ProjectIdeal(p), v = view.ProjectIdeal(q);
  if (!u || !v || (*v - *u).norm() < 1e-6) return std::nullopt;
  const Vector2d t = (*v - *u).normalized();
  return ProjectedLine{*u, {-t.y(), t.x()}};
}

Vector2d ArcPoint(const EllipticalArc& arc, double share) {
  const double t = arc.ideal_from_rad + share * (arc.ideal_to_rad - arc.ideal_from_rad);
  const Vector2d local(arc.ideal_axes.x() * std::cos(t), arc.ideal_axes.y() * std::sin(t));
  return arc.ideal_center + Eigen::Rotation2Dd(arc.ideal_angle_rad) * local;
}

// Whitened residuals of one assignment; `px` (if given) gets the distance of the line's middle.
void Residuals(const WorldSolid& solid, const View& view, const LineAssignment& a, double systematic,
               std::vector<double>& out, double* px) {
  if (a.source == ContourSample::Source::kCircle) {
    const auto& arc = view.lines->arcs[static_cast<std::size_t>(a.line)];
    const auto& c = solid.circles[static_cast<std::size_t>(a.index)];
    for (int k = 0; k < kArcPoints; ++k) {
      const Vector3d ray = view.RayOfIdeal(ArcPoint(arc, (k + 0.5) / kArcPoints));
      const double slope = ray.dot(c.normal);
      const double depth =
          std::abs(slope) > 1e-6 ? (c.center.point - view.center_in_world).dot(c.normal) / slope : -1;
      double r = kLostPx;
      if (depth > 1) {
        const double off = (view.center_in_world + depth * ray - c.center.point).norm() - c.radius_mm;
        r = std::clamp(off * view.camera->intrinsics.fx_px / depth, -kLostPx, kLostPx);
      }
      out.push_back(r / (systematic * std::sqrt(kArcPoints / 2.0)));
      if (px && k == kArcPoints / 2) *px = r;
    }
    return;
  }
  const auto& line = view.lines->segments[static_cast<std::size_t>(a.line)];
  const auto projected = Project(solid, view, a);
  double r1 = kLostPx, r2 = kLostPx;
  if (projected) {
    r1 = (line.ideal_start - projected->point).dot(projected->normal);
    r2 = (line.ideal_end - projected->point).dot(projected->normal);
  }
  const double length = (line.ideal_end - line.ideal_start).norm();
  out.push_back((r1 + r2) / 2 / std::hypot(line.sigma_offset_px, systematic));
  out.push_back((r1 - r2) / 2 / std::hypot(line.sigma_angle_rad * length / 2, systematic));
  if (px) *px = (r1 + r2) / 2;
}

bool TurnedAway(const WorldSolid& solid, const View& view, const LineAssignment& a) {
  if (a.source != ContourSample::Source::kEdge) return false;
  const auto& e = solid.edges[static_cast<std::size_t>(a.index)];
  for (int f : {e.left_face, e.right_face}) {
    const auto& face = solid.faces[static_cast<std::size_t>(f)];
    if (face.is_cylinder || face.triangles.empty() ||
        face.normal_in_part.dot(view.center_in_world - face.triangles[0][0]) > 0)
      return false;
  }
  return true;
}

class Fitter {
 public:
  Fitter(std::span<const View> views, const PlacedObject& start, std::span<const LineAssignment> assignments,
         const FitOptions& options)
      : views_(views), assignments_(assignments), options_(options), x0_(start.State()) {
    const auto defs = start.model->dimensions();
    prior_sigma_ = VectorXd::Zero(x0_.size());
    prior_sigma_[0] = prior_sigma_[1] = kPositionSigmaMm;
    prior_sigma_[3] = kYawSigmaRad;
    if (options.fit_tilt) prior_sigma_[4] = prior_sigma_[5] = kTiltSigmaRad;
    for (std::size_t i = 0; i < defs.size(); ++i)
      prior_sigma_[kPlacementSize + static_cast<Eigen::Index>(i)] =
          std::max(1.0, (defs[i].max_mm - defs[i].min_mm) / std::sqrt(12.0));
    for (Eigen::Index i = 0; i < x0_.size(); ++i)
      if (prior_sigma_[i] > 0) free_.push_back(i);
    x0_[2] = options.support_height_mm;
  }

  VectorXd Evaluate(const PlacedObject& object) const {
    const WorldSolid solid = PlaceSolid(object, false);
    std::vector<double> r;
    for (const auto& a : assignments_)
      Residuals(solid, views_[static_cast<std::size_t>(a.view)], a, options_.systematic_px, r, nullptr);
    return Eigen::Map<VectorXd>(r.data(), static_cast<Eigen::Index>(r.size()));
  }

  MatrixXd Jacobian(const PlacedObject& object) const {
    MatrixXd j;
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const double step = StepOf(free_[k]);
      const VectorXd d =
          (Evaluate(Moved(object, free_[k], step)) - Evaluate(Moved(object, free_[k], -step))) / (2 * step);
      if (k == 0) j.resize(d.size(), static_cast<Eigen::Index>(free_.size()));
      j.col(static_cast<Eigen::Index>(k)) = d;
    }
    return j;
  }

  double Cost(const PlacedObject& object) const {
    return Evaluate(object).squaredNorm() + PriorOf(object).cwiseQuotient(Scale()).squaredNorm();
  }

  // Levenberg-Marquardt; returns the cost.
  double Solve(PlacedObject& object) const {
    constexpr int kIterations = 25;
    constexpr double kEnough = 1e-6;
    double cost = Cost(object), damping = 1e-3;
    const VectorXd w = Scale().cwiseAbs2().cwiseInverse();
    for (int it = 0; it < kIterations; ++it) {
      const MatrixXd j = Jacobian(object);
      MatrixXd h = j.transpose() * j;
      h.diagonal() += w;
      const VectorXd g = -j.transpose() * Evaluate(object) - w.cwiseProduct(PriorOf(object));
      bool better = false;
      for (int trial = 0; trial < 6 && !better; ++trial, damping *= better ? 0.1 : 8) {
        MatrixXd damped = h;
        damped.diagonal() += damping * h.diagonal();
        PlacedObject next = object;
        VectorXd x = object.State();
        const VectorXd step = damped.ldlt().solve(g);
        for (std::size_t k = 0; k < free_.size(); ++k) x[free_[k]] += step[static_cast<Eigen::Index>(k)];
        next.SetState(x);
        KeepInRange(next);
        const double c = Cost(next);
        if (!(c < cost)) continue;
        better = true;
        const bool done = cost - c < kEnough * cost;
        object = next;
        cost = c;
        if (done) return cost;
      }
      if (!better) break;
    }
    return cost;
  }

  int NumTurnedAway(const PlacedObject& object) const {
    const WorldSolid solid = PlaceSolid(object, false);
    return static_cast<int>(std::count_if(assignments_.begin(), assignments_.end(), [&](const auto& a) {
      return TurnedAway(solid, views_[static_cast<std::size_t>(a.view)], a);
    }));
  }

  // Where the picked lines meet the plane on which the part stands, in the mean.
  Vector3d Anchor() const {
    Vector3d sum = Vector3d::Zero();
    double n = 0;
    for (const auto& a : assignments_) {
      const auto& view = views_[static_cast<std::size_t>(a.view)];
      const Vector2d middle =
          a.source == ContourSample::Source::kCircle
              ? view.lines->arcs[static_cast<std::size_t>(a.line)].ideal_center
              : Vector2d((view.lines->segments[static_cast<std::size_t>(a.line)].ideal_start +
                          view.lines->segments[static_cast<std::size_t>(a.line)].ideal_end) /
                         2);
      const Vector3d ray = view.RayOfIdeal(middle);
      const double depth = (options_.support_height_mm - view.center_in_world.z()) / ray.z();
      if (!(depth > 0) || !std::isfinite(depth)) continue;
      sum += view.center_in_world + depth * ray;
      ++n;
    }
    return n > 0 ? Vector3d(sum / n) : Vector3d(x0_[0], x0_[1], 0);
  }

  PlacedObject Best(const PlacedObject& start) const {
    PlacedObject near = start;
    near.SetState(x0_);
    PlacedObject best = near;
    double cost = Solve(best) + kHiddenPenalty * NumTurnedAway(best);
    if (!options_.search_start) return best;
    constexpr int kYaws = 12;
    const Vector3d anchor = Anchor();
    for (int k = 0; k < kYaws; ++k) {
      PlacedObject trial = near;
      trial.placement.head<2>() = anchor.head<2>();
      trial.placement[3] = 2 * kPi * k / kYaws;
      const double c = Solve(trial) + kHiddenPenalty * NumTurnedAway(trial);
      if (c < cost) cost = c, best = trial;
    }
    return best;
  }

  const std::vector<Eigen::Index>& free() const { return free_; }
  VectorXd Scale() const {
    VectorXd s(static_cast<Eigen::Index>(free_.size()));
    for (std::size_t k = 0; k < free_.size(); ++k) s[static_cast<Eigen::Index>(k)] = prior_sigma_[free_[k]];
    return s;
  }
  static double StepOf(Eigen::Index i) { return i >= 3 && i < kPlacementSize ? 1e-6 : 1e-3; }
  static PlacedObject Moved(const PlacedObject& object, Eigen::Index i, double step) {
    PlacedObject moved = object;
    VectorXd x = object.State();
    x[i] += step;
    moved.SetState(x);
    return moved;
  }

 private:
  VectorXd PriorOf(const PlacedObject& object) const {
    const VectorXd d = object.State() - x0_;
    VectorXd out(static_cast<Eigen::Index>(free_.size()));
    for (std::size_t k = 0; k < free_.size(); ++k) {
      // Place and yaw: no wish to stay at the start, only a finite system.
      out[static_cast<Eigen::Index>(k)] = free_[k] < 4 ? 0 : d[free_[k]];
    }
    return out;
  }
  static void KeepInRange(PlacedObject& object) {
    const auto defs = object.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i)
      object.dimensions_mm[i] = std::clamp(object.dimensions_mm[i], defs[i].min_mm, defs[i].max_mm);
  }

  std::span<const View> views_;
  std::span<const LineAssignment> assignments_;
  const FitOptions& options_;
  VectorXd x0_, prior_sigma_;
  std::vector<Eigen::Index> free_;
};

std::string NameOf(const PlacedObject& object, Eigen::Index i) {
  if (i >= kPlacementSize)
    return object.model->dimensions()[static_cast<std::size_t>(i - kPlacementSize)].name;
  return i < 3 ? "position" : i == 3 ? "yaw" : "tilt";
}

// d (distances of the projected edge's ends from itself as it is now) / d free unknowns: 2 x n, px.
MatrixXd EdgeRows(const PlacedObject& object, const View& view, int edge,
                  const std::vector<Eigen::Index>& free) {
  MatrixXd rows = MatrixXd::Zero(2, static_cast<Eigen::Index>(free.size()));
  auto ends = [&](const PlacedObject& o) {
    const WorldSolid solid = PlaceSolid(o, false);
    const auto& e = solid.edges[static_cast<std::size_t>(edge)];
    return std::pair(view.ProjectIdeal(solid.vertices[static_cast<std::size_t>(e.start)].point),
                     view.ProjectIdeal(solid.vertices[static_cast<std::size_t>(e.end)].point));
  };
  const auto [a, b] = ends(object);
  if (!a || !b || (*b - *a).norm() < 1e-6) return rows;
  const Vector2d t = (*b - *a).normalized(), n(-t.y(), t.x());
  for (std::size_t k = 0; k < free.size(); ++k) {
    const double step = Fitter::StepOf(free[k]);
    const auto [c, d] = ends(Fitter::Moved(object, free[k], step));
    if (!c || !d) continue;
    rows(0, static_cast<Eigen::Index>(k)) = (*c - *a).dot(n) / step;
    rows(1, static_cast<Eigen::Index>(k)) = (*d - *b).dot(n) / step;
  }
  return rows;
}

// For the unknown `at` (among the free ones): the visible edge that would make it known best.
std::optional<UsefulEdge> MostUseful(const PlacedObject& object, std::span<const View> views,
                                     std::span<const LineAssignment> assignments, const MatrixXd& information,
                                     const std::vector<Eigen::Index>& free, std::size_t at,
                                     double systematic_px) {
  constexpr double kSpacingPx = 25;
  const WorldSolid solid = PlaceSolid(object, false);
  std::optional<UsefulEdge> best;
  for (std::size_t v = 0; v < views.size(); ++v) {
    std::vector<int> seen;
    for (const auto& s : SampleContour(solid, views[v], kSpacingPx, 2))
      if (s.visible && s.source == ContourSample::Source::kEdge && (seen.empty() || seen.back() != s.index))
        seen.push_back(s.index);
    for (int edge : seen) {
      if (std::any_of(assignments.begin(), assignments.end(), [&](const LineAssignment& a) {
            return a.view == static_cast<int>(v) && a.index == edge &&
                   a.source == ContourSample::Source::kEdge;
          }))
        continue;
      const MatrixXd rows = EdgeRows(object, views[v], edge, free) / systematic_px;
      const MatrixXd sum = information + rows.transpose() * rows;
      VectorXd unit = VectorXd::Zero(sum.rows());
      unit[static_cast<Eigen::Index>(at)] = 1;
      const double sigma = std::sqrt(std::max(0.0, sum.ldlt().solve(unit)[static_cast<Eigen::Index>(at)]));
      if (!best || sigma < best->sigma_mm)
        best = {NameOf(object, free[at]), static_cast<int>(v), edge, sigma};
    }
  }
  return best;
}

Status CheckAssignments(std::span<const View> views, const WorldSolid& solid,
                        std::span<const LineAssignment> list) {
  if (list.empty())
    return UsageError("a fit needs at least one line that is assigned to a contour edge, got none");
  auto in = [](int i, std::size_t n) { return i >= 0 && static_cast<std::size_t>(i) < n; };
  for (const auto& a : list) {
    if (!in(a.view, views.size())) return UsageError("there is no picture {} to fit to", a.view);
    const auto* lines = views[static_cast<std::size_t>(a.view)].lines;
    if (!lines) return UsageError("picture {} has no line image", a.view);
    const bool circle = a.source == ContourSample::Source::kCircle;
    if (!in(a.line, circle ? lines->arcs.size() : lines->segments.size()))
      return UsageError("picture {} has no {} {}", a.view, circle ? "arc" : "segment", a.line);
    const std::size_t count = circle                                     ? solid.circles.size()
                              : a.source == ContourSample::Source::kEdge ? solid.edges.size()
                                                                         : solid.faces.size();
    if (!in(a.index, count)) return UsageError("the part has no contour {} ({} there are)", a.index, count);
    if (a.source == ContourSample::Source::kLimb &&
        !solid.faces[static_cast<std::size_t>(a.index)].is_cylinder)
      return UsageError("face {} of the part is no cylinder", a.index);
  }
  return {};
}

}  // namespace

Result<FitResult> FitPart(std::span<const View> views, const PlacedObject& start,
                          std::span<const LineAssignment> assignments, const FitOptions& options) {
  VSS_RETURN_IF_ERROR(CheckAssignments(views, PlaceSolid(start, false), assignments));
  const Fitter fitter(views, start, assignments, options);
  FitResult out;
  out.object = fitter.Best(start);
  const MatrixXd j = fitter.Jacobian(out.object);
  const MatrixXd data = j.transpose() * j;
  const VectorXd scale = fitter.Scale();
  MatrixXd information = data;
  information.diagonal() += scale.cwiseAbs2().cwiseInverse();
  const auto n = information.rows();
  const MatrixXd covariance = information.ldlt().solve(MatrixXd::Identity(n, n));
  const auto seen = AnalyseObservability(data, scale, kGain);
  const auto& free = fitter.free();
  out.covariance = MatrixXd::Zero(out.object.StateSize(), out.object.StateSize());
  out.observable.assign(static_cast<std::size_t>(out.object.StateSize()), true);
  for (std::size_t a = 0; a < free.size(); ++a) {
    out.observable[static_cast<std::size_t>(free[a])] = seen.observable[a];
    for (std::size_t b = 0; b < free.size(); ++b)
      out.covariance(free[a], free[b]) =
          covariance(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    if (seen.observable[a]) continue;
    const auto edge = MostUseful(out.object, views, assignments, information, free, a, options.systematic_px);
    if (!edge) continue;
    const bool known = std::any_of(out.useful.begin(), out.useful.end(),
                                   [&](const auto& u) { return u.dimension == edge->dimension; });
    if (known) continue;
    out.useful.push_back(*edge);
    out.remarks.push_back(fmt::format("{} is not determined yet; edge {} in picture {} would tell it best",
                                      edge->dimension, edge->edge, edge->view));
  }
  const WorldSolid solid = PlaceSolid(out.object, false);
  double sum = 0;
  for (const auto& a : assignments) {
    std::vector<double> unused;
    double px = 0;
    Residuals(solid, views[static_cast<std::size_t>(a.view)], a, options.systematic_px, unused, &px);
    out.residual_px.push_back(px);
    sum += px * px;
  }
  out.rms_px = std::sqrt(sum / static_cast<double>(assignments.size()));
  return out;
}

}  // namespace vss
