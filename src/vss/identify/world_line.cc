#include "vss/identify/world_line.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "vss/base/parallel.h"
#include "vss/identify/edge_fitter.h"
#include "vss/identify/edge_pairing.h"

namespace vss {
namespace {

using Direction = WorldLine::Direction;

using Explained = std::vector<std::vector<std::optional<EdgeCandidate>>>;  // by view and paired segment

// The explanations, those of most views first.
std::vector<const EdgeCandidate*> InOrder(const Explained& explained) {
  std::vector<const EdgeCandidate*> order;
  for (const auto& view : explained)
    for (const auto& c : view)
      if (c) order.push_back(&*c);
  std::stable_sort(order.begin(), order.end(), [](const EdgeCandidate* a, const EdgeCandidate* b) {
    if (a->num_views != b->num_views) return a->num_views > b->num_views;
    return a->support_px > b->support_px;
  });
  return order;
}

}  // namespace

double AgreementPx(std::span<const WorldLine> lines) {
  constexpr int kMinViews = 4;  // two pictures always agree, three often
  constexpr std::size_t kMinLines = 8;
  constexpr double kBetter = 0.25;  // quantile: the rest are often mixtures of two edges that lie close
  std::vector<double> rms;
  for (const auto& l : lines)
    if (l.num_views >= kMinViews) rms.push_back(l.rms_px);
  if (rms.size() < kMinLines) return 0;
  std::sort(rms.begin(), rms.end());
  return rms[std::size_t(kBetter * double(rms.size()))];
}

std::vector<WorldLine> FindWorldLines(std::span<const View> views, std::span<const LineIndex> indices,
                                      const WorldLineOptions& options, int threads,
                                      const Progress& progress) {
  const EdgeFitter fitter(views, indices, options);
  const EdgePairing pairing(fitter, indices);
  Explained explained(views.size());
  ParallelFor(views.size(), threads, [&](std::size_t i) {
    if (progress.Cancelled()) return;
    for (const int k : pairing.Paired(int(i))) explained[i].push_back(pairing.Explain(int(i), k));
  });
  std::vector<std::vector<bool>> claimed(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) claimed[i].resize(indices[i].lines().size());
  std::vector<WorldLine> out;
  for (const EdgeCandidate* base : InOrder(explained)) {
    const LineRef& first = base->support.front();
    if (claimed[std::size_t(first.view)][std::size_t(first.line)]) continue;
    EdgeCandidate c = *base;
    std::erase_if(c.support,
                  [&](const LineRef& r) { return claimed[std::size_t(r.view)][std::size_t(r.line)]; });
    fitter.Count(c);
    if (c.num_views < (c.kind == Direction::kInclined ? 3 : 2)) continue;
    fitter.Refine(c);
    fitter.Grow(c);
    std::erase_if(c.support,
                  [&](const LineRef& r) { return claimed[std::size_t(r.view)][std::size_t(r.line)]; });
    fitter.Count(c);
    const double rms = fitter.Rms(c);
    if (rms > options.tolerance_px) continue;
    std::sort(c.support.begin(), c.support.end(), [](const LineRef& a, const LineRef& b) {
      return std::pair(a.view, a.line) < std::pair(b.view, b.line);
    });
    for (const LineRef& r : c.support) claimed[std::size_t(r.view)][std::size_t(r.line)] = true;
    out.push_back({c.kind, c.start, c.end, c.support, c.num_views, c.num_stops, rms, fitter.Sensitivity(c)});
  }
  return out;
}

std::vector<WorldLine> LevelLines(const View& view, const LineIndex& index, double z_mm,
                                  double min_length_px) {
  constexpr double kMinSlope = 0.05;  // rays nearer to the horizon say nothing
  std::vector<WorldLine> out;
  for (int k = 0; k < index.num_segments(); ++k) {
    const ViewLine& l = index.lines()[std::size_t(k)];
    if (l.length_px < min_length_px) continue;
    WorldLine line;
    line.start = line.end = view.center_in_world;
    line.lines = {{0, k}};
    line.num_views = line.num_stops = 1;
    const double rise = z_mm - view.center_in_world.z();
    if (rise / l.ray_start.z() > 0 && rise / l.ray_end.z() > 0 && std::abs(l.ray_start.z()) > kMinSlope &&
        std::abs(l.ray_end.z()) > kMinSlope && l.plane_normal.head<2>().norm() > kMinPlaneTilt) {
      line.start += l.ray_start * (rise / l.ray_start.z());
      line.end += l.ray_end * (rise / l.ray_end.z());
    }
    out.push_back(std::move(line));
  }
  return out;
}

}  // namespace vss
