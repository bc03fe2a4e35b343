#include "manual_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "pick_residuals.h"

namespace vss::station {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kYawStarts = 24;  // 15 degrees apart: Gauss-Newton on straight edges converges from 20
constexpr int kStartSteps = 12, kFinalSteps = 40;
constexpr int kRefinedStarts = 4;
constexpr std::size_t kStartPicks = 24;
constexpr double kRobustScale = 4;  // whitened residuals beyond it lose their pull (Cauchy)
constexpr double kPriorPlaceMm = 1e4, kPriorYawRad = 2;
constexpr double kObservableShare =
    0.25;  // of the sigma before any line: more is left where the lines say nothing

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

Normal Accumulate(const PickResiduals& rows, const Prior& prior, const VectorXd& state, bool robust) {
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
  PickResiduals rows = ResidualsOf(q, object, views);
  Normal now = Accumulate(rows, prior, object.State(), robust);
  double lambda = 1e-3;
  for (int i = 0; i < steps; ++i) {
    MatrixXd a = now.information;
    a.diagonal() += prior.sigma.array().square().inverse().matrix();
    a.diagonal() *= 1 + lambda;
    const VectorXd step = -a.ldlt().solve(now.gradient);
    if (!step.allFinite()) break;
    PlacedObject next = Stepped(q, object, prior, step);
    PickResiduals next_rows = ResidualsOf(q, next, views);
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

// What a dimension's sigma is compared with: the dimension itself, or, where it is a place and may be 0, the
// object.
double SizeOf(const PlacedObject& object, std::size_t dimension) {
  if (object.model->dimensions()[dimension].min_mm > 0) return object.dimensions_mm[dimension];
  return *std::max_element(object.dimensions_mm.begin(), object.dimensions_mm.end());
}

// The rows that a line on that contour would add, were it picked: by the free parameters only.
MatrixXd FreeRows(const std::vector<Eigen::RowVectorXd>& rows, const Prior& prior) {
  MatrixXd out(Eigen::Index(rows.size()), Eigen::Index(prior.free.size()));
  for (Eigen::Index i = 0; i < out.rows(); ++i)
    for (Eigen::Index k = 0; k < out.cols(); ++k)
      out(i, k) = rows[std::size_t(i)][prior.free[std::size_t(k)]];
  return out;
}

struct Candidate {
  int image = 0, contour = 0;
  bool is_circle = false;
  MatrixXd rows;
};

// Edges and rims that are visible in some picture and were not picked there.
std::vector<Candidate> UnpickedContours(const FitQuestion& q, const PlacedObject& object,
                                        const std::vector<View>& views, const Prior& prior) {
  constexpr double kSpacingPx = 12;
  constexpr std::size_t kLeastVisible = 3, kRimPoints = 5;  // five points determine an ellipse
  std::vector<Candidate> out;
  const WorldSolid solid = PlaceSolid(object);
  for (const auto& view : views) {
    std::map<std::pair<bool, int>, std::vector<Vector2d>> seen;
    for (const auto& s : SampleContour(solid, view, kSpacingPx, int(kLeastVisible)))
      if (s.visible && s.source != ContourSample::Source::kLimb)
        seen[{s.source == ContourSample::Source::kCircle, s.index}].push_back(s.ideal);
    for (const auto& [contour, points] : seen) {
      const auto [is_circle, index] = contour;
      const bool picked =
          std::any_of(q.picks.begin(), q.picks.end(), [&, circle = is_circle, i = index](const Pick& p) {
            return p.is_circle == circle && p.image == view.image && p.contour == i;
          });
      if (picked || points.size() < kLeastVisible) continue;
      std::vector<Vector2d> at = {points.front(), points.back()};
      if (is_circle) {
        at.clear();
        for (std::size_t k = 0; k < kRimPoints; ++k)
          at.push_back(points[k * (points.size() - 1) / (kRimPoints - 1)]);
      }
      const auto rows = RowsOfContour(solid, is_circle, index, view, at);
      if (!rows.empty()) out.push_back({view.image, index, is_circle, FreeRows(rows, prior)});
    }
  }
  return out;
}

void AddHints(const FitQuestion& q, const std::vector<View>& views, const Prior& prior,
              const MatrixXd& information, FitAnswer& answer) {
  if (std::all_of(answer.observable.begin(), answer.observable.end(), [](bool o) { return o; })) return;
  const auto candidates = UnpickedContours(q, answer.object, views, prior);
  for (Eigen::Index k = 3; k < Eigen::Index(prior.free.size()); ++k) {
    const std::size_t dimension = std::size_t(prior.free[std::size_t(k)] - kPlacementSize);
    if (answer.observable[dimension]) continue;
    const double enough = kObservableShare * std::min(prior.sigma[k], SizeOf(answer.object, dimension));
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
      answer.hints.push_back({std::string(q.model->dimensions()[dimension].name), chosen->image,
                              chosen->contour, chosen->is_circle});
  }
}

void AddQuality(const FitQuestion& q, const std::vector<View>& views, const Prior& prior, FitAnswer& answer) {
  const PickResiduals rows = ResidualsOf(q, answer.object, views);
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
        sigma < kObservableShare * std::min(prior.sigma[Eigen::Index(i)], SizeOf(answer.object, dimension));
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

double RefinePicks(const FitQuestion& q, const std::vector<View>& views, PlacedObject& object) {
  PlacedObject mean = UsualObject(q);
  mean.placement = object.placement;
  return Minimise(q, views, MakePrior(q, mean), kFinalSteps, false, object);
}

}  // namespace vss::station
