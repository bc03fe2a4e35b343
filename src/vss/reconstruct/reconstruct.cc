#include "vss/reconstruct/reconstruct.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "vss/base/median.h"
#include "vss/base/parallel.h"
#include "vss/identify/view.h"
#include "vss/reconstruct/adjustment.h"
#include "vss/reconstruct/coarse_fit.h"
#include "vss/reconstruct/findings.h"
#include "vss/reconstruct/measure_view.h"
#include "vss/reconstruct/moved_cameras.h"
#include "vss/reconstruct/observability.h"
#include "vss/reconstruct/short_edge_search.h"

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// How far identification may be off, several times over: what the pictures do not determine stays near it.
constexpr double kPriorPositionMm = 25, kPriorYawRad = 0.05, kPriorDimensionMm = 25;
// Known before without any picture, for observability: a place on the floor, a dimension's range, but no more
// than this.
constexpr double kKnownMm = 150, kKnownYawRad = 0.5;
constexpr double kObservableGain =
    30;  // a dimension is observed where the pictures know it 30 times better than its range
constexpr double kMinTiltRad = 0.003;      // a part that leans less stands straight
constexpr double kTiltChiSquare = 18.4;    // two degrees of freedom, 1 in 10000
constexpr double kGroundChiSquare = 21.1;  // three degrees of freedom, 1 in 10000
constexpr double kGroundSigmas = 3;        // of how well the ground is z = 0
constexpr double kGroundPx = 0.5;          // less is what shadows on it make
// Flame-cut edges are that far from straight and square: EN ISO 9013, range 4, plates of some 10 mm.
constexpr double kCutEdgeMm = 1;
constexpr double kShortSearchPx = 1;  // of a part that slides a short edge is looked for that far off

std::vector<WorldSolid> PlaceAll(const std::vector<AdjustedPart>& parts) {
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object, false));
  return solids;
}

class Reconstructor {
 public:
  Reconstructor(std::span<const View> views, std::span<const GreyView> pictures,
                std::span<const IdentifiedPart> given, const ReconstructOptions& options, int threads,
                const Progress& progress)
      : views_(views),
        pictures_(pictures),
        given_(given),
        options_(options),
        threads_(threads),
        progress_(progress) {
    for (const auto& view : views) states_.push_back(StateBefore(view));
  }

  Result<Reconstruction> Run() {
    std::vector<AdjustedPart> parts = Start();
    PriorOptions priors{options_.camera_rotation_sigma_mrad * 1e-3, options_.camera_position_sigma_mm,
                        options_.picture_rotation_sigma_mrad * 1e-3, options_.picture_position_sigma_mm};
    AdjustmentOptions adjust;
    adjust.adjust_cameras = options_.adjust_cameras;
    adjust.ground_sigma_mm = options_.ground_sigma_mm;
    adjust.contact_sigma_mm = options_.contact_sigma_mm;
    adjust.wall_sigma_mm = options_.wall_sigma_mm;
    adjust.common_pull_px = options_.contact_bias_px;
    adjust.stop_sigma_mm = options_.stop_sigma_mm;
    adjust.known_lengths = options_.known_lengths;
    adjust.bias_px = {options_.free_bias_px, options_.contact_bias_px, options_.round_bias_px,
                      options_.limb_bias_px, options_.shadowed_bias_px};
    Adjustment a(views_, std::move(parts), MakeCameras(views_, priors), MakeStops(views_), adjust);
    if (options_.wall_sigma_mm > 0)
      a.walls = FindWallTies(a.parts, options_.search_px * TypicalMmPerPx(views_));
    constexpr int kRounds = 6, kSteps = 4;
    // Narrower from round to round, but not so that edges that run off the model's lie outside: of those the
    // parts that happen to lie within would be met alone, and seem to say that all is well.
    const double widest_px = std::max(options_.search_px, kCutEdgeMm / TypicalMmPerPx(views_));
    double scatter_px = 0;
    const auto search_of = [&](int round) {
      constexpr double kNarrower = 0.6, kNarrowestPx = 0.8, kScatters = 3;
      const double as_they_lie = std::min(widest_px, kScatters * scatter_px);
      return std::max({widest_px * std::pow(kNarrower, round), kNarrowestPx, as_they_lie});
    };
    for (int round = 0; round < kRounds; ++round) {
      if (progress_.Cancelled()) return Cancelled();
      progress_.Report("reconstruct", round, kRounds);
      Measure(a, search_of(round), round > 0);
      a.Solve(kSteps, round > 0);
      DropBrokenWalls(a);
      scatter_px = ScatterOf(a);
      if (round == 1 && options_.allow_ground) DecideGround(a);
      if (round == 1 && options_.allow_tilt) DecideTilts(a);
      if (round + 2 == kRounds) {
        // From wide to narrow, in fewer rounds than from the start: most parts stand where they did.
        const auto anew = [&] {
          for (const int again : {1, round / 2, round}) {
            Measure(a, search_of(again));
            a.Solve(kSteps, true);
          }
        };
        if (progress_.Cancelled()) return Cancelled();
        if (SlideToShortEdges(a)) anew();
        if (HoldCaptured(a)) anew();
        a.ComputeCovariance();
        FixUnobservable(a);
      }
    }
    significance_ = ReleaseMovedCameras(a);
    SettlePriors(a);
    a.Solve(kSteps, true);
    a.ComputeCovariance();
    progress_.Report("reconstruct", kRounds, kRounds);
    return Report(a);
  }

