#include "vss/identify/own_shadow.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "vss/identify/refine.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// What seems higher shows its foot apart from its top, what seems lower may be paint.
constexpr double kMostPx = 4, kLeastPx = 1;
// Between what three quarters and what 95 in a hundred of the edges so drawn are off (accuracy_pulls: .78 and
// 1.35 px). Without a bound an outline could go in and up together for ever: the lines beside it say little
// of either.
constexpr double kMostInwardsPx = 1.2;
constexpr double kMostRaisedPx = 10;  // ten pixels higher, no outline is found at the foot

// Changes of an object, in pixels' size.
struct Change {
  double raised_px = 0, inwards_px = 0;
};

class Outline {
 public:
  Outline(const PlacedObject& object, double mm_per_px)
      : object_(object),
        before_(PlaceSolid(object, false)),
        own_(object.model->InstantiateUnchecked(object.dimensions_mm)),
        mm_per_px_(mm_per_px) {
    for (const auto& v : before_.vertices) top_ = std::max(top_, v.point.z());
    for (const auto& c : before_.circles) top_ = std::max(top_, c.center.point.z());
    FindInwards();
  }

  double HeightPx() const { return (top_ - object_.placement[2]) / mm_per_px_; }

  // Empty where the knowledge base forbids it.
  std::optional<PlacedObject> Changed(const Change& change) const {
    const double up = change.raised_px * mm_per_px_, in = change.inwards_px * mm_per_px_;
    WorldSolid goal = before_;
    for (std::size_t i = 0; i < goal.vertices.size(); ++i)
      if (Vector3d& p = goal.vertices[i].point; IsTop(p.z())) p += in * inwards_[i] + up * Vector3d::UnitZ();
    for (std::size_t i = 0; i < goal.circles.size(); ++i) {
      auto& c = goal.circles[i];
      if (!IsTop(c.center.point.z())) continue;
      c.center.point.z() += up;
      c.radius_mm += own_.circles[i].is_hole ? in : -in;
    }
    auto out = MovedTo(goal, LowestOfTop() + up, object_);
    if (out && (!InRange(*out, 0) || !Allowed(*out))) out.reset();
    return out;
  }

 private:
  double LowestOfTop() const {
    constexpr double kLevelPx = 0.5;
    return top_ - kLevelPx * mm_per_px_;
  }
  bool IsTop(double z) const { return z >= LowestOfTop(); }

  // Of each vertex at the top the way (unit vectors summed) that takes the outline's edges there inwards.
  void FindInwards() {
    constexpr double kUpright = 0.5;  // of a face: the most of its normal that points up
    inwards_.assign(before_.vertices.size(), Vector3d::Zero());
    for (const auto& e : before_.edges) {
      const auto a = std::size_t(e.start), b = std::size_t(e.end);
      if (!IsTop(before_.vertices[a].point.z()) || !IsTop(before_.vertices[b].point.z())) continue;
      for (const int face : {e.left_face, e.right_face}) {
        const Vector3d n = before_.faces[std::size_t(face)].normal_in_part;  // placed: in the world
        if (std::abs(n.z()) > kUpright) continue;
        const Vector3d level = Vector3d(n.x(), n.y(), 0).normalized();
        inwards_[a] -= level, inwards_[b] -= level;
      }
    }
  }

  const PlacedObject& object_;
  const WorldSolid before_;
  const Solid own_;
  double mm_per_px_, top_ = -INFINITY;
  std::vector<Vector3d> inwards_;
};

}  // namespace

std::optional<Hypothesis> OutOfItsShadow(const Hypothesis& hypothesis, const SeedContext& context) {
  // In finer pictures a shadow is wide enough to have borders of its own, and mm tell paint: raised, it would
  // pass for a plate.
  if (context.mm_per_px < kFinestClutterPixelMm) return std::nullopt;
  const Outline outline(hypothesis.object, context.mm_per_px);
  if (!(outline.HeightPx() >= kLeastPx && outline.HeightPx() < kMostPx)) return std::nullopt;
  // Uphill on a grid: what is higher hides more of its shadow.
  constexpr double kRaiseStepPx = 1, kInwardsStepPx = 0.4;
  using Node = std::array<int, 2>;
  constexpr std::array<Node, 6> kSteps{{{1, 1}, {1, 0}, {0, 1}, {-1, 0}, {0, -1}, {-1, -1}}};
  const int most_up = int(std::lround(kMostRaisedPx / kRaiseStepPx)),
            most_in = int(std::lround(kMostInwardsPx / kInwardsStepPx));
  std::map<Node, double> known;
  Hypothesis best = hypothesis;
  auto at = [&](const Node& node) {
    const auto [it, fresh] = known.try_emplace(node, -INFINITY);
    if (!fresh || node[0] < 0 || node[0] > most_up || node[1] < 0 || node[1] > most_in) return it->second;
    const auto object = outline.Changed({node[0] * kRaiseStepPx, node[1] * kInwardsStepPx});
    if (object) it->second = FullLogOdds(*object, hypothesis.views, context);
    if (it->second > best.log_odds) best.log_odds = it->second, best.object = *object;
    return it->second;
  };
  Node here{1, 1};
  known[{0, 0}] = hypothesis.log_odds;
  for (double score = at(here);;) {
    Node next = here;
    for (const Node& step : kSteps) {
      const Node node{here[0] + step[0], here[1] + step[1]};
      if (const double there = at(node); there > score) score = there, next = node;
    }
    if (next == here) break;
    here = next;
  }
  if (here == Node{0, 0} || !(best.log_odds > hypothesis.log_odds)) return std::nullopt;
  RefineAndWeigh(best, context);
  return best;
}

}  // namespace vss
