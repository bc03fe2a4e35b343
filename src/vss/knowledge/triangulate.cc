#include "vss/knowledge/triangulate.h"

#include <algorithm>
#include <limits>

namespace vss {
namespace {

using Point = Eigen::Vector2d;

double Cross(const Point& a, const Point& b, const Point& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

bool Inside(const Point& p, const Point& a, const Point& b, const Point& c) {
  return Cross(a, b, p) >= 0 && Cross(b, c, p) >= 0 && Cross(c, a, p) >= 0;
}

// The place in `ring` to which the hole's rightmost point `m` can be joined without crossing anything.
int BridgePlace(const std::vector<Point>& points, const std::vector<int>& ring, const Point& m) {
  const int n = static_cast<int>(ring.size());
  int best = -1;
  double best_x = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n; ++i) {  // the first edge that a ray from m along +x meets
    const Point &a = points[ring[i]], &b = points[ring[(i + 1) % n]];
    if (a.y() > m.y() || b.y() < m.y() || a.y() == b.y()) continue;  // material lies to the left of a -> b
    const double x = a.x() + (m.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    if (x < m.x() || x >= best_x) continue;
    best_x = x;
    best = a.x() > b.x() ? i : (i + 1) % n;
  }
  if (best < 0) return 0;
  const Point hit(best_x, m.y()), corner = points[ring[best]];
  double best_slope = std::numeric_limits<double>::infinity();
  int place = best;
  for (int i = 0; i < n; ++i) {  // a reflex corner inside the triangle m, hit, corner hides it
    const Point& p = points[ring[i]];
    if (i == best || p.x() < m.x()) continue;
    const bool above = corner.y() > m.y();
    if (!(above ? Inside(p, m, hit, corner) : Inside(p, m, corner, hit))) continue;
    const Point &before = points[ring[(i + n - 1) % n]], &after = points[ring[(i + 1) % n]];
    if (Cross(before, p, after) > 0) continue;
    const double slope = std::abs(p.y() - m.y()) / std::max(p.x() - m.x(), 1e-12);
    if (slope < best_slope) best_slope = slope, place = i;
  }
  return place;
}

// The outline with every hole joined to it: one ring of indices.
std::vector<int> JoinHoles(std::span<const Loop2d> loops, std::vector<Point>& points) {
  std::vector<std::vector<int>> rings;
  for (const Loop2d& loop : loops) {
    std::vector<int> ring;
    for (const Point& p : loop) {
      ring.push_back(static_cast<int>(points.size()));
      points.push_back(p);
    }
    rings.push_back(std::move(ring));
  }
  const auto rightmost = [&](const std::vector<int>& ring) {
    return std::max_element(ring.begin(), ring.end(),
                            [&](int a, int b) { return points[a].x() < points[b].x(); });
  };
  std::sort(rings.begin() + 1, rings.end(), [&](const auto& a, const auto& b) {
    return points[*rightmost(a)].x() > points[*rightmost(b)].x();
  });
  std::vector<int> joined = rings[0];
  for (std::size_t h = 1; h < rings.size(); ++h) {
    std::vector<int> hole = rings[h];
    std::rotate(hole.begin(), hole.begin() + (rightmost(hole) - hole.begin()), hole.end());
    const int place = BridgePlace(points, joined, points[hole[0]]);
    hole.push_back(hole[0]);
    hole.push_back(joined[place]);
    joined.insert(joined.begin() + place + 1, hole.begin(), hole.end());
  }
  return joined;
}

bool IsEar(const std::vector<Point>& points, const std::vector<int>& ring, int i) {
  const int n = static_cast<int>(ring.size());
  const int a = ring[(i + n - 1) % n], b = ring[i], c = ring[(i + 1) % n];
  if (Cross(points[a], points[b], points[c]) <= 0) return false;
  for (int j : ring) {
    const Point& p = points[j];
    if (p == points[a] || p == points[b] || p == points[c]) continue;
    if (Inside(p, points[a], points[b], points[c])) return false;
  }
  return true;
}

}  // namespace

double SignedDoubleArea(std::span<const Eigen::Vector2d> loop) {
  double area = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Point &a = loop[i], &b = loop[(i + 1) % loop.size()];
    area += a.x() * b.y() - a.y() * b.x();
  }
  return area;
}

std::vector<std::array<int, 3>> Triangulate(std::span<const Loop2d> loops) {
  std::vector<Point> points;
  std::vector<int> ring = JoinHoles(loops, points);
  std::vector<std::array<int, 3>> triangles;
  int start = 0;
  while (ring.size() > 3) {
    const int n = static_cast<int>(ring.size());
    int ear = start % n;  // where no ear is left (a degenerate polygon), any corner is cut off
    for (int k = 0; k < n; ++k) {
      if (!IsEar(points, ring, (start + k) % n)) continue;
      ear = (start + k) % n;
      break;
    }
    triangles.push_back({ring[(ear + n - 1) % n], ring[ear], ring[(ear + 1) % n]});
    ring.erase(ring.begin() + ear);
    start = ear;
  }
  if (ring.size() == 3) triangles.push_back({ring[0], ring[1], ring[2]});
  return triangles;
}

}  // namespace vss