 private:
  // The parts as given, drawn to the lines, lowest first.
  std::vector<AdjustedPart> Start() {
    std::vector<AdjustedPart> parts;
    for (const auto& g : given_) {
      AdjustedPart p;
      p.object = g.object;
      p.stands_on = g.stands_on;
      parts.push_back(std::move(p));
    }
    const auto solids = PlaceAll(parts);
    const auto others = OthersOf(solids, views_);
    if (options_.draw_to_lines) {
      std::vector<LineDistances> distances(parts.size());
      ParallelFor(parts.size(), threads_, [&](std::size_t i) {
        distances[i] = DistancesToLines(parts[i].object, views_, &others[i], {});
      });
      ParallelFor(parts.size(), threads_,
                  [&](std::size_t i) { DrawToLines(parts[i], others[i], LeastOfOthers(distances, i)); });
    }
    for (auto& p : parts) {
      SetPriors(p);
      drawn_.push_back(p.object);
    }
    return parts;
  }

  // What the grey values say for a part's short edges as it stands, in all views together.
  double ShortSupport(const std::vector<AdjustedPart>& parts, std::size_t p) const {
    const auto solids = PlaceAll(parts);
    const auto others = OthersOf(solids);
    std::vector<double> support(views_.size());
    ParallelFor(views_.size(), threads_, [&](std::size_t v) {
      support[v] = MeasureView(solids, others, views_[v], static_cast<int>(v), pictures_[v], states_[v],
                               {kShortSearchPx, PieceLengthPx(), static_cast<int>(p)})
                       .short_support[p];
    });
    return std::accumulate(support.begin(), support.end(), 0.0);
  }

  // Of all measured edge points around the model's edges, one sigma by the nearer half of them.
  static double ScatterOf(const Adjustment& a) {
    constexpr double kSigmasAtHalf = 0.6745;
    std::vector<double> off;
    for (const auto& g : a.groups)
      for (const auto& o : g.observations) off.push_back(std::abs(o.residual_px));
    return Median(off) / kSigmasAtHalf;
  }

  // Shorter pieces meet a cut's grooves and a surface's grain one by one, not the edge.
  double PieceLengthPx() const {
    constexpr double kGroovesMm = 5;
    return std::max(options_.piece_length_px, kGroovesMm / TypicalMmPerPx(views_));
  }

  using Flags = std::vector<std::vector<bool>>;  // per part and unknown, or dimension

  static LineDistances LeastOfOthers(const std::vector<LineDistances>& all, std::size_t part) {
    LineDistances least = all[part];
    for (std::size_t v = 0; v < least.size(); ++v)
      for (std::size_t l = 0; l < least[v].size(); ++l) {
        least[v][l] = INFINITY;
        for (std::size_t q = 0; q < all.size(); ++q)
          if (q != part) least[v][l] = std::min(least[v][l], all[q][v][l]);
      }
    return least;
  }

