#include "manual_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "vss/product/designation.h"

namespace vss::station {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Jac2 = Eigen::Matrix2Xd;

constexpr double kBiasPx = 0.15;  // what a line is off beyond its noise: contact shadows, lens, chamfers
constexpr double kNearestDepthMm = 100;  // an edge is cut off where it comes closer to the camera
constexpr int kYawStarts = 24;           // 15 degrees apart: Gauss-Newton on straight edges converges from 20
constexpr int kStartSteps = 12, kFinalSteps = 40;
constexpr int kRefinedStarts = 4;
constexpr std::size_t kStartPicks = 24;
constexpr double kRobustScale = 4;  // whitened residuals beyond it lose their pull (Cauchy)
constexpr double kPriorPlaceMm = 1e4, kPriorYawRad = 2;
constexpr double kObservableShare =
    0.25;                           // of the sigma before any line: more is left where the lines say nothing
constexpr double kOvershootPx = 3;  // a segment may reach so far beyond the end of its edge
constexpr int kArcPoints = 9;

struct Projected {
  Vector2d ideal;
  Jac2 by_state;
};

// A material point of the object in the picture; empty behind the camera.
std::optional<Projected> ProjectPoint(const View& view, const WorldPoint& p) {
  const Vector3d c = view.cam_from_world * p.point;
  if (c.z() < kNearestDepthMm) return std::nullopt;
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix<double, 2, 3> d;
  d << k.fx_px / c.z(), 0, -k.fx_px * c.x() / (c.z() * c.z()), 0, k.fy_px / c.z(),
      -k.fy_px * c.y() / (c.z() * c.z());
  return Projected{k.IdealFromNormalized({c.x() / c.z(), c.y() / c.z()}),
                   d * view.cam_from_world.rotation * p.by_state};
}

WorldPoint Between(const WorldPoint& a, const WorldPoint& b, double t) {
  return {(1 - t) * a.point + t * b.point, (1 - t) * a.by_state + t * b.by_state};
}

// The two ends of an edge, cut off in front of the camera.
bool ClippedEdge(const WorldSolid& solid, int edge, const View& view, WorldPoint* a, WorldPoint* b) {
  const auto& e = solid.edges[std::size_t(edge)];
  const WorldPoint &p = solid.vertices[std::size_t(e.start)], &q = solid.vertices[std::size_t(e.end)];
  const double zp = (view.cam_from_world * p.point).z(), zq = (view.cam_from_world * q.point).z(),
               z0 = 2 * kNearestDepthMm;
  if (zp < z0 && zq < z0) return false;
  *a = zp < z0 ? Between(p, q, (z0 - zp) / (zq - zp)) : p;
  *b = zq < z0 ? Between(p, q, (z0 - zp) / (zq - zp)) : q;
  return true;
}

WorldPoint OnCircle(const WorldSolid::Circle& c, double t) {
  const Vector3d out = c.axis_u * std::cos(t) + c.axis_v * std::sin(t);
  return {c.center.point + c.radius_mm * out, c.center.by_state + out * c.radius_by_state};
}

// Signed distance of `m` from the line through a and b, its derivative, and where along it (0 at a, 1 at b).
struct LineDistance {
  double distance = 0, along = 0;
  Eigen::RowVectorXd by_state;
};
std::optional<LineDistance> DistanceFromEdge(const Vector2d& m, const Projected& a, const Projected& b) {
  const Vector2d d = b.ideal - a.ideal;
  const double length2 = d.squaredNorm();
  if (length2 < 1e-6) return std::nullopt;
  const Vector2d n = Vector2d(-d.y(), d.x()) / std::sqrt(length2);
  LineDistance out;
  out.distance = n.dot(m - a.ideal);
  out.along = (m - a.ideal).dot(d) / length2;
  out.by_state = -n.transpose() * ((1 - out.along) * a.by_state + out.along * b.by_state);
  return out;
}

// Distance of `m` from the projected rim, by search on its angle.
std::optional<LineDistance> DistanceFromCircle(const Vector2d& m, const WorldSolid::Circle& c,
                                               const View& view) {
  auto distance2 = [&](double t) {
    const auto p = view.ProjectIdeal(OnCircle(c, t).point);
    return p ? (*p - m).squaredNorm() : INFINITY;
  };
  double best = 0, least = INFINITY;
  constexpr int kSteps = 48;
  for (int k = 0; k < kSteps; ++k)
    if (const double d = distance2(2 * kPi * k / kSteps); d < least) {
      least = d;
      best = 2 * kPi * k / kSteps;
    }
  for (double step = kPi / kSteps; step > 1e-6; step /= 2)
    for (double t : {best - step, best + step})
      if (const double d = distance2(t); d < least) {
        least = d;
        best = t;
      }
  const auto p = ProjectPoint(view, OnCircle(c, best)), q = ProjectPoint(view, OnCircle(c, best + 1e-4));
  if (!p || !q) return std::nullopt;
  const Vector2d tangent = (q->ideal - p->ideal).normalized(), n(-tangent.y(), tangent.x());
  return LineDistance{n.dot(m - p->ideal), best, -n.transpose() * p->by_state};
}

// All picks, whitened: residuals, Jacobian by the whole state, and the plain distances of each pick.
struct Residuals {
  std::vector<double> r;
  std::vector<Eigen::RowVectorXd> j;
  std::vector<double> pick_rms_px;
  double overshoot = 0;  // whitened squares: segments that reach beyond their edges
  int unseen = 0;        // picks whose contour lies behind the camera
};

void AddRow(Residuals& out, double r, Eigen::RowVectorXd j) {
  out.r.push_back(r);
  out.j.push_back(std::move(j));
}

void AddSegment(const Pick& pick, const WorldSolid& solid, const View& view, Residuals& out) {
  WorldPoint a, b;
  std::optional<Projected> pa, pb;
  if (ClippedEdge(solid, pick.contour, view, &a, &b)) pa = ProjectPoint(view, a), pb = ProjectPoint(view, b);
  std::optional<LineDistance> d0, d1;
  if (pa && pb)
    d0 = DistanceFromEdge(pick.ideal_start, *pa, *pb), d1 = DistanceFromEdge(pick.ideal_end, *pa, *pb);
  if (!d0 || !d1) {
    ++out.unseen;
    out.pick_rms_px.push_back(INFINITY);
    return;
  }
  const double length = std::max(1.0, (pick.ideal_end - pick.ideal_start).norm());
  const double sigma_offset = std::hypot(pick.sigma_offset_px, kBiasPx),
               sigma_angle = std::hypot(pick.sigma_angle_rad, 2 * kBiasPx / length);
  AddRow(out, (d0->distance + d1->distance) / 2 / sigma_offset,
         (d0->by_state + d1->by_state) / 2 / sigma_offset);
  AddRow(out, (d1->distance - d0->distance) / length / sigma_angle,
         (d1->by_state - d0->by_state) / length / sigma_angle);
  out.pick_rms_px.push_back(std::sqrt(
      (d0->distance * d0->distance + d0->distance * d1->distance + d1->distance * d1->distance) / 3));
  const double edge_px = (pb->ideal - pa->ideal).norm();
  for (double t : {d0->along, d1->along}) {
    const double beyond = edge_px * std::max({0.0, -t, t - 1}) / kOvershootPx;
    if (beyond > 1) out.overshoot += beyond * beyond;
  }
}

void AddArc(const Pick& pick, const WorldSolid& solid, const View& view, Residuals& out) {
  double sum = 0;
  const double sigma =
      std::hypot(pick.sigma_offset_px, kBiasPx) * std::sqrt(double(pick.ideal_points.size()) / 3);
  for (const auto& m : pick.ideal_points) {
    const auto d = DistanceFromCircle(m, solid.circles[std::size_t(pick.contour)], view);
    if (!d) {
      ++out.unseen;
      continue;
    }
    AddRow(out, d->distance / sigma, d->by_state / sigma);
    sum += d->distance * d->distance;
  }
  out.pick_rms_px.push_back(std::sqrt(sum / double(std::max<std::size_t>(1, pick.ideal_points.size()))));
}

Residuals Evaluate(const FitQuestion& q, const PlacedObject& object, const std::vector<View>& views) {
  Residuals out;
  const WorldSolid solid = PlaceSolid(object);
  for (const auto& pick : q.picks) {
    if (pick.is_circle)
      AddArc(pick, solid, views[std::size_t(pick.image)], out);
    else
      AddSegment(pick, solid, views[std::size_t(pick.image)], out);
  }
  return out;
}

// What is known before any line, of the free parameters.
struct Prior {
  std::vector<int> free;  // indices into the state
  VectorXd mean, sigma;   // of those
};

Prior MakePrior(const FitQuestion& q, const PlacedObject& start) {
  Prior prior;
  std::vector<double> sigma;
  for (int i : {0, 1}) prior.free.push_back(i), sigma.push_back(kPriorPlaceMm);
  prior.free.push_back(3), sigma.push_back(kPriorYawRad);
  const auto defs = q.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    if (q.fixed_mm.contains(defs[i].name)) continue;
    prior.free.push_back(kPlacementSize + int(i));
    sigma.push_back(std::max(1.0, (defs[i].max_mm - defs[i].min_mm) / 2));
  }
  prior.sigma = Eigen::Map<VectorXd>(sigma.data(), Eigen::Index(sigma.size()));
  const VectorXd state = start.State();
  prior.mean.resize(prior.sigma.size());
  for (Eigen::Index i = 0; i < prior.mean.size(); ++i) prior.mean[i] = state[prior.free[std::size_t(i)]];
  return prior;
}

