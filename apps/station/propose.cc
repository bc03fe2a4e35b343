#include "propose.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "collect_picks.h"
#include "pick_residuals.h"
#include "vss/base/parallel.h"
#include "vss/identify/hypothesis_search.h"
#include "vss/identify/scene_choice.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMostRmsPx = 3;  // a reading that leaves more does not explain the lines
constexpr double kSameBodyMm = 8;
// Contours so near to a pick are both where it lies; a reading that leaves so much more than another explains
// the picks as well.
constexpr double kOnItPx = 1.5, kAsWellPx = 0.5;
constexpr std::size_t kMostVaried = 3;  // readings that are looked at with such picks as the other contour

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
  if (order.size() > std::size_t(kSearchViews)) order.resize(std::size_t(kSearchViews));
  std::vector<int> out;
  for (const auto& o : order) out.push_back(o.second);
  std::sort(out.begin(), out.end());
  return out;
}

// Which of the picture's straight lines the pick is; -1: it is a curve, or none of them.
int SegmentOf(const Pick& pick, const LineImage& lines) {
  const auto at = std::find_if(lines.segments.begin(), lines.segments.end(), [&](const LineSegment& s) {
    return s.ideal_start == pick.ideal_start && s.ideal_end == pick.ideal_end;
  });
  return pick.is_circle || at == lines.segments.end() ? -1 : int(at - lines.segments.begin());
}

bool SameBody(const Reading& a, const Reading& b) { return SamePlace(a.object, b.object, kSameBodyMm); }

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

// The question with the picks that are the object's, as those contours.
FitQuestion With(const std::vector<int>& contours, const FitQuestion& question) {
  FitQuestion q = question;
  for (std::size_t i = 0; i < contours.size(); ++i) q.picks[i].contour = contours[i];
  std::erase_if(q.picks, [](const Pick& p) { return p.contour == kNoContour; });
  return q;
}

std::vector<int> ContoursOf(const std::vector<Pick>& picks) {
  std::vector<int> out;
  for (const auto& p : picks) out.push_back(p.contour);
  return out;
}

// Each pick on the nearest contour of the object that is not another pick's, the nearest picks first;
// kNoContour where there is none. Returns how many have one.
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
    picks[i].contour = kNoContour;
  }
  std::sort(order.begin(), order.end());
  int assigned = 0;
  for (const auto& [distance, i, contour] : order) {
    if (picks[i].contour != kNoContour) continue;
    const bool taken = std::any_of(picks.begin(), picks.end(), [&, at = i, c = contour](const Pick& p) {
      return p.contour == c && BesideEachOther(p, picks[at]);
    });
    if (taken) continue;
    picks[i].contour = contour;
    ++assigned;
  }
  return assigned;
}

// The hypothesis with all picks on its visible contours (most, where `some` do), fitted to them; empty where
// they do not fit. One whose ends are not right yet may miss a few at first.
std::optional<Reading> ReadAs(const Hypothesis& h, const FitQuestion& question,
                              const std::vector<View>& views, bool some) {
  constexpr double kMost = 0.6;
  std::vector<Pick> picks = question.picks;
  Reading r{{}, h.object, 0, h.log_odds};
  const int wanted = int(picks.size()), assigned = Assign(r.object, views, picks);
  if (assigned < kMost * wanted) return std::nullopt;
  if (assigned < wanted) {
    RefinePicks(With(ContoursOf(picks), question), views, r.object);
    if (Assign(r.object, views, picks) < (some ? kMost : 1) * wanted) return std::nullopt;
  }
  r.contours = ContoursOf(picks);
  const FitQuestion q = With(r.contours, question);
  RefinePicks(q, views, r.object);
  r.rms_px = RmsOf(ResidualsOf(q, r.object, views));
  if (!(r.rms_px < kMostRmsPx)) return std::nullopt;
  return r;
}

