#include "vss/identify/plates.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "vss/base/parallel.h"
#include "vss/identify/complete.h"
#include "vss/identify/hypothesis_search.h"
#include "vss/identify/refine.h"
#include "vss/identify/seed.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// Halves are level with each other to within this, and reach so near to the wall between them.
constexpr double kLevelPx = 2, kGapPx = 4;

// May `above` stand on the plate `below`, which is another than what it stands on?
bool MayMoveOn(int above, int below, const SceneData& data) {
  const SceneItem &part = data.items[above], &plate = data.items[below];
  if (above == below || below == part.support_item || !part.h.object.model->MayStandOn(plate.kind) ||
      part.top_mm < plate.top_mm + 2 * data.mm_per_px)
    return false;
  // From the ground, or from another reading of the same plate.
  if (part.support_item != SceneItems::kGround &&
      !SameFrame(data.items[part.support_item].volume.box, plate.volume.box))
    return false;
  return Footprint(plate.volume.box, kOverhangPx * data.mm_per_px).contains(Footprint(part.volume.box));
}

// What parts may stand on, the likeliest first.
std::vector<int> PlatesBestFirst(const SceneData& data) {
  std::vector<int> plates;
  for (int i = 0; i < data.items.size(); ++i)
    if (data.items[i].h.log_odds >= data.options.doubtful_log_odds && data.items.BestOfItsPlace(i))
      plates.push_back(i);
  std::stable_sort(plates.begin(), plates.end(),
                   [&](int a, int b) { return data.items[a].h.log_odds > data.items[b].h.log_odds; });
  return plates;
}

// Those that the item may move on; of each level the best few: a large plate is read in dozens of sizes.
std::vector<int> LikeliestUnder(int item, std::span<const int> best_first, const SceneData& data) {
  constexpr int kMostOfALevel = 4;  // readings of one plate that come first are those of its true height
  std::vector<int> out;
  for (int plate : best_first) {
    if (!MayMoveOn(item, plate, data)) continue;
    const auto level = std::count_if(out.begin(), out.end(), [&](int other) {
      return std::abs(data.items[other].top_mm - data.items[plate].top_mm) < kLevelPx * data.mm_per_px;
    });
    if (level < kMostOfALevel) out.push_back(plate);
  }
  return out;
}

}  // namespace

void ReseatOnPlates(SceneData& data) {
  std::vector<std::pair<int, int>> pairs;  // what, on what
  const std::vector<int> plates = PlatesBestFirst(data);
  for (int i = 0; i < data.items.size(); ++i)
    for (int plate : LikeliestUnder(i, plates, data))
      if (data.items.TryOn(i, plate)) pairs.push_back({i, plate});
  std::vector<std::optional<Hypothesis>> seated(pairs.size());
  const SeedContext context = data.Context();
  ParallelFor(pairs.size(), data.threads, [&](std::size_t k) {
    seated[k] = Reseat(data.items[pairs[k].first].h, context, data.items[pairs[k].second].top_mm);
    if (seated[k]) WeighInAllViews(*seated[k], context);
  });
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (seated[k] && seated[k]->log_odds >= data.options.accept_log_odds)
      data.items.Keep(std::move(*seated[k]), pairs[k].second);
}

void PlateJoiner::JoinAll() {
  // Halves() asks for no more of the gap between two than three times the width of the wall and a slack.
  std::vector<int> walls;
  double widest = 0;
  for (int i = 0; i < data_.items.size(); ++i) {
    if (data_.items[i].h.log_odds < data_.options.doubtful_log_odds) continue;
    walls.push_back(i);
    widest = std::max(widest, data_.items[i].volume.box.sizes().head<2>().norm());
  }
  const int n = data_.items.size();
  for (int a = 0; a < n; ++a)
    for (int b = a + 1; b < n; ++b) {
      if (!MayBeHalves(a, b, 3 * widest)) continue;
      for (const int between : walls)
        if (Halves(a, b, between)) Join(a, b, between);
    }
}

// What Halves() asks of the two alone, and whether they are near enough to each other.
bool PlateJoiner::MayBeHalves(int a, int b, double farthest_mm) const {
  const SceneItem &one = data_.items[a], &other = data_.items[b];
  if (one.kind != other.kind || one.support_item != other.support_item ||
      one.h.object.resting_pose != other.h.object.resting_pose ||
      std::abs(one.top_mm - other.top_mm) > kLevelPx * data_.mm_per_px)
    return false;
  const auto &box = one.volume.box, &room = other.volume.box;
  return box.exteriorDistance(room) <= farthest_mm + 2 * kGapPx * data_.mm_per_px;
}

