#include "vss/identify/hypothesis_search.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>

#include "vss/base/parallel.h"
#include "vss/identify/complete.h"
#include "vss/identify/own_shadow.h"
#include "vss/identify/refine.h"
#include "vss/identify/scene_choice.h"
#include "vss/identify/seed.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// Less, and no end that is moved makes a part of it.
constexpr double kWorthSliding = -20;
// Of one picture: from height to height a contour moves by no more than the fit to lines catches; nothing
// that is higher than this share of the camera's height is looked for.
constexpr double kHeightStepPx = 6, kMostOfEye = 0.25;

using SeedOfTemplate = std::pair<std::size_t, Hypothesis>;
using CompletionOfTemplate = std::pair<std::size_t, Completion>;

// A line over the top face of an item (within a few pixels), not below it.
bool Above(const WorldLine& l, const SceneItem& item, double mm_per_px) {
  const double slack = kOverhangPx * mm_per_px;
  const auto room = Footprint(item.volume.box, slack);
  return room.contains(l.start.head<2>()) && room.contains(l.end.head<2>()) &&
         std::min(l.start.z(), l.end.z()) >= item.top_mm - slack;
}

// In one picture a top alone may be a small one that is near or a large one that is far: what stands below
// it must speak for its height.
bool ShowsHeight(const Hypothesis& h, const SeedContext& context) {
  constexpr double kBelowTopPx = 2, kLeast = 6;  // half of what makes a part
  const WorldSolid solid = PlaceSolid(h.object, false);
  const double top = MakeVolume(solid).box.max().z() - kBelowTopPx * context.mm_per_px;
  double below = 0;
  for (const auto& e :
       Weigh(solid, h.views, context.scene, {.grey = true}, context.others, context.claims).edges) {
    const bool is_low =
        e.source == ContourSample::Source::kEdge
            ? std::min(solid.vertices[std::size_t(solid.edges[std::size_t(e.index)].start)].point.z(),
                       solid.vertices[std::size_t(solid.edges[std::size_t(e.index)].end)].point.z()) < top
        : e.source == ContourSample::Source::kCircle
            ? solid.circles[std::size_t(e.index)].center.point.z() < top
            : true;
    if (is_low) below += e.log_odds;
  }
  return below >= kLeast;
}

class Search {
 public:
  Search(int support, const Explained& known, SceneData& data)
      : data_(data),
        known_(known),
        support_z_(support < 0 ? 0 : data.items[support].top_mm),
        on_(support < 0 ? "ground" : data.items[support].kind),
        context_(data.Context()) {
    if (!known.claims.empty()) {
      context_.others = &known.others;
      context_.claims = &known.claims;
      context_.contact = data.options.contact;
    }
    for (std::size_t i = 0; i < data.edges.lines.size(); ++i)
      if (data.edges.well_shown[i] &&
          (support < 0 || Above(data.edges.lines[i], data.items[support], data.mm_per_px)) &&
          !Known(data.edges.lines[i]))
        lines_.push_back(data.edges.lines[i]);
    for (const auto& c : data.edges.circles)
      if (!Known(c)) circles_.push_back(c);
    context_.lines = lines_;
    context_.circles = circles_;
  }

  // What is asked for is known: all templates, on whatever stands there, from these lines.
  Search(std::span<const LineRef> own, double support_z, SceneData& data)
      : Search(SceneItems::kGround, kNothing, data) {
    support_z_ = support_z;
    own_ = own;
    least_ = -INFINITY;
  }

  // Those good enough to be parts.
  std::vector<Hypothesis> Run() {
    by_template_.resize(data_.templates.size());
    if (data_.IsSinglePicture())
      SeedHeights();
    else
      Seed();
    std::vector<Hypothesis> out;
    for (auto& h : FinishAll(CompleteAll()))
      if (h) out.push_back(std::move(*h));
    return out;
  }

 private:
  template <class Edge>
  bool Known(const Edge& edge) const {
    return !known_.claims.empty() && Explains(known_.claims, edge, data_.index);
  }

  bool IsAsked(const KindTemplate& t) const {
    // How a part lies less often is asked only of lines that nothing else explains.
    return own_ || (t.model->MayStandOn(on_) && (t.resting_pose == 0 || !known_.claims.empty()));
  }

