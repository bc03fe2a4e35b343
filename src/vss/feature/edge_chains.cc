#include "vss/feature/edge_chains.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vss {
namespace {

constexpr double kMinCosine = 0.7;  // neighbours on one contour turn by less than 45 degrees, noise included
constexpr double kMaxAcrossPx = 1.2;  // how far a follower may lie beside the tangent
constexpr double kDuplicatePx =
    0.8;  // a point this near to the step just made is the same contour, found along the other axis
constexpr int kReachPx = 2;  // a hole of one pixel is stepped over

struct Walker {
  const std::vector<EdgePoint>& points;
  const std::vector<std::uint32_t>& row_start;
  std::vector<std::uint16_t>& cell;
  int width, height;

  std::int64_t Find(int u, int v) const {
    if (u < 0 || v < 0 || u >= width || v >= height) return -1;
    const int n = cell[std::size_t(v) * width + u];
    return n == 0 ? -1 : std::int64_t{row_start[std::size_t(v)]} + n - 1;
  }
  void Take(std::size_t i) { cell[std::size_t(points[i].cell_v) * width + points[i].cell_u] = 0; }

  // Frees the points beside the step from `p` to `q` that tell of the same contour.
  void TakeDuplicates(const EdgePoint& p, const EdgePoint& q) {
    const double du = q.u - p.u, dv = q.v - p.v, length2 = du * du + dv * dv;
    if (!(length2 > 0)) return;
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const auto i = Find(p.cell_u + x, p.cell_v + y);
        if (i < 0) continue;
        const EdgePoint& d = points[std::size_t(i)];
        const double t = ((d.u - p.u) * du + (d.v - p.v) * dv) / length2;
        const double across = std::abs((d.u - p.u) * dv - (d.v - p.v) * du) / std::sqrt(length2);
        if (t > -0.5 && t < 1 && across < kDuplicatePx && Cosine(d, p) > kMinCosine) Take(std::size_t(i));
      }
  }

  static double Cosine(const EdgePoint& a, const EdgePoint& b) {
    return (double{a.gx} * b.gx + double{a.gy} * b.gy) /
           std::sqrt((double{a.gx} * a.gx + double{a.gy} * a.gy) *
                     (double{b.gx} * b.gx + double{b.gy} * b.gy));
  }

  // The best follower of `p` in direction `sign` at Chebyshev distance `reach`, or -1.
  std::int64_t Follower(const EdgePoint& p, double sign, int reach) const {
    const double length = std::hypot(p.gx, p.gy);
    const double tu = -sign * p.gy / length, tv = sign * p.gx / length;
    std::int64_t best = -1;
    double best_cost = 1e9;
    for (int y = -reach; y <= reach; ++y)
      for (int x = -reach; x <= reach; ++x) {
        if (std::max(std::abs(x), std::abs(y)) != reach || tu * x + tv * y <= 0) continue;
        const auto i = Find(p.cell_u + x, p.cell_v + y);
        if (i < 0) continue;
        const EdgePoint& q = points[std::size_t(i)];
        const double du = q.u - p.u, dv = q.v - p.v, ahead = du * tu + dv * tv,
                     across = std::abs(du * tv - dv * tu);
        if (!(ahead > 0.2 * reach) || across > kMaxAcrossPx * reach || Cosine(p, q) < kMinCosine) continue;
        const double cost = across + 0.3 * ahead;  // straight on first; of two on the tangent the nearer
        if (cost < best_cost) best_cost = cost, best = i;
      }
    return best;
  }

  void Walk(std::size_t from, double sign, std::vector<std::uint32_t>& out) {
    for (std::size_t at = from;;) {
      std::int64_t next = -1;
      for (int reach = 1; reach <= kReachPx && next < 0; ++reach) next = Follower(points[at], sign, reach);
      if (next < 0) return;
      Take(std::size_t(next));
      TakeDuplicates(points[at], points[std::size_t(next)]);
      out.push_back(static_cast<std::uint32_t>(next));
      at = std::size_t(next);
    }
  }
};

void FillCells(const std::vector<EdgePoint>& points, const std::vector<std::uint32_t>& row_start, int width,
               int height, EdgeChains& chains) {
  chains.cell.assign(std::size_t(width) * height, 0);
  for (int v = 0; v < height; ++v)
    for (std::uint32_t i = row_start[std::size_t(v)]; i < row_start[std::size_t(v) + 1]; ++i)
      chains.cell[std::size_t(v) * width + points[i].cell_u] =
          static_cast<std::uint16_t>(1 + i - row_start[std::size_t(v)]);
}

}  // namespace

void JoinChains(const std::vector<EdgePoint>& points, const std::vector<std::uint32_t>& row_start, int width,
                int height, int min_points, EdgeChains& chains) {
  FillCells(points, row_start, width, height, chains);
  chains.order.clear();
  chains.start.assign(1, 0);
  Walker walker{points, row_start, chains.cell, width, height};
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (walker.Find(points[i].cell_u, points[i].cell_v) != std::int64_t(i)) continue;
    walker.Take(i);
    chains.forward.clear();
    chains.backward.clear();
    walker.Walk(i, +1, chains.forward);
    walker.Walk(i, -1, chains.backward);
    if (chains.forward.size() + chains.backward.size() + 1 < std::size_t(min_points)) continue;
    chains.order.insert(chains.order.end(), chains.backward.rbegin(), chains.backward.rend());
    chains.order.push_back(static_cast<std::uint32_t>(i));
    chains.order.insert(chains.order.end(), chains.forward.begin(), chains.forward.end());
    chains.start.push_back(static_cast<std::uint32_t>(chains.order.size()));
  }
}

}  // namespace vss
