#include "reduced_views.h"

#include <gtest/gtest.h>

namespace vss::station {
namespace {

using Eigen::Vector3d;

struct Rig {
  Camera camera;
  std::vector<View> views;
  Rig() {
    camera.width_px = camera.height_px = 512;
    camera.intrinsics.fx_px = camera.intrinsics.fy_px = 520;
    camera.intrinsics.cx_px = camera.intrinsics.cy_px = 255.5;
    const Eigen::Matrix3d down = Eigen::Vector3d(1, -1, -1).asDiagonal();
    views.push_back(MakeView(0, camera, {down, -(down * Vector3d(300, -200, 3000))}, -1, nullptr));
  }
};

TEST(ReducedViews, AReducedPointLiesWhereTheWarmOneWasPhotographed) {
  Rig rig;
  const Vector3d warm(700, 400, 250), middle(100, 50, 0);
  const double factor = 0.998;
  const auto before = rig.views[0].ProjectIdeal(warm);
  ReduceViews({{"temperature", {{"factor", factor}, {"middle", {100, 50, 0}}}}}, rig.views);
  const auto after = rig.views[0].ProjectIdeal(middle + factor * (warm - middle));
  ASSERT_TRUE(before && after);
  EXPECT_LT((*before - *after).norm(), 1e-9);
  EXPECT_GT((*before - *rig.views[0].ProjectIdeal(warm)).norm(), 0.1)
      << "the warm part does not fit any more";
}

TEST(ReducedViews, ARunAt20DegreesLeavesThePicturesWhereTheyAre) {
  Rig rig;
  const Vector3d eye = rig.views[0].center_in_world;
  ReduceViews({{"parameters", Json::object()}}, rig.views);
  EXPECT_EQ(rig.views[0].center_in_world, eye);
}

TEST(ReducedViews, TheMiddleIsOnTheGround) {
  Part part;
  part.vertices = {{0, 0, 0}, {200, 100, 50}};
  const std::vector<Part> parts = {part};
  EXPECT_EQ(MiddleOfReduction(parts), Vector3d(100, 50, 0));
}

}  // namespace
}  // namespace vss::station