  void DrawToLines(AdjustedPart& part, const Occluders& others, const LineDistances& claimed) const {
    // A start that is right already is not drawn to what lies beside its edges.
    constexpr double kClearlyBetter = 0.9;
    CoarseFitOptions o;
    const CoarseFit upright = FitToLines(part.object, views_, &others, claimed, o);
    if (upright.cost < kClearlyBetter * upright.start_cost) part.object = upright.object;
    if (!options_.allow_tilt || upright.num_samples == 0) return;
    // Leaning parts fit the lines clearly better when they may lean.
    constexpr double kMuchBetter = 0.75;
    o.tilt_sigma_rad = RadFromDeg(options_.tilt_sigma_deg);
    const CoarseFit leaning = FitToLines(part.object, views_, &others, claimed, o);
    if (leaning.cost < kMuchBetter * upright.cost && leaning.object.placement.tail<2>().norm() > kMinTiltRad)
      part.object = leaning.object;
  }

  void SetPriors(AdjustedPart& p) const {
    const auto n = p.object.StateSize();
    p.prior_value = p.object.State();
    p.prior_sigma = VectorXd::Constant(n, kPriorPositionMm);
    p.prior_sigma[3] = kPriorYawRad;
    p.prior_sigma[4] = p.prior_sigma[5] = RadFromDeg(options_.tilt_sigma_deg);
    p.prior_value[4] = p.prior_value[5] = 0;
    p.prior_sigma.tail(n - kPlacementSize).setConstant(kPriorDimensionMm);
    p.free.assign(static_cast<std::size_t>(n), true);
    p.leans = p.object.placement[4] != 0 || p.object.placement[5] != 0;
    p.free[4] = p.free[5] = p.leans;
  }

  void Measure(Adjustment& a, double search_px, bool with_short = true) {
    const auto views = a.AdjustedViews();
    const auto solids = PlaceAll(a.parts);
    const auto others = OthersOf(solids, views);
    std::vector<Measured> found(views.size());
    ParallelFor(views.size(), threads_, [&](std::size_t v) {
      found[v] = MeasureView(solids, others, views[v], static_cast<int>(v), pictures_[v], states_[v],
                             {search_px, PieceLengthPx(), -1, with_short});
    });
    a.groups.clear();
    short_edges_.clear();
    constexpr std::size_t kEnough = 20;
    std::vector<std::pair<double, double>> slopes;
    for (const auto& f : found) slopes.insert(slopes.end(), f.slopes.begin(), f.slopes.end());
    if (slopes.size() >= kEnough) slope_sigma_ = SlopeSigma(slopes);
    std::vector<double> all_blurs;
    for (const auto& f : found) all_blurs.insert(all_blurs.end(), f.blurs.begin(), f.blurs.end());
    for (std::size_t v = 0; v < views.size(); ++v) {
      states_[v].slope_sigma = slope_sigma_;
      // Of a picture with few clear edges what the others say: saturated ones look sharper than they are.
      const auto& blurs = found[v].blurs.size() >= kEnough ? found[v].blurs : all_blurs;
      if (blurs.size() >= kEnough) {
        states_[v].blur_px = Median(blurs, states_[v].blur_px);
        states_[v].blur_sigma_px = 0.15 * states_[v].blur_px;
      }
      if (!views_[v].lines && found[v].noises.size() >= kEnough) {
        std::sort(found[v].noises.begin(), found[v].noises.end());
        states_[v].noise =
            found[v].noises[found[v].noises.size() / 4];  // the cleanest quarter has noise alone
      }
      for (auto& g : found[v].groups) a.groups.push_back(std::move(g));
      for (auto& e : found[v].short_edges)
        short_edges_[static_cast<std::size_t>(e.part)].push_back({v, std::move(e)});
    }
    DropUnchecked(a);
    SettleClasses(a);
  }

  // Something that looks like an edge of a few pixels lies near one often: what only one picture has met says
  // nothing.
  static void DropUnchecked(Adjustment& a) {
    std::map<std::pair<int, int>, int> views;
    for (const auto& g : a.groups) ++views[{g.part, g.contour}];
    std::erase_if(a.groups, [&](const auto& g) { return g.IsShort() && views[{g.part, g.contour}] < 2; });
  }

