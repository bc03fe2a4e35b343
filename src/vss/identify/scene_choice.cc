#include "vss/identify/scene_choice.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector3d;

// Surely more than another (log-odds).
constexpr double kClearly = 1e-6;
// A reading that explains less by no more than this is looked at with other company, too: what a part brings.
constexpr double kSecondLook = 100;
// What an edge costs that runs where the part would be solid: as much as tells two readings apart. None ran
// in ninety parts of drawn scenes that were found rightly, one to five in boxes laid around channels.
constexpr double kOpaque = 10;
// Two parts that lie against each other, parallel and both ends flush: four coincidences at once, taken as
// one in 150 each, where one part of that section needs none.
constexpr double kFlush = 20;
// Parts touch that are no farther apart than places are unsure by before reconstruction; what relations ask
// about is not farther than this.
constexpr double kSlackPx = 1.5, kReachPx = 40;
// Of a part that is there some contours are missed, and more where more of it shows. Of 308 drawn and
// rendered parts found rightly two missed a tenth of what was shown (log-odds) and kIncomplete; none
// kRefuted, or half of its length. Of 81 that were taken for a kind that they are not of: 40, and 33.
constexpr double kRefuted = 30, kIncomplete = 15, kMissedOfShown = 0.1, kMissedLength = 0.5;
// Rivals share so much room at least.
constexpr double kTouchMm = 6, kSamePart = 0.3;

}  // namespace

double MostOfRelations(const ObjectModel& model) {
  double most = 0;
  for (const auto& r : model.relations())
    if (r.force != ObjectRelation::Force::kAvoids) most += r.weight;
  return most;
}

// Holds the items that are new against the pictures.
void SceneChoice::Enter() {
  std::vector<PlacedObject> objects;
  for (auto& item : data_.items)
    if (item.candidate < 0) {
      item.candidate = ledger_.size() + int(objects.size());
      objects.push_back(item.h.object);
    }
  ledger_.Add(objects, data_.threads);
  for (auto& item : data_.items)
    if (std::isnan(item.alone)) Value(item);
}

// What speaks for the item alone, or beside the parts that were known when it was found: they may hide what
// is not seen of it.
void SceneChoice::Value(SceneItem& item) {
  const Ledger::Share share = ledger_.Alone(item.candidate);
  item.by_world = (HasRoundEdge(item) ? kOpaque : 0) - kOpaque * EdgesInside(item);
  const double others = MostOfRelations(*item.h.object.model) + item.by_world;
  item.alone = Stands(share, others) ? share.log_odds + item.by_world : 0;
  if (item.h.log_odds + others >= data_.options.accept_log_odds)
    item.alone = std::max(item.alone, item.h.log_odds + item.by_world);
}

// How many edges of the world run inside the item: it is opaque, and were it there, nobody could see them.
// What lines of several pictures meet in by chance lies anywhere, and seldom long and deep inside.
int SceneChoice::EdgesInside(const SceneItem& item) const {
  constexpr double kDeepPx = 4;
  constexpr int kSteps = 7, kMost = 5;
  const double deep = kDeepPx * data_.mm_per_px;
  int count = 0;
  for (const auto& l : data_.index.world_lines) {
    if (!item.volume.box.intersects(Eigen::AlignedBox3d(l.start.cwiseMin(l.end), l.start.cwiseMax(l.end))))
      continue;
    if (l.num_stops < 2 || l.Length() < kSureLinePx * data_.mm_per_px) continue;
    int inside = 0;
    for (int k = 0; k < kSteps; ++k) {
      const Vector3d p = l.start + (l.end - l.start) * ((k + 0.5) / kSteps);
      if (!item.volume.Contains(p)) continue;
      bool is_deep = true;
      for (const Vector3d& axis : {Vector3d(deep, deep, 0), Vector3d(deep, -deep, 0), Vector3d(0, 0, deep)})
        is_deep = is_deep && item.volume.Contains(p + axis) && item.volume.Contains(p - axis);
      inside += is_deep;
    }
    count += inside >= kMost;
  }
  return count;
}

// Is a rim of the item where arcs of many pictures meet in one circle of the world? A plate without the hole
// would leave that circle unexplained. Of one round edge lines are found on both sides of its shadow.
bool SceneChoice::HasRoundEdge(const SceneItem& item) const {
  constexpr double kNearPx = 3;
  // In two drawn scenes all that as many pictures agreed on were rims; two or three agree by chance, too.
  constexpr int kManyViews = 5;
  const double near = kNearPx * data_.mm_per_px;
  return std::any_of(item.circles.begin(), item.circles.end(), [&](const WorldSolid::Circle& rim) {
    return std::any_of(data_.edges.circles.begin(), data_.edges.circles.end(), [&](const WorldCircle& c) {
      return c.num_views >= kManyViews && (c.center - rim.center.point).norm() < near &&
             std::abs(c.radius_mm - rim.radius_mm) < near;
    });
  });
}

