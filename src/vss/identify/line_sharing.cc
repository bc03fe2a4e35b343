#include "vss/identify/line_sharing.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;

// Two contours contend for a line where they share so much of the piece of it that the one covers.
constexpr double kShared = 0.3;

// So many hits of one contour on one line, and the piece of it that they cover.
struct Run {
  int contour, line, count = 0;
  double distance = 0, lo = 1e300, hi = -1e300;

  double MeanDistance() const { return distance / count; }
};

std::vector<Run> RunsOf(std::span<const Hit> hits) {
  std::vector<Run> runs;
  for (const Hit& h : hits) {
    auto it = std::find_if(runs.begin(), runs.end(),
                           [&](const Run& r) { return r.contour == h.contour && r.line == h.line; });
    if (it == runs.end()) it = runs.insert(runs.end(), {h.contour, h.line});
    ++it->count;
    it->distance += h.distance;
    it->lo = std::min(it->lo, h.along);
    it->hi = std::max(it->hi, h.along);
  }
  return runs;
}

// Marks the hits of `mine`, whose line is nearer to the contour of `other`.
void Lose(const Run& mine, const Run& other, std::span<const Hit> hits,
          std::span<const ContourSample> samples, std::vector<int>& lost) {
  for (const Hit& h : hits) {
    if (h.contour != mine.contour || h.line != mine.line) continue;
    const ContourSample& sample = samples[std::size_t(h.sample)];
    const Vector2d normal(-sample.ideal_tangent.y(), sample.ideal_tangent.x());
    double nearest = 1e300;
    for (const Hit& o : hits)
      if (o.contour == other.contour && o.line == h.line)
        nearest =
            std::min(nearest, std::abs((samples[std::size_t(o.sample)].ideal - sample.ideal).dot(normal)));
    int& mark = lost[std::size_t(h.sample)];
    mark = std::max(mark, nearest < kResolvePx ? 1 : 2);
  }
}

// For each circle the nearest other one that runs beside it, by the median of its samples.
void NearestRing(std::span<const ContourSample> samples, const Numbering& numbering,
                 std::vector<Neighbour>& nearest) {
  std::vector<std::vector<const ContourSample*>> rings;
  for (const auto& s : samples) {
    if (!s.visible || s.source != ContourSample::Source::kCircle) continue;
    if (rings.empty() || rings.back()[0]->index != s.index) rings.emplace_back();
    rings.back().push_back(&s);
  }
  std::vector<double> distances;
  for (const auto& a : rings)
    for (const auto& b : rings) {
      if (&a == &b) continue;
      distances.clear();
      for (const auto* s : a) {
        const auto* best = *std::min_element(b.begin(), b.end(), [&](const auto* p, const auto* q) {
          return (p->ideal - s->ideal).squaredNorm() < (q->ideal - s->ideal).squaredNorm();
        });
        distances.push_back(std::abs(
            (best->ideal - s->ideal).dot(Vector2d(-best->ideal_tangent.y(), best->ideal_tangent.x()))));
      }
      const auto middle = distances.begin() + std::ptrdiff_t(distances.size() / 2);
      std::nth_element(distances.begin(), middle, distances.end());
      auto& near = nearest[std::size_t(numbering.Of(*a[0]))];
      if (*middle < near.distance_px) near = {*middle, numbering.Of(*b[0])};
    }
}

}  // namespace

Hit HitOf(const LineHit& hit, const ContourSample& s, int contour, int sample, const LineIndex& index) {
  const auto& l = index.lines()[std::size_t(hit.line)];
  const bool round = l.arc >= 0 && s.source == ContourSample::Source::kCircle && s.t_step > 0;
  return {contour, l.arc < 0 ? hit.line : index.num_segments() + l.arc, sample, std::abs(hit.distance_px),
          round ? s.t / s.t_step * s.step_px : (s.ideal - l.start).dot(l.direction)};
}

void ShareLines(std::span<const Hit> hits, std::span<const ContourSample> samples, std::vector<int>& lost) {
  const std::vector<Run> runs = RunsOf(hits);
  for (std::size_t i = 0; i < runs.size(); ++i)
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (i == k || runs[i].line != runs[k].line) continue;
      const double mine = runs[i].MeanDistance(), other = runs[k].MeanDistance();
      if (mine < other || (mine == other && i < k)) continue;
      const double common = std::min(runs[i].hi, runs[k].hi) - std::max(runs[i].lo, runs[k].lo);
      if (common >= kShared * (runs[i].hi - runs[i].lo)) Lose(runs[i], runs[k], hits, samples, lost);
    }
}

std::vector<Neighbour> NearestParallel(std::span<const ContourSample> samples, const Numbering& numbering,
                                       double min_cosine) {
  std::vector<Neighbour> nearest(static_cast<std::size_t>(numbering.total));
  struct Middle {
    int contour;
    const ContourSample *first, *last;
  };
  std::vector<Middle> runs;
  for (const auto& s : samples) {
    if (!s.visible) continue;
    if (runs.empty() || runs.back().contour != numbering.Of(s)) runs.push_back({numbering.Of(s), &s, &s});
    runs.back().last = &s;
  }
  std::erase_if(runs, [](const Middle& r) { return r.first->source == ContourSample::Source::kCircle; });
  NearestRing(samples, numbering, nearest);
  for (const auto& a : runs) {
    const Vector2d middle = (a.first->ideal + a.last->ideal) / 2;
    const Vector2d along = a.first->ideal_tangent;
    for (const auto& b : runs) {
      if (a.contour == b.contour || std::abs(along.dot(b.first->ideal_tangent)) < min_cosine) continue;
      const double s0 = (b.first->ideal - middle).dot(along), s1 = (b.last->ideal - middle).dot(along);
      const double half = std::abs((a.last->ideal - middle).dot(along));
      if (std::min(std::max(s0, s1), half) < std::max(std::min(s0, s1), -half)) continue;
      const double distance = std::abs((b.first->ideal - middle).dot(Vector2d(-along.y(), along.x())));
      auto& best = nearest[std::size_t(a.contour)];
      if (distance < best.distance_px) best = {distance, b.contour};
    }
  }
  return nearest;
}

}  // namespace vss
