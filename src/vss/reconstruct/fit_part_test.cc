#include "vss/reconstruct/fit_part.h"

#include <gtest/gtest.h>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// One camera that looks down at a box; its line image holds every visible edge of the box, in the order of
// `edges`.
struct Scene {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  Camera camera;
  LineImage lines;
  PlacedObject box;
  std::vector<int> edges;
  std::vector<View> views;

  Scene() {
    camera.width_px = camera.height_px = 512;
    camera.intrinsics.fx_px = camera.intrinsics.fy_px = 520;
    camera.intrinsics.cx_px = camera.intrinsics.cy_px = 255.5;
    const Eigen::Matrix3d down = Vector3d(1, -1, -1).asDiagonal();
    camera.cam_from_world = RigidTransform{RotationFromVector({0.3, 0.2, 0}) * down, Vector3d::Zero()};
    camera.cam_from_world->translation = -camera.cam_from_world->rotation * Vector3d(500, 900, 3000);
    views.push_back(MakeView(0, camera, *camera.cam_from_world, 0, &lines));
    box.model = knowledge.Find("box");
    box.placement << 60, 40, 0, 0.4, 0, 0;
    box.dimensions_mm = {700, 400, 300};
    const WorldSolid solid = PlaceSolid(box);
    for (const auto& s : SampleContour(solid, views[0], 20, 2))
      if (s.visible && (edges.empty() || edges.back() != s.index)) edges.push_back(s.index);
    for (int e : edges) {
      LineSegment line;
      const auto& edge = solid.edges[static_cast<std::size_t>(e)];
      line.ideal_start = *views[0].ProjectIdeal(solid.vertices[static_cast<std::size_t>(edge.start)].point);
      line.ideal_end = *views[0].ProjectIdeal(solid.vertices[static_cast<std::size_t>(edge.end)].point);
      line.sigma_offset_px = 0.02;
      line.sigma_angle_rad = 1e-4;
      lines.segments.push_back(line);
    }
  }

  PlacedObject FarOff() const {
    PlacedObject start = box;
    start.placement << 0, 0, 0, 0, 0, 0;
    start.dimensions_mm = {1000, 500, 200};
    return start;
  }

  bool TouchesGround(int edge) const {
    const WorldSolid solid = PlaceSolid(box);
    const auto& e = solid.edges[static_cast<std::size_t>(edge)];
    return solid.vertices[static_cast<std::size_t>(e.start)].point.z() < 1 &&
           solid.vertices[static_cast<std::size_t>(e.end)].point.z() < 1;
  }
};

TEST(FitPart, FindsABoxFromItsEdgesFromAStartFarOff) {
  const Scene scene;
  std::vector<LineAssignment> picked;
  for (std::size_t i = 0; i < scene.edges.size(); ++i)
    picked.push_back({0, static_cast<int>(i), {}, scene.edges[i], 0});
  const auto fit = FitPart(scene.views, scene.FarOff(), picked, {});
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_LT((fit->object.State() - scene.box.State()).cwiseAbs().maxCoeff(), 0.1);
  EXPECT_LT(fit->rms_px, 0.01);
  for (bool ok : fit->observable) EXPECT_TRUE(ok);
  EXPECT_TRUE(fit->useful.empty());
}

TEST(FitPart, SaysWhichEdgeWouldTellTheHeight) {
  const Scene scene;
  std::vector<LineAssignment> picked;
  for (std::size_t i = 0; i < scene.edges.size(); ++i)
    if (scene.TouchesGround(scene.edges[i]))
      picked.push_back({0, static_cast<int>(i), {}, scene.edges[i], 0});
  ASSERT_GE(picked.size(), 2u);
  FitOptions options;
  options.search_start = false;
  const auto fit = FitPart(scene.views, scene.box, picked, options);
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_FALSE(fit->observable[kPlacementSize + 2]);
  bool told = false;
  for (const auto& u : fit->useful) {
    if (u.dimension != "height") continue;
    told = true;
    EXPECT_FALSE(scene.TouchesGround(u.edge));
  }
  EXPECT_TRUE(told);
}

TEST(FitPart, RefusesALineThatDoesNotExist) {
  const Scene scene;
  const LineAssignment wrong{0, 99, {}, 0, 0};
  const auto fit = FitPart(scene.views, scene.box, {&wrong, 1}, {});
  ASSERT_FALSE(fit);
  EXPECT_NE(fit.error().message.find("no segment 99"), std::string::npos);
}

}  // namespace
}  // namespace vss
