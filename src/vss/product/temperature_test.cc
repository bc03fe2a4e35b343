#include "vss/product/temperature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vss/product/make_part.h"

namespace vss {
namespace {

Product TwoParts() {
  static const KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  Product product;
  for (int i = 0; i < 2; ++i) {
    IdentifiedPart found;
    found.object.model = knowledge.Find("box");
    found.object.dimensions_mm = {1000, 500, 100};
    found.object.placement << 3000.0 * i, 0, 0, 0, 0, 0;
    Part part = MakePart(found, PartId(i), {});
    part.covariance = Eigen::MatrixXd::Identity(9, 9);
    for (auto& d : part.dimensions) d.sigma_mm = 1;
    product.parts.push_back(part);
  }
  product.seams = {{"part-1", "part-2", {0, 0, 0}, {3000, 0, 0}, {}, {}}};
  return product;
}

TEST(Temperature, At20DegreesNothingIsReduced) {
  Product product = TwoParts();
  ReduceToReferenceTemperature({}, product);
  EXPECT_EQ(product.parts[0].dimensions[0].value_mm, 1000);
  EXPECT_FALSE(product.temperature);
}

TEST(Temperature, AWarmWorkpieceIsSmallerAt20Degrees) {
  Product product = TwoParts();
  ReduceToReferenceTemperature({40, 12}, product);
  const double factor = 1 / (1 + 12e-6 * 20);
  for (const auto& part : product.parts) {
    EXPECT_NEAR(part.dimensions[0].value_mm, 1000 * factor, 1e-9);
    EXPECT_NEAR(part.dimensions[0].sigma_mm, factor, 1e-12);
    EXPECT_NEAR(part.covariance(0, 0), factor * factor, 1e-12);
    EXPECT_NEAR(part.covariance(0, 3), 0, 1e-12);
    EXPECT_NEAR(part.covariance(4, 4), 1, 1e-12);  // angles stay
    double lowest = 1e9;
    for (const auto& v : part.vertices) lowest = std::min(lowest, v.z());
    EXPECT_NEAR(lowest, 0, 1e-9);  // it still stands on the ground
  }
  // The distance between the parts shrinks like the parts.
  EXPECT_NEAR(
      (product.parts[1].world_from_part.translation - product.parts[0].world_from_part.translation).norm(),
      3000 * factor, 1e-9);
  EXPECT_NEAR((product.seams[0].end - product.seams[0].start).norm(), 3000 * factor, 1e-9);
  ASSERT_TRUE(product.temperature);
  EXPECT_NEAR(product.temperature->factor, factor, 1e-15);
  EXPECT_THAT(ProductToJson(product, {}), testing::HasSubstr("\"workpiece_c\":40"));
}

}  // namespace
}  // namespace vss
