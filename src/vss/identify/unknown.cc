#include "vss/identify/unknown.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "vss/identify/scene_index.h"

namespace vss {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

// An edge that two stations saw, and more pictures than agree by chance.
constexpr int kMinViews = 4, kMinStops = 2;
// Above what paint, cables and chips of rust reach, in pixels' size.
constexpr double kElevatedPx = 4;
// Edges of one object are no farther apart than this share of the shorter one, or this many pixels' size.
constexpr double kGapShare = 0.3, kGapPx = 4;
// Fewer edges than a solid shows from above, or none of them long, are no object.
constexpr int kMinLines = 4, kMinElevated = 3;
constexpr double kMinLengthPx = 12;

// An edge, or a circle as its box.
struct Piece {
  Vector3d start, end;
  AlignedBox3d box;
  double length = 0;
  bool elevated = false;
};

// The least distance of two segments (Ericson, Real-Time Collision Detection, 2005, 5.1.9).
double Distance(const Piece& a, const Piece& b) {
  const Vector3d d1 = a.end - a.start, d2 = b.end - b.start, r = a.start - b.start;
  const double aa = d1.squaredNorm(), ee = d2.squaredNorm(), f = d2.dot(r), c = d1.dot(r), bb = d1.dot(d2);
  const double denominator = aa * ee - bb * bb;
  double s = denominator > 1e-9 * aa * ee ? std::clamp((bb * f - c * ee) / denominator, 0.0, 1.0) : 0;
  double t = ee > 0 ? (bb * s + f) / ee : 0;
  if (t < 0 || t > 1) {
    t = std::clamp(t, 0.0, 1.0);
    s = aa > 0 ? std::clamp((bb * t - c) / aa, 0.0, 1.0) : 0;
  }
  return (a.start + s * d1 - b.start - t * d2).norm();
}

Piece PieceOf(const WorldLine& l, double mm_per_px) {
  Piece p{l.start, l.end, AlignedBox3d(l.start), l.Length(), false};
  p.box.extend(l.end);
  p.elevated = std::max(l.start.z(), l.end.z()) > kElevatedPx * ClutterPixelMm(mm_per_px);
  return p;
}

Piece PieceOf(const WorldCircle& c, double mm_per_px) {
  const Vector3d reach(c.radius_mm, 0, 0), across(0, c.radius_mm, 0);
  Piece p{c.center - reach, c.center + reach, AlignedBox3d(Vector3d(c.center - reach - across)), 0, false};
  p.box.extend(Vector3d(c.center + reach + across));
  p.length = 2 * c.radius_mm;
  p.elevated = c.center.z() > kElevatedPx * ClutterPixelMm(mm_per_px);
  return p;
}

}  // namespace

std::vector<UnknownGroup> FindUnknown(std::span<const WorldLine> lines, std::span<const WorldCircle> circles,
                                      std::span<const AlignedBox3d> parts, double mm_per_px) {
  std::vector<Piece> pieces;
  for (const auto& l : lines)
    if (l.num_views >= kMinViews && l.num_stops >= kMinStops) pieces.push_back(PieceOf(l, mm_per_px));
  for (const auto& c : circles)
    if (c.num_views >= kMinViews) pieces.push_back(PieceOf(c, mm_per_px));
  std::erase_if(pieces, [&](const Piece& p) {
    return std::any_of(parts.begin(), parts.end(), [&](const AlignedBox3d& box) {
      const Vector3d slack = Vector3d::Constant(kGapPx * mm_per_px);
      return AlignedBox3d(box.min() - slack, box.max() + slack).contains(p.box);
    });
  });
  std::vector<std::size_t> group(pieces.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  auto root = [&](std::size_t i) {
    while (group[i] != i) i = group[i];
    return i;
  };
  for (std::size_t i = 0; i < pieces.size(); ++i)
    for (std::size_t k = i + 1; k < pieces.size(); ++k) {
      const double gap =
          std::max(kGapShare * std::min(pieces[i].length, pieces[k].length), kGapPx * mm_per_px);
      if (Distance(pieces[i], pieces[k]) > gap) continue;
      const std::size_t a = root(i), b = root(k);
      group[std::max(a, b)] = std::min(a, b);
    }
  std::vector<UnknownGroup> out;
  for (std::size_t g = 0; g < pieces.size(); ++g) {
    if (root(g) != g) continue;
    AlignedBox3d box;
    int count = 0, elevated = 0;
    double longest = 0;
    for (std::size_t i = g; i < pieces.size(); ++i) {
      if (root(i) != g) continue;
      box.extend(pieces[i].box);
      ++count;
      elevated += pieces[i].elevated;
      longest = std::max(longest, pieces[i].length);
    }
    if (count < kMinLines || elevated < kMinElevated || longest < kMinLengthPx * mm_per_px) continue;
    out.push_back({box.center(), box.sizes(), count});
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const UnknownGroup& a, const UnknownGroup& b) { return a.num_lines > b.num_lines; });
  return out;
}

}  // namespace vss
