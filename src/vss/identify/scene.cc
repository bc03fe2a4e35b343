#include "vss/identify/scene.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include "vss/base/parallel.h"
#include "vss/identify/hypothesis.h"
#include "vss/identify/ledger.h"
#include "vss/identify/overlap.h"
#include "vss/identify/unknown.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// Calibration errors grow with the picture: this many px, plus a share of its width.
constexpr double kBaseTolerancePx = 1.2;
constexpr double kToleranceShare = 1.0 / 2000;
// Two parts may sink into each other by this before they are said to fill the same room.
constexpr double kTouchMm = 6;
// Lines at least this long have directions that tell edges apart.
constexpr double kSureLinePx = 15;
constexpr double kMaxSharedVolume = 0.005;

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
  int candidate = -1;  // of the ledger
  double alone = NAN;  // log-odds before the choice; 0: it stands nowhere
  int inside = 0;      // EdgesInside()
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
    FindEdgesOfWorld();
    AddHypotheses(kGround, {});
    ReseatOnPlates();
    Select();
    // What the parts found so far hide or explain is known now: the rest of the lines once more, on the
    // ground and on all tops.
    for (int round = 0; round < kMaxRounds && options_.top_down && !progress_.Cancelled(); ++round) {
      const std::vector<int> known = accepted_;
      const Known around = Explained(known);
      changed_ = false;
      SlideAccepted();
      AddHypotheses(kGround, around);
      if (options_.contact)
        for (int support : known) AddHypotheses(support, around);
      JoinPlates();
      if (!changed_) break;
      ReseatOnPlates();
      Select();
      if (accepted_ == known) break;
    }
    if (progress_.Cancelled()) return Cancelled();
    return Collect();
  }

  // Edges and circles of the world, and how far lines lie from them.
  void FindEdgesOfWorld() {
    WorldLineOptions line_options{scene_.tolerance_px, -20 * mm_per_px_, options_.max_height_mm, kSureLinePx};
    progress_.Report("world lines", 0, 1);
    lines_ = FindWorldLines(views_, scene_.lines, line_options, threads_, progress_);
    const std::vector<WorldLine> wide = std::move(lines_);
    line_options.tolerance_px = NarrowPx(wide);
    line_options.min_length_px = 0;
    lines_ = FindWorldLines(views_, scene_.lines, line_options, threads_, progress_);
    scene_.SetWorldLines(lines_);
    scene_.sigma_px = SigmaPx();
    // Edges whose lines are pulled this way and that agree with more tolerance only.
    const std::size_t num_narrow = lines_.size();
    for (const auto& l : wide)
      if (std::none_of(lines_.begin(), lines_.begin() + std::ptrdiff_t(num_narrow),
                       [&](const WorldLine& known) { return Same(known, l); }))
        lines_.push_back(l);
    std::erase_if(lines_, [&](const WorldLine& l) { return MovesWithLamps(l, views_); });
    for (const auto& l : lines_) shown_.push_back(WellShown(l));
    circles_ = FindWorldCircles(views_, line_options);
    progress_.Report("world lines", 1, 1);
  }

  // How much the pictures speak for each of `objects`, the others known.
  std::vector<Evidence> WeighEach(std::span<const PlacedObject> objects) {
    FindEdgesOfWorld();
    std::vector<Evidence> out(objects.size());
    ParallelFor(objects.size(), threads_, [&](std::size_t i) {
      Occluders others;
      for (std::size_t k = 0; k < objects.size(); ++k)
        if (k != i) others.Add(PlaceSolid(objects[k], false), int(k));
      const WorldSolid solid = PlaceSolid(objects[i], false);
      out[i] = Weigh(solid, ViewsThatSee(solid, views_, int(views_.size())), scene_,
                     {.grey = true, .prior_log_odds = PriorLogOdds(objects[i], scene_.mm_per_px)}, &others);
    });
    return out;
  }

 private:
  static constexpr int kGround = -1;
  static constexpr double kBarely =
      10;  // natural logarithm of the odds: as good as nothing between two readings
  static constexpr double kClearly = 1e-6;
  // What an edge costs that runs where the part would be solid: as much as tells two readings apart. None ran
  // in ninety parts of drawn scenes that were found rightly, one to five in boxes laid around channels.
  static constexpr double kOpaque = 10;
  // Two parts that lie against each other, parallel and both ends flush, within pixels: four coincidences at
  // once, taken as one in 150 each, where one part of that section needs none.
  static constexpr double kFlush = 20, kFlushPx = 5, kFlushRad = 2 * kPi / 180;
  static constexpr double kWorthSliding = -20;  // less, and no end that is moved makes a part of it
  // Parts touch that are no farther apart than places are unsure by before reconstruction; what relations ask
  // about is not farther than this.
  static constexpr double kSlackPx = 1.5, kReachPx = 40;
  // Of one picture: from height to height a contour moves by no more than the fit to lines catches; nothing
  // that is higher than this share of the camera's height is looked for.
  static constexpr double kHeightStepPx = 6, kMostOfEye = 0.25;
  static constexpr int kMaxRounds = 4;  // what stands on what stands on what stands on the ground

  // What accepted parts hide and which lines they explain.
  struct Known {
    Occluders others;
    Claims claims;
  };

  // The lines of the pictures themselves tell how well they agree on an edge of the world: with no more
  // tolerance than that, two edges that lie close are not taken for one.
  double NarrowPx(const std::vector<WorldLine>& lines) const {
    constexpr double kTolerances = 3;    // times the rms distance
    constexpr double kLeastShare = 0.4;  // of what is usual: shadows pull edges, corners are rounded
    const double agreement = AgreementPx(lines);
    if (options_.tolerance_px > 0 || agreement <= 0) return scene_.tolerance_px;
    return std::clamp(kTolerances * agreement, kLeastShare * scene_.tolerance_px, scene_.tolerance_px);
  }

  // One edge of the world, to within half a pixel?
  bool Same(const WorldLine& a, const WorldLine& b) const {
    const double near = 0.5 * mm_per_px_;
    const bool turned = a.Unit().dot(b.Unit()) < 0;
    return (a.start - (turned ? b.end : b.start)).norm() < 2 * near &&
           (a.end - (turned ? b.start : b.end)).norm() < 2 * near &&
           a.Unit().cross(b.start - a.start).norm() < near;
  }

  // Is it found in a fair share of the pictures that look at it? Two pictures agree on many a line of
  // texture; an edge that starts a part is seen more often, though other parts hide it from some.
  bool WellShown(const WorldLine& l) const {
    constexpr double kLeastShare = 0.25;
    const Vector3d middle = (l.start + l.end) / 2;
    const auto lookers =
        std::count_if(views_.begin(), views_.end(), [&](const View& v) { return v.Shows(middle); });
    return l.num_views >= kLeastShare * double(lookers);
  }

  // How far lines lie from their edges, as the edges of the world tell.
  double SigmaPx() const {
    constexpr double kOfAgreement = 2;  // edges that are nearest to the truth agree best, most not so well
    constexpr double kLeastShare = 0.15;
    const double agreement = AgreementPx(lines_);
    if (agreement <= 0) return scene_.sigma_px;
    return std::clamp(kOfAgreement * agreement, kLeastShare * scene_.tolerance_px, scene_.sigma_px);
  }

  bool IsSinglePicture() const { return views_.size() == 1; }

  SeedContext Context() const { return {scene_, lines_, circles_, mm_per_px_, 12}; }

  Known Explained(const std::vector<int>& items) const {
    Known known;
    known.claims = NoClaims();
    for (int i : items) {
      known.others.Add(SolidOf(i), i);
      Claim(items_[std::size_t(i)], known.claims);
    }
    return known;
  }

  Claims NoClaims() const {
    Claims claims(views_.size());
    for (std::size_t v = 0; v < views_.size(); ++v) claims[v].resize(scene_.lines[v].lines().size());
    return claims;
  }

  WorldSolid SolidOf(int i) const { return PlaceSolid(items_[std::size_t(i)].h.object, false); }

  // Is most of the line explained already?
  bool Explains(const Claims& claims, const WorldLine& l) const {
    constexpr double kMost = 0.5;
    double all = 0, done = 0;
    for (const auto& r : l.lines) {
      const double px = scene_.lines[std::size_t(r.view)].lines()[std::size_t(r.line)].length_px;
      all += px;
      if (claims[std::size_t(r.view)][std::size_t(r.line)]) done += px;
    }
    return done > kMost * all;
  }

  // Hypotheses of all kinds on the ground or on the top of an item, from the lines that nothing explains.
  void AddHypotheses(int support, const Known& known) {
    const double z = support < 0 ? 0 : items_[std::size_t(support)].top_mm;
    const std::string on = support < 0 ? "ground" : items_[std::size_t(support)].kind;
    if (std::none_of(templates_.begin(), templates_.end(),
                     [&](const KindTemplate& t) { return t.model->MayStandOn(on); }))
      return;
    std::vector<WorldLine> lines;
    for (std::size_t i = 0; i < lines_.size(); ++i)
      if (shown_[i] && (support < 0 || Above(lines_[i], items_[std::size_t(support)])) &&
          (known.claims.empty() || !Explains(known.claims, lines_[i])))
        lines.push_back(lines_[i]);
    std::vector<WorldCircle> circles;
    for (const auto& c : circles_)
      if (known.claims.empty() || !known.claims[std::size_t(c.arcs[0].view)][ChordOf(c.arcs[0])])
        circles.push_back(c);
    SeedContext context = Context();
    context.lines = lines;
    context.circles = circles;
    if (!known.claims.empty()) {
      context.others = &known.others;
      context.claims = &known.claims;
      context.contact = options_.contact;
    }
    std::vector<std::vector<Hypothesis>> by_template(templates_.size());
    auto seed = [&] {
      ParallelFor(templates_.size(), threads_, [&](std::size_t i) {
        // How a part lies less often is asked only of lines that nothing else explains.
        if (!templates_[i].model->MayStandOn(on) || (templates_[i].resting_pose > 0 && known.claims.empty()))
          return;
        auto seeds = Seeds(templates_[i], context, z);
        std::move(seeds.begin(), seeds.end(), std::back_inserter(by_template[i]));
      });
    };
    if (IsSinglePicture()) {
      // One picture does not tell how high a line lies: every height is tried.
      for (double height = z + kHeightStepPx * mm_per_px_;
           height <= std::min(options_.max_height_mm, kMostOfEye * views_[0].center_in_world.z());
           height += kHeightStepPx * mm_per_px_) {
        lines = LevelLines(views_[0], scene_.lines[0], height, kSureLinePx);
        for (auto& l : lines)
          if (!known.claims.empty() && Explains(known.claims, l)) l.end = l.start;
        circles = LevelCircles(views_[0], height, scene_.tolerance_px);
        std::erase_if(circles, [&](const WorldCircle& c) {
          return !known.claims.empty() && known.claims[0][ChordOf(c.arcs[0])];
        });
        context.lines = lines;
        context.circles = circles;
        if (progress_.Cancelled()) return;
        seed();
      }
    } else {
      seed();
    }
    std::vector<std::pair<std::size_t, Hypothesis>> seeds;  // template, seed
    for (std::size_t i = 0; i < templates_.size(); ++i)
      for (auto& h : Promising(std::move(by_template[i]), context)) seeds.push_back({i, std::move(h)});
    std::vector<std::vector<Completion>> completed(seeds.size());
    ParallelFor(seeds.size(), threads_, [&](std::size_t i) {
      if (!progress_.Cancelled())
        completed[i] = Complete(templates_[seeds[i].first], context, seeds[i].second);
    });
    std::vector<std::vector<Completion>> of_template(templates_.size());
    for (std::size_t i = 0; i < seeds.size(); ++i)
      for (auto& c : completed[i]) of_template[seeds[i].first].push_back(std::move(c));
    std::vector<std::pair<std::size_t, Completion>> distinct;
    for (std::size_t t = 0; t < templates_.size(); ++t)
      for (auto& c : Distinct(std::move(of_template[t]), mm_per_px_)) distinct.push_back({t, std::move(c)});
    std::vector<std::optional<Hypothesis>> finished(distinct.size());
    std::atomic<int> done{0};
    ParallelFor(distinct.size(), threads_, [&](std::size_t i) {
      if (progress_.Cancelled()) return;
      const KindTemplate& kind = templates_[distinct[i].first];
      const double least = options_.accept_log_odds - MostOfRelations(*kind.model);
      Hypothesis h = Finish(kind, context, distinct[i].second);
      if (IsSlanted(h, context) && h.log_odds > kWorthSliding)
        for (auto& slid : Slides(h, context))
          if (slid.log_odds > h.log_odds) h = std::move(slid);
      if (h.log_odds >= least) {
        WeighInAllViews(h, context);
        if (h.log_odds >= least && (!IsSinglePicture() || ShowsHeight(h, context)))
          finished[i] = std::move(h);
      }
      progress_.Report("hypotheses", ++done, int(distinct.size()));
    });
    for (auto& h : finished)
      if (h) Keep(std::move(*h), support);
  }

  // Ends of accepted parts, and of what came second there, may be wrong though their edges are right.
  void SlideAccepted() {
    struct Candidate {
      int item, accepted;  // in whose place it would be
    };
    std::vector<Candidate> candidates;
    for (int i : accepted_) {
      candidates.push_back({i, i});
      if (const auto rival = rivals_.find(i); rival != rivals_.end())
        candidates.push_back({rival->second.item, i});
    }
    std::vector<std::vector<Hypothesis>> slid(candidates.size());
    ParallelFor(candidates.size(), threads_, [&](std::size_t i) {
      std::vector<int> rest = accepted_;
      std::erase(rest, candidates[i].accepted);
      const Known around = Explained(rest);
      SeedContext context = Context();
      context.others = &around.others;
      context.claims = &around.claims;
      Hypothesis h = items_[std::size_t(candidates[i].item)].h;
      WeighInAllViews(h, context);
      slid[i] = Slides(h, context);
    });
    for (std::size_t i = 0; i < candidates.size(); ++i)
      for (auto& h : slid[i]) Keep(std::move(h), items_[std::size_t(candidates[i].item)].support_item);
  }

  // A plate on which something stands upright shows as two, one on either side: of two of one kind and height
  // in one line, the whole is tried too, with what stands between them as it stands.
  void JoinPlates() {
    const std::size_t n = items_.size();
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = a + 1; b < n; ++b)
        for (std::size_t between = 0; between < n; ++between)
          if (Halves(a, b, between)) Join(a, b, between);
  }

  // Do a and b lie side by side at one height, with `between` standing where they meet?
  bool Halves(std::size_t a, std::size_t b, std::size_t between) const {
    constexpr double kAligned = 0.9;  // of the longer one's extent along the joint
    const Item &one = items_[a], &other = items_[b], &wall = items_[between];
    if (between == a || between == b || one.kind != other.kind || one.support_item != other.support_item ||
        one.h.object.resting_pose != other.h.object.resting_pose || wall.support_item != one.support_item ||
        !wall.h.object.model->MayStandOn(one.kind) || wall.h.log_odds < options_.doubtful_log_odds ||
        std::abs(one.top_mm - other.top_mm) > 2 * mm_per_px_ || wall.top_mm < one.top_mm + 4 * mm_per_px_)
      return false;
    // In the wall's frame: along it and across.
    const double yaw = wall.h.object.placement[3];
    const Vector3d u(std::cos(yaw), std::sin(yaw), 0), w(-std::sin(yaw), std::cos(yaw), 0);
    const auto ua = Extent(one, u), ub = Extent(other, u), wa = Extent(one, w), wb = Extent(other, w),
               ww = Extent(wall, w);
    const double common = std::min(ua.second, ub.second) - std::max(ua.first, ub.first);
    if (common < kAligned * std::max(ua.second - ua.first, ub.second - ub.first)) return false;
    const double slack = 4 * mm_per_px_ + (ww.second - ww.first);
    auto meets = [&](const std::pair<double, double>& low, const std::pair<double, double>& high) {
      return low.second > ww.first - slack && low.second < ww.second + slack &&
             high.first > ww.first - slack && high.first < ww.second + slack &&
             low.first < ww.first - slack && high.second > ww.second + slack;
    };
    return meets(wa, wb) || meets(wb, wa);
  }

  // The whole of two halves, from the lines around both.
  void Join(std::size_t a, std::size_t b, std::size_t between) {
    const double slack = 3 * mm_per_px_;
    Eigen::AlignedBox3d room = items_[a].volume.box.merged(items_[b].volume.box);
    // The same halves come in many readings, with many a wall between them.
    std::vector<long> place{long(items_[a].support_item), long(items_[a].h.object.resting_pose)};
    for (int axis = 0; axis < 3; ++axis)
      for (double side : {room.min()[axis], room.max()[axis]}) place.push_back(std::lround(side / slack));
    if (!joined_.insert({items_[a].kind, std::move(place)}).second) return;
    room = {room.min().array() - slack, room.max().array() + slack};
    std::vector<WorldLine> lines;
    for (const auto& l : lines_)
      if (room.contains(l.start) && room.contains(l.end)) lines.push_back(l);
    Occluders wall;
    wall.Add(SolidOf(int(between)), int(between));
    SeedContext context = Context();
    context.lines = lines;
    context.circles = {};
    context.others = &wall;
    const int support = items_[a].support_item;
    const PlacedObject half = items_[a].h.object;
    const Eigen::AlignedBox3d first = items_[a].volume.box, second = items_[b].volume.box;
    for (const auto& t : templates_) {
      if (t.model != half.model || t.resting_pose != half.resting_pose) continue;
      for (const auto& seed : Promising(Seeds(t, context, half.placement[2]), context))
        for (const auto& completion : Complete(t, context, seed)) {
          Hypothesis h = Finish(t, context, completion);
          if (h.log_odds < options_.accept_log_odds) continue;
          WeighInAllViews(h, context);
          const auto box = MakeVolume(PlaceSolid(h.object, false)).box;
          if (h.log_odds >= options_.accept_log_odds && box.contains(first.center()) &&
              box.contains(second.center()))
            Keep(std::move(h), support);
        }
    }
  }

  // Of all seeds of a kind from one edge of the world, the few that fit best.
  std::vector<Hypothesis> Promising(std::vector<Hypothesis> seeds, const SeedContext& context) const {
    constexpr int kPerLine = 4, kPerSlantedLine = 6;  // whose ends are believed or not
    std::vector<double> scores(seeds.size());
    ParallelFor(seeds.size(), threads_, [&](std::size_t i) { scores[i] = RoughScore(seeds[i], context); });
    std::vector<std::size_t> order(seeds.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
    std::map<int, int> used;
    std::vector<Hypothesis> out;
    for (std::size_t i : order) {
      Hypothesis& h = seeds[i];
      const int most = IsSlanted(h, context) ? kPerSlantedLine : kPerLine;
      if (h.first_line >= 0 && (used[h.first_line] >= most || used[h.second_line] >= most)) continue;
      ++used[h.first_line];
      ++used[h.second_line];
      out.push_back(std::move(h));
    }
    return out;
  }

  // The search looks at some pictures, the decision at many.
  void WeighInAllViews(Hypothesis& h, const SeedContext& context) const {
    constexpr int kManyViews = 40;
    const WorldSolid solid = PlaceSolid(h.object, false);
    h.views = ViewsThatSee(solid, views_, kManyViews);
    h.log_odds = Weigh(solid, h.views, scene_,
                       {.grey = true, .prior_log_odds = PriorLogOdds(h.object, scene_.mm_per_px)},
                       context.others, context.claims)
                     .Score();
  }

  // In one picture a top alone may be a small one that is near or a large one that is far: what stands below
  // it must speak for its height.
  bool ShowsHeight(const Hypothesis& h, const SeedContext& context) const {
    constexpr double kBelowTopPx = 2, kLeast = 6;  // half of what makes a part
    const WorldSolid solid = PlaceSolid(h.object, false);
    const double top = MakeVolume(solid).box.max().z() - kBelowTopPx * mm_per_px_;
    double below = 0;
    for (const auto& e :
         Weigh(solid, h.views, scene_, {.grey = true}, context.others, context.claims).edges) {
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

  // The first chord of an arc in its picture's line index.
  std::size_t ChordOf(const LineRef& arc) const {
    const auto& index = scene_.lines[std::size_t(arc.view)];
    for (std::size_t k = std::size_t(index.num_segments()); k < index.lines().size(); ++k)
      if (index.lines()[k].arc == arc.line) return k;
    return 0;
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
    if (support >= 0 && (!RestsOn(h.object, item.volume, items_[std::size_t(support)].volume) ||
                         OfOneOutline(item.volume, items_[std::size_t(support)].volume)))
      return;
    // The same object found from another seed: keep the better.
    for (auto& other : items_) {
      if (other.kind != item.kind || other.support_item != support ||
          other.h.object.resting_pose != h.object.resting_pose)
        continue;
      if ((other.volume.box.center() - item.volume.box.center()).norm() > mm_per_px_ ||
          (other.volume.box.sizes() - item.volume.box.sizes()).norm() > mm_per_px_)
        continue;
      if (h.log_odds > other.h.log_odds) {
        changed_ = true;
        item.h = std::move(h);
        other = std::move(item);
        conflicts_.clear();
        flush_.clear();
        reseated_.clear();
      }
      return;
    }
    changed_ = true;
    item.h = std::move(h);
    items_.push_back(std::move(item));
  }

  static bool RestsOn(const PlacedObject& object, const Volume& volume, const Volume& below) {
    const Vector3d foot(object.placement[0], object.placement[1], volume.box.min().z() - kTouchMm);
    return below.Contains(foot);
  }

  // A plate that stands out under a part by no more than shadows do cannot be told from them.
  bool OfOneOutline(const Volume& above, const Volume& below) const {
    constexpr double kShadowPx = 5;
    return ((below.box.sizes() - above.box.sizes()).head<2>().array() < 2 * kShadowPx * mm_per_px_).all();
  }

  // What was taken to stand on the ground may stand on a plate that lies there.
  void ReseatOnPlates() {
    if (!options_.contact) return;
    const std::size_t n = items_.size();
    std::vector<std::pair<std::size_t, std::size_t>> pairs;  // what, on what
    for (std::size_t plate = 0; plate < n; ++plate) {
      const Item& below = items_[plate];
      if (below.h.log_odds < options_.doubtful_log_odds || !BestOfItsPlace(plate)) continue;
      for (std::size_t i = 0; i < n; ++i) {
        const Item& above = items_[i];
        if (i == plate || int(plate) == above.support_item || !above.h.object.model->MayStandOn(below.kind) ||
            above.top_mm < below.top_mm + 2 * mm_per_px_)
          continue;
        // From the ground, or from another reading of the same plate.
        if (above.support_item != kGround &&
            !SamePlace(items_[std::size_t(above.support_item)].volume.box, below.volume.box))
          continue;
        const double slack = 3 * mm_per_px_;
        if ((above.volume.box.min().head<2>().array() < below.volume.box.min().head<2>().array() - slack)
                .any() ||
            (above.volume.box.max().head<2>().array() > below.volume.box.max().head<2>().array() + slack)
                .any())
          continue;
        if (reseated_.insert({i, plate}).second) pairs.push_back({i, plate});
      }
    }
    std::vector<std::optional<Hypothesis>> seated(pairs.size());
    const SeedContext context = Context();
    ParallelFor(pairs.size(), threads_, [&](std::size_t k) {
      seated[k] = Reseat(items_[pairs[k].first].h, context, items_[pairs[k].second].top_mm);
      if (seated[k]) WeighInAllViews(*seated[k], context);
    });
    for (std::size_t k = 0; k < pairs.size(); ++k)
      if (seated[k] && seated[k]->log_odds >= options_.accept_log_odds)
        Keep(std::move(*seated[k]), int(pairs[k].second));
  }

  // Is there no better item of its kind and nearly the same frame?
  bool BestOfItsPlace(std::size_t i) const {
    for (std::size_t k = 0; k < items_.size(); ++k) {
      if (k == i || items_[k].kind != items_[i].kind ||
          !SamePlace(items_[i].volume.box, items_[k].volume.box))
        continue;
      if (items_[k].h.log_odds > items_[i].h.log_odds ||
          (items_[k].h.log_odds == items_[i].h.log_odds && k < i))
        return false;
    }
    return true;
  }

  bool Conflicts(int a, int b) {
    if (a > b) std::swap(a, b);
    const auto key = std::pair(a, b);
    const auto it = conflicts_.find(key);
    if (it != conflicts_.end()) return it->second;
    const bool is = SharedVolume(items_[std::size_t(a)].volume, items_[std::size_t(b)].volume, kTouchMm) >
                        kMaxSharedVolume ||
                    ShareRim(a, b);
    conflicts_[key] = is;
    return is;
  }

  // Have both the same round edge? The rim of a hole is no pipe's that stands in it, nor a pipe's foot a
  // hole's rim. And of one kind, side by side around one middle, they are readings of one part.
  bool ShareRim(int a, int b) const {
    constexpr double kSamePx = 1.5, kOfOnePartPx = 5;
    if (!items_[std::size_t(a)].volume.box.intersects(items_[std::size_t(b)].volume.box)) return false;
    const WorldSolid one = SolidOf(a), other = SolidOf(b);
    const bool one_kind = items_[std::size_t(a)].kind == items_[std::size_t(b)].kind;
    for (const auto& c : one.circles)
      for (const auto& d : other.circles)
        if ((c.center.point - d.center.point).norm() + std::abs(c.radius_mm - d.radius_mm) <
            (one_kind ? kOfOnePartPx : kSamePx) * mm_per_px_)
          return true;
    return false;
  }

  bool Flush(int a, int b) {
    const auto key = std::minmax(a, b);
    const auto it = flush_.find(key);
    if (it != flush_.end()) return it->second;
    return flush_[key] = AreFlush(items_[std::size_t(key.first)], items_[std::size_t(key.second)]);
  }

  bool AreFlush(const Item& a, const Item& b) const {
    const double near = kFlushPx * mm_per_px_;
    if (a.support_item != b.support_item || !HasEdges(a) || !HasEdges(b)) return false;
    const double turn = std::remainder(a.h.object.placement[3] - b.h.object.placement[3], kPi / 2);
    if (std::abs(turn) > kFlushRad) return false;
    const double yaw = a.h.object.placement[3];
    const Vector3d u(std::cos(yaw), std::sin(yaw), 0), w(-std::sin(yaw), std::cos(yaw), 0);
    for (const auto& [along, across] : {std::pair{u, w}, std::pair{w, u}}) {
      const auto ends = Extent(a, along), other_ends = Extent(b, along), sides = Extent(a, across),
                 other_sides = Extent(b, across);
      const double gap =
          std::max(sides.first, other_sides.first) - std::min(sides.second, other_sides.second);
      if (std::abs(ends.first - other_ends.first) < near &&
          std::abs(ends.second - other_ends.second) < near && std::abs(gap) < near)
        return true;
    }
    return false;
  }

  static bool HasEdges(const Item& item) { return !PlaceSolid(item.h.object, false).edges.empty(); }

  static std::pair<double, double> Extent(const Item& item, const Vector3d& direction) {
    std::pair<double, double> e{INFINITY, -INFINITY};
    for (const auto& t : item.volume.triangles)
      for (const auto& p : t) e = {std::min(e.first, direction.dot(p)), std::max(e.second, direction.dot(p))};
    return e;
  }

  // What stands on item `i`'s supports, they included, that `accepted` lacks: `i` first.
  std::vector<int> ChainOf(int i, const std::vector<bool>& accepted) const {
    std::vector<int> chain;
    for (int k = i; k >= 0 && !accepted[std::size_t(k)]; k = items_[std::size_t(k)].support_item)
      chain.push_back(k);
    return chain;
  }

  // A set of items, supports before what they carry, and what it explains.
  struct Choice {
    std::vector<int> items;
    double total = 0;
  };

  // Holds the items that are new against the pictures.
  void Enter() {
    std::vector<PlacedObject> objects;
    for (auto& item : items_)
      if (item.candidate < 0) {
        item.candidate = ledger_.size() + int(objects.size());
        objects.push_back(item.h.object);
      }
    ledger_.Add(objects, threads_);
    for (auto& item : items_)
      if (std::isnan(item.alone)) {
        const Ledger::Share share = ledger_.Alone(item.candidate);
        item.inside = EdgesInside(item);
        const double opaque = -kOpaque * item.inside;
        const double others = MostOfRelations(*item.h.object.model) + opaque;
        item.alone = Stands(share, others) ? share.log_odds + opaque : 0;
        // Alone, or beside the parts that were known when it was found: they may hide what is not seen of it.
        if (item.h.log_odds + others >= options_.accept_log_odds)
          item.alone = std::max(item.alone, item.h.log_odds + opaque);
      }
  }

  // How many edges of the world run inside the item: it is opaque, and were it there, nobody could see them.
  // What lines of several pictures meet in by chance lies anywhere, and seldom long and deep inside.
  int EdgesInside(const Item& item) const {
    constexpr double kDeepPx = 4;
    constexpr int kSteps = 7, kMost = 5;
    const double deep = kDeepPx * mm_per_px_;
    int count = 0;
    for (const auto& l : scene_.world_lines) {
      if (l.num_stops < 2 || l.Length() < kSureLinePx * mm_per_px_) continue;
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

  bool Stands(const Ledger::Share& share, double relations) const {
    return share.log_odds + relations >= options_.accept_log_odds &&
           share.elevated_log_odds + relations >= options_.accept_log_odds;
  }

  // What an object's relations to others can bring at most.
  static double MostOfRelations(const ObjectModel& model) {
    double most = 0;
    for (const auto& r : model.relations())
      if (r.force != ObjectRelation::Force::kAvoids) most += r.weight;
    return most;
  }

  // What the relations of item `i` say of it among `items`.
  double Relations(int i, const std::vector<int>& items) const {
    const Item& item = items_[std::size_t(i)];
    const auto relations = item.h.object.model->relations();
    if (relations.empty() || !options_.contact) return 0;
    std::vector<RelatedSolid> others;
    const Vector3d reach = Vector3d::Constant(kReachPx * mm_per_px_);
    const Eigen::AlignedBox3d room(item.volume.box.min() - reach, item.volume.box.max() + reach);
    for (int k : items)
      if (k != i && room.intersects(items_[std::size_t(k)].volume.box))
        others.push_back(RelatedOf(items_[std::size_t(k)].h.object));
    return RelationLogOdds(relations, RelatedOf(item.h.object), others, kSlackPx * mm_per_px_);
  }

  // A part must bring more than its acceptance asks for; one that does not stand among the others costs that.
  double Total(const std::vector<int>& items) {
    std::vector<int> candidates;
    for (int i : items) candidates.push_back(items_[std::size_t(i)].candidate);
    double total = 0;
    const auto shares = ledger_.Weigh(candidates);
    for (std::size_t n = 0; n < items.size(); ++n) {
      const double others = Relations(items[n], items) - kOpaque * items_[std::size_t(items[n])].inside;
      total += (Stands(shares[n], others) ? shares[n].log_odds + others : 0) - options_.accept_log_odds;
      for (std::size_t m = 0; m < n; ++m)
        if (Flush(items[m], items[n])) total -= kFlush;
    }
    return total;
  }

  bool ConflictsWithAny(const std::vector<int>& chain, const std::vector<int>& items) {
    return std::any_of(chain.begin(), chain.end(), [&](int k) {
      return std::any_of(items.begin(), items.end(), [&](int a) { return Conflicts(k, a); });
    });
  }

  std::vector<int> MissingChain(int i, const std::vector<int>& items) const {
    std::vector<bool> is_in(items_.size());
    for (int k : items) is_in[std::size_t(k)] = true;
    std::vector<int> chain = ChainOf(i, is_in);
    std::reverse(chain.begin(), chain.end());
    return chain;
  }

  // Adds those of `order` that explain more, one after the other.
  void AddBest(const std::vector<int>& order, Choice& choice) {
    for (int i : order) {
      if (progress_.Cancelled()) return;
      const std::vector<int> chain = MissingChain(i, choice.items);
      if (chain.empty() || ConflictsWithAny(chain, choice.items)) continue;
      std::vector<int> more = choice.items;
      more.insert(more.end(), chain.begin(), chain.end());
      const double total = options_.scene_level ? Total(more) : choice.total + items_[std::size_t(i)].alone;
      if (total <= choice.total) continue;
      choice = {std::move(more), total};
    }
  }

  // The item of the same kind at the same place that stands on `support`; -1: none.
  int TwinOn(int i, int support) const {
    const Item& item = items_[std::size_t(i)];
    int best = -1;
    for (std::size_t k = 0; k < items_.size(); ++k) {
      const Item& other = items_[k];
      if (other.support_item != support || other.kind != item.kind ||
          !SamePlace(item.volume.box, other.volume.box))
        continue;
      if (best < 0 || other.alone > items_[std::size_t(best)].alone) best = int(k);
    }
    return best;
  }

  static bool SamePlace(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b) {
    constexpr double kSamePlace = 0.7;
    const auto common = a.intersection(b);
    return !common.isEmpty() && common.volume() > kSamePlace * a.merged(b).volume();
  }

  // The choice with item `i` and what it stands on in the place of what is in its way; what stood there
  // stands on `i` now where it can; then what else has room.
  Choice With(int i, const Choice& choice, const std::vector<int>& order, std::vector<int>& removed) {
    constexpr std::size_t kMostRefills = 6;
    const std::vector<int> chain = MissingChain(i, choice.items);
    Choice with;
    removed.clear();
    std::vector<int> fallen;
    for (int a : choice.items) {
      const int on = items_[std::size_t(a)].support_item;
      if (ConflictsWithAny(chain, {a}))
        removed.push_back(a);
      else if (std::find(removed.begin(), removed.end(), on) != removed.end())
        fallen.push_back(a), removed.push_back(a);
      else
        with.items.push_back(a);
    }
    with.items.insert(with.items.end(), chain.begin(), chain.end());
    for (int a : fallen) {
      const int twin = TwinOn(a, i);
      if (twin >= 0 && !ConflictsWithAny({twin}, with.items)) with.items.push_back(twin);
    }
    with.total = Total(with.items);
    std::vector<int> refills;
    double hope = with.total;
    for (int k : order) {
      if (refills.size() == kMostRefills) break;
      if (std::find(with.items.begin(), with.items.end(), k) != with.items.end()) continue;
      const bool near = std::any_of(removed.begin(), removed.end(), [&](int r) {
        return items_[std::size_t(r)].volume.box.intersects(items_[std::size_t(k)].volume.box);
      });
      if (!near) continue;
      const std::vector<int> more = MissingChain(k, with.items);
      if (more.size() > 1 || ConflictsWithAny(more, with.items)) continue;
      refills.push_back(k);
      hope += items_[std::size_t(k)].alone;
    }
    if (hope > choice.total - kBarely) AddBest(refills, with);
    return with;
  }

  // The set of items that together explains most: greedy, then each item that was left out is given the place
  // of what is in its way, and each accepted one taken out, as long as that explains more.
  void Select() {
    Enter();
    std::vector<int> order;
    for (std::size_t i = 0; i < items_.size(); ++i)
      if (items_[i].alone > 0) order.push_back(int(i));
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return items_[std::size_t(a)].alone > items_[std::size_t(b)].alone;
    });
    Choice best;
    AddBest(order, best);
    constexpr int kMaxPasses = 4;
    bool better = options_.scene_level;
    for (int pass = 0; better && pass < kMaxPasses && !progress_.Cancelled(); ++pass) {
      better = false;
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
    }
    accepted_ = std::move(best.items);
    std::sort(accepted_.begin(), accepted_.end());
    for (auto& item : items_) item.accepted = false;
    for (int i : accepted_) items_[std::size_t(i)].accepted = true;
  }

  // What would be lost if item `rival` took the place of `accepted`.
  void NoteRival(int accepted, int rival, double loss) {
    constexpr double kSamePart = 0.3, kOtherSizePx = 3;
    const Item &mine = items_[std::size_t(accepted)], &other = items_[std::size_t(rival)];
    if (SharedVolume(mine.volume, other.volume, kTouchMm) < kSamePart) return;
    if (mine.kind == other.kind) {
      // Of one kind, but of another size.
      const double apart = (mine.volume.box.sizes() - other.volume.box.sizes()).cwiseAbs().maxCoeff();
      if (apart < kOtherSizePx * mm_per_px_) return;
      const auto it = other_sizes_.try_emplace(accepted, loss).first;
      it->second = std::min(it->second, loss);
      return;
    }
    const auto it = rivals_.find(accepted);
    if (it == rivals_.end() || loss < it->second.loss) rivals_[accepted] = {rival, loss};
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
    std::vector<int> candidates;
    for (std::size_t k = 0; k < accepted_.size(); ++k) {
      items_[std::size_t(accepted_[k])].part = int(k);
      candidates.push_back(items_[std::size_t(accepted_[k])].candidate);
    }
    const std::vector<Ledger::Share> shares = ledger_.Weigh(candidates);
    for (int i : accepted_) {
      Item& item = items_[std::size_t(i)];
      IdentifiedPart part;
      part.object = item.h.object;
      part.stands_on = item.support_item < 0 ? -1 : items_[std::size_t(item.support_item)].part;
      part.views = ViewsThatSee(PlaceSolid(part.object, false), views_, int(views_.size()));
      part.log_odds =
          shares[std::size_t(item.part)].log_odds + Relations(i, accepted_) - kOpaque * item.inside;
      const auto rival = rivals_.find(i);
      if (rival != rivals_.end())
        part.runner_up =
            RunnerUp{items_[std::size_t(rival->second.item)].kind, part.log_odds - rival->second.loss};
      const auto other_size = other_sizes_.find(i);
      part.doubtful = part.log_odds < options_.doubtful_log_odds ||
                      (rival != rivals_.end() && rival->second.loss < kBarely) ||
                      (other_size != other_sizes_.end() && other_size->second < kBarely);
      result.parts.push_back(std::move(part));
    }
    result.unknown = Unexplained();
    return result;
  }

  // Groups of edges of the world that no accepted part explains.
  std::vector<UnknownGroup> Unexplained() const {
    const Known known = Explained(accepted_);
    std::vector<WorldLine> lines;
    for (const auto& l : lines_)
      if (!Explains(known.claims, l)) lines.push_back(l);
    std::vector<WorldCircle> circles;
    for (const auto& c : circles_)
      if (!known.claims[std::size_t(c.arcs[0].view)][ChordOf(c.arcs[0])]) circles.push_back(c);
    std::vector<Eigen::AlignedBox3d> boxes;
    for (int i : accepted_) boxes.push_back(items_[std::size_t(i)].volume.box);
    return FindUnknown(lines, circles, boxes, mm_per_px_);
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
  Ledger ledger_{scene_};
  double mm_per_px_ = 1;
  std::vector<WorldLine> lines_;
  std::vector<bool> shown_;  // of each line: WellShown()
  std::vector<WorldCircle> circles_;
  std::vector<Item> items_;
  std::vector<int> accepted_;
  bool changed_ = false;                                   // an item is new or better than at the last choice
  std::map<std::pair<int, int>, bool> conflicts_, flush_;  // of items, by index
  std::set<std::pair<std::size_t, std::size_t>> reseated_;      // items tried on plates: what, on what
  std::set<std::pair<std::string, std::vector<long>>> joined_;  // wholes tried: kind, place
  struct Rival {
    int item;
    double loss;
  };
  std::map<int, double> other_sizes_;  // of accepted items: what the least bad of another size would lose
  std::map<int, Rival> rivals_;        // of accepted items: what would explain least less in their place
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

std::vector<std::vector<ContourMatch>> MatchLines(std::span<const View> views,
                                                  std::span<const PlacedObject> objects,
                                                  const IdentifyOptions& options, int threads) {
  const SceneIndex scene = MakeSceneIndex(views, TolerancePx(views, options), threads);
  std::vector<WorldSolid> solids;
  for (const auto& object : objects) solids.push_back(PlaceSolid(object, false));
  std::vector<std::vector<ContourMatch>> matches(objects.size());
  ParallelFor(objects.size(), threads, [&](std::size_t i) {
    Occluders others;
    for (std::size_t k = 0; k < solids.size(); ++k)
      if (k != i) others.Add(solids[k], int(k));
    matches[i] = Weigh(solids[i], ViewsThatSee(solids[i], views, int(views.size())), scene,
                       {.keep_matches = true}, &others)
                     .matches;
  });
  return matches;
}

std::vector<Evidence> WeighObjects(std::span<const View> views, std::span<const PlacedObject> objects,
                                   const IdentifyOptions& options, int threads) {
  const KnowledgeBase none;
  SceneSolver solver(views, none, options, threads, {});
  return solver.WeighEach(objects);
}

Result<SceneResult> IdentifyScene(std::span<const View> views, const KnowledgeBase& knowledge,
                                  const IdentifyOptions& options, int threads, const Progress& progress) {
  SceneSolver solver(views, knowledge, options, threads, progress);
  return solver.Run();
}

}  // namespace vss