struct Normal {
  MatrixXd information;  // of the lines alone
  VectorXd gradient;
  double cost = 0;  // lines and prior
};

double Weight(double r, bool robust) { return robust ? 1 / (1 + r * r / (kRobustScale * kRobustScale)) : 1; }
double Cost(double r, bool robust) {
  return robust ? kRobustScale * kRobustScale * std::log1p(r * r / (kRobustScale * kRobustScale)) : r * r;
}

Normal Accumulate(const Residuals& rows, const Prior& prior, const VectorXd& state, bool robust) {
  const auto n = Eigen::Index(prior.free.size());
  Normal out{MatrixXd::Zero(n, n), VectorXd::Zero(n), 1e6 * rows.unseen};
  VectorXd j(n);
  for (std::size_t i = 0; i < rows.r.size(); ++i) {
    for (Eigen::Index k = 0; k < n; ++k) j[k] = rows.j[i][prior.free[std::size_t(k)]];
    const double w = Weight(rows.r[i], robust);
    out.information += w * j * j.transpose();
    out.gradient += w * j * rows.r[i];
    out.cost += Cost(rows.r[i], robust);
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    const double d = (state[prior.free[std::size_t(k)]] - prior.mean[k]) / prior.sigma[k];
    out.gradient[k] += d / prior.sigma[k];
    out.cost += d * d;
  }
  return out;
}

