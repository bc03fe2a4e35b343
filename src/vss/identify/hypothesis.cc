#include "vss/identify/hypothesis.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A face counts as seen from above where its normal rises by this (6 degrees).
constexpr double kMinRise = 0.1;
// World lines are parallel to within this (sine).
constexpr double kMaxSkew = 0.035;
// Short slanted ones to within this: pictures that all look along their plane hardly tell how steep they are.
constexpr double kMaxSlantSkew = 0.07;
// Ends of two parallel edges that differ by more pixels than this are two candidates for the end.
constexpr double kEndTolerancePx = 4;
// How far (in pixels) the edges of a seed may miss its world lines.
constexpr double kSeedTolerancePx = 1.5;
constexpr int kMaxPeaks = 7;
// With every open dimension as usual, or as picked: the seed's own edges are not there.
constexpr double kHopeless = -10;
// Where the seed's edge is slanted its ends are found later.
constexpr double kHopelessSlanted = -40;
// A voted value must beat the usual one by this: it was picked among several, one of which fits by chance.
constexpr double kPicked = 8;

Vector3d EdgeDirection(const WorldSolid& s, const SolidEdge& e) {
  return s.vertices[std::size_t(e.end)].point - s.vertices[std::size_t(e.start)].point;
}

PlacedObject UsualObject(const ObjectModel& model, int rest) {
  PlacedObject o;
  o.model = &model;
  o.resting_pose = rest;
  const std::vector<std::optional<double>> none(model.dimensions().size());
  o.dimensions_mm = model.UsualDimensions(none);
  return o;
}

// Rows of a linear system on the state.
struct Normal {
  Eigen::MatrixXd ata;
  Eigen::VectorXd atb;
  double chi2 = 0;
  explicit Normal(int n) : ata(Eigen::MatrixXd::Zero(n, n)), atb(Eigen::VectorXd::Zero(n)) {}
  void Add(const Eigen::RowVectorXd& j, double residual, double weight) {
    ata += weight * j.transpose() * j;
    atb -= weight * residual * j.transpose();
    chi2 += weight * residual * residual;
  }
};

struct EdgeTarget {
  int edge;
  Vector3d point, unit;  // the world line
  double lo, hi;         // its extent along `unit` from `point`
  bool flip;             // the edge's start lies at hi
};
struct CircleTarget {
  int circle;
  Vector3d center;
  double radius;
};

// Adds what edges on lines and circles on circles demand of `object`.
double AddTargets(const PlacedObject& object, std::span<const EdgeTarget> edges,
                  std::span<const CircleTarget> circles, Normal& normal, bool ends = true) {
  constexpr double kAcrossMm = 1.0, kAlongMm = 10.0;  // an edge's ends are known less well than its place
  const WorldSolid solid = PlaceSolid(object);
  double worst = 0;
  for (const auto& t : edges) {
    const auto& e = solid.edges[std::size_t(t.edge)];
    const Vector3d e1 = t.unit.unitOrthogonal(), e2 = t.unit.cross(e1);
    const auto& first = solid.vertices[std::size_t(t.flip ? e.end : e.start)];
    const auto& last = solid.vertices[std::size_t(t.flip ? e.start : e.end)];
    for (const auto* v : {&first, &last}) {
      for (const Vector3d& across : {e1, e2}) {
        const double r = across.dot(v->point - t.point);
        normal.Add(across.transpose() * v->by_state, r, 1 / (kAcrossMm * kAcrossMm));
        worst = std::max(worst, std::abs(r));
      }
      if (!ends) continue;
      const double r = t.unit.dot(v->point - t.point) - (v == &first ? t.lo : t.hi);
      normal.Add(t.unit.transpose() * v->by_state, r, 1 / (kAlongMm * kAlongMm));
    }
  }
  for (const auto& t : circles) {
    const auto& c = solid.circles[std::size_t(t.circle)];
    for (int axis = 0; axis < 3; ++axis) {
      const double r = c.center.point[axis] - t.center[axis];
      normal.Add(c.center.by_state.row(axis), r, 1 / (kAcrossMm * kAcrossMm));
      worst = std::max(worst, std::abs(r));
    }
    const double r = c.radius_mm - t.radius;
    normal.Add(c.radius_by_state, r, 1 / (kAcrossMm * kAcrossMm));
    worst = std::max(worst, std::abs(r));
  }
  return worst;
}

bool InRange(const PlacedObject& o, double slack_mm) {
  const auto defs = o.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i)
    if (o.dimensions_mm[i] < defs[i].min_mm - slack_mm || o.dimensions_mm[i] > defs[i].max_mm + slack_mm)
      return false;
  return true;
}

bool Allowed(const PlacedObject& o) {
  for (double v : o.model->Violations(o.dimensions_mm))
    if (v > 2.0) return false;
  return true;
}

// Equal to within half a pixel, vertex by vertex in any order.
bool SamePlace(const PlacedObject& a, const PlacedObject& b, double mm_per_px) {
  const double near = 0.5 * mm_per_px;
  if ((a.placement.head<2>() - b.placement.head<2>()).norm() > near) return false;
  const WorldSolid sa = PlaceSolid(a, false), sb = PlaceSolid(b, false);
  for (const auto& v : sa.vertices) {
    bool found = false;
    for (const auto& w : sb.vertices) found |= (v.point - w.point).squaredNorm() < near * near;
    if (!found) return false;
  }
  for (std::size_t i = 0; i < sa.circles.size(); ++i)
    if (std::abs(sa.circles[i].radius_mm - sb.circles[i].radius_mm) > near ||
        (sa.circles[i].center.point - sb.circles[i].center.point).norm() > near)
      return false;
  return true;
}