  // How much light changes beside the edges of a survey: the sigma by which most slopes, each with its own
  // error, are explained, and for those beside shadows and stains so much more. In even light that is far
  // less than what may be anywhere, and noise moves an edge far less where its slopes are known.
  static double SlopeSigma(const std::vector<std::pair<double, double>>& slopes) {
    constexpr double kShare = 0.9, kNormalAtShare = 1.645, kBesideShadows = 5;
    constexpr double kLeast = 0.001;  // 1/px: a strip of eight by eight pixels tells no less
    double low = kLeast, high = kAnySlope / kBesideShadows;
    for (int it = 0; it < 20; ++it) {
      const double middle = std::sqrt(low * high);
      const auto within = std::count_if(slopes.begin(), slopes.end(), [&](const auto& s) {
        return std::abs(s.first) < kNormalAtShare * std::hypot(s.second, middle);
      });
      (static_cast<double>(within) < kShare * static_cast<double>(slopes.size()) ? low : high) = middle;
    }
    return kBesideShadows * high;
  }

  // A contour is what most of its measured pieces are.
  static void SettleClasses(Adjustment& a) {
    std::map<std::pair<int, int>, double> votes;
    auto vote = [](ContourClass c) { return c == ContourClass::kContact ? 1.0 : -1.0; };
    for (const auto& g : a.groups)
      votes[{g.part, g.contour}] += vote(g.edge_class) * static_cast<double>(g.observations.size());
    for (auto& g : a.groups) {
      if (g.edge_class == ContourClass::kLimb) continue;
      const bool contact = votes[{g.part, g.contour}] > 0;
      if (!contact && g.edge_class == ContourClass::kShadowed) continue;
      const bool straight = g.observations[0].sample.source == ContourSample::Source::kEdge;
      g.edge_class = contact ? ContourClass::kContact : straight ? ContourClass::kFree : ContourClass::kRound;
    }
  }

  // The ground is not z = 0 where that explains the pictures of all parts together much better, and where it
  // lies farther off under one of them than is known of it.
  void DecideGround(Adjustment& a) const {
    const auto gain = a.GainOfFreeingGround();
    if (gain.chi_square < kGroundChiSquare) return;
    AdjustedGround there;
    there.value = a.ground.value + gain.step;
    double farthest = 0;
    for (const auto& solid : PlaceAll(a.parts))
      for (const auto& v : solid.vertices)
        farthest = std::max(farthest, std::abs(there.HeightAt(v.point.x(), v.point.y())));
    if (farthest < std::max(kGroundPx * TypicalMmPerPx(views_), kGroundSigmas * options_.ground_sigma_mm))
      return;
    a.FreeGround();
    constexpr int kSteps = 3;
    a.Solve(kSteps, true);
  }

  // Faces that the pictures show apart do not lie against each other.
  static void DropBrokenWalls(Adjustment& a) {
    constexpr double kBrokenSigmas = 3;
    constexpr int kSteps = 2;
    const auto before = a.walls.size();
    if (before == 0) return;
    a.ComputeCovariance();
    a.DropBrokenWalls(kBrokenSigmas);
    if (a.walls.size() < before) a.Solve(kSteps, true);
  }

  // A part leans where that explains the pictures much better than standing straight.
  void DecideTilts(Adjustment& a) const {
    const double sigma = RadFromDeg(options_.tilt_sigma_deg);
    for (std::size_t p = 0; p < a.parts.size(); ++p) {
      if (a.parts[p].leans) continue;
      const auto gain = a.GainOfLeaning(static_cast<int>(p), sigma);
      if (gain.chi_square < kTiltChiSquare || gain.step.segment<2>(4).norm() < kMinTiltRad) continue;
      a.Lean(static_cast<int>(p), sigma);
    }
    constexpr int kSteps = 3;
    a.Solve(kSteps, true);
  }

  static void SettlePriors(Adjustment& a) {
    constexpr int kTimes = 3, kSteps = 3;
    for (int k = 0; k < kTimes; ++k) {
      a.EstimatePriorScales();
      a.Solve(kSteps, true);
    }
    a.ComputeCovariance();
  }

