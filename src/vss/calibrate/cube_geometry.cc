#include "vss/calibrate/cube_geometry.h"

#include <algorithm>
#include <map>

namespace vss::cube {

using Eigen::Vector3d;

Geometry GeometryOf(const CubeSpec& cube) {
  Geometry g;
  const Eigen::Matrix3d turn = RotationFromVector(cube.yaw_rad * Vector3d::UnitZ());
  const double h = 0.5 * cube.size_mm;
  const std::array<Vector3d, 4> base{Vector3d(-h, -h, 0), Vector3d(h, -h, 0), Vector3d(h, h, 0),
                                     Vector3d(-h, h, 0)};
  for (int i = 0; i < 4; ++i) {
    g.corner[i] = cube.position_mm + turn * base[i];
    g.corner[4 + i] = g.corner[i] + Vector3d(0, 0, cube.size_mm);
  }
  // Counter-clockwise from above is 4 5 6 7, so clockwise is the reverse.
  g.face[0] = {{4, 7, 6, 5}, Vector3d::UnitZ()};
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) % 4;
    g.face[1 + i] = {{i, 4 + i, 4 + j, j}, Vector3d::Zero()};
  }
  g.face[5] = {{0, 1, 2, 3}, -Vector3d::UnitZ()};
  for (Face& f : g.face) {
    const Vector3d x = g.corner[f.corner[1]] - g.corner[f.corner[0]],
                   y = g.corner[f.corner[3]] - g.corner[f.corner[0]];
    f.outward = -x.cross(y).normalized();
  }
  std::map<std::pair<int, int>, std::vector<int>> faces;
  for (int f = 0; f < 6; ++f)
    for (int i = 0; i < 4; ++i) {
      const int a = g.face[f].corner[i], b = g.face[f].corner[(i + 1) % 4];
      faces[{std::min(a, b), std::max(a, b)}].push_back(f);
    }
  int n = 0;
  for (const auto& [ends, two] : faces) g.edge[n++] = {ends.first, ends.second, two[0], two[1]};
  return g;
}

std::vector<VisibleEdge> VisibleEdges(const Geometry& g, const Vector3d& camera) {
  std::array<bool, 6> visible{};
  for (int f = 0; f < 6; ++f) visible[f] = g.face[f].outward.dot(camera - g.corner[g.face[f].corner[0]]) > 0;
  std::vector<VisibleEdge> edges;
  for (int e = 0; e < 12; ++e) {
    const auto [from, to, a, b] = g.edge[e];
    if (!visible[a] && !visible[b]) continue;
    const bool both = visible[a] && visible[b];
    const int inner = visible[std::min(a, b)] ? std::min(a, b) : std::max(a, b);  // the top is face 0
    CubeEdgeClass c = CubeEdgeClass::kUprightOuter;
    if (a == 5 || b == 5)
      c = CubeEdgeClass::kFloor;
    else if (a == 0 || b == 0)
      c = both ? CubeEdgeClass::kTopInner : CubeEdgeClass::kTopOuter;
    else if (both)
      c = CubeEdgeClass::kUprightInner;
    edges.push_back({e, c, inner});
  }
  return edges;
}

}  // namespace vss::cube
