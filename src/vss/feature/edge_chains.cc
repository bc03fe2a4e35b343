#include "vss/feature/edge_chains.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace vss {
namespace {

constexpr float kMinCosine = 0.7f;    // neighbours on one contour turn by less
                                      // than 45 degrees, noise included
constexpr float kMaxAcrossPx = 1.2f;  // how far a follower may lie beside the tangent
constexpr float kMinAhead = 0.2f;     // and how far ahead at least, of the pixels between
constexpr float kDuplicatePx = 0.8f;  // a point this near to the step just made is the same contour, found
                                      // along the other axis

constexpr int kReachPx = 2;  // a hole of one pixel is stepped over

// Bits of the five pixels around a place, row by row, five rows: its own is
// bit 12.
constexpr std::uint32_t kNear = 0x7u << 6 | 0x5u << 11 | 0x7u << 16;
constexpr std::uint32_t kFar = 0x1Fu | 0x11u << 5 | 0x11u << 10 | 0x11u << 15 | 0x1Fu << 20;

// Points keep two pixels from the picture's border, so that no look around one
// leaves the picture.
struct Walker {
  const EdgePoint* points;
  PointMap& map;

  PointMap::Word& WordOf(int u, int v) const {
    return map.word[std::size_t(v) * map.words + (std::size_t(u) >> 6)];
  }
  bool IsFree(const EdgePoint& p) const { return WordOf(p.cell_u, p.cell_v).free >> (p.cell_u & 63) & 1; }
  void Take(const EdgePoint& p) const {
    WordOf(p.cell_u, p.cell_v).free &= ~(std::uint64_t{1} << (p.cell_u & 63));
  }
  const EdgePoint& At(int u, int v) const {
    const PointMap::Word& w = WordOf(u, v);
    return points[w.first + CountBits(w.all & ((std::uint64_t{1} << (u & 63)) - 1))];
  }

  // Which of the 25 pixels around `p` have a free point.
  std::uint32_t Around(const EdgePoint& p) const {
    const unsigned u = p.cell_u - unsigned{kReachPx}, shift = u & 63;
    const PointMap::Word* w = &map.word[std::size_t(p.cell_v - kReachPx) * map.words + (u >> 6)];
    std::uint32_t bits = 0;
    for (int row = 0; row <= 2 * kReachPx; ++row, w += map.words) {
      std::uint64_t five = w[0].free >> shift;
      if (shift > 59) five |= w[1].free << (64 - shift);
      bits |= static_cast<std::uint32_t>(five & 0x1F) << (5 * row);
    }
    return bits;
  }

  bool IsAlone(const EdgePoint& p) const { return (Around(p) & (kNear | kFar)) == 0; }

  template <class Visit>
  void ForBits(const EdgePoint& p, std::uint32_t bits, const Visit& visit) const {
    for (; bits != 0; bits &= bits - 1) {
      const int k = std::countr_zero(bits);
      visit(At(p.cell_u + k % 5 - kReachPx, p.cell_v + k / 5 - kReachPx), k % 5 - kReachPx, k / 5 - kReachPx);
    }
  }

  static float Cosine(const EdgePoint& a, const EdgePoint& b) { return a.nu * b.nu + a.nv * b.nv; }

  // Takes the points beside the step from `p` to `q` that tell of the same
  // contour.
  void TakeDuplicates(const EdgePoint& p, const EdgePoint& q, std::uint32_t around) const {
    const float du = q.u - p.u, dv = q.v - p.v, length2 = du * du + dv * dv;
    if (!(length2 > 0)) return;
    ForBits(p, around & kNear, [&](const EdgePoint& d, int, int) {
      const float eu = d.u - p.u, ev = d.v - p.v;
      const float t = eu * du + ev * dv, across = eu * dv - ev * du;
      if (t > -0.5f * length2 && t < length2 && across * across < kDuplicatePx * kDuplicatePx * length2 &&
          Cosine(d, p) > kMinCosine)
        Take(d);
    });
  }