  // A dimension that left the knowledge base's range, or went further than its edge was searched for in the
  // grey values from where it was drawn to and from where identification had it, was captured by another
  // edge: its own is not seen. It is held as it was identified, and its part starts anew. True where one was.
  bool HoldCaptured(Adjustment& a) {
    captured_.resize(a.parts.size());
    bool any = false;
    constexpr double kRoughMm = 5;  // identification reads cut edges no closer, however fine the pixels
    const double reach_mm = std::max(kRoughMm, options_.search_px * TypicalMmPerPx(views_));
    for (std::size_t p = 0; p < a.parts.size(); ++p) {
      auto& part = a.parts[p];
      const PlacedObject& start = drawn_[p];
      const auto defs = start.model->dimensions();
      std::vector<bool> captured(defs.size()), held = captured_[p];
      held.resize(defs.size());
      for (std::size_t i = 0; i < defs.size(); ++i) {
        const double value = part.object.dimensions_mm[i];
        const double way = std::min(std::abs(value - start.dimensions_mm[i]),
                                    std::abs(value - given_[p].object.dimensions_mm[i]));
        captured[i] = held[i] || value < defs[i].min_mm || value > defs[i].max_mm || way > reach_mm;
      }
      captured_[p] = captured;
      if (captured == held) continue;
      any = true;
      part.object = start;
      for (std::size_t i = 0; i < defs.size(); ++i) {
        if (!captured[i]) continue;
        part.object.dimensions_mm[i] = given_[p].object.dimensions_mm[i];
        part.free[kPlacementSize + i] = false;
      }
    }
    return any;
  }

  // What only edges of a few pixels tell of a part may have met others than its own, and no long edge says
  // so: along the directions that the long ones leave open the grey values choose among places around. True
  // where a part was moved.
  bool SlideToShortEdges(Adjustment& a) {
    if (short_edges_.empty()) return false;
    const auto all = a.groups;
    std::erase_if(a.groups, [](const auto& g) { return g.IsShort(); });
    a.ComputeCovariance();
    const SeenPictures pictures{views_, pictures_, states_, TypicalMmPerPx(views_), threads_};
    // Greys are misled by the shadow under a flange, say: then the short edges are not where they say.
    constexpr double kMayLosePx = 8;
    bool any = false;
    for (const auto& [p, edges] : short_edges_)
      for (const auto& step :
           OpenDirections(a, p, edges, KnownBefore(a.parts[p]), kObservableGain, pictures)) {
        const auto best = BestAlong(a.parts, p, step, edges, pictures);
        if (!best) continue;
        auto moved = a.parts;
        moved[p].object.SetState(*best);
        const double before = ShortSupport(a.parts, p), after = ShortSupport(moved, p);
        if (after < before - kMayLosePx) continue;
        any = true;
        a.parts[p].object.SetState(*best);
        drawn_[p] = a.parts[p].object;
      }
    a.groups = all;
    return any;
  }

  static double RangeSigma(const DimensionDef& d) {
    return std::max(1.0, (d.max_mm - d.min_mm) / std::sqrt(12.0));
  }

