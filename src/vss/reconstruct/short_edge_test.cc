#include "vss/reconstruct/short_edge.h"

#include <gtest/gtest.h>

#include "vss/knowledge/object_model.h"
#include "vss/reconstruct/short_edge_search.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// A bar on the ground below a camera that looks straight down from 3 m: its upper face is 5 px wide, and what
// the camera sees of it is a bright rectangle.
class ShortEdges : public testing::Test {
 protected:
  static constexpr double kHeightMm = 40, kFocalPx = 600, kAboveMm = 3000, kBlurPx = 0.7;
  static constexpr double kMmPerPx = (kAboveMm - kHeightMm) / kFocalPx;

  ShortEdges() {
    camera_.id = "above";
    camera_.width_px = camera_.height_px = 512;
    camera_.intrinsics.fx_px = camera_.intrinsics.fy_px = kFocalPx;
    camera_.intrinsics.cx_px = camera_.intrinsics.cy_px = 255.3;
    camera_.cam_from_world =
        RigidTransform{Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), Vector3d(0, 0, kAboveMm)};
    view_ = MakeView(0, camera_, *camera_.cam_from_world, -1, nullptr);
  }

  AdjustedPart Bar(double length_px, double yaw_rad) const {
    AdjustedPart bar;
    bar.object.model = knowledge_.Find("box");
    bar.object.placement[3] = yaw_rad;
    bar.object.dimensions_mm = {length_px * kMmPerPx, 5 * kMmPerPx, kHeightMm};
    bar.free.assign(static_cast<std::size_t>(bar.object.StateSize()), true);
    return bar;
  }

  // The bar as it is, longer by `longer_px` at its end in the positive direction.
  GreyImage Picture(double length_px, double yaw_rad, double longer_px) const {
    GreyImage image(512, 512, 8);
    const Vector2d along(std::cos(yaw_rad), -std::sin(yaw_rad)), across(along.y(), -along.x());
    const auto phi = [](double x) { return 0.5 * std::erfc(-x / (kBlurPx * std::sqrt(2.0))); };
    for (int v = 0; v < 512; ++v)
      for (int u = 0; u < 512; ++u) {
        const Vector2d q = Vector2d(u, v) - Vector2d::Constant(255.3);
        const double s = q.dot(along), d = q.dot(across);
        const double share =
            phi(s + length_px / 2) * phi(length_px / 2 + longer_px - s) * phi(d + 2.5) * phi(2.5 - d);
        image.Row8(v)[u] = static_cast<std::uint8_t>(std::lround(60 + 100 * share));
      }
    return image;
  }

  KnowledgeBase knowledge_ = *LoadKnowledge({}, ".");
  Camera camera_;
  View view_;
};

TEST_F(ShortEdges, AnEdgeOfFivePixelsIsMeasuredWithWhatIsAroundIt) {
  for (const double yaw : {0.0, 0.3, 1.0})
    for (const double longer_px : {0.0, 0.4}) {
      const std::vector<WorldSolid> solids{PlaceSolid(Bar(40, yaw).object, false)};
      const GreyImage image = Picture(40, yaw, longer_px);
      const auto found =
          MeasureView(solids, std::vector<Occluders>(1), view_, 0, image.view(), {kBlurPx, 0.1, 0.3}, {});
      int ends = 0;
      for (const auto& g : found.groups) {
        if (!g.IsShort()) continue;
        ASSERT_EQ(g.observations.size(), 1u);
        const auto& o = g.observations[0];
        const Vector2d along(std::cos(yaw), -std::sin(yaw));
        const Vector2d off = o.measured - o.sample.img;
        const bool moved_end = (o.sample.img - Vector2d::Constant(255.3)).dot(along) > 0;
        EXPECT_NEAR(off.dot(along), moved_end ? longer_px : 0, 0.06) << yaw;
        ++ends;
      }
      EXPECT_EQ(ends, 2) << yaw;
      EXPECT_EQ(found.short_edges.size(), 2u);
    }
}

TEST_F(ShortEdges, WhatDoesNotFitAroundAnEdgeMakesItLessSure) {
  const std::vector<WorldSolid> solids{PlaceSolid(Bar(40, 0).object, false)};
  GreyImage image = Picture(40, 0, 0);
  const auto sigma = [&] {
    double most = 0;
    for (const auto& g :
         MeasureView(solids, std::vector<Occluders>(1), view_, 0, image.view(), {kBlurPx, 0.1, 0.3}, {})
             .groups)
      if (g.IsShort()) most = std::max(most, g.observations[0].sigma_px);
    return most;
  };
  const double clean = sigma();
  for (int v = 254; v < 262; ++v)  // a shadow's border across the end
    for (int u = 270; u < 290; ++u) image.Row8(v)[u] = static_cast<std::uint8_t>(image.Row8(v)[u] * 3 / 4);
  EXPECT_GT(clean, 0);
  EXPECT_GT(sigma(), 3 * clean);
}

TEST_F(ShortEdges, TheNearestOfFacesIsSeen) {
  const std::vector<WorldSolid> solids{PlaceSolid(Bar(40, 0).object, false)};
  const FacesSeen faces(solids, view_);
  const auto all = faces.In({Vector2d::Constant(-1), Vector2d::Constant(1)});
  const int top = FacesSeen::First(all, {0, 0});
  ASSERT_GT(top, 0);
  EXPECT_GT(solids[0].faces[static_cast<std::size_t>(top - 1)].normal_in_part.z(), 0.9);
  EXPECT_EQ(FacesSeen::First(all, {0.2, 0.2}), 0);
}

// Two pictures show the bar; the one that is taken for it ends three pixels short of it.
TEST_F(ShortEdges, GreysChooseTheLengthThatAShortEdgeTells) {
  const GreyImage image = Picture(40, 0, 0);
  const std::vector<View> views{view_, view_};
  const std::vector<GreyView> pictures{image.view(), image.view()};
  const std::vector<PictureState> states(2, {kBlurPx, 0.1, 0.3});
  const SeenPictures seen{views, pictures, states, kMmPerPx, 1};
  const AdjustedPart bar = Bar(34, 0);
  const std::vector<WorldSolid> solids{PlaceSolid(bar.object, false)};
  std::vector<SeenShortEdge> edges;
  for (std::size_t v = 0; v < 2; ++v)
    for (auto& e :
         MeasureView(solids, std::vector<Occluders>(1), views[v], int(v), pictures[v], states[v], {})
             .short_edges)
      edges.push_back({v, e});
  ASSERT_EQ(edges.size(), 4u);
  VectorXd longer = VectorXd::Zero(bar.object.StateSize());
  longer[kPlacementSize] = 2 * kMmPerPx;  // a pixel at either end
  const auto best = BestAlong({bar}, 0, longer, edges, seen);
  ASSERT_TRUE(best);
  EXPECT_NEAR((*best)[kPlacementSize], 40 * kMmPerPx, 0.1);
  EXPECT_FALSE(BestAlong({Bar(40, 0)}, 0, longer, edges, seen));
}

}  // namespace
}  // namespace vss
