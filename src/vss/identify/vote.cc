#include "vss/identify/vote.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxPeaks = 7;

// How far it is to a line, and how much that counts.
struct Vote {
  double far, weight;
  auto operator<=>(const Vote&) const = default;
};

std::vector<Vote> Votes(const PlacedObject& o, const Eigen::VectorXd& direction, double least, double most,
                        std::span<const int> views, const SceneIndex& scene) {
  const WorldSolid solid = PlaceSolid(o);
  std::vector<Vote> votes;
  const ContourSampling sampling{
      .spacing_px = 12, .min_samples = 2, .max_samples = 8, .img = false, .visibility = false};
  for (int v : views) {
    const View& view = scene.views[std::size_t(v)];
    for (const auto& s : SampleContour(solid, view, sampling)) {
      const Vector3d motion = SampleByState(solid, s) * direction;
      if (motion.squaredNorm() < 1e-4) continue;
      const auto ahead = view.ProjectIdeal(s.point_in_world + motion);
      if (!ahead) continue;
      const Vector2d step = *ahead - s.ideal;  // px per unit of the way
      const Vector2d normal(-s.ideal_tangent.y(), s.ideal_tangent.x());
      const double across = step.dot(normal);
      if (std::abs(across) < 0.2 / scene.mm_per_px) continue;
      scene.lines[std::size_t(v)].ForParallel(s.ideal_tangent, [&](const ViewLine& l) {
        const double far = (l.start - s.ideal).dot(l.normal) / step.dot(l.normal);
        if (!(far >= least && far <= most)) return;
        const double along = (s.ideal + far * step - l.start).dot(l.direction);
        if (along < -1 || along > l.length_px + 1) return;
        votes.push_back({far, std::abs(across) * scene.mm_per_px});
      });
    }
  }
  std::sort(votes.begin(), votes.end());
  return votes;
}

// Where the votes lie thickest, no two nearer than one and a half widths.
std::vector<double> Peaks(std::span<const Vote> votes, double width) {
  std::vector<double> prefix(votes.size() + 1);
  for (std::size_t i = 0; i < votes.size(); ++i) prefix[i + 1] = prefix[i] + votes[i].weight;
  std::vector<std::pair<double, double>> windows;  // weight, how far
  for (std::size_t i = 0, j = 0; i < votes.size(); ++i) {
    while (j < votes.size() && votes[j].far <= votes[i].far + width) ++j;
    windows.push_back({prefix[j] - prefix[i], votes[(i + j - 1) / 2].far});
  }
  std::stable_sort(windows.begin(), windows.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<double> peaks;
  for (const auto& w : windows) {
    if (int(peaks.size()) == kMaxPeaks) break;
    const bool near = std::any_of(peaks.begin(), peaks.end(),
                                  [&](double p) { return std::abs(p - w.second) < 1.5 * width; });
    if (!near) peaks.push_back(w.second);
  }
  return peaks;
}

}  // namespace

std::vector<double> VoteAlong(const PlacedObject& o, const Eigen::VectorXd& direction, double least,
                              double most, std::span<const int> views, const SceneIndex& scene) {
  return Peaks(Votes(o, direction, least, most, views, scene), scene.mm_per_px);
}

}  // namespace vss