  VectorXd KnownBefore(const AdjustedPart& p) const {
    VectorXd sigma = VectorXd::Constant(p.object.StateSize(), kKnownMm);
    sigma[3] = kKnownYawRad;
    sigma[4] = sigma[5] = RadFromDeg(options_.tilt_sigma_deg);
    const auto defs = p.object.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i)
      sigma[kPlacementSize + static_cast<Eigen::Index>(i)] = std::min(kKnownMm, RangeSigma(defs[i]));
    return sigma;
  }

  // What the pictures would determine if nothing were taken to lie against another part.
  Flags ObservableWithoutWalls(Adjustment& a) const {
    const auto walls = std::exchange(a.walls, {});
    a.ComputeCovariance();
    Flags out;
    for (std::size_t p = 0; p < a.parts.size(); ++p)
      out.push_back(AnalyseObservability(a.DataInformation(static_cast<int>(p)), KnownBefore(a.parts[p]),
                                         kObservableGain)
                        .observable);
    a.walls = walls;
    a.ComputeCovariance();
    return out;
  }

  // What the pictures do not determine goes back to what is known without them.
  void FixUnobservable(Adjustment& a) {
    if (!a.walls.empty()) without_walls_ = ObservableWithoutWalls(a);
    observable_.clear();
    singular_values_.clear();
    bool changed = false;
    for (std::size_t p = 0; p < a.parts.size(); ++p) {
      auto& part = a.parts[p];
      const auto seen =
          AnalyseObservability(a.DataInformation(static_cast<int>(p)), KnownBefore(part), kObservableGain);
      observable_.push_back(seen.observable);
      singular_values_.push_back(seen.singular_values);
      std::vector<std::optional<double>> known;
      bool all = true;
      for (std::size_t i = 0; i < part.object.dimensions_mm.size(); ++i) {
        const bool ok = seen.observable[kPlacementSize + i] && !captured_[p][i];
        observable_[p][kPlacementSize + i] = ok;
        all &= ok;
        known.push_back(ok ? std::optional(part.object.dimensions_mm[i]) : std::nullopt);
      }
      if (all) continue;
      std::vector<bool> held;
      for (const auto& k : known) held.push_back(!k);
      part.held_covariance = CovarianceOfHeld(a, p, held);
      // Back to what identification gave: from its lines, or from the knowledge base where it saw none. What
      // was captured is held already.
      for (std::size_t i = 0; i < known.size(); ++i) {
        if (known[i] || captured_[p][i]) continue;
        part.object.dimensions_mm[i] = given_[p].object.dimensions_mm[i];
        part.free[kPlacementSize + i] = false;
      }
      changed = true;
    }
    if (changed) {
      constexpr int kSteps = 3;
      a.Solve(kSteps, true);
    }
  }

  // How well what is held is known. The value that is kept is off by what it lies from the pictures' and by
  // what that is off, however weakly they tell; of what was captured they tell nothing.
  MatrixXd CovarianceOfHeld(const Adjustment& a, std::size_t p, const std::vector<bool>& held) const {
    const auto& part = a.parts[p];
    const auto defs = part.object.model->dimensions();
    const MatrixXd by_pictures = a.PartCovariance(static_cast<int>(p));
    VectorXd off = VectorXd::Zero(part.object.StateSize());
    std::vector<Eigen::Index> measured;
    MatrixXd out = MatrixXd::Zero(off.size(), off.size());
    for (std::size_t i = 0; i < defs.size(); ++i) {
      const auto at = kPlacementSize + static_cast<Eigen::Index>(i);
      if (captured_[p][i]) {
        out(at, at) = std::pow(std::min(kPriorDimensionMm, RangeSigma(defs[i])), 2);
      } else if (held[i]) {
        off[at] = given_[p].object.dimensions_mm[i] - part.object.dimensions_mm[i];
        measured.push_back(at);
      }
    }
    out(measured, measured) = by_pictures(measured, measured) + off(measured) * off(measured).transpose();
    return out;
  }

  Reconstruction Report(Adjustment& a) const {
    Reconstruction out;
    for (std::size_t p = 0; p < a.parts.size(); ++p) out.parts.push_back(ReportPart(a, p));
    for (const auto& view : a.AdjustedViews()) out.cam_from_world.push_back(view.cam_from_world);
    AddEdgeFindings(a, out);
    out.systematic_px = a.systematic_px;
    out.camera_scale = a.camera_scale;
    out.stop_scale = a.stop_scale;
    if (options_.adjust_cameras) AddCameraFindings(a, significance_, out);
    AddInfluences(a, out);
    AddScale(a, options_.picture_position_sigma_mm, out);
    AddGround(a, out);
    return out;
  }

  ReconstructedPart ReportPart(const Adjustment& a, std::size_t p) const {
    const auto& part = a.parts[p];
    ReconstructedPart out;
    out.object = part.object;
    out.stands_on = part.stands_on;
    out.leans = part.leans;
    out.observable = observable_[p];
    out.singular_values = singular_values_[p];
    out.covariance = a.PartCovariance(static_cast<int>(p));
    const auto defs = part.object.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i) {
      const auto at = kPlacementSize + static_cast<Eigen::Index>(i);
      ReconstructedDimension d;
      d.name = defs[i].name;
      d.value_mm = part.object.dimensions_mm[i];
      d.observable = observable_[p][static_cast<std::size_t>(at)];
      if (!d.observable) {
        // Not measured: known no better than its range.
        out.covariance(at, at) = std::max(out.covariance(at, at), RangeSigma(defs[i]) * RangeSigma(defs[i]));
        d.origin = OriginOfHeld(defs[i], captured_[p][i]);
      }
      d.sigma_mm = std::sqrt(std::max(0.0, out.covariance(at, at)));
      out.dimensions.push_back(std::move(d));
    }
    if (const auto by_wall = KnownByWall(p); !by_wall.empty())
      out.remarks.push_back(fmt::format(
          "{} {} known only because a face of it is taken to lie against another part's, to {} mm: "
          "the pictures alone do not determine {}",
          fmt::join(by_wall, ", "), by_wall.size() == 1 ? "is" : "are", options_.wall_sigma_mm,
          by_wall.size() == 1 ? "it" : "them"));
    for (const auto& v : PlaceSolid(part.object).vertices) {
      const Eigen::Matrix3d covariance = v.by_state * out.covariance * v.by_state.transpose();
      out.vertex_sigma.push_back(covariance.diagonal().cwiseMax(0).cwiseSqrt());
      if (options_.full_covariance) out.vertex_covariance.push_back(covariance);
    }
    return out;
  }

  // Dimensions that are observed because the part lies against another one.
  std::vector<std::string> KnownByWall(std::size_t p) const {
    std::vector<std::string> names;
    if (without_walls_.empty()) return names;
    const auto defs = given_[p].object.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i)
      if (observable_[p][kPlacementSize + i] && !without_walls_[p][kPlacementSize + i])
        names.push_back(defs[i].name);
    return names;
  }

  static std::string OriginOfHeld(const DimensionDef& d, bool captured) {
    if (captured) return "another edge was met in place of its own, which is not seen; kept as identified";
    return fmt::format(
        "the pictures do not determine it beyond the knowledge base's range {} to {} mm; kept as identified",
        d.min_mm, d.max_mm);
  }

  std::span<const View> views_;
  std::span<const GreyView> pictures_;
  std::span<const IdentifiedPart> given_;
  const ReconstructOptions& options_;
  int threads_;
  const Progress& progress_;
  std::vector<PictureState> states_;
  Flags observable_;
  Flags without_walls_;  // the same if nothing lay against another part; empty where nothing does
  std::vector<VectorXd> singular_values_;
  std::vector<PlacedObject> drawn_;  // the parts as the line images have them
  Flags captured_;                   // per part and dimension: see HoldCaptured
  std::vector<double> significance_;
  std::map<std::size_t, std::vector<SeenShortEdge>> short_edges_;  // by part, as last measured
  double slope_sigma_ = kAnySlope;  // of light beside edges, of their contrast per px
};

}  // namespace