// The reading with one pick as another contour that lies where the pick does too, fitted anew, for each of
// those that explain the picks as well.
std::vector<Reading> Variations(const Reading& r, const FitQuestion& question,
                                const std::vector<View>& views) {
  std::vector<Reading> out;
  const WorldSolid solid = PlaceSolid(r.object, false);
  for (std::size_t i = 0; i < r.contours.size(); ++i) {
    if (r.contours[i] == kNoContour) continue;
    const Pick& pick = question.picks[i];
    const auto contours = VisibleContoursOf(solid, views[std::size_t(pick.image)], nullptr);
    for (const auto& near : ContoursNear(pick, contours, kOnItPx)) {
      if (near.contour == r.contours[i]) continue;
      Reading other = r;
      other.contours[i] = near.contour;
      const FitQuestion q = With(other.contours, question);
      RefinePicks(q, views, other.object);
      other.rms_px = RmsOf(ResidualsOf(q, other.object, views));
      if (other.rms_px < r.rms_px + kAsWellPx && InRange(other.object, kSameBodyMm) && !SameBody(other, r))
        out.push_back(std::move(other));
    }
  }
  return out;
}

std::vector<Reading> Sorted(std::vector<Reading> readings) {
  std::stable_sort(readings.begin(), readings.end(),
                   [](const Reading& a, const Reading& b) { return a.log_odds > b.log_odds; });
  return readings;
}

// Each is another body.
std::vector<Reading> Distinct(const std::vector<Reading>& sorted, std::size_t most) {
  std::vector<Reading> out;
  for (const auto& r : sorted) {
    if (out.size() == most) break;
    if (std::none_of(out.begin(), out.end(), [&](const Reading& o) { return SameBody(o, r); }))
      out.push_back(r);
  }
  return out;
}

// What the pictures show around the picks, and the readings that it allows, best first.
std::vector<Reading> ReadingsIn(const std::vector<int>& images, const FitQuestion& q,
                                const std::vector<View>& views, const std::vector<LineImage>& lines,
                                int threads, bool some) {
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
  ParallelFor(found.size(), threads, [&](std::size_t i) { read[i] = ReadAs(found[i], q, views, some); });
  std::vector<Reading> out;
  for (auto& r : read)
    if (r) out.push_back(std::move(*r));
  out = Sorted(std::move(out));
  for (const auto& r : Distinct(out, kMostVaried))
    for (auto& other : Variations(r, q, views)) out.push_back(std::move(other));
  return Sorted(std::move(out));
}

// Do the picks, read so, say where the object stands?
bool Placed(const Reading& r, const FitQuestion& question, const std::vector<View>& views) {
  const auto fit = FitPicks(With(r.contours, question), views);
  return fit && fit->placed;
}

// The best, and the best that is another body.
Proposal BestOf(const std::vector<Reading>& sorted, const FitQuestion& question,
                const std::vector<View>& views) {
  Proposal out;
  out.readings = Distinct(sorted, 2);
  const auto& r = out.readings;
  out.decided = (r.size() == 1 || r[0].log_odds - r[1].log_odds >= kBarely) && Placed(r[0], question, views);
  return out;
}

}  // namespace

Result<Proposal> ProposeContours(
    const FitQuestion& q, const std::vector<View>& views,
    const std::function<std::vector<LineImage>(const std::vector<int>&)>& lines_of, int threads, bool some) {
  if (q.picks.empty()) return UsageError("no line is picked yet; click a line that belongs to the object");
  if (q.picks.size() > kMaxProposed)
    return UsageError(
        "{} picked lines are more than the {} that a proposal takes; drop some, or choose the contours in "
        "the drawing",
        q.picks.size(), kMaxProposed);
  const std::vector<int> images = PicturesOfPicks(q, views);
  const std::vector<LineImage> lines = lines_of(images);
  std::vector<Reading> readings;
  if (images.size() > 1) readings = ReadingsIn(images, q, views, lines, threads, some);
  for (std::size_t k = 0; k < images.size() && readings.empty(); ++k)
    if (std::any_of(q.picks.begin(), q.picks.end(), [&](const Pick& p) { return p.image == images[k]; }))
      readings = ReadingsIn({images[k]}, q, views, {lines[k]}, threads, some);
  if (readings.empty())
    return UsageError(
        "no way to see a {} explains these {} lines; is it that kind, lying so, and are all lines its own?",
        q.model->kind(), q.picks.size());
  return BestOf(readings, q, views);
}

}  // namespace vss::station