// How far to go along `direction` (of the state), between `least` and `most`, for predicted contours to meet
// lines of many pictures: the best few.
std::vector<double> VoteAlong(const PlacedObject& o, const Eigen::VectorXd& direction, double least,
                              double most, std::span<const int> views, const SceneIndex& scene) {
  const WorldSolid solid = PlaceSolid(o);
  std::vector<std::pair<double, double>> votes;  // how far, weight
  const ContourSampling sampling{
      .spacing_px = 12, .min_samples = 2, .max_samples = 8, .img = false, .visibility = false};
  for (int v : views) {
    const View& view = scene.views[std::size_t(v)];
    for (const auto& s : SampleContour(solid, view, sampling)) {
      const Vector3d motion = SampleByState(solid, s) * direction;
      if (motion.squaredNorm() < 1e-4) continue;
      const auto ahead = view.ProjectIdeal(s.point_in_world + motion);
      if (!ahead) continue;
      const Vector2d step = *ahead - s.ideal;  // px per unit of the way
      const Vector2d normal(-s.ideal_tangent.y(), s.ideal_tangent.x());
      const double across = step.dot(normal);
      if (std::abs(across) < 0.2 / scene.mm_per_px) continue;
      scene.lines[std::size_t(v)].ForParallel(s.ideal_tangent, [&](const ViewLine& l) {
        const double far = (l.start - s.ideal).dot(l.normal) / step.dot(l.normal);
        if (!(far >= least && far <= most)) return;
        const double along = (s.ideal + far * step - l.start).dot(l.direction);
        if (along < -1 || along > l.length_px + 1) return;
        votes.push_back({far, std::abs(across) * scene.mm_per_px});
      });
    }
  }
  std::sort(votes.begin(), votes.end());
  std::vector<double> prefix(votes.size() + 1);
  for (std::size_t i = 0; i < votes.size(); ++i) prefix[i + 1] = prefix[i] + votes[i].second;
  const double width = 1.0 * scene.mm_per_px;
  std::vector<std::pair<double, double>> windows;  // weight, how far
  for (std::size_t i = 0, j = 0; i < votes.size(); ++i) {
    while (j < votes.size() && votes[j].first <= votes[i].first + width) ++j;
    windows.push_back({prefix[j] - prefix[i], votes[(i + j - 1) / 2].first});
  }
  std::stable_sort(windows.begin(), windows.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<double> peaks;
  for (const auto& w : windows) {
    if (int(peaks.size()) == kMaxPeaks) break;
    const bool near = std::any_of(peaks.begin(), peaks.end(),
                                  [&](double p) { return std::abs(p - w.second) < 1.5 * width; });
    if (!near) peaks.push_back(w.second);
  }
  return peaks;
}

class Seeder {
 public:
  Seeder(const KindTemplate& kind, const SeedContext& context, double support_z)
      : kind_(kind),
        context_(context),
        support_z_(support_z),
        usual_(UsualObject(*kind.model, kind.resting_pose)) {
    usual_.placement[2] = support_z;
    usual_solid_ = PlaceSolid(usual_);
  }

  std::vector<Hypothesis> Seeds() {
    FromPairs();
    FromSlants();
    FromRims();
    return std::move(seeds_);
  }

  // The best completions of a seed.
  std::vector<Completion> Complete(Hypothesis h) const {
    h.views = ViewsThatSee(PlaceSolid(h.object, false), context_.scene.views, context_.max_views);
    if (h.views.empty()) return {};
    if (!kind_.rims.empty() && !kind_.pairs.empty() && !CompleteRims(h, h.views)) return {};
    const double hopeless = IsSlanted(h, context_) ? kHopelessSlanted : kHopeless;
    if (Score(h.object, h.views) < hopeless) return {};
    std::vector<Completion> out = CompleteDimensions(h);
    std::erase_if(out, [&](Completion& c) {
      c.h.log_odds = Score(c.h.object, h.views);
      return c.h.log_odds < hopeless;
    });
    return out;
  }

  Hypothesis Finish(const Completion& completion) const {
    Hypothesis h = completion.h;
    RefineAndWeigh(h, context_);
    Settle(h, completion.known);
    return h;
  }

 private:
  void FromPairs() {
    const auto lines = context_.lines;
    const int least =
        context_.scene.views.size() > 1 ? 5 : 2;  // two pictures agree on many a line of texture
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (std::size_t k = 0; k < lines.size(); ++k) {
        if (i == k || lines[i].num_views + lines[k].num_views < least || !MayPair(lines[i], lines[k]))
          continue;
        first_line_ = int(i);
        second_line_ = int(k);
        for (const auto& pair : kind_.pairs) FromPair(pair, lines[i], lines[k]);
      }
    }
  }

  static bool MayPair(const WorldLine& a, const WorldLine& b) {
    if (a.kind == WorldLine::Direction::kVertical || b.kind == WorldLine::Direction::kVertical) return false;
    if (a.start == a.end || b.start == b.end) return false;
    const Vector3d u = a.Unit();
    const bool slanted =
        a.kind == WorldLine::Direction::kInclined && b.kind == WorldLine::Direction::kInclined;
    if (u.cross(b.Unit()).norm() > (slanted ? kMaxSlantSkew : kMaxSkew)) return false;
    double lo = (b.start - a.start).dot(u), hi = (b.end - a.start).dot(u);
    if (lo > hi) std::swap(lo, hi);
    return std::min(hi, a.Length()) - std::max(lo, 0.0) > 0.3 * std::min(hi - lo, a.Length());
  }

  // Do the dimensions' ranges allow the level lines' distance and height?
  bool MayFit(const KindTemplate::Pair& pair, const WorldLine& a, const WorldLine& b) const {
    const double slack = 2 * kSeedTolerancePx * context_.mm_per_px;
    auto within = [&](const Eigen::AlignedBox1d& range, double x) {
      return x > range.min().x() - slack && x < range.max().x() + slack;
    };
    const Vector3d offset = (b.start + b.end - a.start - a.end) / 2;
    const Vector2d u = a.Unit().head<2>().normalized();
    const double left = u.x() * offset.y() - u.y() * offset.x();  // the line may be the edge either way round
    return (within(pair.left, left) || within(pair.left, -left)) && within(pair.above, offset.z()) &&
           within(pair.height, (a.start.z() + a.end.z()) / 2 - support_z_);
  }

  // How well a line's direction is known: what an offset across it, where the pictures show it least, moves
  // there, over the line's length.
  static double Firmness(const WorldLine& l) {
    const Vector3d e1 = l.Unit().unitOrthogonal(), e2 = l.Unit().cross(e1);
    Eigen::Matrix<double, 3, 2> across;
    across << e1, e2;
    const Eigen::Matrix2d information = across.transpose() * l.px2_per_mm2 * across;
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(information, Eigen::EigenvaluesOnly)
               .eigenvalues()[0] *
           l.num_views * l.Length() * l.Length();
  }

  // The line turned about its middle into the direction of `other`.
  static WorldLine Aligned(WorldLine l, const WorldLine& other) {
    const Vector3d middle = (l.start + l.end) / 2;
    const Vector3d half = other.Unit() * (l.end - l.start).dot(other.Unit()) / 2;
    l.start = middle - half;
    l.end = middle + half;
    return l;
  }

  // Of two slanted lines the one whose direction is known less takes the other's.
  void FromPair(const KindTemplate::Pair& pair, const WorldLine& a, const WorldLine& b) {
    const bool slanted = a.kind == WorldLine::Direction::kInclined;
    if (!slanted || a.Unit().cross(b.Unit()).norm() < kMaxSkew / 2)
      FromParallels(pair, a, b);
    else if (Firmness(a) < Firmness(b))
      FromParallels(pair, Aligned(a, b), b);
    else
      FromParallels(pair, a, Aligned(b, a));
  }

  // `a` for the pair's first edge, `b` for its second.
  void FromParallels(const KindTemplate::Pair& pair, const WorldLine& a, const WorldLine& b) {
    if (pair.level) {
      const Vector3d u = a.Unit(), mid = (b.start + b.end) / 2;
      const Vector3d opposite = a.start + u * u.dot(mid - a.start);
      if (std::abs(opposite.z() - mid.z()) > 2 * kSeedTolerancePx * context_.mm_per_px) return;
    }
    const Vector3d first =
        EdgeDirection(usual_solid_, usual_solid_.edges[std::size_t(pair.first)]).normalized();
    const Vector3d second =
        EdgeDirection(usual_solid_, usual_solid_.edges[std::size_t(pair.second)]).normalized();
    const bool inclined = std::abs(first.z()) > 0.05;
    if (inclined != (a.kind == WorldLine::Direction::kInclined)) return;
    if (!inclined && !MayFit(pair, a, b)) return;
    Vector3d unit = a.Unit();
    if (inclined && (unit.z() > 0) != (first.z() > 0)) unit = -unit;
    // Extents along `unit`, from a.start.
    auto extent = [&](const WorldLine& l) {
      double lo = (l.start - a.start).dot(unit), hi = (l.end - a.start).dot(unit);
      if (lo > hi) std::swap(lo, hi);
      return std::pair{lo, hi};
    };
    const auto ea = extent(a), eb = extent(b);
    std::vector<double> lows{ea.first}, highs{ea.second};
    const double apart = kEndTolerancePx * context_.mm_per_px;
    if (pair.same_extent) {
      if (std::abs(ea.first - eb.first) > apart)
        lows.push_back(eb.first);
      else
        lows[0] = (ea.first + eb.first) / 2;
      if (std::abs(ea.second - eb.second) > apart)
        highs.push_back(eb.second);
      else
        highs[0] = (ea.second + eb.second) / 2;
    }
    if (inclined) {
      const auto [low, high] = MedianEnds(a, unit);
      if (std::abs(low - lows[0]) > apart) lows.push_back(low);
      if (std::abs(high - highs[0]) > apart) highs.push_back(high);
    }
    for (int flip = 0; flip < (inclined ? 1 : 2); ++flip) {
      const Vector3d toward = flip ? Vector3d(-unit) : unit;
      const double yaw = std::atan2(toward.y(), toward.x()) - std::atan2(first.y(), first.x());
      for (double lo : lows)
        for (double hi : highs) {
          if (hi - lo < 2 * context_.mm_per_px) continue;
          EdgeTarget ta{pair.first, a.start, unit, lo, hi, flip == 1};
          const double shift = (b.start - a.start).dot(unit);
          EdgeTarget tb{pair.second,
                        b.start,
                        unit,
                        (pair.same_extent ? lo : eb.first) - shift,
                        (pair.same_extent ? hi : eb.second) - shift,
                        (flip == 1) != (second.dot(first) < 0)};
          if (pair.same_extent && !inclined && !EndsSeen(ta, tb)) continue;
          const EdgeTarget targets[] = {ta, tb};
          // Ends of slanted edges are hidden as often as not: once believed, once left open.
          Seed(yaw, (a.start + a.end) / 2, targets, {}, true);
          if (inclined) Seed(yaw, (a.start + a.end) / 2, targets, {}, false);
        }
    }
  }

  // Where the line ends in the median of its pictures, along `unit` from its start. Seen along its plane, a
  // slanted edge and the level one that continues it are one line: the outermost ends are not its own.
  std::pair<double, double> MedianEnds(const WorldLine& l, const Vector3d& unit) const {
    std::vector<double> lows, highs;
    for (const LineRef& r : l.lines) {
      const ViewLine& line = context_.scene.lines[std::size_t(r.view)].lines()[std::size_t(r.line)];
      const Vector3d w = l.start - context_.scene.views[std::size_t(r.view)].center_in_world;
      double ends[2];
      int n = 0;
      for (const Vector3d& ray : {line.ray_start, line.ray_end}) {
        // The point of the line nearest to the ray.
        const double b = unit.dot(ray);
        ends[n++] = (b * ray.dot(w) - unit.dot(w)) / std::max(1 - b * b, 1e-9);
      }
      lows.push_back(std::min(ends[0], ends[1]));
      highs.push_back(std::max(ends[0], ends[1]));
    }
    auto median = [](std::vector<double>& v) {
      std::nth_element(v.begin(), v.begin() + std::ptrdiff_t(v.size() / 2), v.end());
      return v[v.size() / 2];
    };
    return {median(lows), median(highs)};
  }

  // The face's two other sides, between the ends of its long ones: where they are long enough to be found and
  // lie in some picture, lines must lie on at least one of them, and on a part of the other unless it is
  // hidden.
  bool EndsSeen(const EdgeTarget& a, const EdgeTarget& b) const {
    constexpr double kMinLengthPx = 16, kMinShare = 0.25;
    constexpr int kSteps = 6;
    double best = 0;
    bool asked = false;
    for (int end = 0; end < 2; ++end) {
      const Vector3d p = a.point + (end ? a.hi : a.lo) * a.unit, q = b.point + (end ? b.hi : b.lo) * b.unit;
      if ((q - p).norm() < kMinLengthPx * context_.mm_per_px) continue;
      int inside = 0, found = 0;
      for (std::size_t v = 0; v < context_.scene.views.size(); ++v) {
        const View& view = context_.scene.views[v];
        for (int k = 0; k < kSteps; ++k) {
          const Vector3d x = p + (q - p) * ((k + 0.5) / kSteps);
          if (!view.Shows(x)) continue;
          const auto here = view.ProjectIdeal(x), ahead = view.ProjectIdeal(x + (q - p) * 1e-3);
          if (!here || !ahead) continue;
          ++inside;
          found += context_.scene.lines[v]
                       .Nearest(*here, (*ahead - *here).normalized(), 2 * context_.scene.tolerance_px, 0.99)
                       .line >= 0;
        }
      }
      if (inside < kSteps) continue;  // never in a picture: nothing can be said
      asked = true;
      best = std::max(best, double(found) / inside);
    }
    return !asked || best >= kMinShare;
  }

  // Slanted and vertical lines in one upright plane.
  void FromSlants() {
    if (kind_.slants.empty()) return;
    const auto lines = context_.lines;
    const double near = 2 * kSeedTolerancePx * context_.mm_per_px;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i].kind != WorldLine::Direction::kInclined) continue;
      const WorldLine& slanted = lines[i];
      Vector3d unit = slanted.Unit();
      if (unit.z() < 0) unit = -unit;
      const Vector2d level = unit.head<2>().normalized();
      const double lo = unit.dot(slanted.start) < unit.dot(slanted.end) ? 0 : -slanted.Length();
      for (std::size_t k = 0; k < lines.size(); ++k) {
        if (lines[k].kind != WorldLine::Direction::kVertical) continue;
        const WorldLine& upright = lines[k];
        const Vector2d foot = ((upright.start + upright.end) / 2).head<2>() - slanted.start.head<2>();
        if (std::abs(level.x() * foot.y() - level.y() * foot.x()) > near) continue;
        // Not farther away than the line is long: the two are of one face.
        const double along =
            level.dot(foot) / level.dot(unit.head<2>());  // where the vertical meets the line
        if (along < lo - slanted.Length() || along > lo + 2 * slanted.Length()) continue;
        first_line_ = int(i);
        second_line_ = int(k);
        for (const auto& s : kind_.slants) FromSlant(s, slanted, unit, lo, upright);
      }
    }
  }

  // `unit`: along `slanted`, upwards, from its start; its lower end lies at `lo`.
  void FromSlant(const KindTemplate::Slant& slant, const WorldLine& slanted, const Vector3d& unit, double lo,
                 const WorldLine& upright) {
    const SolidEdge& edge = usual_solid_.edges[std::size_t(slant.slanted)];
    const SolidEdge& other = usual_solid_.edges[std::size_t(slant.upright)];
    Vector3d usual = EdgeDirection(usual_solid_, edge);
    const bool falls = usual.z() < 0;
    if (falls) usual = -usual;
    const double yaw = std::atan2(unit.y(), unit.x()) - std::atan2(usual.y(), usual.x());
    const double low = std::min(upright.start.z(), upright.end.z()),
                 high = std::max(upright.start.z(), upright.end.z());
    const Vector3d foot((upright.start.x() + upright.end.x()) / 2, (upright.start.y() + upright.end.y()) / 2,
                        0);
    const EdgeTarget targets[] = {
        {slant.slanted, slanted.start, unit, lo, lo + slanted.Length(), falls},
        {slant.upright, foot, Vector3d::UnitZ(), low, high, EdgeDirection(usual_solid_, other).z() < 0}};
    Seed(yaw, (slanted.start + slanted.end) / 2, targets, {}, false);
  }

  void FromRims() {
    first_line_ = second_line_ = -1;
    for (const auto& c : context_.circles)
      for (int rim : kind_.rims) {
        const CircleTarget target{rim, c.center, c.radius_mm};
        Seed(0, c.center, {}, {&target, 1}, true);
      }
  }

  void Seed(double yaw, const Vector3d& near, std::span<const EdgeTarget> edges,
            std::span<const CircleTarget> circles, bool trust_ends) {
    PlacedObject o = usual_;
    o.placement[0] = near.x();
    o.placement[1] = near.y();
    o.placement[3] = yaw;
    const int n = o.StateSize();
    const auto defs = o.model->dimensions();
    Eigen::MatrixXd covariance;
    double worst = 0;
    for (int iteration = 0; iteration < 3; ++iteration) {
      Normal normal(n);
      worst = AddTargets(o, edges, circles, normal);
      if (iteration == 2) break;
      Eigen::MatrixXd a = normal.ata;
      Eigen::VectorXd b = normal.atb;
      for (std::size_t i = 0; i < defs.size(); ++i) {
        const int at = kPlacementSize + int(i);
        const double w = 1 / std::pow(PriorSigma(defs[i]), 2);
        a(at, at) += w;
        b[at] -= w * (o.dimensions_mm[i] - usual_.dimensions_mm[i]);
      }
      for (int held : {2, 3, 4, 5}) {
        a.row(held).setZero();
        a.col(held).setZero();
        a(held, held) = 1;
        b[held] = 0;
      }
      a.diagonal().array() += 1e-9;
      const Eigen::LDLT<Eigen::MatrixXd> solver(a);
      const Eigen::VectorXd state = o.State() + Eigen::VectorXd(solver.solve(b));
      if (!state.allFinite()) return;
      o.SetState(state);
      if (iteration == 1) covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
    }
    if (worst > kSeedTolerancePx * context_.mm_per_px) return;
    if (!InRange(o, 2 * context_.mm_per_px)) return;
    Hypothesis h;
    h.object = o;
    h.determined.resize(defs.size());
    const bool slanted = !edges.empty() && std::abs(edges[0].unit.z()) >= 0.05;
    Normal fixed(n);
    AddTargets(o, edges, circles, fixed, trust_ends);
    if (!trust_ends) covariance = Covariance(fixed.ata, defs);
    for (std::size_t i = 0; i < defs.size(); ++i) {
      h.object.dimensions_mm[i] = std::clamp(o.dimensions_mm[i], defs[i].min_mm, defs[i].max_mm);
      h.determined[i] =
          std::sqrt(covariance(kPlacementSize + int(i), kPlacementSize + int(i))) < 0.2 * PriorSigma(defs[i]);
    }
    h.open_direction = OpenDirections(fixed.ata, h.determined);
    if (slanted || std::all_of(h.determined.begin(), h.determined.end(), [](bool d) { return d; })) {
      Store(std::move(h));
      return;
    }
    // Re-ask the usual dimensions, now that some are known.
    std::vector<std::optional<double>> known(defs.size());
    for (std::size_t i = 0; i < defs.size(); ++i)
      if (h.determined[i]) known[i] = h.object.dimensions_mm[i];
    const auto usual = h.object.model->UsualDimensions(known);
    for (std::size_t i = 0; i < defs.size(); ++i)
      if (!h.determined[i]) Move(h.object, h.open_direction, i, usual[i]);
    Store(std::move(h));
  }

  // Sets an open dimension; the rest of the state follows so that the seed's edges stay where they are.
  static void Move(PlacedObject& o, const Eigen::MatrixXd& directions, std::size_t d, double value) {
    o.SetState(o.State() + (value - o.dimensions_mm[d]) * directions.col(int(d)));
  }

  void Store(Hypothesis h) {
    h.first_line = first_line_;
    h.second_line = second_line_;
    if (!Allowed(h.object)) return;
    for (const auto& other : seeds_)
      if (other.determined == h.determined && SamePlace(other.object, h.object, context_.mm_per_px)) return;
    seeds_.push_back(std::move(h));
  }

  Eigen::MatrixXd Covariance(Eigen::MatrixXd information, std::span<const DimensionDef> defs) const {
    for (std::size_t i = 0; i < defs.size(); ++i)
      information(kPlacementSize + int(i), kPlacementSize + int(i)) += 1 / std::pow(PriorSigma(defs[i]), 2);
    for (int held : {2, 3, 4, 5}) {
      information.row(held).setZero();
      information.col(held).setZero();
      information(held, held) = 1;
    }
    information.diagonal().array() += 1e-9;
    return information.inverse();
  }

  static Eigen::MatrixXd OpenDirections(const Eigen::MatrixXd& information,
                                        const std::vector<bool>& determined) {
    const int n = int(information.rows());
    std::vector<int> follow{0, 1};
    for (std::size_t d = 0; d < determined.size(); ++d)
      if (determined[d]) follow.push_back(kPlacementSize + int(d));
    const int m = int(follow.size());
    Eigen::MatrixXd a(m, m), out = Eigen::MatrixXd::Zero(n, int(determined.size()));
    for (int i = 0; i < m; ++i)
      for (int k = 0; k < m; ++k) a(i, k) = information(follow[std::size_t(i)], follow[std::size_t(k)]);
    a.diagonal().array() += 1e-9;
    const Eigen::LDLT<Eigen::MatrixXd> solver(a);
    for (std::size_t d = 0; d < determined.size(); ++d) {
      if (determined[d]) continue;
      const int column = kPlacementSize + int(d);
      Eigen::VectorXd b(m);
      for (int i = 0; i < m; ++i) b[i] = -information(follow[std::size_t(i)], column);
      const Eigen::VectorXd x = solver.solve(b);
      for (int i = 0; i < m; ++i) out(follow[std::size_t(i)], int(d)) = x[i];
      out(column, int(d)) = 1;
    }
    return out;
  }

  static double PriorSigma(const DimensionDef& d) { return std::max(10.0, (d.max_mm - d.min_mm) / 4); }

  // Roughly: to choose among candidates.
  double Score(const PlacedObject& o, const std::vector<int>& views) const {
    return Weigh(PlaceSolid(o, false), views, context_.scene,
                 {.spacing_px = 12,
                  .min_samples = 3,
                  .max_samples = 8,
                  .rough = true,
                  .prior_log_odds = PriorLogOdds(o, context_.mm_per_px)},
                 context_.others)
        .log_odds;
  }

  // Candidates for dimension `d` from the lines of all pictures: values at which predicted contours meet
  // lines.
  std::vector<double> Vote(const PlacedObject& o, std::size_t d, const Hypothesis& seed) const {
    const auto& def = o.model->dimensions()[d];
    std::vector<double> values =
        VoteAlong(o, seed.open_direction.col(int(d)), def.min_mm - o.dimensions_mm[d],
                  def.max_mm - o.dimensions_mm[d], seed.views, context_.scene);
    for (double& v : values) v += o.dimensions_mm[d];
    return values;
  }

  // Values of dimension `d` at which an upright face of the object comes to lie on one of a part that is
  // known: what is welded touches.
  std::vector<double> Contacts(const PlacedObject& o, std::size_t d, const Hypothesis& seed) const {
    std::vector<double> values;
    if (!context_.others || !context_.contact) return values;
    const auto& def = o.model->dimensions()[d];
    const WorldSolid solid = PlaceSolid(o);
    const double slack_mm = 2 * context_.mm_per_px;
    for (const auto& f : solid.faces) {
      if (f.is_cylinder || f.triangles.empty() || std::abs(f.normal_in_part.z()) > 0.01) continue;
      Vector3d middle = Vector3d::Zero();
      for (const auto& t : f.triangles) middle += (t[0] + t[1] + t[2]) / (3.0 * double(f.triangles.size()));
      // How fast the face moves along its normal: that of the vertex nearest to its plane.
      double rate = 0, nearest = 1e9;
      for (const auto& v : solid.vertices) {
        const double off = std::abs(f.normal_in_part.dot(v.point - middle));
        if (off >= nearest - 1e-6) continue;
        nearest = off;
        rate = f.normal_in_part.dot(v.by_state * seed.open_direction.col(int(d)));
      }
      if (std::abs(rate) < 0.3) continue;
      const double reach = std::abs(rate) * (def.max_mm - def.min_mm);
      const double ahead =
          context_.others->Cast(middle - slack_mm * f.normal_in_part, f.normal_in_part, reach);
      if (!std::isfinite(ahead)) continue;
      const double value = o.dimensions_mm[d] + (ahead - slack_mm) / rate;
      if (value >= def.min_mm && value <= def.max_mm) values.push_back(value);
    }
    return values;
  }

  // A rim whose place the seed left open, from the world's circles at its height.
  // False where there is none: the object is then a simpler one.
  bool CompleteRims(Hypothesis& h, const std::vector<int>& views) const {
    const WorldSolid solid = PlaceSolid(h.object);
    double best_score = -INFINITY;
    PlacedObject best = h.object;
    bool found = false, any_open = false;
    for (int rim : kind_.rims) {
      const auto& c = solid.circles[std::size_t(rim)];
      bool open = false;
      for (std::size_t d = 0; d < h.determined.size(); ++d)
        open |= !h.determined[d] && (c.radius_by_state[kPlacementSize + int(d)] != 0 ||
                                     c.center.by_state.col(kPlacementSize + int(d)).norm() > 0);
      if (!open) continue;
      any_open = true;
      for (const auto& w : context_.circles) {
        if (std::abs(w.center.z() - c.center.point.z()) > 3 * context_.mm_per_px) continue;
        PlacedObject o = h.object;
        const CircleTarget target{rim, {w.center.x(), w.center.y(), c.center.point.z()}, w.radius_mm};
        double worst = 0;
        for (int iteration = 0; iteration < 3; ++iteration) {
          Normal normal(o.StateSize());
          worst = AddTargets(o, {}, {&target, 1}, normal);
          Eigen::MatrixXd a = normal.ata;
          Eigen::VectorXd b = normal.atb;
          a.diagonal().array() += 1e-6;
          for (int i = 0; i < o.StateSize(); ++i) {
            if (i >= kPlacementSize && !h.determined[std::size_t(i - kPlacementSize)]) continue;
            a.row(i).setZero();
            a.col(i).setZero();
            a(i, i) = 1;
            b[i] = 0;
          }
          o.SetState(o.State() + Eigen::VectorXd(a.ldlt().solve(b)));
        }
        if (worst > kSeedTolerancePx * context_.mm_per_px || !InRange(o, 0) || !Allowed(o)) continue;
        const double score = Score(o, views);
        if (score > best_score) {
          best_score = score;
          best = o;
          found = true;
        }
      }
    }
    if (!found) return !any_open;
    h.object = best;
    for (std::size_t d = 0; d < h.determined.size(); ++d)
      for (int rim : kind_.rims) {
        const auto& c = solid.circles[std::size_t(rim)];
        if (c.radius_by_state[kPlacementSize + int(d)] != 0 ||
            c.center.by_state.col(kPlacementSize + int(d)).norm() > 0)
          h.determined[d] = true;
      }
    return true;
  }

  // Dimensions that the seed left open, one after the other, the best few combinations kept (beam search).
  std::vector<Completion> CompleteDimensions(const Hypothesis& h) const {
    constexpr std::size_t kBeam = 4, kRefined = 2;
    constexpr int kPasses = 2;  // the second sees the later dimensions where they belong
    struct State {
      double score;
      PlacedObject object;
      std::vector<bool> known;  // dimensions told by the seed or picked
    };
    // Every second picture will do to choose among values.
    std::vector<int> some;
    for (std::size_t i = 0; i<h.views.size(); i += h.views.size()> 6 ? 2 : 1) some.push_back(h.views[i]);
    auto valued = [&](PlacedObject object, std::vector<bool> known) {
      const auto picked = std::count(known.begin(), known.end(), true) -
                          std::count(h.determined.begin(), h.determined.end(), true);
      const double score = Score(object, h.views) - kPicked * double(picked);
      return State{score, std::move(object), std::move(known)};
    };
    std::vector<State> beam{valued(h.object, h.determined)};
    for (int pass = 0; pass < kPasses; ++pass)
      for (std::size_t d = 0; d < h.determined.size(); ++d) {
        if (h.determined[d]) continue;
        std::vector<State> next = beam;
        auto consider = [&](const State& from, double value, bool picked) {
          PlacedObject o = from.object;
          Move(o, h.open_direction, d, value);
          const bool again = std::any_of(next.begin(), next.end(), [&](const State& n) {
            return n.known[d] == picked &&
                   (n.object.State() - o.State()).cwiseAbs().maxCoeff() < 0.3 * context_.mm_per_px;
          });
          if (again || !Allowed(o)) return;
          auto known = from.known;
          known[d] = picked;
          next.push_back(valued(std::move(o), std::move(known)));
        };
        for (const State& from : beam) {
          consider(from, UsualValue(from.object, from.known, d), false);
          for (double value : Contacts(from.object, d, h)) consider(from, value, true);
          for (double value : Vote(from.object, d, h)) consider(from, value, true);
        }
        std::stable_sort(next.begin(), next.end(),
                         [](const State& a, const State& b) { return a.score > b.score; });
        if (next.size() > kBeam) next.resize(kBeam);
        beam = std::move(next);
      }
    std::vector<Completion> best;
    for (const State& state : beam) {
      if (best.size() == kRefined) break;
      best.push_back({h, state.known});
      best.back().h.object = state.object;
    }
    return best;
  }

  // Dimensions that were neither told nor picked, but moved with the fit, go back to what is usual beside the
  // others, the least missed first, unless that costs as much as a picked one must bring.
  void Settle(Hypothesis& h, std::vector<bool> known) const {
    for (std::size_t round = 0; round < known.size(); ++round) {
      double best = h.log_odds - kPicked;
      int which = -1;
      PlacedObject settled;
      for (std::size_t d = 0; d < known.size(); ++d) {
        if (known[d]) continue;
        std::vector<bool> others(known.size(), true);
        PlacedObject o = h.object;
        Move(o, h.open_direction, d, UsualValue(o, others, d));
        if (!Allowed(o)) continue;
        const double score = Weigh(PlaceSolid(o, false), h.views, context_.scene,
                                   {.grey = true, .prior_log_odds = PriorLogOdds(o, context_.mm_per_px)},
                                   context_.others, context_.claims)
                                 .Score();
        if (score <= best) continue;
        best = score;
        which = int(d);
        settled = o;
      }
      if (which < 0) return;
      known[std::size_t(which)] = true;
      h.object = settled;
      h.log_odds = best;
    }
  }

  // What dimension `d` usually is beside those that are known.
  static double UsualValue(const PlacedObject& o, const std::vector<bool>& known, std::size_t d) {
    std::vector<std::optional<double>> values(known.size());
    for (std::size_t i = 0; i < known.size(); ++i)
      if (known[i] && i != d) values[i] = o.dimensions_mm[i];
    return o.model->UsualDimensions(values)[d];
  }

  const KindTemplate& kind_;
  const SeedContext& context_;
  double support_z_;
  PlacedObject usual_;
  WorldSolid usual_solid_;
  std::vector<Hypothesis> seeds_;
  int first_line_ = -1, second_line_ = -1;  // of the seed at hand
};

}  // namespace