Result<Reconstruction> ReconstructScene(std::span<const View> views, std::span<const GreyView> pictures,
                                        std::span<const IdentifiedPart> parts,
                                        const ReconstructOptions& options, int threads,
                                        const Progress& progress) {
  if (views.size() != pictures.size())
    return tl::unexpected<Error>(
        {ErrorCode::kInternal,
         fmt::format("reconstruction got {} pictures for {} views", pictures.size(), views.size())});
  for (std::size_t v = 0; v < views.size(); ++v)
    if (pictures[v].width != views[v].camera->width_px || pictures[v].height != views[v].camera->height_px)
      return InputError("picture {} has {} x {} pixels, but its camera {} has {} x {}", v, pictures[v].width,
                        pictures[v].height, views[v].camera->id, views[v].camera->width_px,
                        views[v].camera->height_px);
  for (const auto& known : options.known_lengths)
    if (known.part < 0 || known.part >= static_cast<int>(parts.size()) || known.dimension < 0 ||
        known.dimension >=
            static_cast<int>(parts[static_cast<std::size_t>(known.part)].object.dimensions_mm.size()))
      return InputError("a known length names dimension {} of part {}, which is not there", known.dimension,
                        known.part);
  if (parts.empty()) {
    Reconstruction nothing;
    for (const auto& v : views) nothing.cam_from_world.push_back(v.cam_from_world);
    return nothing;
  }
  return Reconstructor(views, pictures, parts, options, threads, progress).Run();
}

}  // namespace vss
