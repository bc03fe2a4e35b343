#include "vss/identify/explained.h"

namespace vss {
namespace {

// The first chord of an arc in its picture's line index.
std::size_t ChordOf(const LineRef& arc, const SceneIndex& scene) {
  const auto& index = scene.lines[std::size_t(arc.view)];
  for (std::size_t k = std::size_t(index.num_segments()); k < index.lines().size(); ++k)
    if (index.lines()[k].arc == arc.line) return k;
  return 0;
}

// A line; of an arc all of it.
void ClaimLine(int v, int line, const SceneIndex& scene, Claims& claims) {
  auto& claimed = claims[std::size_t(v)];
  const auto& lines = scene.lines[std::size_t(v)].lines();
  const int arc = lines[std::size_t(line)].arc;
  claimed[std::size_t(line)] = true;
  if (arc < 0) return;
  for (std::size_t k = std::size_t(scene.lines[std::size_t(v)].num_segments()); k < lines.size(); ++k)
    if (lines[k].arc == arc) claimed[k] = true;
}

// The lines on which the item's visible contour lies.
void Claim(const SceneItem& item, const SceneIndex& scene, Claims& claims) {
  const WorldSolid solid = item.Solid();
  for (int v : ViewsThatSee(solid, scene.views, int(scene.views.size())))
    for (const auto& s : SampleContour(solid, scene.views[std::size_t(v)], 6, 3)) {
      if (!s.visible) continue;
      const LineHit hit = scene.Match(v, s, scene.tolerance_px, 0.9962);
      if (hit.line >= 0) ClaimLine(v, hit.line, scene, claims);
    }
}

}  // namespace

Explained ExplainedBy(std::span<const int> items, const SceneData& data) {
  Explained known;
  known.claims.resize(data.views.size());
  for (std::size_t v = 0; v < data.views.size(); ++v)
    known.claims[v].resize(data.index.lines[v].lines().size());
  for (int i : items) {
    known.others.Add(data.items[i].Solid(), i);
    Claim(data.items[i], data.index, known.claims);
  }
  return known;
}

bool Explains(const Claims& claims, const WorldLine& l, const SceneIndex& scene) {
  constexpr double kMost = 0.5;
  double all = 0, done = 0;
  for (const auto& r : l.lines) {
    const double px = scene.lines[std::size_t(r.view)].lines()[std::size_t(r.line)].length_px;
    all += px;
    if (claims[std::size_t(r.view)][std::size_t(r.line)]) done += px;
  }
  return done > kMost * all;
}

bool Explains(const Claims& claims, const WorldCircle& circle, const SceneIndex& index) {
  const LineRef& arc = circle.arcs[0];
  return claims[std::size_t(arc.view)][ChordOf(arc, index)];
}

}  // namespace vss
