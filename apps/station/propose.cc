#include "propose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "collect_picks.h"
#include "pick_residuals.h"

namespace vss::station {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kSameYawRad = 0.015;  // turns so near to each other are one
constexpr double kAcrossSine = 0.06;   // an edge leaves the plane of camera and line by no more
constexpr double kLevelSine = 0.05;    // an edge that rises by less is level
constexpr double kPlaceSigmaMm = 4;    // of an edge, before the fit
constexpr double kRimSigmaMm = 60;     // of a rim's middle by the middle of an arc
constexpr std::size_t kBeam = 150, kYaws = 20, kRefined = 120, kWeighed = 20;
constexpr double kMostRmsPx = 3;      // a reading that leaves more does not explain the lines
constexpr double kMissed = 0.5;       // a visible contour without a line, against one with
constexpr double kClearlyBetter = 2;  // scores that differ by less do not decide
constexpr double kSameBodyMm = 8;

// The plane through the camera and a picked line, or the ray to an arc's middle.
struct Sight {
  Vector3d eye, normal, ray;
  double length_px = 0;
};

Sight SightOf(const Pick& pick, const View& view) {
  Sight s;
  s.eye = view.center_in_world;
  if (pick.is_circle) {
    Vector2d sum = Vector2d::Zero();
    for (const auto& p : pick.ideal_points) sum += p;
    s.ray = view.RayOfIdeal(sum / double(std::max<std::size_t>(1, pick.ideal_points.size())));
    s.normal = s.ray.unitOrthogonal();
    return s;
  }
  const Vector3d a = view.RayOfIdeal(pick.ideal_start), b = view.RayOfIdeal(pick.ideal_end);
  s.ray = (a + b).normalized();
  s.normal = a.cross(b).normalized();
  s.length_px = (pick.ideal_end - pick.ideal_start).norm();
  return s;
}

Vector3d EdgeDirection(const WorldSolid& solid, const SolidEdge& e) {
  return (solid.vertices[std::size_t(e.end)].point - solid.vertices[std::size_t(e.start)].point).normalized();
}

// How the object may be turned: those that most lines agree with first.
std::vector<double> YawsOf(const WorldSolid& unturned, const std::vector<Pick>& picks,
                           const std::vector<Sight>& sights) {
  std::vector<std::pair<int, double>> yaws;  // minus the votes
  for (std::size_t i = 0; i < picks.size(); ++i) {
    const Vector3d level = sights[i].normal.cross(Vector3d::UnitZ());
    if (picks[i].is_circle || level.norm() < kLevelSine) continue;
    for (const auto& e : unturned.edges) {
      const Vector3d d = EdgeDirection(unturned, e);
      if (std::abs(d.z()) > kLevelSine) continue;
      for (double half : {0.0, kPi}) {
        const double yaw =
            std::remainder(std::atan2(level.y(), level.x()) - std::atan2(d.y(), d.x()) + half, 2 * kPi);
        const auto same = std::find_if(yaws.begin(), yaws.end(), [&](const auto& y) {
          return std::abs(std::remainder(y.second - yaw, 2 * kPi)) < kSameYawRad;
        });
        if (same == yaws.end())
          yaws.emplace_back(-1, yaw);
        else
          --same->first;
      }
    }
  }
  std::stable_sort(yaws.begin(), yaws.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  if (yaws.size() > kYaws) yaws.resize(kYaws);
  std::vector<double> out;
  for (const auto& y : yaws) out.push_back(y.second);
  if (out.empty()) out = {0, kPi / 2};  // rims alone
  return out;
}

// One assignment so far, as the normal equations of position and dimensions.
struct Branch {
  std::vector<int> contours;
  MatrixXd information;
  VectorXd gradient;
  double square = 0, cost = 0;
};

struct Row {
  VectorXd by;
  double value = 0;
};

Row RowOf(const WorldPoint& p, const Sight& s, const Vector3d& normal, const std::vector<int>& free,
          double sigma_mm) {
  Row row{VectorXd(Eigen::Index(free.size())), normal.dot(p.point - s.eye) / sigma_mm};
  for (std::size_t k = 0; k < free.size(); ++k)
    row.by[Eigen::Index(k)] = normal.dot(p.by_state.col(free[k])) / sigma_mm;
  return row;
}

// What assigning a pick to a contour says; empty where the contour runs another way.
std::vector<Row> RowsOf(const Pick& pick, const Sight& s, const WorldSolid& solid, int contour,
                        const std::vector<int>& free) {
  if (pick.is_circle) {
    const WorldPoint& c = solid.circles[std::size_t(contour)].center;
    return {RowOf(c, s, s.normal, free, kRimSigmaMm), RowOf(c, s, s.ray.cross(s.normal), free, kRimSigmaMm)};
  }
  const SolidEdge& e = solid.edges[std::size_t(contour)];
  if (e.weight == 0 || std::abs(s.normal.dot(EdgeDirection(solid, e))) > kAcrossSine) return {};
  const WorldPoint &a = solid.vertices[std::size_t(e.start)], &b = solid.vertices[std::size_t(e.end)];
  const WorldPoint middle{(a.point + b.point) / 2, (a.by_state + b.by_state) / 2};
  return {RowOf(middle, s, s.normal, free, kPlaceSigmaMm)};
}

void Extend(Branch& b, int pick, int contour, const std::vector<Row>& rows) {
  b.contours[std::size_t(pick)] = contour;
  for (const auto& r : rows) {
    b.information += r.by * r.by.transpose();
    b.gradient += r.by * r.value;
    b.square += r.value * r.value;
  }
  b.cost = b.square - b.gradient.dot(b.information.ldlt().solve(b.gradient));
}

PlacedObject UsualAt(const FitQuestion& q, double yaw, const Vector2d& foot) {
  PlacedObject object = UsualObject(q);
  object.placement.head<2>() = foot;
  object.placement[3] = yaw;
  return object;
}

// Two lines of one picture are one contour only where they lie in one line.
bool MayShareContour(const Pick& a, const Pick& b) {
  constexpr double kOnePx = 1.5;
  if (a.image != b.image || a.is_circle || b.is_circle) return true;
  const Vector2d d = (a.ideal_end - a.ideal_start).normalized();
  const auto off = [&](const Vector2d& p) {
    const Vector2d v = p - a.ideal_start;
    return std::abs(d.x() * v.y() - d.y() * v.x());
  };
  return off(b.ideal_start) < kOnePx && off(b.ideal_end) < kOnePx;
}

struct Start {
  double cost = 0;
  std::vector<int> contours;
  PlacedObject object;
};

// The best assignments with the object turned by `yaw`.
void SearchAt(const FitQuestion& q, const std::vector<Sight>& sights, const PlacedObject& usual,
              std::vector<Start>& out) {
  const WorldSolid solid = PlaceSolid(usual);
  std::vector<int> free = {0, 1, 3};
  std::vector<double> sigma = {1e4, 1e4, kSameYawRad};
  const auto defs = q.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i)
    if (!q.fixed_mm.contains(defs[i].name)) {
      free.push_back(kPlacementSize + int(i));
      sigma.push_back(std::max(1.0, (defs[i].max_mm - defs[i].min_mm) / 2));
    }
  const auto n = Eigen::Index(free.size());
  Branch root{std::vector<int>(q.picks.size(), -1), MatrixXd::Zero(n, n), VectorXd::Zero(n)};
  for (Eigen::Index k = 0; k < n; ++k)
    root.information(k, k) = 1 / (sigma[std::size_t(k)] * sigma[std::size_t(k)]);
  std::vector<Branch> beam = {root};
  for (std::size_t i = 0; i < q.picks.size(); ++i) {
    std::vector<std::pair<int, std::vector<Row>>> candidates;
    const std::size_t count = q.picks[i].is_circle ? solid.circles.size() : solid.edges.size();
    for (int c = 0; c < int(count); ++c)
      if (auto rows = RowsOf(q.picks[i], sights[i], solid, c, free); !rows.empty())
        candidates.emplace_back(c, std::move(rows));
    std::vector<Branch> next;
    for (const auto& branch : beam)
      for (const auto& [contour, rows] : candidates) {
        bool taken = false;
        for (std::size_t k = 0; k < i && !taken; ++k)
          taken = branch.contours[k] == contour && q.picks[k].is_circle == q.picks[i].is_circle &&
                  !MayShareContour(q.picks[k], q.picks[i]);
        if (taken) continue;
        next.push_back(branch);
        Extend(next.back(), int(i), contour, rows);
      }
    std::stable_sort(next.begin(), next.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
    if (next.size() > kBeam) next.resize(kBeam);
    beam = std::move(next);
  }
  for (const auto& branch : beam) {
    const VectorXd step = -branch.information.ldlt().solve(branch.gradient);
    PlacedObject object = usual;
    VectorXd state = object.State();
    for (Eigen::Index k = 0; k < n; ++k) state[free[std::size_t(k)]] += step[k];
    double beyond = 0;  // dimensions out of their ranges, as shares
    for (std::size_t i = 0; i < defs.size(); ++i) {
      double& value = state[kPlacementSize + int(i)];
      const double inside = std::clamp(value, defs[i].min_mm, defs[i].max_mm);
      beyond += std::abs(value - inside) / std::max(10.0, inside);
      value = inside;
    }
    object.SetState(state);
    out.push_back({branch.cost + 20 * beyond, branch.contours, std::move(object)});
  }
}

double RmsOf(const PickResiduals& rows) {
  double sum = 0;
  for (double r : rows.pick_rms_px) sum += r * r;
  return std::sqrt(sum / double(std::max<std::size_t>(1, rows.pick_rms_px.size())));
}

using Shown = std::set<std::tuple<int, bool, int>>;  // picture, is it a rim?, contour

// Those of which at least `least` samples are seen.
Shown VisibleContours(const WorldSolid& solid, const std::vector<View>& views, int least) {
  constexpr double kSpacingPx = 16;
  constexpr int kLeastSamples = 3;
  std::map<std::tuple<int, bool, int>, int> count;
  for (const auto& view : views)
    for (const auto& s : SampleContour(solid, view, kSpacingPx, kLeastSamples))
      if (s.visible && s.source != ContourSample::Source::kLimb)
        ++count[{view.image, s.source == ContourSample::Source::kCircle, s.index}];
  Shown shown;
  for (const auto& [key, n] : count)
    if (n >= least) shown.insert(key);
  return shown;
}

bool SameBody(const PlacedObject& a, const PlacedObject& b) {
  const WorldSolid sa = PlaceSolid(a, false), sb = PlaceSolid(b, false);
  const auto points = [](const WorldSolid& s) {
    std::vector<Vector3d> out;
    for (const auto& v : s.vertices) out.push_back(v.point);
    for (const auto& c : s.circles) out.push_back(c.center.point);
    return out;
  };
  const auto pb = points(sb);
  for (const auto& p : points(sa))
    if (std::none_of(pb.begin(), pb.end(), [&](const auto& o) { return (o - p).norm() < kSameBodyMm; }))
      return false;
  return true;
}

// Fitted, and kept where it explains the picks by contours that can be seen.
std::vector<Reading> Refined(const FitQuestion& question, const std::vector<View>& views,
                             std::vector<Start> starts) {
  std::vector<Reading> out;
  FitQuestion q = question;
  for (auto& s : starts) {
    for (std::size_t i = 0; i < q.picks.size(); ++i) q.picks[i].contour = s.contours[i];
    Reading r{s.contours, std::move(s.object), 0, 0};
    const double cost = RefinePicks(q, views, r.object);
    r.rms_px = RmsOf(ResidualsOf(q, r.object, views));
    if (!(r.rms_px < kMostRmsPx)) continue;
    r.score = -cost;
    out.push_back(std::move(r));
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  return out;
}

bool PicksAreSeen(const FitQuestion& q, const Reading& r, const Shown& shown) {
  for (std::size_t i = 0; i < q.picks.size(); ++i)
    if (!shown.contains({q.picks[i].image, q.picks[i].is_circle, r.contours[i]})) return false;
  return true;
}

}  // namespace

Result<Proposal> ProposeContours(const FitQuestion& q, const std::vector<View>& views,
                                 const std::function<std::vector<Pick>(int)>& lines_of) {
  if (q.picks.empty()) return UsageError("no line is picked yet; click a line that belongs to the object");
  if (q.picks.size() > kMaxProposed)
    return UsageError(
        "{} picked lines are more than the {} that a proposal takes; drop some, or choose the contours in "
        "the drawing",
        q.picks.size(), kMaxProposed);
  std::vector<Sight> sights;
  std::vector<View> near;  // the pictures with picks: there the operator sees the part
  Vector2d foot = Vector2d::Zero();
  for (const auto& p : q.picks) {
    const View& view = views[std::size_t(p.image)];
    sights.push_back(SightOf(p, view));
    if (std::none_of(near.begin(), near.end(), [&](const View& v) { return v.image == view.image; }))
      near.push_back(view);
    const Sight& s = sights.back();
    const double along = (q.support_height_mm - s.eye.z()) / std::min(-0.1, s.ray.z());
    foot += (s.eye + along * s.ray).head<2>() / double(q.picks.size());
  }
  std::vector<Start> starts;
  for (double yaw : YawsOf(PlaceSolid(UsualAt(q, 0, foot), false), q.picks, sights))
    SearchAt(q, sights, UsualAt(q, yaw, foot), starts);
  std::stable_sort(starts.begin(), starts.end(),
                   [](const auto& a, const auto& b) { return a.cost < b.cost; });
  if (starts.size() > kRefined) starts.resize(kRefined);

  Proposal out;
  std::vector<Reading> weighed;
  for (auto& r : Refined(q, views, std::move(starts))) {
    if (weighed.size() >= kWeighed) break;
    if (std::any_of(weighed.begin(), weighed.end(),
                    [&](const auto& w) { return SameBody(w.object, r.object); }))
      continue;
    const WorldSolid solid = PlaceSolid(r.object, false);
    if (!PicksAreSeen(q, r, VisibleContours(solid, near, 1))) continue;
    const Shown visible = VisibleContours(solid, near, 3);
    Shown found;
    for (const auto& l : CollectPicks(
             r.object, near, nullptr, kMostRmsPx, [](const Pick&) { return false; }, lines_of))
      found.emplace(l.image, l.is_circle, l.contour);
    for (std::size_t i = 0; i < q.picks.size(); ++i)
      found.emplace(q.picks[i].image, q.picks[i].is_circle, r.contours[i]);
    r.score = double(found.size()) -
              kMissed * double(visible.size() - std::min(visible.size(), found.size())) - r.rms_px;
    weighed.push_back(std::move(r));
  }
  if (weighed.empty())
    return UsageError(
        "no way to see a {} explains these {} lines; is it that kind, lying so, and are all lines its own?",
        q.model->kind(), q.picks.size());
  std::stable_sort(weighed.begin(), weighed.end(),
                   [](const auto& a, const auto& b) { return a.score > b.score; });
  out.decided = weighed.size() == 1 || weighed[0].score - weighed[1].score >= kClearlyBetter;
  if (weighed.size() > 2) weighed.resize(2);
  out.readings = std::move(weighed);
  return out;
}

}  // namespace vss::station
