#include "vss/identify/on_walls.h"

#include <cmath>

#include "vss/identify/refine.h"
#include "vss/identify/upright_faces.h"

namespace vss {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kTouchesPx = 0.5;  // what lies nearer to a wall lies on it, as far as lines tell
constexpr double kLeastRate = 0.3;  // mm that a face moves for a mm of the slide: less is another one's

// How fast the face moves along its normal as the state goes along `direction`.
double RateOf(const WorldSolid& solid, const SolidFace& face, const Vector3d& middle,
              const VectorXd& direction) {
  double rate = 0, nearest = INFINITY;
  for (const auto& v : solid.vertices) {
    const double off = std::abs(face.normal_in_part.dot(v.point - middle));
    if (off >= nearest) continue;
    nearest = off;
    rate = face.normal_in_part.dot(v.by_state * direction);
  }
  return rate;
}

}  // namespace

std::vector<Hypothesis> OnWalls(const Hypothesis& hypothesis, std::span<const WorldSolid> walls,
                                const SeedContext& context) {
  std::vector<Hypothesis> out;
  const WorldSolid solid = PlaceSolid(hypothesis.object);
  const double reach_mm = kReachOfEndsPx * context.mm_per_px, touches_mm = kTouchesPx * context.mm_per_px;
  // How far each face must go to lie on the wall before or behind it.
  std::vector<std::pair<const SolidFace*, double>> ways;
  for (const auto& face : solid.faces)
    for (const auto& wall : walls)
      for (const auto& other : wall.faces)
        if (const auto way = WayToWall(face, other);
            way && std::abs(*way) < reach_mm && std::abs(*way) > touches_mm)
          ways.emplace_back(&face, *way);
  if (ways.empty()) return out;
  for (const VectorXd& direction : WeakDirections(hypothesis, context))
    for (const auto& [face, way] : ways) {
      const double rate = RateOf(solid, *face, MiddleOf(*face), direction);
      if (std::abs(rate) < kLeastRate) continue;
      Hypothesis h = hypothesis;
      h.object.SetState(hypothesis.object.State() + way / rate * direction);
      if (!InRange(h.object, 0) || !Allowed(h.object)) continue;
      out.push_back(std::move(h));
    }
  return out;
}

}  // namespace vss
