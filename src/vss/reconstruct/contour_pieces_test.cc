#include "vss/reconstruct/contour_pieces.h"

#include <gtest/gtest.h>

#include <set>

#include "vss/knowledge/object_model.h"
#include "vss/reconstruct/measure_view.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// One part on the ground below a camera that looks straight down from 3 m, 1 px for 5 mm on the ground.
class ContourPieces : public testing::Test {
 protected:
  ContourPieces() {
    camera_.id = "above";
    camera_.width_px = camera_.height_px = 512;
    camera_.intrinsics.fx_px = camera_.intrinsics.fy_px = 600;
    camera_.intrinsics.cx_px = camera_.intrinsics.cy_px = 255.5;
    camera_.cam_from_world =
        RigidTransform{Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), Vector3d(0, 0, 3000)};
    view_ = MakeView(0, camera_, *camera_.cam_from_world, -1, nullptr);
  }

  void Place(const std::string& kind, const Vector3d& at, std::vector<double> dimensions_mm) {
    PlacedObject object;
    object.model = knowledge_.Find(kind);
    object.placement.head<3>() = at;
    object.dimensions_mm = std::move(dimensions_mm);
    solids_ = {PlaceSolid(object, false)};
  }

  std::vector<ContourPiece> Pieces() const { return CutContour(solids_, others_, view_, {}); }

  // The part's foot is the outline of a dark area in a bright picture that grows by `by_px` on every side:
  // what its shadow would do.
  GreyImage DarkWithShadow(double half_x_px, double half_y_px, const Vector2d& center, double by_px) const {
    GreyImage image(512, 512, 8);
    for (int v = 0; v < 512; ++v)
      for (int u = 0; u < 512; ++u) {
        const double x = std::abs(u - center.x()) - half_x_px - by_px,
                     y = std::abs(v - center.y()) - half_y_px - by_px;
        const double dark = 0.5 * std::erfc(std::max(x, y) / (0.7 * std::sqrt(2.0)));
        image.Row8(v)[u] = static_cast<std::uint8_t>(std::lround(180 - 120 * dark));
      }
    return image;
  }

  KnowledgeBase knowledge_ = *LoadKnowledge({}, ".");
  Camera camera_;
  View view_;
  std::vector<WorldSolid> solids_;
  std::vector<Occluders> others_{1};
};

TEST_F(ContourPieces, TheBackgroundOfAConvexPartsOutlineLiesAwayFromItsMiddle) {
  Place("box", {700, -400, 0}, {500, 300, 200});
  const Vector2d center = *view_.ProjectInside(Vector3d(700, -400, 100));
  int outlines = 0, inner = 0;
  for (const auto& p : Pieces()) {
    (p.sample.silhouette ? outlines : inner) += 1;
    EXPECT_EQ(p.background != 0, p.sample.silhouette);
    if (p.background == 0) continue;
    EXPECT_GT(p.background * p.curve.normal.dot(p.curve.point - center), 0);
  }
  EXPECT_GT(outlines, 20);
  EXPECT_GT(inner, 5);
}

TEST_F(ContourPieces, TheBackgroundOfAHolesRimLiesInsideIt) {
  Place("holed_plate", {900, 0, 0}, {600, 500, 30, 300, 0, 0});
  const Vector2d center = *view_.ProjectInside(Vector3d(900, 0, 30));
  int rims = 0;
  for (const auto& p : Pieces()) {
    if (p.sample.source != ContourSample::Source::kCircle || p.background == 0) continue;
    ++rims;
    EXPECT_LT(p.background * p.curve.normal.dot(p.curve.point - center), 0);
  }
  EXPECT_GT(rims, 5);
}

// The wall of a large hole is made of facets that stand before its true rims; what is seen of the lower one
// must be known beside the upper one, which is else taken for it where plate and wall are alike.
TEST_F(ContourPieces, ALargeHolesLowerRimIsSeenBesideItsUpperOne) {
  Place("holed_plate", {1000, 0, 0}, {900, 900, 60, 600, 0, 0});
  std::set<int> rims;
  int with_neighbour = 0;
  for (const auto& p : Pieces()) {
    if (p.sample.source != ContourSample::Source::kCircle) continue;
    rims.insert(p.sample.index);
    with_neighbour += !p.neighbours.empty();
  }
  EXPECT_EQ(rims.size(), 2u);
  EXPECT_GT(with_neighbour, 5);
}

TEST_F(ContourPieces, AStepBehindALowDarkPartIsSaidToBePerhapsItsShadow) {
  Place("box", {0, 0, 0}, {600, 400, 20});  // its top: 120.8 x 80.5 px
  const GreyImage image = DarkWithShadow(60.4, 40.27, {255.5, 255.5}, 0.5);
  const auto low = MeasureView(solids_, others_, view_, 0, image.view(), {0.7, 0.1, 1}, {});
  ASSERT_EQ(low.groups.size(), 4u);
  for (const auto& g : low.groups) EXPECT_EQ(g.edge_class, ContourClass::kShadowed);

  Place("box", {0, 0, 0}, {600, 400, 300});  // the same top nearer to the camera
  const double nearer = 3000 / 2700.0 * 2980 / 3000;
  const GreyImage high = DarkWithShadow(60.4 * nearer, 40.27 * nearer, {255.5, 255.5}, 0.5);
  const auto tall = MeasureView(solids_, others_, view_, 0, high.view(), {0.7, 0.1, 1}, {});
  ASSERT_EQ(tall.groups.size(), 4u);
  for (const auto& g : tall.groups) EXPECT_EQ(g.edge_class, ContourClass::kFree);
}

}  // namespace
}  // namespace vss
