#include "propose.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "collect_picks.h"
#include "pick_residuals.h"
#include "vss/base/parallel.h"
#include "vss/identify/hypothesis_search.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMostRmsPx = 3;        // a reading that leaves more does not explain the lines
constexpr double kClearlyBetter = 10;   // log-odds that differ by less do not decide
constexpr double kSameBodyMm = 8;

// The pictures that show where the picks are: those with picks, then the nearest.
std::vector<int> PicturesOfPicks(const FitQuestion& q, const std::vector<View>& views) {
  const Vector2d foot = FootOfPicks(q, views);
  const Vector3d place(foot.x(), foot.y(), q.support_height_mm);
  std::vector<std::pair<double, int>> order;  // by distance
  for (std::size_t i = 0; i < views.size(); ++i) {
    const bool picked =
        std::any_of(q.picks.begin(), q.picks.end(), [&](const Pick& p) { return p.image == int(i); });
    if (picked || views[i].Shows(place))
      order.emplace_back(picked ? 0 : (views[i].center_in_world - place).norm(), int(i));
  }
  std::stable_sort(order.begin(), order.end());
  if (order.size() > SceneData::kSearchViews) order.resize(SceneData::kSearchViews);
  std::vector<int> out;
  for (const auto& o : order) out.push_back(o.second);
  std::sort(out.begin(), out.end());
  return out;
}

// Which of the picture's lines the pick is: segments first, then arcs' chords are not asked; -1: none.
int SegmentOf(const Pick& pick, const LineImage& lines) {
  const auto at = std::find_if(lines.segments.begin(), lines.segments.end(), [&](const LineSegment& s) {
    return s.ideal_start == pick.ideal_start && s.ideal_end == pick.ideal_end;
  });
  return pick.is_circle || at == lines.segments.end() ? -1 : int(at - lines.segments.begin());
}

double RmsOf(const PickResiduals& rows) {
  double sum = 0;
  for (double r : rows.pick_rms_px) sum += r * r;
  return std::sqrt(sum / double(std::max<std::size_t>(1, rows.pick_rms_px.size())));
}

// Lines of one picture beside each other cannot be one contour; one behind the other they can.
bool BesideEachOther(const Pick& a, const Pick& b) {
  constexpr double kOverlapPx = 3;
  if (a.image != b.image || a.is_circle || b.is_circle) return false;
  const Vector2d along = (a.ideal_end - a.ideal_start).normalized();
  const double length = along.dot(a.ideal_end - a.ideal_start), s = along.dot(b.ideal_start - a.ideal_start),
               e = along.dot(b.ideal_end - a.ideal_start);
  return std::min(length, std::max(s, e)) - std::max(0.0, std::min(s, e)) > kOverlapPx;
}

constexpr int kNone = -1;

// Each pick on the nearest contour of the object that is not another pick's, the nearest picks first; kNone
// where there is none. Returns how many have one.
int Assign(const PlacedObject& object, const std::vector<View>& views, std::vector<Pick>& picks) {
  const WorldSolid solid = PlaceSolid(object, false);
  std::map<int, VisibleContours> contours;
  std::vector<std::tuple<double, std::size_t, int>> order;  // distance, pick, contour
  for (std::size_t i = 0; i < picks.size(); ++i) {
    const int image = picks[i].image;
    if (!contours.contains(image))
      contours[image] = VisibleContoursOf(solid, views[std::size_t(image)], nullptr);
    for (const auto& c : ContoursNear(picks[i], contours[image], kMostRmsPx))
      order.emplace_back(c.mean_px, i, c.contour);
    picks[i].contour = kNone;
  }
  std::sort(order.begin(), order.end());
  int assigned = 0;
  for (const auto& [distance, i, contour] : order) {
    if (picks[i].contour != kNone) continue;
    const bool taken = std::any_of(picks.begin(), picks.end(), [&, at = i, c = contour](const Pick& p) {
      return p.contour == c && BesideEachOther(p, picks[at]);
    });
    if (taken) continue;
    picks[i].contour = contour;
    ++assigned;
  }
  return assigned;
}

