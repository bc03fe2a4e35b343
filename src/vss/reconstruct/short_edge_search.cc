#include "vss/reconstruct/short_edge_search.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "vss/base/parallel.h"
#include "vss/identify/hypothesis.h"
#include "vss/reconstruct/observability.h"

namespace vss {
namespace {

using Eigen::AlignedBox2i;
using Eigen::Vector2d;
using Eigen::Vector2i;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kSteps = 5;
constexpr double kTellsPx = 0.5;    // a short edge that moves less in its picture tells nothing of a step
constexpr double kAroundPx = 2;     // seen around the edges, beyond where they may come to lie
constexpr int kLargestPx = 64;      // of a window
constexpr double kPixelsAlike = 4;  // whose misfit is one observation: blur, texture and shadows
// Log-likelihood, of all pictures together; more than one must speak for it; and of one picture more than so
// much counts by its logarithm only, for a shadow or something else may lie over the place there.
constexpr double kClear = 6, kSpeaks = 1, kMuchOfPicture = 6;
constexpr int kLeastSpeaking = 2;

struct Window {
  std::size_t view;
  AlignedBox2i box;
};

// What to compare as the edges move by up to `reach_px`: where windows of one picture overlap, one around
// both.
std::vector<Window> WindowsAround(std::span<const SeenShortEdge> edges, double reach_px,
                                  const SeenPictures& pictures) {
  std::map<std::size_t, std::vector<AlignedBox2i>> boxes;
  for (const auto& e : edges) {
    AlignedBox2i box;
    for (const double side : {-1.0, 1.0}) {
      const Vector2d& n = e.piece.curve.normal;
      const Vector2d end = e.piece.curve.point + side * e.piece.half_length_px * Vector2d(n.y(), -n.x());
      box.extend((end.array() - reach_px).floor().matrix().cast<int>().eval());
      box.extend((end.array() + reach_px).ceil().matrix().cast<int>().eval());
    }
    auto& there = boxes[e.view];
    for (std::size_t i = 0; i < there.size();) {
      const AlignedBox2i both = box.merged(there[i]);
      if (!box.intersects(there[i]) || both.sizes().maxCoeff() >= kLargestPx) {
        ++i;
        continue;
      }
      box = both;
      there.erase(there.begin() + static_cast<std::ptrdiff_t>(i));
      i = 0;
    }
    there.push_back(box);
  }
  std::vector<Window> out;
  for (const auto& [v, all] : boxes)
    for (const auto& box : all) {
      const Vector2i last(pictures.pictures[v].width - 1, pictures.pictures[v].height - 1);
      const AlignedBox2i inside = box.intersection(AlignedBox2i(Vector2i::Zero(), last));
      if (!inside.isEmpty()) out.push_back({v, inside});
    }
  return out;
}

// Of each window the negative log-likelihood of the parts as they stand, but for a constant.
std::vector<double> Unlikelihoods(std::span<const AdjustedPart> parts, std::span<const Window> windows,
                                  const SeenPictures& pictures) {
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object, false));
  std::vector<double> out(windows.size());
  ParallelFor(windows.size(), pictures.threads, [&](std::size_t w) {
    const auto& [v, box] = windows[w];
    const PictureState& state = pictures.states[v];
    const GreyMisfit m = MisfitOfGreys(pictures.pictures[v], pictures.views[v],
                                       FacesSeen(solids, pictures.views[v]), box, state.blur_px);
    const double noise = std::max(1.0, state.noise * state.noise) * m.num_pixels;
    out[w] = m.num_pixels / kPixelsAlike / 2 * std::log(std::max(m.sum_squares, noise));
  });
  return out;
}

double Counted(double gain) {
  return std::copysign(kMuchOfPicture * std::log1p(std::abs(gain) / kMuchOfPicture), gain);
}

}  // namespace

std::vector<VectorXd> OpenDirections(const Adjustment& adjustment, std::size_t part,
                                     std::span<const SeenShortEdge> edges, const VectorXd& known, double gain,
                                     const SeenPictures& pictures) {
  const AdjustedPart& p = adjustment.parts[part];
  std::vector<Eigen::Index> free;
  for (std::size_t i = 0; i < p.free.size(); ++i)
    if (p.free[i]) free.push_back(static_cast<Eigen::Index>(i));
  const VectorXd known_free = known(free);
  const auto seen =
      AnalyseObservability(adjustment.DataInformation(static_cast<int>(part))(free, free), known_free, gain);
  const WorldSolid solid = PlaceSolid(p.object);
  const auto tells = [&](const SeenShortEdge& edge, const VectorXd& step) {
    const auto& s = edge.piece.sample;
    const View& view = pictures.views[edge.view];
    const Vector3d moved = s.point_in_world + SampleByState(solid, s) * step;
    const auto from = view.ProjectIdeal(s.point_in_world), to = view.ProjectIdeal(moved);
    return from && to && std::abs((*to - *from).dot(edge.piece.curve.normal)) > kTellsPx;
  };
  std::vector<VectorXd> out;
  for (Eigen::Index k = 0; k < seen.singular_values.size(); ++k) {
    VectorXd step = VectorXd::Zero(p.object.StateSize());
    step(free) = known_free.cwiseProduct(seen.directions.col(k));
    double moves_mm = 0;
    for (const auto& v : solid.vertices) moves_mm = std::max(moves_mm, (v.by_state * step).norm());
    if (seen.singular_values[k] >= gain || moves_mm == 0) continue;
    step *= pictures.mm_per_px / moves_mm;
    if (std::any_of(edges.begin(), edges.end(), [&](const auto& e) { return tells(e, step); }))
      out.push_back(std::move(step));
  }
  return out;
}

std::optional<VectorXd> BestAlong(std::vector<AdjustedPart> parts, std::size_t part, const VectorXd& step,
                                  std::span<const SeenShortEdge> edges, const SeenPictures& pictures) {
  const auto windows = WindowsAround(edges, kSteps + kAroundPx, pictures);
  PlacedObject& object = parts[part].object;
  const VectorXd state = object.State();
  const std::vector<double> now = Unlikelihoods(parts, windows, pictures);
  std::optional<VectorXd> best;
  double most = kClear;
  for (int k = -kSteps; k <= kSteps; ++k) {
    object.SetState(state + k * step);
    if (k == 0 || !InRange(object, 0)) continue;
    const std::vector<double> then = Unlikelihoods(parts, windows, pictures);
    std::map<std::size_t, double> of_picture;
    for (std::size_t w = 0; w < windows.size(); ++w) of_picture[windows[w].view] += now[w] - then[w];
    double gain = 0;
    int speaking = 0;
    for (const auto& [view, of_this] : of_picture) {
      gain += Counted(of_this);
      speaking += of_this > kSpeaks;
    }
    if (gain > most && speaking >= kLeastSpeaking) most = gain, best = state + k * step;
  }
  return best;
}

}  // namespace vss
