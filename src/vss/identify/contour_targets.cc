#include "vss/identify/contour_targets.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vss {

using Eigen::Vector3d;

double AddTargets(const PlacedObject& object, std::span<const EdgeTarget> edges,
                  std::span<const CircleTarget> circles, NormalEquations& normal, bool ends) {
  constexpr double kAcrossMm = 1.0, kAlongMm = 10.0;  // an edge's ends are known less well than its place
  const WorldSolid solid = PlaceSolid(object);
  double worst = 0;
  for (const auto& t : edges) {
    const auto& e = solid.edges[std::size_t(t.edge)];
    const Vector3d e1 = t.unit.unitOrthogonal(), e2 = t.unit.cross(e1);
    const auto& first = solid.vertices[std::size_t(t.flip ? e.end : e.start)];
    const auto& last = solid.vertices[std::size_t(t.flip ? e.start : e.end)];
    for (const auto* v : {&first, &last}) {
      for (const Vector3d& across : {e1, e2}) {
        const double r = across.dot(v->point - t.point);
        normal.Add(across.transpose() * v->by_state, r, 1 / (kAcrossMm * kAcrossMm));
        worst = std::max(worst, std::abs(r));
      }
      if (!ends) continue;
      const double r = t.unit.dot(v->point - t.point) - (v == &first ? t.lo : t.hi);
      normal.Add(t.unit.transpose() * v->by_state, r, 1 / (kAlongMm * kAlongMm));
    }
  }
  for (const auto& t : circles) {
    const auto& c = solid.circles[std::size_t(t.circle)];
    for (int axis = 0; axis < 3; ++axis) {
      const double r = c.center.point[axis] - t.center[axis];
      normal.Add(c.center.by_state.row(axis), r, 1 / (kAcrossMm * kAcrossMm));
      worst = std::max(worst, std::abs(r));
    }
    const double r = c.radius_mm - t.radius;
    normal.Add(c.radius_by_state, r, 1 / (kAcrossMm * kAcrossMm));
    worst = std::max(worst, std::abs(r));
  }
  return worst;
}

void HoldUpright(Eigen::MatrixXd& ata, Eigen::VectorXd& atb) {
  for (int held : {2, 3, 4, 5}) {
    ata.row(held).setZero();
    ata.col(held).setZero();
    ata(held, held) = 1;
    atb[held] = 0;
  }
  ata.diagonal().array() += 1e-9;
}

}  // namespace vss