  // The best follower of `p` in direction `sign` among the points at `bits`,
  // `reach` away, or null.
  const EdgePoint* Follower(const EdgePoint& p, float sign, std::uint32_t bits, float reach) const {
    const float tu = -sign * p.nv, tv = sign * p.nu;
    const EdgePoint* best = nullptr;
    float best_cost = 1e9f;
    ForBits(p, bits, [&](const EdgePoint& q, int u, int v) {
      const float du = q.u - p.u, dv = q.v - p.v, ahead = du * tu + dv * tv,
                  across = std::abs(du * tv - dv * tu);
      if (!(ahead > kMinAhead * reach) || across > kMaxAcrossPx * reach || Cosine(p, q) < kMinCosine ||
          tu * float(u) + tv * float(v) <= 0)
        return;
      const float cost = across + 0.3f * ahead;  // straight on first; of two on the tangent the nearer
      if (cost < best_cost) best_cost = cost, best = &q;
    });
    return best;
  }

  void Walk(const EdgePoint* at, float sign, std::vector<std::uint32_t>& out) const {
    for (;;) {
      const std::uint32_t around = Around(*at);
      if (around == 0) return;
      const EdgePoint* next = Follower(*at, sign, around & kNear, 1);
      if (!next) next = Follower(*at, sign, around & kFar, kReachPx);
      if (!next) return;
      Take(*next);
      TakeDuplicates(*at, *next, around);
      out.push_back(static_cast<std::uint32_t>(next - points));
      at = next;
    }
  }
};

void FillMap(const std::vector<EdgePoint>& points, int width, int height, PointMap& map) {
  map.words = std::size_t(width) / 64 + 1;
  map.word.assign(map.words * height, {});
  for (std::size_t i = points.size(); i-- > 0;) {
    PointMap::Word& w = map.word[points[i].cell_v * map.words + (points[i].cell_u >> 6)];
    w.all |= std::uint64_t{1} << (points[i].cell_u & 63);
    w.first = static_cast<std::uint32_t>(i);
  }
  for (auto& w : map.word) w.free = w.all;
}

float Strongest(const std::vector<EdgePoint>& points, const std::vector<std::uint32_t>& some) {
  float strongest = 0;
  for (const auto i : some) strongest = std::max(strongest, points[i].strength);
  return strongest;
}

}  // namespace

double Significance(double mean_strength, double num_points, double texture) {
  constexpr double kTextureGrainPx = 6;  // points of texture nearer together than this tell the same
  return mean_strength / texture * std::sqrt(num_points / kTextureGrainPx);
}

void JoinChains(const std::vector<EdgePoint>& points, int width, int height, const NoiseMap& noise,
                int min_points, double min_significance, EdgeChains& chains) {
  FillMap(points, width, height, chains.map);
  chains.order.clear();
  chains.start.assign(1, 0);
  const Walker walker{points.data(), chains.map};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const EdgePoint& p = points[i];
    if (!walker.IsFree(p) || walker.IsAlone(p)) continue;
    walker.Take(p);
    chains.forward.clear();
    chains.backward.clear();
    walker.Walk(&p, +1, chains.forward);
    walker.Walk(&p, -1, chains.backward);
    const std::size_t n = chains.forward.size() + chains.backward.size() + 1;
    if (n < std::size_t(min_points)) continue;
    const float strongest =
        std::max({p.strength, Strongest(points, chains.forward), Strongest(points, chains.backward)});
    if (Significance(strongest, double(n), noise.TextureAt(p.cell_u, p.cell_v)) < min_significance) continue;
    chains.order.insert(chains.order.end(), chains.backward.rbegin(), chains.backward.rend());
    chains.order.push_back(static_cast<std::uint32_t>(i));
    chains.order.insert(chains.order.end(), chains.forward.begin(), chains.forward.end());
    chains.start.push_back(static_cast<std::uint32_t>(chains.order.size()));
  }
}

}  // namespace vss