PlacedObject Stepped(const FitQuestion& q, const PlacedObject& from, const Prior& prior,
                     const VectorXd& step) {
  PlacedObject to = from;
  VectorXd state = from.State();
  for (Eigen::Index k = 0; k < step.size(); ++k) state[prior.free[std::size_t(k)]] += step[k];
  const auto defs = q.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i)
    state[kPlacementSize + int(i)] =
        std::clamp(state[kPlacementSize + int(i)], defs[i].min_mm, defs[i].max_mm);
  to.SetState(state);
  return to;
}

// Levenberg-Marquardt; returns the cost.
double Minimise(const FitQuestion& q, const std::vector<View>& views, const Prior& prior, int steps,
                bool robust, PlacedObject& object) {
  Residuals rows = Evaluate(q, object, views);
  Normal now = Accumulate(rows, prior, object.State(), robust);
  double lambda = 1e-3;
  for (int i = 0; i < steps; ++i) {
    MatrixXd a = now.information;
    a.diagonal() += prior.sigma.array().square().inverse().matrix();
    a.diagonal() *= 1 + lambda;
    const VectorXd step = -a.ldlt().solve(now.gradient);
    if (!step.allFinite()) break;
    PlacedObject next = Stepped(q, object, prior, step);
    Residuals next_rows = Evaluate(q, next, views);
    const Normal next_normal = Accumulate(next_rows, prior, next.State(), robust);
    if (next_normal.cost < now.cost) {
      const bool done = now.cost - next_normal.cost < 1e-7 * (1 + now.cost);
      object = std::move(next);
      rows = std::move(next_rows);
      now = next_normal;
      lambda = std::max(lambda / 5, 1e-9);
      if (done) break;
    } else if ((lambda *= 6) > 1e8) {
      break;
    }
  }
  return now.cost + rows.overshoot;
}

