#include "vss/identify/seed.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "vss/identify/seed_fit.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// World lines are parallel to within this (sine).
constexpr double kMaxSkew = 0.035;
// Short slanted ones to within this: pictures that all look along their plane hardly tell how steep they are.
constexpr double kMaxSlantSkew = 0.07;
// Ends of two parallel edges that differ by more pixels than this are two candidates for the end.
constexpr double kEndTolerancePx = 4;

// Parallel and beside each other?
bool MayPair(const WorldLine& a, const WorldLine& b) {
  if (a.kind == WorldLine::Direction::kVertical || b.kind == WorldLine::Direction::kVertical) return false;
  if (a.start == a.end || b.start == b.end) return false;
  const Vector3d u = a.Unit();
  const bool slanted = a.kind == WorldLine::Direction::kInclined && b.kind == WorldLine::Direction::kInclined;
  if (u.cross(b.Unit()).norm() > (slanted ? kMaxSlantSkew : kMaxSkew)) return false;
  double lo = (b.start - a.start).dot(u), hi = (b.end - a.start).dot(u);
  if (lo > hi) std::swap(lo, hi);
  return std::min(hi, a.Length()) - std::max(lo, 0.0) > 0.3 * std::min(hi - lo, a.Length());
}

constexpr double kPairCellMm = 1000;

Eigen::AlignedBox2d PlanBox(const WorldLine& l) {
  Eigen::AlignedBox2d box(Vector2d(l.start.head<2>()));
  box.extend(Vector2d(l.end.head<2>()));
  // Lines pair to within a skew: between the middles of two that lie beside each other they come apart by as
  // much.
  return {box.min().array() - kMaxSlantSkew * l.Length(), box.max().array() + kMaxSlantSkew * l.Length()};
}

Eigen::AlignedBox2d Grown(const Eigen::AlignedBox2d& box, double by) {
  return {box.min().array() - by, box.max().array() + by};
}

class Seeder {
 public:
  Seeder(const KindTemplate& kind, const SeedContext& context, std::span<const LinePair> pairs,
         double support_z)
      : kind_(kind),
        context_(context),
        pairs_(pairs),
        support_z_(support_z),
        usual_(UsualObject(*kind.model, kind.resting_pose)),
        stored_(2 * context.mm_per_px) {
    usual_.placement[2] = support_z;
    usual_solid_ = PlaceSolid(usual_);
  }

  std::vector<Hypothesis> Seeds() {
    FromPairs();
    FromSlants();
    FromRims();
    return std::move(seeds_);
  }