namespace {

// Left of, above, and height of the pair's edges over the dimensions' ranges.
void SetRanges(const ObjectModel& model, int rest, KindTemplate::Pair& pair) {
  const auto defs = model.dimensions();
  const int n = int(defs.size());
  struct Place {
    Vector3d value;  // left, above, height
    Eigen::Matrix3Xd by_dimension;
  };
  PlacedObject object = UsualObject(model, rest);
  auto place = [&]() {
    const WorldSolid solid = PlaceSolid(object);
    const auto &a = solid.edges[std::size_t(pair.first)], &b = solid.edges[std::size_t(pair.second)];
    const auto& from = solid.vertices[std::size_t(a.start)];
    const auto& to = solid.vertices[std::size_t(b.start)];
    const Vector2d u = EdgeDirection(solid, a).head<2>().normalized();
    Eigen::Matrix3d m = Eigen::Matrix3d::Zero();  // of the offset
    m.row(0) << -u.y(), u.x(), 0;
    m(1, 2) = 1;
    Place p;
    p.value = m * (to.point - from.point);
    p.value.z() = from.point.z();
    p.by_dimension = (m * (to.by_state - from.by_state)).rightCols(n);
    p.by_dimension.row(2) = from.by_state.row(2).tail(n);
    return p;
  };
  const Place usual = place();
  const std::vector<double> usual_mm = object.dimensions_mm;
  auto set = [&](const Vector3d& lo, const Vector3d& hi) {
    Eigen::AlignedBox1d* ranges[] = {&pair.left, &pair.above, &pair.height};
    for (int k = 0; k < 3; ++k)
      *ranges[k] =
          Eigen::AlignedBox1d(Eigen::Matrix<double, 1, 1>(lo[k]), Eigen::Matrix<double, 1, 1>(hi[k]));
  };
  // Linear? The same derivatives at both ends of every range.
  bool linear = true;
  for (int i = 0; i < n && linear; ++i)
    for (double end : {defs[std::size_t(i)].min_mm, defs[std::size_t(i)].max_mm}) {
      object.dimensions_mm = usual_mm;
      object.dimensions_mm[std::size_t(i)] = end;
      const Place other = place();
      linear &= other.by_dimension.allFinite() &&
                (other.by_dimension - usual.by_dimension).cwiseAbs().maxCoeff() < 1e-6;
    }
  if (!linear) {
    set(Vector3d::Constant(-INFINITY), Vector3d::Constant(INFINITY));
    return;
  }
  Vector3d lo = usual.value, hi = usual.value;
  for (int i = 0; i < n; ++i) {
    const double down = defs[std::size_t(i)].min_mm - usual_mm[std::size_t(i)],
                 up = defs[std::size_t(i)].max_mm - usual_mm[std::size_t(i)];
    const Vector3d j = usual.by_dimension.col(i);
    lo += (j * down).cwiseMin(j * up);
    hi += (j * down).cwiseMax(j * up);
  }
  set(lo, hi);
}

}  // namespace

