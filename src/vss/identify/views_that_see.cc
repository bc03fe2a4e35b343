#include "vss/identify/views_that_see.h"

#include <algorithm>
#include <cmath>

namespace vss {

using Eigen::Vector3d;

std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, std::span<const int> near,
                              int most) {
  std::vector<Vector3d> points;
  for (const auto& v : solid.vertices) points.push_back(v.point);
  for (const auto& e : solid.edges)
    for (double t : {0.25, 0.5, 0.75})
      points.push_back((1 - t) * solid.vertices[std::size_t(e.start)].point +
                       t * solid.vertices[std::size_t(e.end)].point);
  for (const auto& c : solid.circles)
    for (int k = 0; k < 8; ++k)
      points.push_back(c.center.point +
                       c.radius_mm * (c.axis_u * std::cos(k * kPi / 4) + c.axis_v * std::sin(k * kPi / 4)));
  std::vector<std::pair<double, int>> seen;
  for (const int i : near) {
    const View& view = views[static_cast<std::size_t>(i)];
    int inside = 0;
    double size = 0;
    for (const auto& p : points) {
      if (!view.Shows(p)) continue;
      ++inside;
      size += view.camera->intrinsics.fx_px / (p - view.center_in_world).norm();
    }
    if (inside > 0) seen.push_back({-size, i});
  }
  std::sort(seen.begin(), seen.end());
  if (static_cast<int>(seen.size()) > most) seen.resize(static_cast<std::size_t>(most));
  std::vector<int> out;
  for (const auto& s : seen) out.push_back(s.second);
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace vss