 private:
  void FromPairs() {
    const auto lines = context_.lines;
    for (const auto& [i, k] : pairs_) {
      first_line_ = i;
      second_line_ = k;
      sides_.clear();
      for (const auto& pair : kind_.pairs) FromPair(pair, lines[std::size_t(i)], lines[std::size_t(k)]);
    }
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

  // The ends that an edge may have along a line, mm.
  struct Ends {
    std::vector<double> lows, highs;
  };

  // Where `l` begins and ends along `unit` from `origin`.
  static std::pair<double, double> Extent(const WorldLine& l, const Vector3d& origin, const Vector3d& unit) {
    double lo = (l.start - origin).dot(unit), hi = (l.end - origin).dot(unit);
    if (lo > hi) std::swap(lo, hi);
    return {lo, hi};
  }

  // Those of the line `a`; where the pair's edges end side by side, those of `b` too.
  Ends EndsOf(const KindTemplate::Pair& pair, const WorldLine& a, const Vector3d& unit,
              const std::pair<double, double>& of_a, const std::pair<double, double>& of_b,
              bool inclined) const {
    Ends ends{{of_a.first}, {of_a.second}};
    const double apart = kEndTolerancePx * context_.mm_per_px;
    auto merge = [&](std::vector<double>& values, double other) {
      if (std::abs(values[0] - other) > apart)
        values.push_back(other);
      else
        values[0] = (values[0] + other) / 2;
    };
    if (pair.same_extent) {
      merge(ends.lows, of_b.first);
      merge(ends.highs, of_b.second);
    }
    if (inclined) {
      const auto [low, high] = MedianEnds(a, unit);
      if (std::abs(low - ends.lows[0]) > apart) ends.lows.push_back(low);
      if (std::abs(high - ends.highs[0]) > apart) ends.highs.push_back(high);
    }
    return ends;
  }

  bool AreLevel(const WorldLine& a, const WorldLine& b) const {
    const Vector3d u = a.Unit(), mid = (b.start + b.end) / 2;
    const Vector3d opposite = a.start + u * u.dot(mid - a.start);
    return std::abs(opposite.z() - mid.z()) <= 2 * kSeedTolerancePx * context_.mm_per_px;
  }

  Vector3d UsualUnit(int edge) const {
    return EdgeDirection(usual_solid_, usual_solid_.edges[std::size_t(edge)]).normalized();
  }

  // `a` for the pair's first edge, `b` for its second.
  void FromParallels(const KindTemplate::Pair& pair, const WorldLine& a, const WorldLine& b) {
    if (pair.level && !AreLevel(a, b)) return;
    const Vector3d first = UsualUnit(pair.first), second = UsualUnit(pair.second);
    const bool inclined = std::abs(first.z()) > 0.05;
    if (inclined != (a.kind == WorldLine::Direction::kInclined)) return;
    if (!inclined && !MayFit(pair, a, b)) return;
    Vector3d unit = a.Unit();
    if (inclined && (unit.z() > 0) != (first.z() > 0)) unit = -unit;
    const auto of_a = Extent(a, a.start, unit), of_b = Extent(b, a.start, unit);
    const Ends ends = EndsOf(pair, a, unit, of_a, of_b, inclined);
    const double shift = (b.start - a.start).dot(unit);
    for (int flip = 0; flip < (inclined ? 1 : 2); ++flip) {
      const Vector3d toward = flip ? Vector3d(-unit) : unit;
      const double yaw = std::atan2(toward.y(), toward.x()) - std::atan2(first.y(), first.x());
      for (double lo : ends.lows)
        for (double hi : ends.highs) {
          if (hi - lo < 2 * context_.mm_per_px) continue;
          const EdgeTarget targets[] = {
              {pair.first, a.start, unit, lo, hi, flip == 1},
              {pair.second, b.start, unit, (pair.same_extent ? lo : of_b.first) - shift,
               (pair.same_extent ? hi : of_b.second) - shift, (flip == 1) != (second.dot(first) < 0)}};
          if (pair.same_extent && !inclined && !EndsSeen(targets[0], targets[1])) continue;
          // Ends of slanted edges are hidden as often as not: once believed, once left open.
          Seed(yaw, (a.start + a.end) / 2, {targets, {}, true});
          if (inclined) Seed(yaw, (a.start + a.end) / 2, {targets, {}, false});
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
  bool EndsSeen(const EdgeTarget& a, const EdgeTarget& b) {
    constexpr double kMinShare = 0.25;
    double best = 0;
    bool asked = false;
    for (const auto& [mine, other] : {std::pair(a.lo, b.lo), std::pair(a.hi, b.hi)}) {
      // Kinds of pairs and ways round ask the same of two lines over and over.
      const double at = mine;
      auto known = std::find_if(sides_.begin(), sides_.end(), [&](const Side& s) { return s.at == at; });
      if (known == sides_.end())
        known =
            sides_.insert(sides_.end(), {at, ShareSeen(a.point + mine * a.unit, b.point + other * b.unit)});
      if (!known->share) continue;
      asked = true;
      best = std::max(best, *known->share);
    }
    return !asked || best >= kMinShare;
  }

  // On what share of the points between p and q that pictures show a line lies; empty where they are too near
  // to each other, or in no picture, to say.
  std::optional<double> ShareSeen(const Vector3d& p, const Vector3d& q) const {
    constexpr double kMinLengthPx = 16;
    constexpr int kSteps = 6;
    if ((q - p).norm() < kMinLengthPx * context_.mm_per_px) return std::nullopt;
    int inside = 0, found = 0;
    for (const int near : context_.scene.ViewsNear({p.cwiseMin(q), p.cwiseMax(q)})) {
      const auto v = std::size_t(near);
      const View& view = context_.scene.views[v];
      if (view.SurelyMisses(p, q)) continue;
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
    if (inside < kSteps) return std::nullopt;
    return double(found) / inside;
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
    Seed(yaw, (slanted.start + slanted.end) / 2, {targets, {}, false});
  }

  void FromRims() {
    first_line_ = second_line_ = -1;
    for (const auto& c : context_.circles)
      for (int rim : kind_.rims) {
        const CircleTarget target{rim, c.center, c.radius_mm};
        Seed(0, c.center, {{}, {&target, 1}, true});
      }
  }

  void Seed(double yaw, const Vector3d& near, const SeedTargets& targets) {
    if (auto h = FitSeed(usual_, yaw, near, targets, context_.mm_per_px)) Store(std::move(*h));
  }

  void Store(Hypothesis h) {
    h.first_line = first_line_;
    h.second_line = second_line_;
    if (!Allowed(h.object)) return;
    const Vector2d place = h.object.placement.head<2>(), reach = Vector2d::Constant(context_.mm_per_px);
    stored_.Find({place - reach, place + reach}, near_);
    for (const int i : near_) {
      const auto& other = seeds_[std::size_t(i)];
      if (other.determined == h.determined && SamePlace(other.object, h.object, context_.mm_per_px / 2))
        return;
    }
    stored_.Add({place, place});
    seeds_.push_back(std::move(h));
  }

  const KindTemplate& kind_;
  const SeedContext& context_;
  std::span<const LinePair> pairs_;
  double support_z_;
  PlacedObject usual_;
  WorldSolid usual_solid_;
  std::vector<Hypothesis> seeds_;
  BoxGrid stored_;                          // where each of them lies
  std::vector<int> near_;                   // scratch
  int first_line_ = -1, second_line_ = -1;  // of the seed at hand
  struct Side {
    double at;                    // along the first line, mm
    std::optional<double> share;  // ShareSeen() there
  };
  std::vector<Side> sides_;  // of the two lines at hand
};

}  // namespace

double FarthestPairMm(std::span<const KindTemplate> kinds) {
  double farthest = 0;
  for (const auto& kind : kinds)
    for (const auto& pair : kind.pairs)
      farthest = std::max({farthest, std::abs(pair.left.min().x()), std::abs(pair.left.max().x())});
  return farthest;
}

std::vector<LinePair> ParallelPairs(const SeedContext& context, double farthest_mm) {
  const auto lines = context.lines;
  const int least = context.scene.views.size() > 1 ? 5 : 2;  // two pictures agree on many a line of texture
  // As MayFit() allows, and more than what that is rounded by.
  const double most_mm = farthest_mm + 2 * kSeedTolerancePx * context.mm_per_px + 1;
  BoxGrid boxes(kPairCellMm);
  for (const auto& l : lines) boxes.Add(PlanBox(l));
  std::vector<int> all(lines.size()), near;
  std::iota(all.begin(), all.end(), 0);
  std::vector<LinePair> pairs;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool level = lines[i].kind == WorldLine::Direction::kHorizontal && lines[i].start != lines[i].end;
    const Vector3d middle = (lines[i].start + lines[i].end) / 2;
    const Vector2d u = level ? Vector2d(lines[i].Unit().head<2>().normalized()) : Vector2d::Zero();
    if (level) boxes.Find(Grown(PlanBox(lines[i]), most_mm), near);
    for (const int other : level ? near : all) {
      const auto k = std::size_t(other);
      if (i == k || lines[i].num_views + lines[k].num_views < least) continue;
      const Vector3d offset = (lines[k].start + lines[k].end) / 2 - middle;
      if (std::abs(u.x() * offset.y() - u.y() * offset.x()) > most_mm) continue;
      if (MayPair(lines[i], lines[k])) pairs.push_back({int(i), int(k)});
    }
  }
  return pairs;
}

std::vector<Hypothesis> Seeds(const KindTemplate& kind, const SeedContext& context,
                              std::span<const LinePair> pairs, double support_z_mm) {
  return Seeder(kind, context, pairs, support_z_mm).Seeds();
}

double RoughScore(const Hypothesis& seed, const SeedContext& context) {
  constexpr int kFewViews = 6;
  const auto views = ViewsThatSee(PlaceSolid(seed.object, false), context.scene, kFewViews);
  return RoughLogOdds(seed.object, views, context, context.claims);
}

}  // namespace vss