PlacedObject UsualObject(const FitQuestion& q) {
  PlacedObject object;
  object.model = q.model;
  object.resting_pose = q.resting_pose;
  std::vector<std::optional<double>> known;
  for (const auto& def : q.model->dimensions()) {
    const auto at = q.fixed_mm.find(def.name);
    known.push_back(at == q.fixed_mm.end() ? std::nullopt : std::optional(at->second));
  }
  object.dimensions_mm = q.model->UsualDimensions(known);
  object.placement[2] = q.support_height_mm;
  return object;
}

// Where the rays of the picks meet the plane on which the part stands, on average.
Vector2d FootOfPicks(const FitQuestion& q, const std::vector<View>& views) {
  Vector2d sum = Vector2d::Zero();
  int n = 0;
  for (const auto& pick : q.picks) {
    const View& view = views[std::size_t(pick.image)];
    const Vector2d m = pick.is_circle ? pick.ideal_points[pick.ideal_points.size() / 2]
                                      : Vector2d((pick.ideal_start + pick.ideal_end) / 2);
    const Vector3d ray = view.RayOfIdeal(m);
    if (ray.z() > -1e-3) continue;
    const double s = (q.support_height_mm - view.center_in_world.z()) / ray.z();
    sum += (view.center_in_world + s * ray).head<2>();
    ++n;
  }
  return n > 0 ? Vector2d(sum / n) : Vector2d::Zero();
}

// Every so manieth pick, so that not many more than kStartPicks are left: enough to tell the starts apart.
FitQuestion Thinned(const FitQuestion& q) {
  FitQuestion thin = q;
  const std::size_t step = std::max<std::size_t>(1, q.picks.size() / kStartPicks);
  thin.picks.clear();
  for (std::size_t i = 0; i < q.picks.size(); i += step) thin.picks.push_back(q.picks[i]);
  return thin;
}

// The object at the best of many starts; all picks are fitted later.
PlacedObject FitFromNothing(const FitQuestion& all, const std::vector<View>& views) {
  const FitQuestion q = Thinned(all);
  PlacedObject usual = UsualObject(q);
  usual.placement.head<2>() = FootOfPicks(q, views);
  const Prior prior = MakePrior(q, usual);
  std::vector<std::pair<double, PlacedObject>> starts;
  for (int i = 0; i < kYawStarts; ++i) {
    PlacedObject object = usual;
    object.placement[3] = 2 * kPi * i / kYawStarts;
    const double cost = Minimise(q, views, prior, kStartSteps, false, object);
    starts.emplace_back(cost, std::move(object));
  }
  std::sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  starts.resize(kRefinedStarts);
  for (auto& [cost, object] : starts) cost = Minimise(q, views, prior, kFinalSteps, false, object);
  return std::min_element(starts.begin(), starts.end(),
                          [](const auto& a, const auto& b) { return a.first < b.first; })
      ->second;
}

