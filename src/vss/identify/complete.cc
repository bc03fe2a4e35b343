#include "vss/identify/complete.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "vss/identify/contour_targets.h"
#include "vss/identify/refine.h"
#include "vss/identify/seed_fit.h"
#include "vss/identify/vote.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// With every open dimension as usual, or as picked: the seed's own edges are not there.
constexpr double kHopeless = -10;
// Where the seed's edge is slanted its ends are found later.
constexpr double kHopelessSlanted = -40;
// A voted value must beat the usual one by this: it was picked among several, one of which fits by chance.
constexpr double kPicked = 8;

// What dimension `d` usually is beside those that are known.
double UsualValue(const PlacedObject& o, const std::vector<bool>& known, std::size_t d) {
  std::vector<std::optional<double>> values(known.size());
  for (std::size_t i = 0; i < known.size(); ++i)
    if (known[i] && i != d) values[i] = o.dimensions_mm[i];
  return o.model->UsualDimensions(values)[d];
}

class Completer {
 public:
  Completer(const KindTemplate& kind, const SeedContext& context) : kind_(kind), context_(context) {}

  // The best completions of a seed.
  std::vector<Completion> Complete(Hypothesis h) const {
    h.views = ViewsThatSee(PlaceSolid(h.object, false), context_.scene, context_.max_views);
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

 private:
  struct State {
    double score;
    PlacedObject object;
    std::vector<bool> known;  // dimensions told by the seed or picked
  };

  double Score(const PlacedObject& object, std::span<const int> views) const {
    return RoughLogOdds(object, views, context_);
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

  // Does the rim move with dimension `d`?
  static bool Moves(const WorldSolid::Circle& rim, std::size_t d) {
    const int at = kPlacementSize + int(d);
    return rim.radius_by_state[at] != 0 || rim.center.by_state.col(at).norm() > 0;
  }

  // A rim whose place the seed left open, from the world's circles at its height.
  // False where there is none: the object is then a simpler one.
  bool CompleteRims(Hypothesis& h, const std::vector<int>& views) const {
    const WorldSolid solid = PlaceSolid(h.object);
    // No rim lies farther from the object's middle than all its dimensions together.
    double farthest = 0;
    for (const auto& d : h.object.model->dimensions()) farthest += d.max_mm;
    double best_score = -INFINITY;
    PlacedObject best = h.object;
    bool any_open = false;
    for (int rim : kind_.rims) {
      const auto& c = solid.circles[std::size_t(rim)];
      bool open = false;
      for (std::size_t d = 0; d < h.determined.size(); ++d) open |= !h.determined[d] && Moves(c, d);
      if (!open) continue;
      any_open = true;
      for (const auto& w : context_.circles) {
        if (std::abs(w.center.z() - c.center.point.z()) > 3 * context_.mm_per_px ||
            (w.center - h.object.placement.head<3>()).head<2>().norm() > farthest)
          continue;
        const auto o = LaidOnCircle(h.object, h.determined,
                                    {rim, {w.center.x(), w.center.y(), c.center.point.z()}, w.radius_mm},
                                    context_.mm_per_px);
        if (!o) continue;
        const double score = Score(*o, views);
        if (score > best_score) {
          best_score = score;
          best = *o;
        }
      }
    }
    if (best_score == -INFINITY) return !any_open;
    h.object = best;
    for (std::size_t d = 0; d < h.determined.size(); ++d)
      for (int rim : kind_.rims)
        if (Moves(solid.circles[std::size_t(rim)], d)) h.determined[d] = true;
    return true;
  }

  State Valued(const Hypothesis& h, PlacedObject object, std::vector<bool> known) const {
    const auto picked = std::count(known.begin(), known.end(), true) -
                        std::count(h.determined.begin(), h.determined.end(), true);
    const double score = Score(object, h.views) - kPicked * double(picked);
    return {score, std::move(object), std::move(known)};
  }

  // The best of `beam` and of what becomes of them with other values of dimension `d`.
  std::vector<State> Widen(const Hypothesis& h, std::size_t d, const std::vector<State>& beam) const {
    constexpr std::size_t kBeam = 4;
    std::vector<State> next = beam;
    auto consider = [&](const State& from, double value, bool picked) {
      PlacedObject o = from.object;
      MoveDimension(o, h.open_direction, d, value);
      const bool again = std::any_of(next.begin(), next.end(), [&](const State& n) {
        return n.known[d] == picked &&
               (n.object.State() - o.State()).cwiseAbs().maxCoeff() < 0.3 * context_.mm_per_px;
      });
      if (again || !Allowed(o)) return;
      auto known = from.known;
      known[d] = picked;
      next.push_back(Valued(h, std::move(o), std::move(known)));
    };
    for (const State& from : beam) {
      consider(from, UsualValue(from.object, from.known, d), false);
      for (double value : Contacts(from.object, d, h)) consider(from, value, true);
      for (double value : Vote(from.object, d, h)) consider(from, value, true);
    }
    std::stable_sort(next.begin(), next.end(),
                     [](const State& a, const State& b) { return a.score > b.score; });
    if (next.size() > kBeam) next.resize(kBeam);
    return next;
  }

  // Dimensions that the seed left open, one after the other, the best few combinations kept (beam search).
  std::vector<Completion> CompleteDimensions(const Hypothesis& h) const {
    constexpr std::size_t kRefined = 2;
    constexpr int kPasses = 2;  // the second sees the later dimensions where they belong
    std::vector<State> beam{Valued(h, h.object, h.determined)};
    for (int pass = 0; pass < kPasses; ++pass)
      for (std::size_t d = 0; d < h.determined.size(); ++d)
        if (!h.determined[d]) beam = Widen(h, d, beam);
    std::vector<Completion> best;
    for (const State& state : beam) {
      if (best.size() == kRefined) break;
      best.push_back({h, state.known});
      best.back().h.object = state.object;
    }
    return best;
  }

  const KindTemplate& kind_;
  const SeedContext& context_;
};

// Dimensions that were neither told nor picked, but moved with the fit, go back to what is usual beside the
// others, the least missed first, unless that costs as much as a picked one must bring.
void Settle(Hypothesis& h, std::vector<bool> known, const SeedContext& context) {
  for (std::size_t round = 0; round < known.size(); ++round) {
    double best = h.log_odds - kPicked;
    int which = -1;
    PlacedObject settled;
    for (std::size_t d = 0; d < known.size(); ++d) {
      if (known[d]) continue;
      const std::vector<bool> others(known.size(), true);
      PlacedObject o = h.object;
      MoveDimension(o, h.open_direction, d, UsualValue(o, others, d));
      if (!Allowed(o)) continue;
      const double score = FullLogOdds(o, h.views, context);
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

}  // namespace

std::optional<PlacedObject> LaidOnCircle(PlacedObject o, const std::vector<bool>& fixed,
                                         const CircleTarget& target, double mm_per_px) {
  double worst = 0;
  for (int iteration = 0; iteration < 3; ++iteration) {
    NormalEquations normal(o.StateSize());
    worst = AddTargets(o, {}, {&target, 1}, normal);
    Eigen::MatrixXd a = normal.ata;
    Eigen::VectorXd b = normal.atb;
    a.diagonal().array() += 1e-6;
    for (int i = 0; i < o.StateSize(); ++i) {
      if (i >= kPlacementSize && !fixed[std::size_t(i - kPlacementSize)]) continue;
      a.row(i).setZero();
      a.col(i).setZero();
      a(i, i) = 1;
      b[i] = 0;
    }
    o.SetState(o.State() + Eigen::VectorXd(a.ldlt().solve(b)));
  }
  if (worst > kSeedTolerancePx * mm_per_px || !InRange(o, 0) || !Allowed(o)) return std::nullopt;
  return o;
}

std::vector<Completion> Complete(const KindTemplate& kind, const SeedContext& context,
                                 const Hypothesis& seed) {
  return Completer(kind, context).Complete(seed);
}

Hypothesis Finish(const SeedContext& context, const Completion& completion) {
  Hypothesis h = completion.h;
  RefineAndWeigh(h, context);
  Settle(h, completion.known, context);
  return h;
}

std::vector<Completion> Distinct(std::vector<Completion> completions, double mm_per_px) {
  std::stable_sort(completions.begin(), completions.end(),
                   [](const Completion& a, const Completion& b) { return a.h.log_odds > b.h.log_odds; });
  std::vector<Completion> out;
  for (auto& c : completions)
    if (std::none_of(out.begin(), out.end(), [&](const Completion& o) {
          return o.known == c.known && SamePlace(o.h.object, c.h.object, mm_per_px / 2);
        }))
      out.push_back(std::move(c));
  return out;
}

}  // namespace vss
