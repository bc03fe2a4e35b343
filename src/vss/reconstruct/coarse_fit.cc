#include "vss/reconstruct/coarse_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kSpacingPx = 8;
constexpr double kTouchMm = 12;         // parts that touch may overlap by that much at the start
constexpr double kMaxAngleCos = 0.985;  // 10 degrees between contour and line
constexpr double kCutWidths = 3;        // lines further than that many widths do not draw
constexpr double kOutlier = 0.05;       // weight of "this sample belongs to no line"
constexpr int kStepsPerWidth = 3;
constexpr double kShrink = 0.62;
constexpr double kFreeWidthPx = 1.5;  // below, dimensions are free and every line has one owner

struct Pull {
  Vector2d normal;
  double distance = 0;  // of the sample from the line, along normal
};

std::optional<Pull> TowardsSegment(const LineSegment& line, const ContourSample& s, double reach) {
  const Vector2d along = line.ideal_end - line.ideal_start;
  const double length = along.norm();
  if (length < 1e-9) return std::nullopt;
  const Vector2d t = along / length, n(-t.y(), t.x()), q = s.ideal - line.ideal_start;
  if (std::abs(t.dot(s.ideal_tangent)) < kMaxAngleCos) return std::nullopt;
  const double at = q.dot(t);
  if (at < -reach || at > length + reach) return std::nullopt;
  return Pull{n, q.dot(n)};
}

std::optional<Pull> TowardsArc(const EllipticalArc& arc, const ContourSample& s) {
  const double c = std::cos(arc.ideal_angle_rad), sn = std::sin(arc.ideal_angle_rad);
  const Vector2d q = s.ideal - arc.ideal_center;
  const double a = arc.ideal_axes.x(), b = arc.ideal_axes.y();
  if (!(a > 0 && b > 0)) return std::nullopt;
  const Vector2d l(c * q.x() + sn * q.y(), -sn * q.x() + c * q.y());
  double angle = std::atan2(l.y() / b, l.x() / a);
  while (angle < arc.ideal_from_rad) angle += 2 * kPi;
  if (angle > arc.ideal_to_rad + 0.1) return std::nullopt;
  const Vector2d g(2 * l.x() / (a * a), 2 * l.y() / (b * b));
  const double norm = g.norm();
  if (norm < 1e-12) return std::nullopt;
  const double f = l.x() * l.x() / (a * a) + l.y() * l.y() / (b * b) - 1;
  const Vector2d n((c * g.x() - sn * g.y()) / norm, (sn * g.x() + c * g.y()) / norm);
  if (std::abs(n.dot(s.ideal_tangent)) > std::sqrt(1 - kMaxAngleCos * kMaxAngleCos)) return std::nullopt;
  return Pull{n, f / norm};
}

struct ViewSamples {
  const View* view;
  std::vector<ContourSample> samples;
  std::vector<const LineSegment*> segments;
  std::vector<const EllipticalArc*> arcs;
  std::vector<std::size_t>
      line_index;  // of the segments, then the arcs, in the picture's segments, then arcs
};

// The visible samples of a view, and the lines within `reach` of them.
std::optional<ViewSamples> Look(const WorldSolid& solid, const View& view, const Occluders* others,
                                double reach) {
  if (!view.lines) return std::nullopt;
  ViewSamples out{&view, {}, {}, {}, {}};
  Eigen::AlignedBox2d box;
  for (auto& s : SampleContour(solid, view, kSpacingPx, 2, others, kTouchMm))
    if (s.visible) {
      box.extend(s.ideal);
      out.samples.push_back(s);
    }
  if (out.samples.empty()) return std::nullopt;
  box.min().array() -= reach;
  box.max().array() += reach;
  const auto& segments = view.lines->segments;
  const auto& arcs = view.lines->arcs;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const auto& l = segments[i];
    Eigen::AlignedBox2d span(l.ideal_start.cwiseMin(l.ideal_end), l.ideal_start.cwiseMax(l.ideal_end));
    if (!box.intersects(span)) continue;
    out.segments.push_back(&l);
    out.line_index.push_back(i);
  }
  for (std::size_t i = 0; i < arcs.size(); ++i) {
    const double r = arcs[i].ideal_axes.maxCoeff();
    Eigen::AlignedBox2d span(Vector2d(arcs[i].ideal_center.array() - r),
                             Vector2d(arcs[i].ideal_center.array() + r));
    if (!box.intersects(span)) continue;
    out.arcs.push_back(&arcs[i]);
    out.line_index.push_back(segments.size() + i);
  }
  return out;
}