bool SceneChoice::Stands(const Ledger::Share& share, double relations) const {
  return share.log_odds + relations >= data_.options.accept_log_odds &&
         share.elevated_log_odds + relations >= data_.options.accept_log_odds;
}

// What the relations of item `i` say of it among `items`.
double SceneChoice::Relations(int i, const std::vector<int>& items) const {
  const SceneItem& item = data_.items[i];
  const auto relations = item.h.object.model->relations();
  if (relations.empty() || !data_.options.contact) return 0;
  std::vector<RelatedSolid> others;
  const Vector3d reach = Vector3d::Constant(kReachPx * data_.mm_per_px);
  const Eigen::AlignedBox3d room(item.volume.box.min() - reach, item.volume.box.max() + reach);
  for (int k : items)
    if (k != i && room.intersects(data_.items[k].volume.box))
      others.push_back(RelatedOf(data_.items[k].h.object));
  return RelationLogOdds(relations, RelatedOf(item.h.object), others, kSlackPx * data_.mm_per_px);
}

// The items in groups that have nothing to do with each other, each in the order of `items`.
std::vector<std::vector<int>> SceneChoice::Independent(const std::vector<int>& items) {
  place_.resize(std::size_t(ledger_.size()), -1);
  for (std::size_t n = 0; n < items.size(); ++n)
    place_[std::size_t(data_.items[items[n]].candidate)] = int(n);
  std::vector<int> group(items.size(), -1), open;
  int num_groups = 0;
  for (std::size_t first = 0; first < items.size(); ++first) {
    if (group[first] >= 0) continue;
    group[first] = num_groups;
    open.assign(1, int(first));
    while (!open.empty()) {
      const int candidate = data_.items[items[std::size_t(open.back())]].candidate;
      open.pop_back();
      for (const int k : ledger_.Linked(candidate, kReachPx * data_.mm_per_px)) {
        const int n = place_[std::size_t(k)];
        if (n < 0 || group[std::size_t(n)] >= 0) continue;
        group[std::size_t(n)] = num_groups;
        open.push_back(n);
      }
    }
    ++num_groups;
  }
  std::vector<std::vector<int>> groups(static_cast<std::size_t>(num_groups));
  for (std::size_t n = 0; n < items.size(); ++n) {
    groups[std::size_t(group[n])].push_back(items[n]);
    place_[std::size_t(data_.items[items[n]].candidate)] = -1;
  }
  return groups;
}

// What the items explain: of each independent group once, whatever stands elsewhere.
double SceneChoice::Total(const std::vector<int>& items) {
  double total = 0;
  for (const auto& group : Independent(items)) {
    std::vector<int> candidates;
    for (const int i : group) candidates.push_back(data_.items[i].candidate);
    const auto [it, is_new] = totals_.try_emplace(std::move(candidates));
    if (is_new) it->second = TotalOfGroup(group);
    total += it->second;
  }
  return total;
}

// A part must bring more than its acceptance asks for; one that does not stand among the others costs that.
double SceneChoice::TotalOfGroup(const std::vector<int>& items) {
  std::vector<int> candidates;
  for (int i : items) candidates.push_back(data_.items[i].candidate);
  double total = 0;
  const auto shares = ledger_.Weigh(candidates);
  for (std::size_t n = 0; n < items.size(); ++n) {
    const double others = Relations(items[n], items) + data_.items[items[n]].by_world;
    total += (Stands(shares[n], others) ? shares[n].log_odds + others : 0) - data_.options.accept_log_odds;
    for (std::size_t m = 0; m < n; ++m)
      if (data_.items.Flush(items[m], items[n])) total -= kFlush;
  }
  return total;
}

bool SceneChoice::ConflictsWithAny(const std::vector<int>& chain, const std::vector<int>& items) {
  return std::any_of(chain.begin(), chain.end(), [&](int k) {
    return std::any_of(items.begin(), items.end(), [&](int a) { return data_.items.Conflicts(k, a); });
  });
}

