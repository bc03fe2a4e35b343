#include "vss/identify/found_contours.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector3d;

// Without a line, what the grey values say: the logarithm of the odds that a contour is there, by the
// strength of the step (typical of the picture = 1) up to each bound, as accuracy_evidence measured it on
// 115,000 pieces of true contours and 285,000 of others. The last is less than measured: what is strong may
// belong to something else.
constexpr std::array<double, 7> kStepBounds{0.7, 1, 1.5, 2.2, 3.5, 6, 12};
constexpr std::array<double, 8> kStepStrong{-4.2, -3.7, -3.4, -2.8, -2.1, -1.5, -0.8, 0.7};
constexpr std::array<double, 8> kStepWeak{-3.1, -2.6, -2.1, -1.8,
                                          -0.9, -0.4, -0.3, 0.3};  // hollow, or in contact
// Contours of which so few pixels show are seldom lines (a twentieth up to 6 px, half at 16), but show their
// step: of either kind, shorter than the first and than the second of these.
constexpr double kShortPx = 9, kMediumPx = 20;
constexpr std::array<double, 8> kStepShort{-4.6, -4.2, -3.7, -3.0, -1.9, -0.7, 0.6, 2.0};
constexpr std::array<double, 8> kStepMedium{-4.2, -3.7, -3.3, -2.7, -1.5, -0.8, 0.1, 1.2};

}  // namespace

bool IsCovered(const WorldSolid& solid, const Eigen::Vector3d& point) {
  constexpr double kAboveMm = 1;  // faces that meet in the edge itself are no roof
  for (const auto& f : solid.faces) {
    if (f.is_cylinder || f.normal_in_part.z() > -0.5) continue;  // seen from below
    for (const auto& t : f.triangles) {
      const Eigen::Vector2d a = t[0].head<2>(), b = t[1].head<2>(), c = t[2].head<2>(), p = point.head<2>();
      auto side = [](const Eigen::Vector2d& u, const Eigen::Vector2d& v, const Eigen::Vector2d& w) {
        return (v - u).x() * (w - u).y() - (v - u).y() * (w - u).x();
      };
      const double s1 = side(a, b, p), s2 = side(b, c, p), s3 = side(c, a, p);
      const double touch = 1e-6;
      if (!((s1 >= -touch && s2 >= -touch && s3 >= -touch) || (s1 <= touch && s2 <= touch && s3 <= touch)))
        continue;
      if (std::max({t[0].z(), t[1].z(), t[2].z()}) > point.z() + kAboveMm) return true;
    }
  }
  return false;
}

double TopOf(const WorldSolid& solid, ContourSample::Source source, int index) {
  if (source == ContourSample::Source::kLimb) return INFINITY;
  if (source == ContourSample::Source::kCircle)
    return solid.circles[static_cast<std::size_t>(index)].center.point.z();
  const auto& e = solid.edges[static_cast<std::size_t>(index)];
  return std::max(solid.vertices[static_cast<std::size_t>(e.start)].point.z(),
                  solid.vertices[static_cast<std::size_t>(e.end)].point.z());
}

// How often a contour that is there is found.
double DetectOf(const WorldSolid& solid, ContourSample::Source source, int index, double lowest_z) {
  constexpr double kContactMm = 1;
  if (source == ContourSample::Source::kLimb) return kDetectStrong;
  if (source == ContourSample::Source::kCircle)
    return solid.circles[static_cast<std::size_t>(index)].center.point.z() < lowest_z + kContactMm
               ? kDetectContact
               : kDetectStrong;
  const auto& e = solid.edges[static_cast<std::size_t>(index)];
  if (std::max(solid.vertices[static_cast<std::size_t>(e.start)].point.z(),
               solid.vertices[static_cast<std::size_t>(e.end)].point.z()) < lowest_z + kContactMm)
    return kDetectContact;
  const Vector3d middle = (solid.vertices[static_cast<std::size_t>(e.start)].point +
                           solid.vertices[static_cast<std::size_t>(e.end)].point) /
                          2;
  if (IsCovered(solid, middle)) return kDetectCovered;
  return e.convex ? kDetectStrong : kDetectWeak;
}

double StepLogOdds(double strength, bool weak, double visible_px) {
  const auto bin = std::upper_bound(kStepBounds.begin(), kStepBounds.end(), strength) - kStepBounds.begin();
  const auto& table = visible_px < kShortPx    ? kStepShort
                      : visible_px < kMediumPx ? kStepMedium
                      : weak                   ? kStepWeak
                                               : kStepStrong;
  return table[std::size_t(bin)];
}

}  // namespace vss
