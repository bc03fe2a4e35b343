#include "vss/identify/open_ends.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vss/identify/weigh.h"

namespace vss {
namespace {

// Of 123 pairs of ends of true parts, drawn and rendered, the one that was found better was found on 0.28 of
// its length at least; of six lengths of cable taken for bars on 0.18 at most.
constexpr double kMissing = 0.2, kFound = 0.4;
// A mean length in a picture (px) and a number of pictures from which on an end is found where it is.
constexpr double kLeastPx = 7;
constexpr int kLeastViews = 5;
// No cable, hose or painted line is thicker.
constexpr double kThickestCableMm = 60;

bool IsUpright(const SolidFace& face) {
  constexpr double kLevel = 0.02;  // sine
  return !face.is_cylinder && std::abs(face.normal_in_part.z()) < kLevel;
}

void Add(const EdgeShown& edge, EdgeShown& all) {
  all.num_views = std::max(all.num_views, edge.num_views);
  all.open_px += edge.open_px;
  all.supported_px += edge.supported_px;
}

bool IsMissing(const EdgeShown& end) {
  return end.num_views >= kLeastViews && end.open_px >= kLeastPx * end.num_views && end.Share() < kMissing;
}

// Two upright plane faces that look away from each other, and the edges that run from one to the other.
struct OppositeEnds {
  EdgeShown ends[2], sides;
};

std::vector<OppositeEnds> FindOppositeEnds(const WorldSolid& solid, std::span<const EdgeShown> by_edge) {
  constexpr double kOpposite = -0.999;  // cosine
  std::vector<OppositeEnds> out;
  const int n = int(solid.faces.size());
  const auto face = [&](int f) -> const SolidFace& { return solid.faces[std::size_t(f)]; };
  const auto bounds = [&](int f, const SolidEdge& e) { return e.left_face == f || e.right_face == f; };
  const auto touches = [&](int f, int vertex) {
    return std::any_of(solid.edges.begin(), solid.edges.end(), [&](const SolidEdge& e) {
      return bounds(f, e) && (e.start == vertex || e.end == vertex);
    });
  };
  for (int a = 0; a < n; ++a)
    for (int b = a + 1; b < n; ++b) {
      if (!IsUpright(face(a)) || !IsUpright(face(b)) ||
          face(a).normal_in_part.dot(face(b).normal_in_part) > kOpposite)
        continue;
      OppositeEnds pair;
      for (std::size_t i = 0; i < solid.edges.size(); ++i) {
        const SolidEdge& e = solid.edges[i];
        if (bounds(a, e))
          Add(by_edge[i], pair.ends[0]);
        else if (bounds(b, e))
          Add(by_edge[i], pair.ends[1]);
        else if ((touches(a, e.start) && touches(b, e.end)) || (touches(b, e.start) && touches(a, e.end)))
          Add(by_edge[i], pair.sides);
      }
      out.push_back(pair);
    }
  return out;
}

}  // namespace

int MissingEnds(const WorldSolid& solid, std::span<const EdgeShown> by_edge) {
  if (const auto [low, high] = HeightsOf(solid); high - low > kThickestCableMm) return 0;
  int most = 0;
  for (const auto& p : FindOppositeEnds(solid, by_edge))
    if (p.sides.Share() > kFound) most = std::max(most, IsMissing(p.ends[0]) + IsMissing(p.ends[1]));
  return most;
}

}  // namespace vss