struct Sums {
  MatrixXd h;
  VectorXd g;
  double cost = 0;
  int num_samples = 0;
};

struct Pulled {
  std::size_t sample;
  std::size_t line;  // segments first, then arcs
  Pull pull;
};

std::vector<Pulled> AllPulls(const ViewSamples& look, double width) {
  std::vector<Pulled> pulls;
  auto take = [&](std::size_t sample, std::size_t line, const std::optional<Pull>& pull) {
    if (pull && std::abs(pull->distance) < kCutWidths * width) pulls.push_back({sample, line, *pull});
  };
  for (std::size_t i = 0; i < look.samples.size(); ++i) {
    const auto& s = look.samples[i];
    for (std::size_t l = 0; l < look.segments.size(); ++l)
      take(i, l, TowardsSegment(*look.segments[l], s, width));
    if (s.source != ContourSample::Source::kCircle) continue;
    for (std::size_t l = 0; l < look.arcs.size(); ++l)
      take(i, look.segments.size() + l, TowardsArc(*look.arcs[l], s));
  }
  return pulls;
}

int CurveOf(const ContourSample& s) { return (s.index * 3 + static_cast<int>(s.source)) * 3 + s.limb_side; }

using CurveOnLine = std::pair<std::size_t, int>;  // line, curve

// Mean squared distance of each curve from each line along which it runs.
std::map<CurveOnLine, double> MeanSquares(const ViewSamples& look, const std::vector<Pulled>& pulls) {
  std::map<CurveOnLine, std::pair<double, double>> sums;
  for (const auto& p : pulls) {
    auto& [d2, n] = sums[{p.line, CurveOf(look.samples[p.sample])}];
    d2 += p.pull.distance * p.pull.distance;
    ++n;
  }
  std::map<CurveOnLine, double> means;
  for (const auto& [key, sum] : sums) means[key] = sum.first / sum.second;
  return means;
}

// How much of a line each of the part's curves may claim: a line belongs to one contour, the nearest most
// likely, and where `strict` to that alone.
std::map<CurveOnLine, double> Claims(const ViewSamples& look, const std::vector<Pulled>& pulls, double width,
                                     const std::vector<double>& claimed, bool strict) {
  auto claims = MeanSquares(look, pulls);
  std::map<std::size_t, std::pair<double, double>> lines;  // nearest, sum of weights
  auto weight = [&](double d2) { return std::exp(-d2 / (2 * width * width)); };
  for (const auto& [key, d2] : claims) {
    const double theirs = claimed.empty() ? INFINITY : claimed[look.line_index[key.first]];
    auto& [nearest, sum] = lines.insert({key.first, {theirs, weight(theirs)}}).first->second;
    nearest = std::min(nearest, d2);
    sum += weight(d2);
  }
  for (auto& [key, d2] : claims) {
    const auto& [nearest, sum] = lines.at(key.first);
    d2 = strict ? (d2 <= nearest ? 1.0 : 0.0) : weight(d2) / sum;
  }
  return claims;
}

void Accumulate(const WorldSolid& solid, const ViewSamples& look, double width,
                const std::vector<double>& claimed, bool strict, Sums& sums) {
  const auto pulls = AllPulls(look, width);
  const auto claims = Claims(look, pulls, width, claimed, strict);
  sums.num_samples += static_cast<int>(look.samples.size());
  sums.cost += static_cast<double>(look.samples.size());
  for (std::size_t begin = 0, end = 0; begin < pulls.size(); begin = end) {
    const auto& s = look.samples[pulls[begin].sample];
    std::vector<double> weights;
    double total = kOutlier, best = 0;
    for (end = begin; end < pulls.size() && pulls[end].sample == pulls[begin].sample; ++end) {
      const double d = pulls[end].pull.distance, claim = claims.at({pulls[end].line, CurveOf(s)});
      weights.push_back(claim * std::exp(-d * d / (2 * width * width)));
      total += weights.back();
      best = std::max(best, weights.back());
    }
    sums.cost -= best;
    const MatrixXd by_state = IdealByWorld(*look.view, s.point_in_world) * SampleByState(solid, s);
    for (std::size_t i = begin; i < end; ++i) {
      const VectorXd j = by_state.transpose() * pulls[i].pull.normal;
      const double weight = weights[i - begin] / total / (width * width);
      sums.h.selfadjointView<Eigen::Lower>().rankUpdate(j, weight);
      sums.g -= weight * pulls[i].pull.distance * j;
    }
  }
}