// The item and what it stands on, supports first, that `items` lacks.
std::vector<int> SceneChoice::MissingChain(int i, const std::vector<int>& items) const {
  std::vector<int> chain;
  for (int k = i; k >= 0 && std::find(items.begin(), items.end(), k) == items.end();
       k = data_.items[k].support_item)
    chain.push_back(k);
  std::reverse(chain.begin(), chain.end());
  return chain;
}

// Adds those of `order` that explain more, one after the other.
void SceneChoice::AddBest(const std::vector<int>& order, Choice& choice) {
  for (int i : order) {
    if (data_.progress.Cancelled()) return;
    const std::vector<int> chain = MissingChain(i, choice.items);
    if (chain.empty() || ConflictsWithAny(chain, choice.items)) continue;
    std::vector<int> more = choice.items;
    more.insert(more.end(), chain.begin(), chain.end());
    const double total = data_.options.scene_level ? Total(more) : choice.total + data_.items[i].alone;
    if (total <= choice.total) continue;
    choice = {std::move(more), total};
  }
}

// Adds those of `items` that explain more, each time the one with which the whole explains most.
void SceneChoice::AddBestByTotal(std::vector<int> items, Choice& choice) {
  while (!items.empty() && !data_.progress.Cancelled()) {
    Choice best = choice;
    int added = -1;
    for (int i : items) {
      const std::vector<int> chain = MissingChain(i, choice.items);
      if (chain.empty() || ConflictsWithAny(chain, choice.items)) continue;
      std::vector<int> more = choice.items;
      more.insert(more.end(), chain.begin(), chain.end());
      const double total = Total(more);
      if (total <= best.total) continue;
      best = {std::move(more), total};
      added = i;
    }
    if (added < 0) return;
    choice = std::move(best);
    std::erase(items, added);
  }
}

// The choice with item `i` and what it stands on in the place of what is in its way, which goes to `removed`;
// what stood there stands on `i` now where it can.
SceneChoice::Choice SceneChoice::Replaced(int i, const Choice& choice, std::vector<int>& removed) {
  const std::vector<int> chain = MissingChain(i, choice.items);
  Choice with;
  removed.clear();
  std::vector<int> fallen;
  for (int a : choice.items) {
    const int on = data_.items[a].support_item;
    if (ConflictsWithAny(chain, {a})) {
      removed.push_back(a);
    } else if (std::find(removed.begin(), removed.end(), on) != removed.end()) {
      fallen.push_back(a);
      removed.push_back(a);
    } else {
      with.items.push_back(a);
    }
  }
  with.items.insert(with.items.end(), chain.begin(), chain.end());
  for (int a : fallen) {
    const int twin = data_.items.TwinOn(a, i);
    if (twin >= 0 && !StandsOnRefuted(twin) && !ConflictsWithAny({twin}, with.items))
      with.items.push_back(twin);
  }
  with.total = Total(with.items);
  return with;
}

// As Replaced(), then with what else has room there.
SceneChoice::Choice SceneChoice::With(int i, const Choice& choice, const std::vector<int>& order,
                                      std::vector<int>& removed) {
  constexpr std::size_t kMostRefills = 6;
  Choice with = Replaced(i, choice, removed);
  std::vector<int> refills;
  double hope = with.total;
  for (int k : order) {
    if (refills.size() == kMostRefills) break;
    if (std::find(with.items.begin(), with.items.end(), k) != with.items.end()) continue;
    const bool near = std::any_of(removed.begin(), removed.end(), [&](int r) {
      return data_.items[r].volume.box.intersects(data_.items[k].volume.box);
    });
    if (!near) continue;
    const std::vector<int> more = MissingChain(k, with.items);
    if (more.size() > 1 || ConflictsWithAny(more, with.items)) continue;
    refills.push_back(k);
    hope += data_.items[k].alone;
  }
  if (hope <= choice.total - kBarely) return with;
  const Choice bare = with;
  AddBest(refills, with);
  // What fits in first may keep better company out.
  if (with.total <= choice.total && with.total > choice.total - kSecondLook) {
    Choice other = bare;
    AddBestByTotal(std::move(refills), other);
    if (other.total > with.total) with = std::move(other);
  }
  return with;
}

// One pass over the items that were left out; whether one of them explains more in the place of what is in
// its way.
bool SceneChoice::Improve(const std::vector<int>& order, Choice& best) {
  bool better = false;
  rivals_.clear();
  other_sizes_.clear();
  for (int i : order) {
    if (std::find(best.items.begin(), best.items.end(), i) != best.items.end()) continue;
    std::vector<int> removed;
    Choice with = With(i, best, order, removed);
    if (with.total > best.total + kClearly) {
      best = std::move(with);
      better = true;
      continue;
    }
    for (int r : removed) NoteRival(r, i, best.total - with.total);
  }
  return better;
}

