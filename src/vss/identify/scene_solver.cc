#include "vss/identify/scene_solver.h"

#include <algorithm>

#include "vss/base/parallel.h"
#include "vss/identify/hypothesis_search.h"
#include "vss/identify/on_walls.h"
#include "vss/identify/refine.h"
#include "vss/identify/rim_search.h"
#include "vss/identify/unknown.h"

namespace vss {

Result<SceneResult> SceneSolver::Run() {
  constexpr int kMaxRounds = 4;  // what stands on what stands on what stands on the ground
  FindEdges();
  AddHypotheses(SceneItems::kGround, {}, data_);
  if (data_.options.contact) ReseatOnPlates(data_);
  choice_.Select();
  // What the parts found so far hide or explain is known now: the rest of the lines once more, on the ground
  // and on all tops.
  for (int round = 0; round < kMaxRounds && data_.options.top_down && !data_.progress.Cancelled(); ++round) {
    const std::vector<int> known = choice_.accepted();
    const Explained around = ExplainedBy(known, data_);
    data_.items.TakeChanged();
    SlideAccepted();
    if (data_.options.contact) BringUpToWalls();
    SeekRims();
    AddHypotheses(SceneItems::kGround, around, data_);
    bool afresh = false;
    if (data_.options.contact)
      for (int support : known) {
        afresh |= SearchAfresh(support, known);
        AddHypotheses(support, around, data_);
      }
    joiner_.JoinAll();
    if (!data_.items.TakeChanged()) break;
    if (data_.options.contact) ReseatOnPlates(data_);
    choice_.Select();
    if (choice_.accepted() == known && !afresh) break;
  }
  choice_.DropRefuted();
  if (data_.progress.Cancelled()) return Cancelled();
  return Collect();
}

void SceneSolver::FindEdges() {
  data_.edges = FindSceneEdges(data_.index, data_.options, data_.threads, data_.progress);
}

std::vector<Evidence> SceneSolver::WeighEach(std::span<const PlacedObject> objects) {
  FindEdges();
  std::vector<Evidence> out(objects.size());
  ParallelFor(objects.size(), data_.threads, [&](std::size_t i) {
    Occluders others;
    for (std::size_t k = 0; k < objects.size(); ++k)
      if (k != i) others.Add(PlaceSolid(objects[k], false), int(k));
    const WorldSolid solid = PlaceSolid(objects[i], false);
    out[i] =
        Weigh(solid, ViewsThatSee(solid, data_.index, int(data_.views.size())), data_.index,
              {.grey = true, .prior_log_odds = PriorLogOdds(objects[i], data_.index.mm_per_px)}, &others);
  });

  return out;
}

// Ends of accepted parts, and of what came second there, may be wrong though their edges are right.
void SceneSolver::SlideAccepted() {
  struct Candidate {
    int item, accepted;  // in whose place it would be
  };
  const std::vector<int>& accepted = choice_.accepted();
  std::vector<Candidate> candidates;
  for (int i : accepted) {
    candidates.push_back({i, i});
    if (const auto* rival = choice_.RivalOf(i)) candidates.push_back({rival->item, i});
  }
  std::vector<std::vector<Hypothesis>> slid(candidates.size());
  const Explained known = ExplainedBy(accepted, data_);
  ParallelFor(candidates.size(), data_.threads, [&](std::size_t i) {
    const Explained around = ExplainedWithout(candidates[i].accepted, known, accepted, data_);
    SeedContext context = data_.Context();
    context.others = &around.others;
    context.claims = &around.claims;
    Hypothesis h = data_.items[candidates[i].item].h;
    WeighInAllViews(h, context);
    slid[i] = Slides(h, context);
  });
  for (std::size_t i = 0; i < candidates.size(); ++i)
    for (auto& h : slid[i]) data_.items.Keep(std::move(h), data_.items[candidates[i].item].support_item);
}

// A part whose end no line shows sinks into the one that it is welded to, where it cannot stand, or ends
// short of it. Whatever may be a part is brought up to those that are accepted.
void SceneSolver::BringUpToWalls() {
  const std::vector<int>& accepted = choice_.accepted();
  const double reach_mm = kReachOfEndsPx * data_.mm_per_px;
  std::vector<int> items;
  for (int i = 0; i < data_.items.size(); ++i)
    if (data_.items[i].alone > 0 && brought_.insert(data_.items[i].serial).second) items.push_back(i);
  const Explained known = ExplainedBy(accepted, data_);
  std::vector<std::vector<Hypothesis>> brought(items.size());
  ParallelFor(items.size(), data_.threads, [&](std::size_t n) {
    const SceneItem& item = data_.items[items[n]];
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(reach_mm);
    const Eigen::AlignedBox3d room(item.volume.box.min() - reach, item.volume.box.max() + reach);
    std::vector<WorldSolid> walls;
    for (const int k : accepted)
      if (k != items[n] && k != item.support_item && room.intersects(data_.items[k].volume.box))
        walls.push_back(data_.items[k].Solid());
    if (walls.empty()) return;
    const bool stands = std::find(accepted.begin(), accepted.end(), items[n]) != accepted.end();
    const Explained around = stands ? ExplainedWithout(items[n], known, accepted, data_) : known;
    SeedContext context = data_.Context();
    context.others = &around.others;
    context.claims = &around.claims;
    brought[n] = OnWalls(item.h, walls, context);
    for (auto& h : brought[n]) WeighInAllViews(h, context);
  });
  for (std::size_t n = 0; n < items.size(); ++n)
    for (auto& h : brought[n])
      if (h.log_odds + MostOfRelations(*h.object.model) >= data_.options.accept_log_odds)
        data_.items.Keep(std::move(h), data_.items[items[n]].support_item);
}

// What was found over a plate before the plate was known may be wrong in kind, and claims the lines of what
// is right: each plate is searched once as if nothing stood there. False: it was, or nothing does.
bool SceneSolver::SearchAfresh(int support, const std::vector<int>& known) {
  const auto room = Footprint(data_.items[support].volume.box, kOverhangPx * data_.mm_per_px);
  std::vector<int> beside;
  for (int i : known)
    if (i == support || !room.contains(Footprint(data_.items[i].volume.box))) beside.push_back(i);
  if (beside.size() == known.size() || !searched_.insert(support).second) return false;
  AddHypotheses(support, ExplainedBy(beside, data_), data_);
  return true;
}

void SceneSolver::SeekRims() {
  std::vector<int> fresh;
  for (int i : choice_.accepted())
    if (sought_.insert(data_.items[i].serial).second) fresh.push_back(i);
  AddRims(fresh, choice_.accepted(), data_);
}

SceneResult SceneSolver::Collect() {
  SceneResult result;
  // Supports before what stands on them.
  std::vector<int> accepted = choice_.accepted();
  std::stable_sort(accepted.begin(), accepted.end(),
                   [&](int a, int b) { return data_.items.Level(a) < data_.items.Level(b); });
  const std::vector<SceneChoice::Verdict> verdicts = choice_.Verdicts(accepted);
  for (std::size_t k = 0; k < accepted.size(); ++k) {
    const SceneItem& item = data_.items[accepted[k]];
    IdentifiedPart part;
    part.object = item.h.object;
    if (item.support_item >= 0)
      part.stands_on = int(std::find(accepted.begin(), accepted.end(), item.support_item) - accepted.begin());
    part.views = ViewsThatSee(item.Solid(), data_.index, int(data_.views.size()));
    part.log_odds = verdicts[k].log_odds;
    if (const auto* rival = choice_.RivalOf(accepted[k]))
      part.runner_up = RunnerUp{data_.items[rival->item].kind, part.log_odds - rival->loss};
    part.doubtful = part.log_odds < data_.options.doubtful_log_odds || verdicts[k].incomplete ||
                    choice_.IsContested(accepted[k]);
    result.parts.push_back(std::move(part));
  }
  result.unknown = Unexplained();
  return result;
}

// Groups of edges of the world that no accepted part explains.
std::vector<UnknownGroup> SceneSolver::Unexplained() {
  const Explained known = ExplainedBy(choice_.accepted(), data_);
  std::vector<WorldLine> lines;
  for (const auto& l : data_.edges.lines)
    if (!Explains(known.claims, l, data_.index)) lines.push_back(l);
  std::vector<WorldCircle> circles;
  for (const auto& c : data_.edges.circles)
    if (!Explains(known.claims, c, data_.index)) circles.push_back(c);
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i : choice_.accepted()) boxes.push_back(data_.items[i].volume.box);
  return FindUnknown(lines, circles, boxes, data_.mm_per_px);
}

}  // namespace vss