  // Of each of the context's lines, whether it may start a hypothesis.
  std::vector<bool> Starts() const {
    std::vector<bool> starts;
    for (const auto& l : lines_)
      starts.push_back(own_ && std::any_of(l.lines.begin(), l.lines.end(), [&](const LineRef& r) {
                         return std::find(own_->begin(), own_->end(), r) != own_->end();
                       }));
    if (std::find(starts.begin(), starts.end(), true) == starts.end()) starts.assign(lines_.size(), true);
    return starts;
  }

  void Seed() {
    const auto pairs = ParallelPairs(context_, FarthestPairMm(data_.templates));
    const std::vector<bool> starts = Starts();
    ParallelFor(data_.templates.size(), data_.threads, [&](std::size_t i) {
      const KindTemplate& t = data_.templates[i];
      if (!IsAsked(t)) return;
      auto seeds = Seeds(t, context_, pairs, support_z_);
      const auto started = [&](const Hypothesis& h) {
        return h.first_line < 0 ? 2 : starts[std::size_t(h.first_line)] + starts[std::size_t(h.second_line)];
      };
      // One picture shows every pair at every height: where two of the own lines make a pair, others wait.
      const bool pairs_of_own = data_.IsSinglePicture() && own_ &&
                                std::any_of(seeds.begin(), seeds.end(), [&](const Hypothesis& h) {
                                  return h.first_line >= 0 && started(h) == 2;
                                });
      std::erase_if(seeds, [&](const Hypothesis& h) { return started(h) < (pairs_of_own ? 2 : 1); });
      std::move(seeds.begin(), seeds.end(), std::back_inserter(by_template_[i]));
    });
  }

  // One picture does not tell how high a line lies: every height is tried.
  void SeedHeights() {
    const View& view = data_.views[0];
    const double step = kHeightStepPx * data_.mm_per_px;
    const double most = std::min(data_.options.max_height_mm, kMostOfEye * view.center_in_world.z());
    for (double height = support_z_ + step; height <= most; height += step) {
      lines_ = LevelLines(view, data_.index.lines[0], height, kSureLinePx);
      for (auto& l : lines_)
        if (Known(l)) l.end = l.start;
      circles_ = LevelCircles(view, height, data_.index.tolerance_px);
      std::erase_if(circles_, [&](const WorldCircle& c) { return Known(c); });
      context_.lines = lines_;
      context_.circles = circles_;
      if (data_.progress.Cancelled()) return;
      Seed();
    }
  }

  std::vector<CompletionOfTemplate> CompleteAll() {
    std::vector<SeedOfTemplate> seeds;
    for (std::size_t i = 0; i < by_template_.size(); ++i)
      for (auto& h : Promising(std::move(by_template_[i]), context_, data_.threads))
        seeds.push_back({i, std::move(h)});
    std::vector<std::vector<Completion>> completed(seeds.size());
    ParallelFor(seeds.size(), data_.threads, [&](std::size_t i) {
      if (!data_.progress.Cancelled())
        completed[i] = Complete(data_.templates[seeds[i].first], context_, seeds[i].second);
    });
    std::vector<std::vector<Completion>> of_template(by_template_.size());
    for (std::size_t i = 0; i < seeds.size(); ++i)
      for (auto& c : completed[i]) of_template[seeds[i].first].push_back(std::move(c));
    std::vector<CompletionOfTemplate> distinct;
    for (std::size_t t = 0; t < of_template.size(); ++t)
      for (auto& c : Distinct(std::move(of_template[t]), data_.mm_per_px))
        distinct.push_back({t, std::move(c)});
    return distinct;
  }

  std::vector<std::optional<Hypothesis>> FinishAll(const std::vector<CompletionOfTemplate>& completions) {
    std::vector<std::optional<Hypothesis>> finished(completions.size());
    std::atomic<int> done{0};
    ParallelFor(completions.size(), data_.threads, [&](std::size_t i) {
      if (data_.progress.Cancelled()) return;
      const auto& [kind, completion] = completions[i];
      finished[i] = FinishOne(*data_.templates[kind].model, completion);
      data_.progress.Report("hypotheses", ++done, int(completions.size()));
    });
    return finished;
  }

  std::optional<Hypothesis> FinishOne(const ObjectModel& model, const Completion& completion) const {
    const double least = std::min(least_, data_.options.accept_log_odds - MostOfRelations(model));
    Hypothesis h = Finish(context_, completion);
    if (IsSlanted(h, context_) && h.log_odds > kWorthSliding)
      for (auto& slid : Slides(h, context_))
        if (slid.log_odds > h.log_odds) h = std::move(slid);
    if (auto raised = OutOfItsShadow(h, context_)) h = std::move(*raised);
    if (h.log_odds < least) return std::nullopt;
    WeighInAllViews(h, context_);
    if (h.log_odds < least || (data_.IsSinglePicture() && !own_ && !ShowsHeight(h, context_)))
      return std::nullopt;
    return h;
  }

