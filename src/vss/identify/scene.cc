#include "vss/identify/scene.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

#include "vss/base/parallel.h"
#include "vss/identify/hypothesis.h"
#include "vss/identify/overlap.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// Calibration errors grow with the picture: this many px, plus a share of its width.
constexpr double kBaseTolerancePx = 1.2;
constexpr double kToleranceShare = 1.0 / 2000;
// Two parts may sink into each other by this before they are said to fill the same room.
constexpr double kTouchMm = 6;
constexpr double kMaxSharedVolume = 0.02;

double TolerancePx(std::span<const View> views, const IdentifyOptions& options) {
  if (options.tolerance_px > 0) return options.tolerance_px;
  double width = 0;
  for (const auto& v : views) width = std::max<double>(width, v.camera->width_px);
  return kBaseTolerancePx + kToleranceShare * width;
}

struct Item {
  Hypothesis h;
  Volume volume;
  std::string kind;
  int support_item = -1;  // index into the items; -1: ground
  double top_mm = 0;
  bool accepted = false;
  int part = -1;  // index among the accepted
};

class SceneSolver {
 public:
  SceneSolver(std::span<const View> views, const KnowledgeBase& knowledge, const IdentifyOptions& options,
              int threads, const Progress& progress)
      : views_(views),
        options_(options),
        threads_(threads),
        progress_(progress),
        templates_(MakeTemplates(knowledge)) {
    scene_ = MakeSceneIndex(views, TolerancePx(views, options), threads);
    mm_per_px_ = scene_.mm_per_px;
  }

  Result<SceneResult> Run() {
    const WorldLineOptions line_options{scene_.tolerance_px, -20 * mm_per_px_, options_.max_height_mm};
    progress_.Report("world lines", 0, 1);
    lines_ = FindWorldLines(views_, scene_.lines, line_options, threads_, progress_);
    scene_.SetWorldLines(lines_);
    circles_ = FindWorldCircles(views_, line_options);
    progress_.Report("world lines", 1, 1);
    if (progress_.Cancelled()) return Cancelled();
    AddHypotheses(-1);
    if (progress_.Cancelled()) return Cancelled();
    Select();
    StackOnTops();
    if (progress_.Cancelled()) return Cancelled();
    Select();
    return Collect();
  }

 private:
  SeedContext Context() const { return {scene_, lines_, circles_, mm_per_px_, 12}; }

  // Hypotheses of all kinds on the ground (-1) or on the top of an item.
  void AddHypotheses(int support) {
    const double z = support < 0 ? 0 : items_[std::size_t(support)].top_mm;
    const std::string on = support < 0 ? "ground" : items_[std::size_t(support)].kind;
    std::vector<WorldLine> lines;
    for (const auto& l : lines_)
      if (support < 0 || Above(l, items_[std::size_t(support)])) lines.push_back(l);
    if (support >= 0 && lines.size() < 2) return;
    SeedContext context = Context();
    context.lines = lines;
    std::vector<std::pair<std::size_t, Hypothesis>> seeds;  // template, seed
    for (std::size_t i = 0; i < templates_.size(); ++i) {
      if (!templates_[i].model->MayStandOn(on)) continue;
      for (auto& h : Seeds(templates_[i], context, z)) seeds.push_back({i, std::move(h)});
    }
    std::vector<std::vector<Hypothesis>> finished(seeds.size());
    std::atomic<int> done{0};
    ParallelFor(seeds.size(), threads_, [&](std::size_t i) {
      if (progress_.Cancelled()) return;
      finished[i] = Complete(templates_[seeds[i].first], context, seeds[i].second, options_.accept_log_odds);
      progress_.Report("hypotheses", ++done, int(seeds.size()));
    });
    for (auto& list : finished)
      for (auto& h : list) Keep(std::move(h), support);
  }

  // A line over the top face of an item (within a few pixels), not below it.
  bool Above(const WorldLine& l, const Item& item) const {
    const double slack = 3 * mm_per_px_;
    for (const Vector3d& p : {l.start, l.end, Vector3d((l.start + l.end) / 2)}) {
      if (p.z() < item.top_mm - slack || p.x() < item.volume.box.min().x() - slack ||
          p.x() > item.volume.box.max().x() + slack || p.y() < item.volume.box.min().y() - slack ||
          p.y() > item.volume.box.max().y() + slack)
        return false;
    }
    return true;
  }