// The rows that a line on that edge would add, were it picked.
MatrixXd RowsOfEdge(const WorldSolid& solid, int edge, const View& view, const Vector2d& from,
                    const Vector2d& to, const Prior& prior) {
  WorldPoint a, b;
  if (!ClippedEdge(solid, edge, view, &a, &b)) return {};
  const auto pa = ProjectPoint(view, a), pb = ProjectPoint(view, b);
  if (!pa || !pb) return {};
  const auto d0 = DistanceFromEdge(from, *pa, *pb), d1 = DistanceFromEdge(to, *pa, *pb);
  if (!d0 || !d1) return {};
  MatrixXd rows(2, Eigen::Index(prior.free.size()));
  for (Eigen::Index k = 0; k < rows.cols(); ++k) {
    rows(0, k) = d0->by_state[prior.free[std::size_t(k)]] / kBiasPx;
    rows(1, k) = d1->by_state[prior.free[std::size_t(k)]] / kBiasPx;
  }
  return rows;
}

struct Candidate {
  int image, contour;
  MatrixXd rows;
};

// Edges that are visible in some picture and were not picked there.
std::vector<Candidate> UnpickedEdges(const FitQuestion& q, const PlacedObject& object,
                                     const std::vector<View>& views, const Prior& prior) {
  constexpr double kSpacingPx = 12;
  constexpr int kLeastVisible = 3;
  std::vector<Candidate> out;
  const WorldSolid solid = PlaceSolid(object);
  for (const auto& view : views) {
    std::map<int, std::vector<Vector2d>> seen;
    for (const auto& s : SampleContour(solid, view, kSpacingPx, kLeastVisible))
      if (s.visible && s.source == ContourSample::Source::kEdge) seen[s.index].push_back(s.ideal);
    for (const auto& [edge, points] : seen) {
      const bool picked = std::any_of(q.picks.begin(), q.picks.end(), [&](const Pick& p) {
        return !p.is_circle && p.image == view.image && p.contour == edge;
      });
      if (picked || int(points.size()) < kLeastVisible) continue;
      MatrixXd rows = RowsOfEdge(solid, edge, view, points.front(), points.back(), prior);
      if (rows.size() > 0) out.push_back({view.image, edge, std::move(rows)});
    }
  }
  return out;
}

void AddHints(const FitQuestion& q, const std::vector<View>& views, const Prior& prior,
              const MatrixXd& information, FitAnswer& answer) {
  if (std::all_of(answer.observable.begin(), answer.observable.end(), [](bool o) { return o; })) return;
  const auto candidates = UnpickedEdges(q, answer.object, views, prior);
  for (Eigen::Index k = 3; k < Eigen::Index(prior.free.size()); ++k) {
    const std::size_t dimension = std::size_t(prior.free[std::size_t(k)] - kPlacementSize);
    if (answer.observable[dimension]) continue;
    const double enough = kObservableShare * std::min(prior.sigma[k], answer.object.dimensions_mm[dimension]);
    // Where a line of the present picture is enough, nobody has to look for a better one elsewhere.
    std::pair best{true, 0.98 * kObservableShare * prior.sigma[k]};
    const Candidate* chosen = nullptr;
    for (const auto& c : candidates) {
      const MatrixXd with = information + c.rows.transpose() * c.rows;
      const double sigma = std::sqrt(std::max(0.0, with.ldlt().solve(VectorXd::Unit(with.rows(), k))[k]));
      const std::pair rank{c.image != q.present_image || sigma >= enough, sigma};
      if (rank < best) best = rank, chosen = &c;
    }
    if (chosen)
      answer.hints.push_back(
          {std::string(q.model->dimensions()[dimension].name), chosen->image, chosen->contour, false});
  }
}