std::vector<KindTemplate> MakeTemplates(const KnowledgeBase& knowledge) {
  std::vector<KindTemplate> out;
  for (const auto& model : knowledge.objects) {
    for (std::size_t rest = 0; rest < model->resting_poses().size(); ++rest) {
      KindTemplate t;
      t.model = model.get();
      t.resting_pose = int(rest);
      const WorldSolid solid = PlaceSolid(UsualObject(*model, int(rest)));
      auto above = [&](int face) {
        const auto& f = solid.faces[std::size_t(face)];
        return !f.is_cylinder && f.normal_in_part.z() > kMinRise;
      };
      for (std::size_t i = 0; i < solid.edges.size(); ++i)
        for (std::size_t k = i + 1; k < solid.edges.size(); ++k) {
          const auto &a = solid.edges[i], &b = solid.edges[k];
          if (a.weight <= 0 || b.weight <= 0) continue;
          int shared = -1;
          for (int f : {a.left_face, a.right_face})
            if ((f == b.left_face || f == b.right_face) && above(f)) shared = f;
          if (shared < 0) continue;
          const Vector3d da = EdgeDirection(solid, a), db = EdgeDirection(solid, b);
          if (da.normalized().cross(db.normalized()).norm() > 1e-6) continue;
          const Vector3d unit = da.normalized();
          // Same extent at all dimensions: the ends' difference along the edge does not depend on any.
          auto along = [&](int vertex) {
            const auto& v = solid.vertices[std::size_t(vertex)];
            return std::pair{unit.dot(v.point), Eigen::RowVectorXd(unit.transpose() * v.by_state)};
          };
          const bool turned = da.dot(db) < 0;
          const auto as = along(a.start), ae = along(a.end), bs = along(turned ? b.end : b.start),
                     be = along(turned ? b.start : b.end);
          const bool same = std::abs(as.first - bs.first) + std::abs(ae.first - be.first) < 1e-6 &&
                            (as.second - bs.second).tail(int(model->dimensions().size())).norm() +
                                    (ae.second - be.second).tail(int(model->dimensions().size())).norm() <
                                1e-9;
          // Level with each other at all dimensions.
          const auto& va = solid.vertices[std::size_t(a.start)];
          const auto& vb = solid.vertices[std::size_t(turned ? b.end : b.start)];
          const bool level =
              std::abs(va.point.z() - vb.point.z()) < 1e-6 &&
              (va.by_state.row(2) - vb.by_state.row(2)).tail(int(model->dimensions().size())).norm() < 1e-9;
          KindTemplate::Pair pair{int(i), int(k), same, same && level, {}, {}, {}};
          SetRanges(*model, int(rest), pair);
          t.pairs.push_back(pair);
        }
      for (std::size_t i = 0; i < solid.edges.size(); ++i)
        for (std::size_t k = 0; k < solid.edges.size(); ++k) {
          const auto &a = solid.edges[i], &b = solid.edges[k];
          if (a.weight <= 0 || b.weight <= 0) continue;
          const Vector3d da = EdgeDirection(solid, a).normalized(), db = EdgeDirection(solid, b).normalized();
          if (std::abs(da.z()) < kMinRise || std::abs(da.z()) > 1 - kMinRise || std::abs(db.z()) < 1 - 1e-9)
            continue;
          bool one_face = false;
          for (int f : {a.left_face, a.right_face}) one_face |= f == b.left_face || f == b.right_face;
          if (one_face) t.slants.push_back({int(i), int(k)});
        }
      for (std::size_t i = 0; i < solid.circles.size(); ++i)
        if (above(solid.circles[i].plane_face)) t.rims.push_back(int(i));
      out.push_back(std::move(t));
    }
  }
  return out;
}