  void Keep(Hypothesis h, int support) {
    Item item;
    const WorldSolid solid = PlaceSolid(h.object, false);
    item.volume = MakeVolume(solid);
    item.kind = h.object.model->kind();
    item.top_mm = item.volume.box.max().z();
    item.support_item = support;
    h.support = support;
    if (support >= 0) {
      const auto& below = items_[std::size_t(support)].volume;
      const Vector3d foot(h.object.placement[0], h.object.placement[1], item.volume.box.min().z() - kTouchMm);
      if (!below.Contains(foot)) return;
    }
    // The same object found from another seed: keep the better.
    for (auto& other : items_) {
      if (other.kind != item.kind || other.support_item != support ||
          other.h.object.resting_pose != h.object.resting_pose)
        continue;
      if ((other.volume.box.center() - item.volume.box.center()).norm() > mm_per_px_ ||
          (other.volume.box.sizes() - item.volume.box.sizes()).norm() > mm_per_px_)
        continue;
      if (h.log_odds > other.h.log_odds) {
        item.h = std::move(h);
        other = std::move(item);
      }
      return;
    }
    item.h = std::move(h);
    items_.push_back(std::move(item));
  }

  // Tops that something could stand on: of accepted parts, and of wide ones that lost to what may stand on
  // them.
  void StackOnTops() {
    const std::size_t n = items_.size();
    for (std::size_t i = 0; i < n; ++i) {
      bool candidate = items_[i].accepted;
      if (!candidate && items_[i].h.log_odds > options_.doubtful_log_odds) {
        for (std::size_t k = 0; k < n && !candidate; ++k)
          candidate = items_[k].accepted && items_[k].top_mm > items_[i].top_mm + 2 * mm_per_px_ &&
                      SharedVolume(items_[i].volume, items_[k].volume, kTouchMm) > 0 &&
                      items_[i].volume.mm3 > items_[k].volume.mm3;
      }
      if (candidate) AddHypotheses(int(i));
      if (progress_.Cancelled()) return;
    }
  }

  bool Conflicts(const Item& a, const Item& b) const {
    return SharedVolume(a.volume, b.volume, kTouchMm) > kMaxSharedVolume;
  }

  // Greedy by what each adds to the explanation of all lines.
  void Select() {
    for (auto& item : items_) {
      item.accepted = false;
      item.part = -1;
    }
    Claims claims(views_.size());
    for (std::size_t v = 0; v < views_.size(); ++v) claims[v].resize(scene_.lines[v].lines().size());
    std::vector<std::pair<double, int>> queue;
    for (std::size_t i = 0; i < items_.size(); ++i) queue.push_back({items_[i].h.log_odds, int(i)});
    auto later = [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first < b.first : a.second > b.second;
    };
    std::make_heap(queue.begin(), queue.end(), later);
    std::vector<int> accepted;
    while (!queue.empty() && !progress_.Cancelled()) {
      std::pop_heap(queue.begin(), queue.end(), later);
      auto [old_score, i] = queue.back();
      queue.pop_back();
      Item& item = items_[std::size_t(i)];
      if (item.accepted) continue;
      // What it stands on comes first.
      std::vector<int> chain;
      for (int k = i; k >= 0 && !items_[std::size_t(k)].accepted; k = items_[std::size_t(k)].support_item)
        chain.push_back(k);
      bool blocked = false;
      for (int k : chain)
        for (int a : accepted) blocked |= Conflicts(items_[std::size_t(k)], items_[std::size_t(a)]);
      if (blocked) continue;
      // What is left for it when the other parts, and what it stands on, have explained their lines.
      Occluders others;
      for (int a : accepted) others.Add(PlaceSolid(items_[std::size_t(a)].h.object, false), a);
      Claims after = claims;
      for (int k : chain) {
        if (k == i) continue;
        others.Add(PlaceSolid(items_[std::size_t(k)].h.object, false), k);
        Claim(items_[std::size_t(k)], after);
      }
      const Evidence left =
          Weigh(PlaceSolid(item.h.object, false), item.h.views, scene_,
                {.prior_log_odds = PriorLogOdds(item.h.object, scene_.mm_per_px)}, &others, &after);
      const double now = left.Score();
      if (now < options_.accept_log_odds) continue;
      if (now < old_score - 1e-9 && !queue.empty() && now < queue.front().first) {
        queue.push_back({now, i});
        std::push_heap(queue.begin(), queue.end(), later);
        continue;
      }
      for (auto k = chain.rbegin(); k != chain.rend(); ++k) {
        Item& member = items_[std::size_t(*k)];
        member.accepted = true;
        accepted.push_back(*k);
        Claim(member, claims);
      }
    }
    accepted_ = accepted;
  }