// Do a and b lie side by side at one height, with `between` standing where they meet?
bool PlateJoiner::Halves(int a, int b, int between) const {
  constexpr double kAligned = 0.9;  // of the longer one's extent along the joint
  const SceneItem &one = data_.items[a], &other = data_.items[b], &wall = data_.items[between];
  if (between == a || between == b || one.kind != other.kind || one.support_item != other.support_item ||
      one.h.object.resting_pose != other.h.object.resting_pose || wall.support_item != one.support_item ||
      !wall.h.object.model->MayStandOn(one.kind) || wall.h.log_odds < data_.options.doubtful_log_odds ||
      std::abs(one.top_mm - other.top_mm) > kLevelPx * data_.mm_per_px ||
      wall.top_mm < one.top_mm + 4 * data_.mm_per_px)
    return false;
  // In the wall's frame: along it and across.
  const double yaw = wall.h.object.placement[3];
  const Vector3d u(std::cos(yaw), std::sin(yaw), 0), w(-std::sin(yaw), std::cos(yaw), 0);
  const auto ua = Extent(one, u), ub = Extent(other, u), wa = Extent(one, w), wb = Extent(other, w),
             ww = Extent(wall, w);
  const double common = std::min(ua.second, ub.second) - std::max(ua.first, ub.first);
  if (common < kAligned * std::max(ua.second - ua.first, ub.second - ub.first)) return false;
  const double slack = kGapPx * data_.mm_per_px + (ww.second - ww.first);
  auto meets = [&](const std::pair<double, double>& low, const std::pair<double, double>& high) {
    return low.second > ww.first - slack && low.second < ww.second + slack && high.first > ww.first - slack &&
           high.first < ww.second + slack && low.first < ww.first - slack && high.second > ww.second + slack;
  };
  return meets(wa, wb) || meets(wb, wa);
}

// The same halves come in many readings, with many a wall between them.
bool PlateJoiner::IsNew(int a, int b) {
  const double slack = 3 * data_.mm_per_px;
  const Eigen::AlignedBox3d room = data_.items[a].volume.box.merged(data_.items[b].volume.box);
  std::vector<long> place{long(data_.items[a].support_item), long(data_.items[a].h.object.resting_pose)};
  for (int axis = 0; axis < 3; ++axis)
    for (double side : {room.min()[axis], room.max()[axis]}) place.push_back(std::lround(side / slack));
  return joined_.insert({data_.items[a].kind, std::move(place)}).second;
}

// The whole of two halves, from the lines around both.
void PlateJoiner::Join(int a, int b, int between) {
  if (!IsNew(a, b)) return;
  const double slack = 3 * data_.mm_per_px;
  Eigen::AlignedBox3d room = data_.items[a].volume.box.merged(data_.items[b].volume.box);
  room = {room.min().array() - slack, room.max().array() + slack};
  std::vector<WorldLine> lines;
  for (const auto& l : data_.edges.lines)
    if (room.contains(l.start) && room.contains(l.end)) lines.push_back(l);
  Occluders wall;
  wall.Add(data_.items[between].Solid(), between);
  SeedContext context = data_.Context();
  context.lines = lines;
  context.circles = {};
  context.others = &wall;
  const int support = data_.items[a].support_item;
  const PlacedObject half = data_.items[a].h.object;
  const Vector3d first = data_.items[a].volume.box.center(), second = data_.items[b].volume.box.center();
  const auto pairs = ParallelPairs(context, FarthestPairMm(data_.templates));
  for (const auto& t : data_.templates) {
    if (t.model != half.model || t.resting_pose != half.resting_pose) continue;
    for (const auto& seed : Promising(Seeds(t, context, pairs, half.placement[2]), context, data_.threads))
      for (const auto& completion : Complete(t, context, seed)) {
        Hypothesis h = Finish(context, completion);
        if (h.log_odds < data_.options.accept_log_odds) continue;
        WeighInAllViews(h, context);
        const auto box = MakeVolume(PlaceSolid(h.object, false)).box;
        if (h.log_odds >= data_.options.accept_log_odds && box.contains(first) && box.contains(second))
          data_.items.Keep(std::move(h), support);
      }
  }
}

}  // namespace vss