bool IsSlanted(const Hypothesis& h, const SeedContext& context) {
  return h.first_line >= 0 &&
         context.lines[std::size_t(h.first_line)].kind == WorldLine::Direction::kInclined;
}

std::vector<Hypothesis> Seeds(const KindTemplate& kind, const SeedContext& context, double support_z_mm) {
  return Seeder(kind, context, support_z_mm).Seeds();
}

double RoughScore(const Hypothesis& seed, const SeedContext& context) {
  constexpr int kFewViews = 6;
  const WorldSolid solid = PlaceSolid(seed.object, false);
  const auto views = ViewsThatSee(solid, context.scene.views, kFewViews);
  return Weigh(solid, views, context.scene,
               {.spacing_px = 12,
                .max_samples = 8,
                .rough = true,
                .prior_log_odds = PriorLogOdds(seed.object, context.mm_per_px)},
               context.others, context.claims)
      .log_odds;
}

std::vector<Completion> Complete(const KindTemplate& kind, const SeedContext& context,
                                 const Hypothesis& seed) {
  return Seeder(kind, context, seed.object.placement[2]).Complete(seed);
}

Hypothesis Finish(const KindTemplate& kind, const SeedContext& context, const Completion& completion) {
  return Seeder(kind, context, completion.h.object.placement[2]).Finish(completion);
}