  // A line; of an arc all of it.
  void ClaimLine(int v, int line, Claims& claims) const {
    auto& claimed = claims[std::size_t(v)];
    const auto& lines = scene_.lines[std::size_t(v)].lines();
    const int arc = lines[std::size_t(line)].arc;
    claimed[std::size_t(line)] = true;
    if (arc < 0) return;
    for (std::size_t k = std::size_t(scene_.lines[std::size_t(v)].num_segments()); k < lines.size(); ++k)
      if (lines[k].arc == arc) claimed[k] = true;
  }

  void Claim(const Item& item, Claims& claims) const {
    const WorldSolid solid = PlaceSolid(item.h.object, false);
    for (int v : ViewsThatSee(solid, views_, int(views_.size())))
      for (const auto& s : SampleContour(solid, views_[std::size_t(v)], 6, 3)) {
        if (!s.visible) continue;
        const LineHit hit = scene_.Match(v, s, scene_.tolerance_px, 0.9962);
        if (hit.line >= 0) ClaimLine(v, hit.line, claims);
      }
  }

  SceneResult Collect() {
    SceneResult result;
    std::sort(accepted_.begin(), accepted_.end());
    // Supports before what stands on them.
    std::stable_sort(accepted_.begin(), accepted_.end(), [&](int a, int b) { return Level(a) < Level(b); });
    Occluders everything;
    for (std::size_t k = 0; k < accepted_.size(); ++k) {
      items_[std::size_t(accepted_[k])].part = int(k);
      everything.Add(PlaceSolid(items_[std::size_t(accepted_[k])].h.object, false), accepted_[k]);
    }
    for (int i : accepted_) {
      Item& item = items_[std::size_t(i)];
      IdentifiedPart part;
      part.object = item.h.object;
      part.stands_on = item.support_item < 0 ? -1 : items_[std::size_t(item.support_item)].part;
      const WorldSolid solid = PlaceSolid(part.object, false);
      part.views = ViewsThatSee(solid, views_, int(views_.size()));
      const Evidence evidence = Weigh(
          solid, part.views, scene_,
          {.keep_matches = true, .prior_log_odds = PriorLogOdds(part.object, scene_.mm_per_px)}, &everything);
      part.matches = evidence.matches;
      part.log_odds = evidence.log_odds;
      for (const auto& other : items_) {
        if (other.accepted || other.kind == item.kind) continue;
        if (part.runner_up && other.h.log_odds <= part.runner_up->log_odds) continue;
        if (SharedVolume(item.volume, other.volume, kTouchMm) < 0.3) continue;
        part.runner_up = RunnerUp{other.kind, other.h.log_odds};
      }
      part.doubtful = part.log_odds < options_.doubtful_log_odds;
      result.parts.push_back(std::move(part));
    }
    return result;
  }

  int Level(int i) const {
    int level = 0;
    for (int k = items_[std::size_t(i)].support_item; k >= 0; k = items_[std::size_t(k)].support_item)
      ++level;
    return level;
  }

  std::span<const View> views_;
  const IdentifyOptions& options_;
  int threads_;
  const Progress& progress_;
  std::vector<KindTemplate> templates_;
  SceneIndex scene_;
  double mm_per_px_ = 1;
  std::vector<WorldLine> lines_;
  std::vector<WorldCircle> circles_;
  std::vector<Item> items_;
  std::vector<int> accepted_;
};

}  // namespace

std::span<const ParameterOf<IdentifyOptions>> IdentifyParameters() {
  static const ParameterOf<IdentifyOptions> rows[] = {
      {"identify.tolerance_px", &IdentifyOptions::tolerance_px, 0, 50, "px",
       "How far a line may lie from a predicted contour; 0: from the size of the pictures."},
      {"identify.max_height_mm", &IdentifyOptions::max_height_mm, 1, 100000, "mm",
       "Nothing of the workpiece is higher than this above the ground."},
      {"identify.accept_log_odds", &IdentifyOptions::accept_log_odds, 0, 1000, "",
       "An object needs this much evidence (natural logarithm of the odds) to be reported."},
      {"identify.doubtful_log_odds", &IdentifyOptions::doubtful_log_odds, 0, 1000, "",
       "Below this an object is reported as doubtful."},
  };
  return rows;
}

Result<SceneResult> IdentifyScene(std::span<const View> views, const KnowledgeBase& knowledge,
                                  const IdentifyOptions& options, int threads, const Progress& progress) {
  SceneSolver solver(views, knowledge, options, threads, progress);
  return solver.Run();
}

}  // namespace vss