// While lines are looked for far off, dimensions keep nearly as they are: free ones would let the two edges
// of a thin plate fall onto one line.
VectorXd PriorWeights(const PlacedObject& start, double width, const CoarseFitOptions& o) {
  constexpr double kFixed = 1e12, kStiff = 0.02;
  VectorXd w(start.StateSize());
  for (std::size_t i = 0; i < start.dimensions_mm.size(); ++i) {
    const double sigma = width > kFreeWidthPx
                             ? std::min(o.dimension_sigma_mm, kStiff * start.dimensions_mm[i])
                             : o.dimension_sigma_mm;
    w[kPlacementSize + static_cast<int>(i)] = 1 / (sigma * sigma);
  }
  w[0] = w[1] = 1 / (o.position_sigma_mm * o.position_sigma_mm);
  w[2] = kFixed;
  w[3] = 1 / (o.yaw_sigma_rad * o.yaw_sigma_rad);
  w[4] = w[5] = o.tilt_sigma_rad > 0 ? 1 / (o.tilt_sigma_rad * o.tilt_sigma_rad) : kFixed;
  return w;
}

// Dimensions stay positive and within reach of their range, whatever the lines say.
void KeepInRange(PlacedObject& object) {
  const auto defs = object.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i)
    object.dimensions_mm[i] = std::clamp(object.dimensions_mm[i], defs[i].min_mm, defs[i].max_mm);
}

}  // namespace

Eigen::Matrix<double, 2, 3> IdealByWorld(const View& view, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d p = view.cam_from_world * point_in_world;
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix<double, 2, 3> j;
  j << k.fx_px / p.z(), 0, -k.fx_px * p.x() / (p.z() * p.z()), 0, k.fy_px / p.z(),
      -k.fy_px * p.y() / (p.z() * p.z());
  return j * view.cam_from_world.rotation;
}

LineDistances DistancesToLines(const PlacedObject& part, std::span<const View> views, const Occluders* others,
                               const CoarseFitOptions& options) {
  LineDistances out;
  const WorldSolid solid = PlaceSolid(part, false);
  for (const auto& view : views) {
    out.emplace_back(view.lines ? view.lines->segments.size() + view.lines->arcs.size() : 0, INFINITY);
    const auto look = Look(solid, view, others, kCutWidths * options.start_width_px);
    if (!look) continue;
    for (const auto& [key, d2] : MeanSquares(*look, AllPulls(*look, options.start_width_px))) {
      double& least = out.back()[look->line_index[key.first]];
      least = std::min(least, d2);
    }
  }
  return out;
}

CoarseFit FitToLines(const PlacedObject& start, std::span<const View> views, const Occluders* others,
                     const LineDistances& claimed, const CoarseFitOptions& options) {
  const VectorXd x0 = start.State();
  const auto n = x0.size();
  auto sum_up = [&](const PlacedObject& object, double width) {
    const WorldSolid solid = PlaceSolid(object);
    Sums sums{MatrixXd::Zero(n, n), VectorXd::Zero(n), 0, 0};
    for (std::size_t v = 0; v < views.size(); ++v)
      if (const auto look = Look(solid, views[v], others, kCutWidths * width))
        Accumulate(solid, *look, width, claimed.empty() ? std::vector<double>{} : claimed[v],
                   width < kFreeWidthPx, sums);
    if (sums.num_samples > 0) sums.cost /= sums.num_samples;
    return sums;
  };
  const Sums before = sum_up(start, options.end_width_px);
  CoarseFit fit{start, before.num_samples, before.num_samples > 0 ? before.cost : 1};
  fit.start_cost = fit.cost;
  PlacedObject object = start;
  for (double width = options.start_width_px;; width = std::max(width * kShrink, options.end_width_px)) {
    const VectorXd prior = PriorWeights(start, width, options);
    for (int step = 0; step < kStepsPerWidth; ++step) {
      Sums sums = sum_up(object, width);
      const VectorXd x = object.State();
      sums.h.diagonal() += prior;
      sums.g += prior.cwiseProduct(x0 - x);
      object.SetState(x + sums.h.selfadjointView<Eigen::Lower>().ldlt().solve(sums.g));
      KeepInRange(object);
      if (options.tilt_sigma_rad <= 0) object.placement.tail<2>() = start.placement.tail<2>();
    }
    if (width <= options.end_width_px) break;
  }
  const Sums after = sum_up(object, options.end_width_px);
  if (after.num_samples > 0 && after.cost <= fit.cost)
    fit = {object, after.num_samples, after.cost, fit.start_cost};
  return fit;
}

}  // namespace vss