// The hypothesis with all picks on its visible contours, fitted to them; empty where they do not fit. One
// whose ends are not right yet may miss a few at first.
std::optional<Reading> ReadAs(const Hypothesis& h, const FitQuestion& question,
                              const std::vector<View>& views) {
  constexpr double kMost = 0.6;
  FitQuestion q = question;
  Reading r{{}, h.object, 0, h.log_odds};
  const int wanted = int(q.picks.size()), assigned = Assign(r.object, views, q.picks);
  if (assigned < kMost * wanted) return std::nullopt;
  if (assigned < wanted) {
    std::erase_if(q.picks, [](const Pick& p) { return p.contour == kNone; });
    RefinePicks(q, views, r.object);
    q.picks = question.picks;
    if (Assign(r.object, views, q.picks) < wanted) return std::nullopt;
  }
  for (const auto& pick : q.picks) r.contours.push_back(pick.contour);
  RefinePicks(q, views, r.object);
  r.rms_px = RmsOf(ResidualsOf(q, r.object, views));
  if (!(r.rms_px < kMostRmsPx)) return std::nullopt;
  return r;
}

// What the pictures show around the picks, and the readings that it allows.
std::vector<Reading> ReadingsIn(const std::vector<int>& images, const FitQuestion& q,
                                const std::vector<View>& views, const std::vector<LineImage>& lines,
                                int threads) {
  std::vector<View> shown;
  std::vector<LineRef> own;
  for (std::size_t k = 0; k < images.size(); ++k) {
    shown.push_back(views[std::size_t(images[k])]);
    shown.back().lines = &lines[k];
    for (const auto& pick : q.picks)
      if (pick.image == images[k])
        if (const int segment = SegmentOf(pick, lines[k]); segment >= 0) own.push_back({int(k), segment});
  }
  KnowledgeBase one;
  one.objects.emplace_back(std::shared_ptr<const void>(), q.model);
  const IdentifyOptions options;
  const Progress progress;
  SceneData scene(shown, one, options, threads, progress);
  std::erase_if(scene.templates, [&](const KindTemplate& t) { return t.resting_pose != q.resting_pose; });
  if (!scene.IsSinglePicture()) scene.edges = FindSceneEdges(scene.index, options, threads, progress);
  const std::vector<Hypothesis> found = HypothesesOn(own, q.support_height_mm, scene);
  std::vector<std::optional<Reading>> read(found.size());
  ParallelFor(found.size(), threads, [&](std::size_t i) { read[i] = ReadAs(found[i], q, views); });
  std::vector<Reading> out;
  for (auto& r : read)
    if (r) out.push_back(std::move(*r));
  std::stable_sort(out.begin(), out.end(),
                   [](const Reading& a, const Reading& b) { return a.log_odds > b.log_odds; });
  return out;
}

// The best, and the best that is another body.
Proposal BestOf(std::vector<Reading> sorted) {
  Proposal out;
  for (auto& r : sorted) {
    if (out.readings.empty() || !SamePlace(out.readings[0].object, r.object, kSameBodyMm))
      out.readings.push_back(std::move(r));
    if (out.readings.size() == 2) break;
  }
  out.decided =
      out.readings.size() == 1 || out.readings[0].log_odds - out.readings[1].log_odds >= kClearlyBetter;
  return out;
}

}  // namespace

Result<Proposal> ProposeContours(
    const FitQuestion& q, const std::vector<View>& views,
    const std::function<std::vector<LineImage>(const std::vector<int>&)>& lines_of, int threads) {
  if (q.picks.empty()) return UsageError("no line is picked yet; click a line that belongs to the object");
  if (q.picks.size() > kMaxProposed)
    return UsageError(
        "{} picked lines are more than the {} that a proposal takes; drop some, or choose the contours in "
        "the drawing",
        q.picks.size(), kMaxProposed);
  const std::vector<int> images = PicturesOfPicks(q, views);
  const std::vector<LineImage> lines = lines_of(images);
  std::vector<Reading> readings;
  if (images.size() > 1) readings = ReadingsIn(images, q, views, lines, threads);
  for (std::size_t k = 0; k < images.size() && readings.empty(); ++k)
    if (std::any_of(q.picks.begin(), q.picks.end(), [&](const Pick& p) { return p.image == images[k]; }))
      readings = ReadingsIn({images[k]}, q, views, {lines[k]}, threads);
  if (readings.empty())
    return UsageError(
        "no way to see a {} explains these {} lines; is it that kind, lying so, and are all lines its own?",
        q.model->kind(), q.picks.size());
  return BestOf(std::move(readings));
}

}  // namespace vss::station
