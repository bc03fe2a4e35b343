#include "vss/reconstruct/measure_view.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "vss/base/median.h"
#include "vss/reconstruct/short_edge.h"

namespace vss {
namespace {

constexpr double kMinPolarityShare = 0.5;

// An edge keeps its bright side in one picture: of its points those go that say otherwise than most.
void KeepOnePolarity(ObservationGroup& group) {
  double sum = 0, total = 0;
  for (const auto& o : group.observations) {
    sum += o.contrast / o.sigma_px;
    total += std::abs(o.contrast) / o.sigma_px;
  }
  if (std::abs(sum) < kMinPolarityShare * total) {
    group.observations.clear();
    return;
  }
  std::erase_if(group.observations, [&](const Observation& o) { return (o.contrast > 0) != (sum > 0); });
}

// Whether the step may be the border of the part's shadow: see ContourClass::kShadowed.
bool MayBeShadowed(const ContourPiece& piece, double contrast) {
  // Higher above, the shadow's border lies farther away than an edge is looked for, but under a lamp that
  // stands nearly where the camera does (accuracy_pulls).
  constexpr double kHighestPx = 12;
  return piece.background * contrast > 0 && piece.above_foot_px < kHighestPx;
}

// What a shadow may lie behind is another group than the rest of its contour: of an edge all or nothing, of a
// rim the part of it that has one.
void SetShadowedApart(std::vector<ObservationGroup>& groups) {
  const auto is_shadowed = [](const Observation& o) { return o.shadowed; };
  for (std::size_t i = 0, n = groups.size(); i < n; ++i) {
    if (groups[i].edge_class == ContourClass::kContact || groups[i].observations.empty()) continue;
    auto& all = groups[i].observations;
    const auto count = static_cast<std::size_t>(std::count_if(all.begin(), all.end(), is_shadowed));
    const bool rim = all[0].sample.source == ContourSample::Source::kCircle;
    if (count == all.size() || (!rim && 2 * count > all.size()))
      groups[i].edge_class = ContourClass::kShadowed;
    if (!rim || count == 0 || count == all.size()) continue;
    ObservationGroup apart = groups[i];
    apart.edge_class = ContourClass::kShadowed;
    std::erase_if(apart.observations, [&](const auto& o) { return !is_shadowed(o); });
    std::erase_if(all, is_shadowed);
    groups.push_back(std::move(apart));
  }
}

// How much an edge speaks for its part's being there: its length in px, half of it for one exactly where it
// should be, half against it for none within reach; steps anywhere, as texture has them, speak neither for
// nor against.
double SupportOf(const ContourPiece& piece, const std::optional<ProfileFit>& fit, double search_px) {
  constexpr double kSpread = 16 / 9.0;  // so that offsets spread evenly over the reach add up to nothing
  const double off = fit ? fit->offset_px / search_px : 1;
  return (0.5 - std::min(1.0, kSpread * off * off)) * 2 * piece.half_length_px;
}

}  // namespace

PictureState StateBefore(const View& view) {
  constexpr double kSharpestPx = 0.4, kBluntestPx = 4;
  PictureState state;
  if (!view.lines) return state;
  std::vector<double> blurs;
  for (const auto& l : view.lines->segments)
    if (l.blur_px > 0) blurs.push_back(l.blur_px);
  state.blur_px = std::clamp(Median(blurs, state.blur_px), kSharpestPx, kBluntestPx);
  state.noise = view.lines->noise_sigma;
  return state;
}

Measured MeasureView(std::span<const WorldSolid> solids, std::span<const Occluders> others, const View& view,
                     int view_index, const GreyView& picture, const PictureState& state,
                     const MeasureOptions& options) {
  constexpr double kReachBlurs = 3.2;  // a step has ended that many blurs from its middle
  // Where the light is known to be even, farther pixels tell an edge's two levels, too.
  constexpr double kMinReachPx = 2.5, kEvenReachPx = 4, kEvenSlope = 0.01;
  // What surrounds a piece (crossing contours' blur, shading) pulls it the more the shorter it is, px * px:
  // the scatter of rendered surveys' edges that consist of one short piece.
  constexpr double kShortPieceError = 0.3;
  constexpr double kClearBlur = 0.12;  // relative: strips whose contrast allows to learn the blur from
  PieceOptions cut;
  cut.only_part = options.only_part;
  cut.length_px = options.piece_length_px * std::max(1.0, state.blur_px);
  cut.reach_px = std::max(state.slope_sigma < kEvenSlope ? kEvenReachPx : kMinReachPx,
                          options.search_px + kReachBlurs * state.blur_px);
  cut.min_gap_px = 1.9 * state.blur_px;
  cut.vertex_margin_px = 2 * state.blur_px + 0.7;
  Measured out;
  out.short_support.assign(solids.size(), 0);
  std::map<std::pair<int, int>, std::size_t> index;
  std::vector<int> contacts;  // of each group: pieces that lie on something, less the others
  const auto take = [&](const ContourPiece& piece, const ProfileFit& fit, bool is_short) {
    const auto key = std::pair(piece.part, ContourKey(piece.sample));
    const auto [at, fresh] = index.insert({key, out.groups.size()});
    if (fresh) {
      ObservationGroup group;
      group.part = piece.part;
      group.view = view_index;
      group.contour = key.second;
      if (piece.edge_class == ContourClass::kLimb) group.edge_class = ContourClass::kLimb;
      out.groups.push_back(std::move(group));
      contacts.push_back(0);
    }
    contacts[at->second] += piece.edge_class == ContourClass::kContact ? 1 : -1;
    Observation o;
    o.sample = piece.sample;
    o.normal = piece.curve.normal;
    o.measured = piece.curve.point + fit.offset_px * piece.curve.normal;
    o.half_length_px = piece.half_length_px;
    o.sigma_px = std::hypot(fit.sigma_px, kShortPieceError / (piece.half_length_px * piece.half_length_px));
    o.contrast = fit.contrast;
    o.shadowed = MayBeShadowed(piece, fit.contrast);
    o.bright_behind = piece.background * fit.contrast > 0;
    o.saturated = fit.saturated;
    o.is_short = is_short;
    for (const auto& n : piece.neighbours)
      o.neighbour_blurs =
          std::min(o.neighbour_blurs, std::abs(n.Distance(piece.curve.point)) / state.blur_px);
    out.groups[at->second].observations.push_back(o);
  };
  std::vector<ShortEdge> short_edges;
  for (const auto& piece : CutContour(solids, others, view, cut, &short_edges)) {
    ProfileRequest request;
    request.curve = piece.curve;
    request.half_length_px = piece.half_length_px;
    request.reach_minus_px = piece.reach_minus_px;
    request.reach_plus_px = piece.reach_plus_px;
    request.search_px = std::min(options.search_px, std::min(piece.reach_minus_px, piece.reach_plus_px));
    request.blur_px = state.blur_px;
    request.blur_sigma_px = state.blur_sigma_px;
    // A cylinder's outline is shaded however even the light.
    request.slope_sigma = piece.edge_class == ContourClass::kLimb ? kAnySlope : state.slope_sigma;
    request.neighbours = piece.neighbours;
    const auto fit = FitProfile(picture, request, state.noise);
    if (!fit) continue;
    take(piece, *fit, false);
    if (fit->saturated) continue;
    if (piece.neighbours.empty() && fit->sigma_px < kClearBlur * state.blur_px) {
      out.blurs.push_back(fit->blur_px);
      if (piece.edge_class != ContourClass::kLimb)
        for (std::size_t side = 0; side < 2; ++side)
          out.slopes.emplace_back(fit->slope[side], fit->slope_sigma[side]);
    }
    out.noises.push_back(fit->rms);
  }
  if (options.short_edges && !short_edges.empty()) {
    const FacesSeen faces(solids, view);
    for (const auto& edge : short_edges) {
      const auto fit =
          FitShortEdge(picture, view, faces, edge, state.blur_px, state.noise, options.search_px);
      out.short_edges.push_back(edge.piece);
      out.short_support[static_cast<std::size_t>(edge.piece.part)] +=
          SupportOf(edge.piece, fit, options.search_px);
      if (fit) take(edge.piece, *fit, true);
    }
  }
  for (std::size_t i = 0; i < out.groups.size(); ++i)
    if (contacts[i] > 0) out.groups[i].edge_class = ContourClass::kContact;
  for (auto& group : out.groups) KeepOnePolarity(group);
  SetShadowedApart(out.groups);
  std::erase_if(out.groups, [](const auto& g) { return g.observations.empty(); });
  return out;
}

}  // namespace vss
