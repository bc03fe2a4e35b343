#include "vss/reconstruct/edge_bow.h"

#include <gtest/gtest.h>

#include "vss/reconstruct/adjustment_scene.h"

namespace vss {
namespace {

using namespace test;

// As if `edge` of part 0 ran along a parabola.
void Bend(const Adjustment& truth, int edge, const Vector3d& bow_mm, std::vector<ObservationGroup>& groups) {
  const auto views = truth.AdjustedViews();
  for (auto& g : groups)
    for (auto& o : g.observations) {
      if (g.part != 0 || o.sample.source != ContourSample::Source::kEdge || o.sample.index != edge) continue;
      const auto& view = views[static_cast<std::size_t>(g.view)];
      Eigen::Matrix<double, 2, 3> by_cam;
      (void)view.camera->intrinsics.Project(view.cam_from_world * o.sample.point_in_world, &by_cam);
      const double t = o.sample.t;
      o.measured += by_cam * view.cam_from_world.rotation * (4 * t * (1 - t) * bow_mm);
    }
}

// A long upper edge of the box, seen by many pictures.
int UpperEdge(const Adjustment& a) {
  const auto solid = PlaceSolid(a.parts[0].object, false);
  for (std::size_t e = 0; e < solid.edges.size(); ++e) {
    const Vector3d p = solid.vertices[static_cast<std::size_t>(solid.edges[e].start)].point;
    const Vector3d q = solid.vertices[static_cast<std::size_t>(solid.edges[e].end)].point;
    if (p.z() > 50 && q.z() > 50 && (q - p).norm() > 800) return static_cast<int>(e);
  }
  return -1;
}

TEST(EdgeBow, ABentEdgeIsMeasured) {
  const Scene scene;
  Adjustment a = scene.Make();
  const int edge = UpperEdge(a);
  const auto solid = PlaceSolid(a.parts[0].object, false);
  const auto& e = solid.edges[static_cast<std::size_t>(edge)];
  const Vector3d along = (solid.vertices[static_cast<std::size_t>(e.end)].point -
                          solid.vertices[static_cast<std::size_t>(e.start)].point)
                             .normalized();
  const Vector3d bow = 3 * Vector3d::UnitZ() + 2 * along.cross(Vector3d::UnitZ());
  std::mt19937 random(1);
  Observe(a, 0.03, random, a.groups);
  Bend(a, edge, bow, a.groups);
  a.Solve(6, true);
  bool found = false;
  for (const auto& b : EdgeBows(a)) {
    if (b.part != 0 || b.edge != edge) continue;
    found = true;
    EXPECT_GT(b.chi_square, 40);
    const Vector3d error = b.bow_mm - bow;  // the two directions across the edge
    const Eigen::Matrix3d along_too = b.covariance + along * along.transpose();
    EXPECT_LT(error.dot(along_too.ldlt().solve(error)), 18.4) << b.bow_mm.transpose();
    EXPECT_LT(error.norm(), 1.5);
  }
  EXPECT_TRUE(found);
}

TEST(EdgeBow, AStraightEdgeIsNotBent) {
  const Scene scene;
  std::mt19937 random(2);
  int count = 0, bent = 0;
  for (int run = 0; run < 10; ++run) {
    Adjustment a = scene.Make();
    Observe(a, 0.05, random, a.groups);
    a.Solve(6, true);
    for (const auto& b : EdgeBows(a)) ++count, bent += b.chi_square > 13.8;  // 1 in 1000
  }
  EXPECT_GT(count, 50);
  EXPECT_LE(bent, 1 + count / 100);
}

}  // namespace
}  // namespace vss