void AddQuality(const FitQuestion& q, const std::vector<View>& views, const Prior& prior, FitAnswer& answer) {
  const Residuals rows = Evaluate(q, answer.object, views);
  const Normal normal = Accumulate(rows, prior, answer.object.State(), true);
  MatrixXd information = normal.information;
  information.diagonal() += prior.sigma.array().square().inverse().matrix();
  const MatrixXd covariance =
      information.ldlt().solve(MatrixXd::Identity(information.rows(), information.cols()));
  double chi2 = 0;
  for (double r : rows.r) chi2 += Cost(r, true);
  const double freedom = double(rows.r.size()) - double(prior.free.size());
  const double scale = freedom > 0 ? std::max(1.0, chi2 / freedom) : 1.0;
  const int n = answer.object.StateSize();
  answer.covariance = MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < prior.free.size(); ++i)
    for (std::size_t k = 0; k < prior.free.size(); ++k)
      answer.covariance(prior.free[i], prior.free[k]) = scale * covariance(Eigen::Index(i), Eigen::Index(k));
  answer.residual_px = rows.pick_rms_px;
  double sum = 0;
  for (double r : rows.pick_rms_px) sum += r * r;
  answer.rms_px = std::sqrt(sum / double(std::max<std::size_t>(1, rows.pick_rms_px.size())));
  answer.sigma_mm.assign(answer.object.dimensions_mm.size(), 0.0);
  answer.observable.assign(answer.object.dimensions_mm.size(), true);
  for (std::size_t i = 0; i < prior.free.size(); ++i) {
    const double sigma = std::sqrt(covariance(Eigen::Index(i), Eigen::Index(i)));
    if (prior.free[i] < kPlacementSize) continue;
    const std::size_t dimension = std::size_t(prior.free[i] - kPlacementSize);
    answer.sigma_mm[dimension] = std::sqrt(scale) * sigma;
    answer.observable[dimension] =
        sigma <
        kObservableShare * std::min(prior.sigma[Eigen::Index(i)], answer.object.dimensions_mm[dimension]);
  }
  answer.placed =
      covariance(0, 0) < 100 * 100 && covariance(1, 1) < 100 * 100 && covariance(2, 2) < 0.1 * 0.1;
  AddHints(q, views, prior, information, answer);
}

Status CheckQuestion(const FitQuestion& q, const std::vector<View>& views) {
  if (q.picks.empty()) return UsageError("no line is picked yet; click a line that belongs to the object");
  PlacedObject usual = UsualObject(q);
  const WorldSolid solid = PlaceSolid(usual, false);
  for (const auto& p : q.picks) {
    const std::size_t count = p.is_circle ? solid.circles.size() : solid.edges.size();
    if (p.contour < 0 || std::size_t(p.contour) >= count)
      return UsageError("a {} has no {} number {}", q.model->kind(), p.is_circle ? "rim" : "edge", p.contour);
    if (p.image < 0 || std::size_t(p.image) >= views.size())
      return UsageError("there is no picture number {}", p.image);
  }
  for (const auto& [name, value] : q.fixed_mm) {
    const auto defs = q.model->dimensions();
    const auto def =
        std::find_if(defs.begin(), defs.end(), [&name = name](const auto& d) { return d.name == name; });
    if (def == defs.end()) return UsageError("a {} has no dimension {}", q.model->kind(), name);
    if (!(value >= def->min_mm && value <= def->max_mm))
      return UsageError("{}: {} mm is outside its range {} to {} mm", name, value, def->min_mm, def->max_mm);
  }
  return {};
}

}  // namespace

