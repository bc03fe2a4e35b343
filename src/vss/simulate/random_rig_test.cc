#include "vss/simulate/random_rig.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "vss/camera/lens.h"
#include "vss/identify/view.h"

namespace vss {
namespace {

using Eigen::Vector3d;

constexpr Rig kRigs[] = {Rig::kCarriage, Rig::kCrane, Rig::kFixed, Rig::kHandHeld};

SimulatedScene Drawn(Rig rig, std::uint64_t seed) {
  SimulatedScene scene;
  scene.seed = seed;
  AddRandomRig(seed, {.rig = rig}, scene);
  return scene;
}

// In how many pictures a point of the world lies.
int NumPictures(const SimulatedScene& scene, const Vector3d& point) {
  int count = 0;
  for (const ScenePicture& p : scene.pictures)
    count += MakeView(0, scene.cameras[std::size_t(p.camera)].camera, p.cam_from_world, -1, nullptr)
                 .Shows(point);
  return count;
}

TEST(RandomRig, EveryPlaceOfTheFloorIsInSeveralPictures) {
  for (const Rig rig : kRigs)
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const SimulatedScene scene = Drawn(rig, seed);
      const Eigen::AlignedBox2d floor = Floor({4, 2});
      int fewest = 1000;
      for (double x : {0.05, 0.3, 0.5, 0.7, 0.95})
        for (double y : {0.05, 0.3, 0.5, 0.7, 0.95})
          fewest = std::min(fewest, NumPictures(scene, {floor.min().x() + x * floor.sizes().x(),
                                                        floor.min().y() + y * floor.sizes().y(), 100}));
      EXPECT_GE(fewest, 2) << "rig " << int(rig) << ", seed " << seed;
    }
}

TEST(RandomRig, OnlyACarriageHasStopsAndTakesItsLampsAlong) {
  for (const Rig rig : kRigs) {
    const SimulatedScene scene = Drawn(rig, 5);
    const bool has_stops = rig == Rig::kCarriage || rig == Rig::kCrane;
    for (const auto& p : scene.pictures) EXPECT_EQ(p.gantry_mm.has_value(), has_stops);
    for (const auto& l : scene.lamps) EXPECT_EQ(l.on_gantry, rig == Rig::kCarriage);
    EXPECT_FALSE(scene.lamps.empty());
  }
}

TEST(RandomRig, NamesAreUnderstood) {
  EXPECT_EQ(*RigNamed("hand-held"), Rig::kHandHeld);
  const auto wrong = RigNamed("drone");
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().message.find("hand-held"), std::string::npos);
}

}  // namespace
}  // namespace vss
