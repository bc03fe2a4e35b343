#include "vss/identify/contour_vote.h"

#include <algorithm>
#include <cmath>

#include "vss/identify/found_contours.h"

namespace vss {
namespace {

// A round edge is darker, or lighter, inside all around: so often a piece of one shows a clear step (see
// measured_contours.h) of the sign that most others show, and so often a piece of any other ring.
constexpr double kRisesTrue = 0.75, kRisesChance = 0.2;
// Of those longer than this (px) the pictures' own arcs tell more.
constexpr double kSmallRingPx = 120;
// And shadows run there beside whatever stands above.
constexpr double kChanceContact = 0.2;
// Samples closer than this along a contour stand or fall together: one line covers them.
constexpr double kIndependentPx = 25;
constexpr double kFullIndependent = 4;  // so many count fully, further ones by their logarithm
// Shadows, chamfers and rust pull so many lines off their contour.
constexpr double kPulled = 0.2;
// Ends of a ledge that are rather not there than there: so in none of forty true ones, in most that were made
// of a shadow.
constexpr double kOpenLedge = 8;
// Of two contours that cannot be resolved, or nearly so, the one that was not found is found this often.
constexpr double kDetectUnresolved = 0.3;
constexpr double kDetectCrowded = 0.45;
// And nearer than this the weaker is lost beside the stronger more often than not.
constexpr double kCrowdedPx = 5;

// Of one contour in one picture.
struct Tally {
  int visible = 0, open = 0, supported = 0;  // open: neither another part's nor unresolvable
  int stepped = 0;                           // without a line, but the grey values were asked
  int rises = 0, falls = 0, rings = 0;       // of a round edge: clear steps of either sign, pieces asked
  double px = 0, chance = 0, squared = 0;
  double steps = 0;  // log-odds of what the grey values say there
  double empty_px = 0;
  double ends = 0;  // log-odds of where the lines end
  double Share() const { return open > 0 ? double(supported) / open : 0; }
  // Log-odds of what the grey values say of a round edge as a whole, whichever side is dark.
  double Ring() const {
    const int same = std::max(rises, falls);
    return same * std::log(kRisesTrue / kRisesChance) +
           (rings - same) * std::log((1 - kRisesTrue) / (1 - kRisesChance)) - std::log(2);
  }
};

// Of each contour what its samples say.
std::span<const Tally> TallySamples(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                                    const std::function<bool(std::size_t)>& visible,
                                    const std::function<bool(std::size_t)>& taken) {
  static thread_local std::vector<Tally> tallies;
  tallies.assign(measured.contours.size(), {});
  for (std::size_t i = 0; i < in_view.samples.size(); ++i) {
    if (visible && !visible(i)) continue;
    const auto& m = in_view.samples[i];
    auto& t = tallies[std::size_t(m.contour)];
    ++t.visible;
    t.px += m.step_px;
    t.chance += m.chance;
    if (m.line >= 0 && taken && taken(i)) continue;
    ++t.open;
    if (m.rises) {
      ++t.rings;
      t.rises += *m.rises > 0;
      t.falls += *m.rises < 0;
    }
    if (m.asked) {
      ++t.stepped;
      t.steps += m.step;
      t.empty_px += m.empty ? m.step_px : 0;
    }
    if (m.line < 0 || m.lost != 0) continue;
    ++t.supported;
    t.squared += m.distance_px * m.distance_px;
    t.ends += m.ends;
  }
  return tallies;
}

// A true contour lies near its line (normal, sigma; now and then pulled off it), a chance one anywhere
// within the tolerance: the log-odds of the distances of a tally.
double NearLogOdds(const Tally& t, const SceneIndex& scene, bool rough) {
  if (t.supported == 0) return 0;
  const double sigma = rough ? kSigmaShare * scene.tolerance_px : scene.sigma_px;
  const double density = 2 * scene.tolerance_px / (sigma * std::sqrt(2 * kPi));
  return std::log((1 - kPulled) * density * std::exp(-t.squared / t.supported / (2 * sigma * sigma)) +
                  kPulled);
}

// Fills what the open pieces of contour `k` say.
void Judge(int k, const MeasuredContours::Contour& contour, std::span<const Tally> tallies,
           const Neighbour& near_by, const SceneIndex& scene, bool rough, ContourVote::Contour& c) {
  const Tally& t = tallies[std::size_t(k)];
  const double share = t.Share();
  c.open_px = t.px * t.open / t.visible;
  c.supported_px = share * c.open_px;
  c.empty_px = t.empty_px;
  c.squared = t.squared / std::max(1, t.supported) * c.supported_px;
  const double chance =
      std::max(t.chance / t.visible, contour.detect == kDetectContact ? kChanceContact : 0.0);
  // Of two crowded contours the one that was found was the stronger.
  const bool weaker = near_by.contour >= 0 && share < tallies[std::size_t(near_by.contour)].Share();
  const double beside = weaker || share == 0 ? near_by.distance_px : 1e9;
  const double crowded = beside < kResolvePx ? kDetectUnresolved : beside < kCrowdedPx ? kDetectCrowded : 1.0;
  const double detect = std::max(std::min(contour.detect, crowded), chance + 0.05);
  const double near = NearLogOdds(t, scene, rough);
  const double missed = t.open - t.supported - t.stepped;
  c.ends = contour.weight * t.ends;
  // A step beside another contour is that contour's as likely as this one's.
  const double steps = near_by.distance_px < kCrowdedPx ? std::min(t.steps, 0.0) : t.steps;
  c.per_piece = contour.weight * (share * (std::log(detect / chance) + near) + steps / t.open +
                                  missed / t.open * std::log((1 - detect) / (1 - chance)));
  if (t.rings == 0 || t.px >= kSmallRingPx) return;
  // Of two that run close together the clearer one has the steps.
  const double ring = t.Ring();
  const double other =
      near_by.distance_px < kCrowdedPx ? tallies[std::size_t(near_by.contour)].Ring() : -INFINITY;
  if (ring > other || (ring == other && k > near_by.contour))
    c.per_piece = std::max(c.per_piece, contour.weight * ring / IndependentPieces(c.open_px));
}

}  // namespace

double OpenLedges(const MeasuredContours& measured, std::span<const double> log_odds) {
  double sum = 0;
  for (const auto& ends : measured.ledge_ends) {
    double of_ends = 0;
    for (int k : ends) of_ends += log_odds[std::size_t(k)];
    if (of_ends < 0) sum -= kOpenLedge;
  }
  return sum;
}

double IndependentPieces(double px) {
  // A contour that is shorter is one observation all the same, if as long as the pieces that were measured.
  if (px < kIndependentPx) return std::min(px / kPiecePx, 1.0);
  const double pieces = px / kIndependentPx;
  return pieces < kFullIndependent ? pieces : kFullIndependent * (1 + std::log(pieces / kFullIndependent));
}

ContourVote VoteOf(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                   const std::function<bool(std::size_t)>& visible,
                   const std::function<bool(std::size_t)>& taken, const SceneIndex& scene, bool rough) {
  ContourVote out;
  const std::span<const Tally> tallies = TallySamples(measured, in_view, visible, taken);
  for (std::size_t k = 0; k < tallies.size(); ++k) {
    const Tally& t = tallies[k];
    if (t.visible == 0) continue;
    ContourVote::Contour c{.contour = int(k), .visible_px = t.px};
    if (t.open > 0) Judge(int(k), measured.contours[k], tallies, in_view.crowded[k], scene, rough, c);
    out.contours.push_back(c);
  }
  return out;
}

}  // namespace vss