void SceneChoice::Select() {
  constexpr int kMaxPasses = 4;
  Enter();
  std::vector<int> order;
  for (int i = 0; i < data_.items.size(); ++i)
    if (data_.items[i].alone > 0 && !StandsOnRefuted(i)) order.push_back(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return data_.items[a].alone > data_.items[b].alone; });
  Choice best;
  AddBest(order, best);
  bool better = data_.options.scene_level;
  for (int pass = 0; better && pass < kMaxPasses && !data_.progress.Cancelled(); ++pass)
    better = Improve(order, best);
  accepted_ = std::move(best.items);
  std::sort(accepted_.begin(), accepted_.end());
}

const SceneChoice::Rival* SceneChoice::RivalOf(int accepted) const {
  const auto it = rivals_.find(accepted);
  return it == rivals_.end() ? nullptr : &it->second;
}

bool SceneChoice::IsContested(int accepted) const {
  const Rival* rival = RivalOf(accepted);
  const auto other_size = other_sizes_.find(accepted);
  return (rival && rival->loss < kBarely) ||
         (other_size != other_sizes_.end() && other_size->second < kBarely);
}

std::vector<SceneChoice::Verdict> SceneChoice::Verdicts(const std::vector<int>& items) {
  std::vector<int> candidates;
  for (int i : items) candidates.push_back(data_.items[i].candidate);
  const std::vector<Ledger::Share> shares = ledger_.Weigh(candidates);
  std::vector<Verdict> out;
  for (std::size_t n = 0; n < items.size(); ++n) {
    const Ledger::Share& share = shares[n];
    const bool incomplete = share.missed >= std::max(kIncomplete, kMissedOfShown * share.shown);
    const bool mostly = share.missed >= kRefuted || share.missed_share >= kMissedLength;
    const bool endless =
        share.missing_ends == 2 || (share.missing_ends == 1 && data_.items[items[n]].endless);
    out.push_back({share.log_odds + Relations(items[n], items) + data_.items[items[n]].by_world, incomplete,
                   (incomplete && mostly) || endless, endless});
  }
  return out;
}

// Is the item, or what it stands on, refuted?
bool SceneChoice::StandsOnRefuted(int i) const {
  for (int k = i; k >= 0; k = data_.items[k].support_item)
    if (data_.items[k].refuted) return true;
  return false;
}

// A length of a cable may be cut off anywhere: of other readings of the same one end may seem to be there.
void SceneChoice::MarkEndless(int item) {
  for (auto& other : data_.items)
    other.endless =
        other.endless || (other.volume.box.intersects(data_.items[item].volume.box) &&
                          SharesMoreThan(other.volume, data_.items[item].volume, kTouchMm, kSamePart));
}

void SceneChoice::DropRefuted() {
  constexpr int kMostTimes = 8;  // it ends by itself, for what is dropped stays out; this bounds the time
  for (int times = 0; times < kMostTimes && !data_.progress.Cancelled(); ++times) {
    const std::vector<Verdict> verdicts = Verdicts(accepted_);
    bool dropped = false;
    for (std::size_t n = 0; n < accepted_.size(); ++n) {
      if (!verdicts[n].refuted) continue;
      data_.items[accepted_[n]].refuted = true;
      if (verdicts[n].endless) MarkEndless(accepted_[n]);
      dropped = true;
    }
    if (!dropped) return;
    Select();
  }
}

// What would be lost if item `rival` took the place of `accepted`.
void SceneChoice::NoteRival(int accepted, int rival, double loss) {
  constexpr double kOtherSizePx = 3;
  const SceneItem &mine = data_.items[accepted], &other = data_.items[rival];
  if (!SharesMoreThan(mine.volume, other.volume, kTouchMm, kSamePart)) return;
  if (mine.kind == other.kind) {
    // Of one kind, but of another size.
    const double apart = (mine.volume.box.sizes() - other.volume.box.sizes()).cwiseAbs().maxCoeff();
    if (apart < kOtherSizePx * data_.mm_per_px) return;
    const auto it = other_sizes_.try_emplace(accepted, loss).first;
    it->second = std::min(it->second, loss);
    return;
  }
  const auto it = rivals_.find(accepted);
  if (it == rivals_.end() || loss < it->second.loss) rivals_[accepted] = {rival, loss};
}

}  // namespace vss
