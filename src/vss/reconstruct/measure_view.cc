#include "vss/reconstruct/measure_view.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

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

// How much a piece of contour speaks for its part's being there: its length in px, half of it for an edge
// exactly where it should be, half against it for none within reach.
double SupportOf(const ContourPiece& piece, const std::optional<ProfileFit>& fit, double search_px) {
  const double off = fit ? fit->offset_px / search_px : 1;
  return (0.5 - std::min(1.0, off * off)) * 2 * piece.half_length_px;
}

}  // namespace

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
  out.support.assign(solids.size(), 0);
  std::map<std::pair<int, int>, std::size_t> index;
  std::vector<int> contacts;  // of each group: pieces that lie on something, less the others
  for (const auto& piece : CutContour(solids, others, view, cut)) {
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
    out.support[static_cast<std::size_t>(piece.part)] += SupportOf(piece, fit, request.search_px);
    if (!fit) continue;
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
    auto& group = out.groups[at->second];
    contacts[at->second] += piece.edge_class == ContourClass::kContact ? 1 : -1;
    Observation o;
    o.sample = piece.sample;
    o.normal = piece.curve.normal;
    o.measured = piece.curve.point + fit->offset_px * piece.curve.normal;
    o.half_length_px = piece.half_length_px;
    o.sigma_px = std::hypot(fit->sigma_px, kShortPieceError / (piece.half_length_px * piece.half_length_px));
    o.contrast = fit->contrast;
    group.observations.push_back(o);
    if (piece.neighbours.empty() && fit->sigma_px < kClearBlur * state.blur_px) {
      out.blurs.push_back(fit->blur_px);
      if (piece.edge_class != ContourClass::kLimb)
        for (std::size_t side = 0; side < 2; ++side)
          out.slopes.emplace_back(fit->slope[side], fit->slope_sigma[side]);
    }
    out.noises.push_back(fit->rms);
  }
  for (std::size_t i = 0; i < out.groups.size(); ++i)
    if (contacts[i] > 0) out.groups[i].edge_class = ContourClass::kContact;
  for (auto& group : out.groups) KeepOnePolarity(group);
  std::erase_if(out.groups, [](const auto& g) { return g.observations.empty(); });
  return out;
}

}  // namespace vss
