#include "vss/identify/own_shadow.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "vss/identify/four_views.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMmPerPx = 6;  // of the four views

struct Scene : test::FourViews {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  SceneIndex index;

  PlacedObject Plate(double length, double width, double height) const {
    PlacedObject o;
    o.model = knowledge.Find("box");
    o.placement << 0, 0, 0, 0, 0, 0;
    o.dimensions_mm = {length, width, height};
    return o;
  }

  // The sides of a plate of which the pictures show but one line each: the border of what is dark, of the
  // plate or of its shadow on the floor, whichever lies farther out.
  void DrawWithShadow(const PlacedObject& plate, double shadow_mm) {
    const double x = plate.dimensions_mm[0] / 2, y = plate.dimensions_mm[1] / 2, z = plate.dimensions_mm[2];
    auto corners = [](double half_x, double half_y, double height) {
      return std::vector<Vector3d>{{-half_x, -half_y, height},
                                   {half_x, -half_y, height},
                                   {half_x, half_y, height},
                                   {-half_x, half_y, height}};
    };
    const auto top = corners(x, y, z), shadow = corners(x + shadow_mm, y + shadow_mm, 0);
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Vector2d middle = *views[v].ProjectIdeal({0, 0, 0});
      for (std::size_t i = 0; i < 4; ++i) {
        auto side = [&](const std::vector<Vector3d>& of) {
          return std::pair(*views[v].ProjectIdeal(of[i]), *views[v].ProjectIdeal(of[(i + 1) % 4]));
        };
        const auto a = side(top), b = side(shadow);
        const bool top_is_out =
            ((a.first + a.second) / 2 - middle).norm() > ((b.first + b.second) / 2 - middle).norm();
        LineSegment l;
        std::tie(l.ideal_start, l.ideal_end) = top_is_out ? a : b;
        l.start = l.ideal_start, l.end = l.ideal_end;
        lines[v].segments.push_back(l);
      }
    }
    index = MakeSceneIndex(views, 1.5, 1);
  }

  std::optional<Hypothesis> Corrected(const PlacedObject& read, double mm_per_px = kMmPerPx) {
    const SeedContext context{.scene = index, .lines = {}, .circles = {}, .mm_per_px = mm_per_px};
    Hypothesis h;
    h.object = read;
    h.views = {0, 1, 2, 3};
    h.log_odds = FullLogOdds(read, h.views, context);
    h.determined.assign(3, true);
    return OutOfItsShadow(h, context);
  }
};

TEST(OutOfItsShadow, FindsTheHeightOfAPlateWhoseShadowDrewItsOutlineDown) {
  Scene scene;
  scene.DrawWithShadow(scene.Plate(800, 500, 30), 6);
  const auto h = scene.Corrected(scene.Plate(812, 512, 9));
  ASSERT_TRUE(h);
  EXPECT_NEAR(h->object.dimensions_mm[0], 800, 6);
  EXPECT_NEAR(h->object.dimensions_mm[1], 500, 6);
  EXPECT_NEAR(h->object.dimensions_mm[2], 30, 10);
  EXPECT_NEAR(h->object.placement[2], 0, 1e-9);
  EXPECT_TRUE(scene.Corrected(scene.Plate(812, 512, 9), kFinestClutterPixelMm));
  EXPECT_FALSE(scene.Corrected(scene.Plate(812, 512, 9), 0.99 * kFinestClutterPixelMm)) << "fine pictures";
}

TEST(OutOfItsShadow, LeavesPaintAndWhatIsHighAlone) {
  Scene paint;
  paint.DrawWithShadow(paint.Plate(800, 500, 0), 0);
  EXPECT_FALSE(paint.Corrected(paint.Plate(800, 500, 3))) << "as low as a line on the floor";
  Scene block;
  block.DrawWithShadow(block.Plate(800, 500, 60), 6);
  EXPECT_FALSE(block.Corrected(block.Plate(812, 512, 40))) << "foot and top are apart";
}

}  // namespace
}  // namespace vss