std::vector<Completion> Distinct(std::vector<Completion> completions, double mm_per_px) {
  std::stable_sort(completions.begin(), completions.end(),
                   [](const Completion& a, const Completion& b) { return a.h.log_odds > b.h.log_odds; });
  std::vector<Completion> out;
  for (auto& c : completions)
    if (std::none_of(out.begin(), out.end(), [&](const Completion& o) {
          return o.known == c.known && SamePlace(o.h.object, c.h.object, mm_per_px);
        }))
      out.push_back(std::move(c));
  return out;
}

std::optional<Hypothesis> Reseat(const Hypothesis& hypothesis, const SeedContext& context,
                                 double support_z_mm) {
  constexpr int kIterations = 4;
  constexpr double kWeakHold = 1e-3;  // of one vertex: on dimensions that no vertex above the support shows
  Hypothesis h = hypothesis;
  const WorldSolid before = PlaceSolid(h.object, false);
  // What is hardly higher than the new support was its own foot, and moves with it.
  const double stays_mm = support_z_mm + 2 * context.mm_per_px;
  h.object.placement[2] = support_z_mm;
  const int n = h.object.StateSize();
  const std::vector<double> start = h.object.dimensions_mm;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const WorldSolid now = PlaceSolid(h.object);
    Normal normal(n);
    for (std::size_t i = 0; i < now.vertices.size(); ++i) {
      const Vector3d& goal = before.vertices[i].point;
      if (goal.z() < stays_mm) continue;
      for (int axis = 0; axis < 3; ++axis)
        normal.Add(now.vertices[i].by_state.row(axis), now.vertices[i].point[axis] - goal[axis], 1);
    }
    for (std::size_t i = 0; i < now.circles.size(); ++i) {
      const auto &c = now.circles[i], &goal = before.circles[i];
      if (goal.center.point.z() < stays_mm) continue;
      for (int axis = 0; axis < 3; ++axis)
        normal.Add(c.center.by_state.row(axis), c.center.point[axis] - goal.center.point[axis], 1);
      normal.Add(c.radius_by_state, c.radius_mm - goal.radius_mm, 1);
    }
    Eigen::MatrixXd a = normal.ata;
    Eigen::VectorXd b = normal.atb;
    for (int i = kPlacementSize; i < n; ++i) {
      a(i, i) += kWeakHold;
      b[i] -= kWeakHold * (h.object.dimensions_mm[std::size_t(i - kPlacementSize)] -
                           start[std::size_t(i - kPlacementSize)]);
    }
    for (int held : {2, 3, 4, 5}) {
      a.row(held).setZero();
      a.col(held).setZero();
      a(held, held) = 1;
      b[held] = 0;
    }
    a.diagonal().array() += 1e-9;
    const Eigen::VectorXd state = h.object.State() + Eigen::VectorXd(a.ldlt().solve(b));
    if (!state.allFinite()) return std::nullopt;
    h.object.SetState(state);
  }
  const auto defs = h.object.model->dimensions();
  if (!InRange(h.object, 2 * context.mm_per_px)) return std::nullopt;
  for (std::size_t i = 0; i < defs.size(); ++i)
    h.object.dimensions_mm[i] = std::clamp(h.object.dimensions_mm[i], defs[i].min_mm, defs[i].max_mm);
  if (!Allowed(h.object)) return std::nullopt;
  RefineAndWeigh(h, context);
  return h;
}

