#include "vss/identify/explained.h"

#include <algorithm>

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
std::vector<LineRef> LinesOf(const SceneItem& item, const SceneIndex& scene) {
  std::vector<LineRef> found;
  const WorldSolid solid = item.Solid();
  for (int v : ViewsThatSee(solid, scene, int(scene.views.size())))
    for (const auto& s : SampleContour(solid, scene.views[std::size_t(v)], 6, 3)) {
      if (!s.visible) continue;
      const LineHit hit = scene.Match(v, s, scene.tolerance_px, 0.9962);
      const LineRef line{v, hit.line};
      if (hit.line >= 0 && std::find(found.rbegin(), found.rend(), line) == found.rend())
        found.push_back(line);
    }
  return found;
}

Claims ClaimsOf(std::span<const int> items, int left_out, const SceneData& data) {
  Claims claims(data.views.size());
  for (std::size_t v = 0; v < data.views.size(); ++v) claims[v].resize(data.index.lines[v].lines().size());
  for (int i : items)
    if (i != left_out)
      for (const LineRef& r : *data.items[i].claimed) ClaimLine(r.view, r.line, data.index, claims);
  return claims;
}

}  // namespace

Explained ExplainedBy(std::span<const int> items, SceneData& data) {
  Explained known;
  for (int i : items) {
    auto& claimed = data.items[i].claimed;
    if (!claimed) claimed = LinesOf(data.items[i], data.index);
    known.others.Add(data.items[i].Solid(), i);
  }
  known.others.Prepare(data.views);
  known.claims = ClaimsOf(items, SceneItems::kGround, data);
  return known;
}

Explained ExplainedWithout(int item, const Explained& known, std::span<const int> items,
                           const SceneData& data) {
  return {known.others.Without(item), ClaimsOf(items, item, data)};
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