Result<FitAnswer> FitPicks(const FitQuestion& q, const std::vector<View>& views) {
  VSS_RETURN_IF_ERROR(CheckQuestion(q, views));
  FitAnswer answer;
  answer.object = q.start ? *q.start : FitFromNothing(q, views);
  if (q.start) {
    answer.object.placement[2] = q.support_height_mm;
    const auto defs = q.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i)
      if (const auto at = q.fixed_mm.find(defs[i].name); at != q.fixed_mm.end())
        answer.object.dimensions_mm[i] = at->second;
  }
  PlacedObject mean = UsualObject(q);
  mean.placement = answer.object.placement;
  const Prior prior = MakePrior(q, mean);
  Minimise(q, views, prior, kFinalSteps, true, answer.object);
  answer.object.placement[3] = std::remainder(answer.object.placement[3], 2 * kPi);
  AddQuality(q, views, prior, answer);
  return answer;
}

namespace {

// How well a straight line lies on the visible samples of one contour: mean distance, and how much of it they
// cover.
struct Closeness {
  double mean_px = INFINITY, covered = 0;
};
Closeness ClosenessOf(const Pick& line, const std::vector<ContourSample>& samples, double spacing_px,
                      double tolerance_px) {
  const Vector2d d = line.ideal_end - line.ideal_start;
  const double length = std::max(d.norm(), 1e-9), max_sine = std::max(0.05, 2 * tolerance_px / length);
  const Vector2d along = d / length, n(-along.y(), along.x());
  double sum = 0;
  int count = 0;
  for (const auto& s : samples) {
    const double t = along.dot(s.ideal - line.ideal_start);
    if (t < -tolerance_px || t > length + tolerance_px || std::abs(n.dot(s.ideal_tangent)) > max_sine)
      continue;
    const double distance = std::abs(n.dot(s.ideal - line.ideal_start));
    if (distance > tolerance_px) continue;
    sum += distance;
    ++count;
  }
  if (count == 0) return {};
  return {sum / count, count * spacing_px / length};
}

Closeness ArcClosenessOf(const Pick& arc, const std::vector<ContourSample>& samples, double tolerance_px) {
  double sum = 0;
  int count = 0;
  for (const auto& m : arc.ideal_points) {
    double least = INFINITY;
    for (const auto& s : samples) {
      const Vector2d n(-s.ideal_tangent.y(), s.ideal_tangent.x());
      if ((m - s.ideal).norm() < 10) least = std::min(least, std::abs(n.dot(m - s.ideal)));
    }
    if (least > tolerance_px) continue;
    sum += least;
    ++count;
  }
  if (count == 0) return {};
  return {sum / count, double(count) / double(arc.ideal_points.size())};
}

}  // namespace

std::vector<Pick> CollectPicks(const PlacedObject& object, const std::vector<View>& views,
                               const Occluders* others, double tolerance_px,
                               const std::function<bool(int, int)>& taken,
                               const std::function<std::vector<Pick>(int)>& lines_of) {
  constexpr double kSpacingPx = 4, kLeastCovered = 0.6, kDistinctPx = 0.7;
  const WorldSolid solid = PlaceSolid(object, false);
  std::vector<Pick> out;
  for (const auto& view : views) {
    std::map<std::pair<bool, int>, std::vector<ContourSample>> contours;
    for (const auto& s : SampleContour(solid, view, kSpacingPx, 2, others))
      if (s.visible && s.source != ContourSample::Source::kLimb)
        contours[{s.source == ContourSample::Source::kCircle, s.index}].push_back(s);
    if (contours.empty()) continue;
    for (Pick line : lines_of(view.image)) {
      if (taken(view.image, line.line)) continue;
      double best = INFINITY, second = INFINITY;
      for (const auto& [key, samples] : contours) {
        if (key.first != line.is_circle) continue;
        const Closeness c = line.is_circle ? ArcClosenessOf(line, samples, tolerance_px)
                                           : ClosenessOf(line, samples, kSpacingPx, tolerance_px);
        if (c.covered < kLeastCovered) continue;
        if (c.mean_px < best) {
          second = best;
          best = c.mean_px;
          line.contour = key.second;
        } else
          second = std::min(second, c.mean_px);
      }
      if (best <= tolerance_px && second - best > kDistinctPx) out.push_back(std::move(line));
    }
  }
  return out;
}