namespace {

// A tall part may lean by a degree or so, which moves its top against its foot further than lines are looked
// for.
template <class Weigh>
void RefineLean(Hypothesis& h, const SeedContext& context, const Weigh& weigh) {
  constexpr double kUsualLean = 1 * kPi / 180, kMaxLean = 3 * kPi / 180;
  constexpr double kLeans =
      10;  // log-odds that leaning must bring: two more parameters, and most parts stand upright
  constexpr double kFirstReach = 4, kLastReach = 1;  // tolerances
  const double tolerance = context.scene.tolerance_px;
  const WorldSolid upright = PlaceSolid(h.object, false);
  double top = h.object.placement[2];
  for (const auto& v : upright.vertices) top = std::max(top, v.point.z());
  if ((top - h.object.placement[2]) * kUsualLean < tolerance * context.mm_per_px) return;
  std::vector<bool> free(std::size_t(h.object.StateSize()), true);
  free[2] = false;
  PlacedObject leaning = h.object;
  FitToLines(leaning, h.views, context.scene, free, kFirstReach * tolerance, kLastReach * tolerance, 8,
             context.others);
  if (leaning.placement.tail<2>().norm() > kMaxLean || !Allowed(leaning)) return;
  const double after = weigh(leaning);
  if (after < h.log_odds + kLeans) return;
  h.log_odds = after;
  h.object = leaning;
}

}  // namespace

