#include "vss/product/seams.h"

#include <gtest/gtest.h>

#include <numbers>

#include "vss/product/make_part.h"

namespace vss {
namespace {

using Eigen::Vector3d;

Part PartAt(const KnowledgeBase& knowledge, const std::string& id, const std::string& kind,
            std::vector<double> dimensions_mm, const Vector3d& place, double yaw_rad = 0) {
  PlacedObject object;
  object.model = knowledge.Find(kind);
  object.dimensions_mm = std::move(dimensions_mm);
  object.placement.head<3>() = place;
  object.placement[3] = yaw_rad;
  Part part;
  part.id = id;
  part.kind = kind;
  SetGeometry(object, part);
  return part;
}

// An upright on a plate: the plate's top is at z = 20, the upright stands `gap_mm` above it.
std::vector<Seam> SeamsOfUpright(double gap_mm, double yaw_rad = 0) {
  const auto knowledge = LoadKnowledge({}, {});
  Product product;
  product.parts.push_back(PartAt(*knowledge, "plate", "box", {1000, 800, 20}, {0, 0, 0}));
  product.parts.push_back(
      PartAt(*knowledge, "upright", "box", {600, 12, 150}, {50, 30, 20 + gap_mm}, yaw_rad));
  return FindSeams(product, *knowledge, {});
}

TEST(Seams, AreTheLongLowerEdgesOfAnUprightOnAPlate) {
  for (const double yaw_rad : {0.0, 0.7}) {
    const auto seams = SeamsOfUpright(0, yaw_rad);
    ASSERT_EQ(seams.size(), 2u);  // the ends, 12 mm, are shorter than a seam
    for (const auto& seam : seams) {
      EXPECT_EQ(seam.part_a, "plate");
      EXPECT_EQ(seam.part_b, "upright");
      EXPECT_NEAR((seam.end - seam.start).norm(), 600, 1e-9);
      EXPECT_NEAR(seam.start.z(), 20, 1e-9);
    }
  }
}

TEST(Seams, AreApproachedHalfwayBetweenTheTwoFaces) {
  for (const auto& seam : SeamsOfUpright(0, 0.3)) {
    const Vector3d approach = ApproachOf(seam);
    EXPECT_NEAR(approach.norm(), 1, 1e-12);
    EXPECT_NEAR(approach.z(), std::numbers::sqrt2 / 2, 1e-9);
    EXPECT_NEAR(approach.dot(seam.end - seam.start), 0, 1e-9);
    // Away from the upright's middle plane.
    const Vector3d out = (seam.start + seam.end) / 2 - Vector3d(50, 30, 20);
    EXPECT_GT(approach.dot(out), 0);
  }
}

TEST(Seams, KnowTheirGapAndItsSign) {
  for (const double gap_mm : {1.5, 0.0, -0.8})
    for (const auto& seam : SeamsOfUpright(gap_mm)) EXPECT_NEAR(seam.gap_mm, gap_mm, 1e-9);
  EXPECT_TRUE(SeamsOfUpright(SeamOptions{}.max_gap_mm + 0.1).empty());
}

TEST(Seams, WithoutNormalsHaveNoApproach) { EXPECT_EQ(ApproachOf(Seam{}), Vector3d::Zero()); }

}  // namespace
}  // namespace vss