namespace {

// The standard size that the dimensions tell; those that the operator gave count as measured.
void SetDesignation(const FitAnswer& answer, const FitQuestion& q, Part& part) {
  ReconstructedPart measured;
  measured.object = answer.object;
  measured.covariance = answer.covariance;
  for (const auto& d : part.dimensions)
    measured.dimensions.push_back(
        {d.name, d.value_mm, d.sigma_mm, d.observable || q.fixed_mm.contains(d.name), d.origin});
  const Designation size = Designate(measured);
  part.designation = size.name;
  part.standard = size.standard;
  part.designation_candidates = size.candidates;
  for (std::size_t i = 0; i < size.nominal_mm.size(); ++i) part.dimensions[i].nominal_mm = size.nominal_mm[i];
}

}  // namespace

Part PartOfFit(const FitAnswer& answer, const FitQuestion& q) {
  Part part;
  const PlacedObject& object = answer.object;
  const WorldSolid solid = PlaceSolid(object);
  const int n = int(object.dimensions_mm.size());
  part.kind = q.model->kind();
  part.features = FeaturesOf(*q.model);
  part.has_features = !q.model->features().empty();
  part.resting_pose = q.model->resting_poses()[std::size_t(object.resting_pose)].name;
  part.world_from_part = solid.world_from_part;
  part.yaw_rad = object.placement[3];
  const auto defs = q.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    DimensionValue d{defs[i].name, object.dimensions_mm[i], answer.sigma_mm[i], answer.observable[i], ""};
    if (q.fixed_mm.contains(d.name))
      d.origin = "given by the operator", d.observable = false, d.sigma_mm = 0;
    else if (!d.observable)
      d.origin = "not determined by the picked lines: what is usual for this kind";
    part.dimensions.push_back(std::move(d));
  }
  for (const auto& v : solid.vertices) {
    part.vertices.push_back(v.point);
    part.vertex_sigma.push_back(
        (v.by_state * answer.covariance * v.by_state.transpose()).diagonal().cwiseMax(0).cwiseSqrt());
  }
  for (const auto& e : solid.edges) part.edges.push_back({e.start, e.end});
  for (const auto& c : solid.circles) part.circles.push_back({c.center.point, c.normal, c.radius_mm});
  // (x, y, z, rotation vector, dimensions) by the state.
  MatrixXd by_state = MatrixXd::Zero(6 + n, object.StateSize());
  constexpr double kStep = 1e-4;
  for (int i = 0; i < object.StateSize(); ++i) {
    PlacedObject moved = object;
    VectorXd state = object.State();
    state[i] += kStep;
    moved.SetState(state);
    const RigidTransform after = PlaceSolid(moved, false).world_from_part;
    by_state.block<3, 1>(0, i) = (after.translation - solid.world_from_part.translation) / kStep;
    by_state.block<3, 1>(3, i) =
        VectorFromRotation(after.rotation * solid.world_from_part.rotation.transpose()) / kStep;
    if (i >= kPlacementSize) by_state(i, i) = 1;
  }
  part.covariance = by_state * answer.covariance * by_state.transpose();
  for (std::size_t i = 0; i < q.picks.size(); ++i) {
    const Pick& p = q.picks[i];
    part.matches.push_back({p.image, p.line, p.contour, p.is_circle, answer.residual_px[i]});
    if (std::find(part.images.begin(), part.images.end(), p.image) == part.images.end())
      part.images.push_back(p.image);
  }
  std::sort(part.images.begin(), part.images.end());
  part.residual_px = answer.rms_px;
  SetDesignation(answer, q, part);
  return part;
}

}  // namespace vss::station