void RefineAndWeigh(Hypothesis& h, const SeedContext& context) {
  std::vector<bool> free(std::size_t(h.object.StateSize()), true);
  free[2] = free[4] = free[5] = false;
  auto weigh = [&](const PlacedObject& object) {
    const WeighOptions options{.grey = true, .prior_log_odds = PriorLogOdds(object, context.mm_per_px)};
    return Weigh(PlaceSolid(object, false), h.views, context.scene, options, context.others, context.claims)
        .Score();
  };
  const double tolerance = context.scene.tolerance_px;
  const PlacedObject start = h.object;
  h.log_odds = weigh(start);
  constexpr double kHopeless = -60;  // no fit within a few pixels brings that much
  if (h.log_odds < kHopeless) return;
  // A wide reach forgives a poor start, a narrow one is not led astray by neighbours: what explains most is
  // kept.
  for (double reach : {3.0, 2.0, 1.0}) {
    PlacedObject fitted = reach == 1.0 ? h.object : start;
    FitToLines(fitted, h.views, context.scene, free, reach * tolerance, tolerance, 5, context.others);
    if ((fitted.placement.head<2>() - start.placement.head<2>()).norm() > 30 * context.mm_per_px ||
        !Allowed(fitted))
      continue;
    const double after = weigh(fitted);
    if (after <= h.log_odds) continue;
    h.log_odds = after;
    h.object = fitted;
  }
  RefineLean(h, context, weigh);
}

std::vector<Hypothesis> Slides(const Hypothesis& hypothesis, const SeedContext& context) {
  constexpr int kMost = 3;        // ways
  constexpr double kWeak = 0.3;   // px^2 per mm^2: what some ten samples on lines tell
  constexpr double kFarMm = 400;  // an end is not lost further
  constexpr int kRefined = 2;     // of each way
  std::vector<bool> free(std::size_t(hypothesis.object.StateSize()), true);
  free[2] = free[4] = free[5] = false;
  PlacedObject unmoved = hypothesis.object;
  const double tolerance = context.scene.tolerance_px;
  const FitToLinesResult fit =
      FitToLines(unmoved, hypothesis.views, context.scene, free, tolerance, tolerance, 1, context.others);
  if (fit.information.size() == 0) return {};
  // In mm: a turn by what it moves the ends.
  double reach = 1;
  for (const auto& v : PlaceSolid(hypothesis.object, false).vertices)
    reach = std::max(reach, (v.point - hypothesis.object.placement.head<3>()).norm());
  std::vector<int> states;
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(hypothesis.object.StateSize());
  scale[3] = 1 / reach;
  for (int i = 0; i < int(free.size()); ++i)
    if (free[std::size_t(i)]) states.push_back(i);
  const int n = int(states.size());
  Eigen::MatrixXd a(n, n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      a(i, k) = fit.information(states[std::size_t(i)], states[std::size_t(k)]) *
                scale[states[std::size_t(i)]] * scale[states[std::size_t(k)]];
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
  std::vector<Hypothesis> out;
  for (int way = 0; way < std::min(n, kMost) && solver.eigenvalues()[way] < kWeak; ++way) {
    Eigen::VectorXd direction = Eigen::VectorXd::Zero(hypothesis.object.StateSize());
    for (int i = 0; i < n; ++i)
      direction[states[std::size_t(i)]] = solver.eigenvectors()(i, way) * scale[states[std::size_t(i)]];
    const double largest = direction.tail(direction.size() - kPlacementSize).cwiseAbs().maxCoeff();
    if (largest < 0.1) continue;  // it moves as a whole
    direction /= largest;
    std::vector<Hypothesis> better;
    for (double far :
         VoteAlong(hypothesis.object, direction, -kFarMm, kFarMm, hypothesis.views, context.scene)) {
      Hypothesis h = hypothesis;
      h.object.SetState(hypothesis.object.State() + far * direction);
      if (!InRange(h.object, 0) || !Allowed(h.object)) continue;
      h.log_odds = Weigh(PlaceSolid(h.object, false), h.views, context.scene,
                         {.grey = true, .prior_log_odds = PriorLogOdds(h.object, context.mm_per_px)},
                         context.others, context.claims)
                       .Score();
      better.push_back(std::move(h));
    }
    std::stable_sort(better.begin(), better.end(),
                     [](const Hypothesis& x, const Hypothesis& y) { return x.log_odds > y.log_odds; });
    if (int(better.size()) > kRefined) better.resize(kRefined);
    for (auto& h : better) {
      RefineAndWeigh(h, context);
      if (h.log_odds > hypothesis.log_odds) out.push_back(std::move(h));
    }
  }
  return out;
}

}  // namespace vss