  inline static const Explained kNothing;
  SceneData& data_;
  const Explained& known_;
  std::optional<std::span<const LineRef>> own_;
  double support_z_, least_ = INFINITY;
  std::string on_;
  SeedContext context_;
  std::vector<WorldLine> lines_;
  std::vector<WorldCircle> circles_;
  std::vector<std::vector<Hypothesis>> by_template_;
};

}  // namespace

namespace {

// Of each line the best of those seeds that pair it with its nearest partner on either side, where lines
// speak for it at all: where parts stand side by side, edges of two of them pair as well as those of one.
std::vector<std::size_t> WithNearestPartners(std::span<const Hypothesis> seeds,
                                             std::span<const double> scores,
                                             std::span<const std::size_t> best_first,
                                             std::span<const WorldLine> lines) {
  struct Partner {
    double apart_mm = INFINITY;
    std::size_t seed = 0;
  };
  std::map<std::pair<int, bool>, Partner> nearest;  // by line and side
  for (std::size_t i : best_first) {
    const Hypothesis& h = seeds[i];
    if (scores[i] <= 0) break;
    if (h.first_line < 0) continue;
    const WorldLine &a = lines[std::size_t(h.first_line)], &b = lines[std::size_t(h.second_line)];
    const Vector3d offset = (b.start + b.end - a.start - a.end) / 2;
    const double apart = a.Unit().cross(offset).norm();
    for (int line : {h.first_line, h.second_line}) {
      const Vector3d u = lines[std::size_t(line)].Unit();
      const double left = (u.x() * offset.y() - u.y() * offset.x()) * (line == h.first_line ? 1 : -1);
      Partner& p = nearest[{line, left > 0}];
      if (apart < p.apart_mm) p = {apart, i};
    }
  }
  std::vector<std::size_t> out;
  for (const auto& [side, partner] : nearest) out.push_back(partner.seed);
  return out;
}

}  // namespace

void AddHypotheses(int support, const Explained& known, SceneData& data) {
  const std::string on = support < 0 ? "ground" : data.items[support].kind;
  if (std::none_of(data.templates.begin(), data.templates.end(),
                   [&](const KindTemplate& t) { return t.model->MayStandOn(on); }))
    return;
  for (auto& h : Search(support, known, data).Run()) data.items.Keep(std::move(h), support);
}

std::vector<Hypothesis> HypothesesOn(std::span<const LineRef> own, double support_z_mm, SceneData& data) {
  return Search(own, support_z_mm, data).Run();
}

std::vector<Hypothesis> Promising(std::vector<Hypothesis> seeds, const SeedContext& context, int threads) {
  constexpr int kPerLine = 4, kPerSlantedLine = 6;  // whose ends are believed or not
  std::vector<double> scores(seeds.size());
  ParallelFor(seeds.size(), threads, [&](std::size_t i) { scores[i] = RoughScore(seeds[i], context); });
  std::vector<std::size_t> order(seeds.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
  std::map<int, int> used;
  std::vector<bool> chosen(seeds.size());
  for (std::size_t i : order) {
    const Hypothesis& h = seeds[i];
    const int most = IsSlanted(h, context) ? kPerSlantedLine : kPerLine;
    if (h.first_line >= 0 && (used[h.first_line] >= most || used[h.second_line] >= most)) continue;
    ++used[h.first_line];
    ++used[h.second_line];
    chosen[i] = true;
  }
  for (std::size_t i : WithNearestPartners(seeds, scores, order, context.lines)) chosen[i] = true;
  std::vector<Hypothesis> out;
  for (std::size_t i : order)
    if (chosen[i]) out.push_back(std::move(seeds[i]));
  return out;
}

void WeighInAllViews(Hypothesis& h, const SeedContext& context) {
  constexpr int kManyViews = 40;
  const WorldSolid solid = PlaceSolid(h.object, false);
  h.views = ViewsThatSee(solid, context.scene, kManyViews);
  h.log_odds = Weigh(solid, h.views, context.scene,
                     {.grey = true, .prior_log_odds = PriorLogOdds(h.object, context.scene.mm_per_px)},
                     context.others, context.claims)
                   .Score();
}

}  // namespace vss
