#include "vss/identify/rim_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "vss/identify/four_views.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kTopMm = 40;

// A light plate on a dark floor, with a disc of light `disc` on its top, seen from four places; the lines are
// the plate's edges.
struct Scene : test::FourViews {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box", "holed_plate"}, ".");
  std::vector<GreyImage> pictures;
  PlacedObject plate;

  Scene(const Vector2d& middle, double radius_mm, int disc) {
    plate.model = knowledge.Find("box");
    plate.placement << 0, 0, 0, 0, 0, 0;
    plate.dimensions_mm = {900, 500, kTopMm};
    Draw(plate);
    for (const View& view : views) {
      pictures.emplace_back(512, 512, 8);
      Paint(view, middle, radius_mm, disc, pictures.back());
    }
    for (std::size_t i = 0; i < views.size(); ++i) views[i].picture = pictures[i].view();
  }

  // What a ray through the pixel meets at the height of the top.
  static void Paint(const View& view, const Vector2d& middle, double radius_mm, int disc, GreyImage& image) {
    for (int v = 0; v < 512; ++v)
      for (int u = 0; u < 512; ++u) {
        const Vector3d ray = view.RayOfIdeal(Vector2d(u, v));
        const Vector3d at = view.center_in_world + (kTopMm - view.center_in_world.z()) / ray.z() * ray;
        const bool on_plate = std::abs(at.x()) < 450 && std::abs(at.y()) < 250;
        const bool on_disc = (at.head<2>() - middle).norm() < radius_mm;
        image.Row8(v)[u] = static_cast<std::uint8_t>(!on_plate ? 30 : on_disc ? disc : 160);
      }
  }

  // The plates with a hole that rims on the plate make.
  std::vector<PlacedObject> Holed() const {
    const IdentifyOptions options;
    SceneData data(views, knowledge, options, 1, {});
    Hypothesis h;
    h.object = plate;
    h.log_odds = 100;
    data.items.Keep(std::move(h), SceneItems::kGround);
    const int plate_item = 0;
    AddRims({&plate_item, 1}, {&plate_item, 1}, data);
    std::vector<PlacedObject> out;
    for (const auto& item : data.items)
      if (item.kind == "holed_plate") out.push_back(item.h.object);
    return out;
  }
};

TEST(RimSearch, FindsASmallHoleThatNoPictureHasAnArcOf) {
  const auto holed = Scene({-120, 40}, 42, 25).Holed();
  ASSERT_FALSE(holed.empty());
  const auto& o = holed.front();
  EXPECT_NEAR(o.dimensions_mm[0], 900, 3);
  EXPECT_NEAR(o.dimensions_mm[3], 84, 12);  // to a pixel on either side
  EXPECT_NEAR(o.dimensions_mm[4], -120, 8);
  EXPECT_NEAR(o.dimensions_mm[5], 40, 8);
}

TEST(RimSearch, AFaintStainIsNoHole) { EXPECT_TRUE(Scene({-120, 40}, 42, 130).Holed().empty()); }

}  // namespace
}  // namespace vss
