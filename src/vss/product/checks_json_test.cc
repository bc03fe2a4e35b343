#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vss/product/json_pieces.inc"

namespace vss {
namespace {

using product_json::Json;

const std::vector<std::string> kFiles = {"images/a.png", "images/b.png"};

Part Sample() {
  Part part;
  part.id = "part-1";
  part.kind = "box";
  part.dimensions = {{"length", 100, 0.1, true, ""}};
  part.covariance = Eigen::MatrixXd::Identity(7, 7);
  part.covariance(0, 6) = part.covariance(6, 0) = 0.5;
  part.covariance(6, 6) = 4;
  part.contour_residuals = {{"edge", 2, 0, "free", 0, 0.01, 0.05, 12, true},
                            {"edge", 2, 0, "free", 1, -0.4, 0.5, 9, false},
                            {"limb", 1, -1, "round", 0, 0.02, 0.05, 3, true, true}};
  part.straightness = {{2, 0.31, 0.1, 2}};
  part.observable = {true, true, true, true, false, false, false};
  part.singular_values = Eigen::Vector2d(900, 4);
  return part;
}

TEST(ChecksJson, EveryPictureOfEveryContourIsWritten) {
  Product product;
  product.parts = {Sample()};
  const Json part = Json::parse(ProductToJson(product, kFiles))["parts"][0];
  ASSERT_EQ(part["contours"].size(), 2u);
  EXPECT_EQ(part["contours"][0]["edge"], 2);
  ASSERT_EQ(part["contours"][0]["pictures"].size(), 2u);
  EXPECT_EQ(part["contours"][0]["pictures"][1]["image"], "images/b.png");
  EXPECT_EQ(part["contours"][0]["pictures"][1]["used"], false);
  EXPECT_EQ(part["contours"][1]["side"], -1);
  EXPECT_EQ(part["contours"][1]["pictures"][0]["shadowed"], true);
  EXPECT_FALSE(part["contours"][0]["pictures"][0].contains("shadowed"));
  EXPECT_EQ(part["straightness"][0]["bow"], 0.31);
  EXPECT_EQ(part["observability"]["observable"]["tilt_x"], false);
  EXPECT_EQ(part["observability"]["observable"]["length"], false);
  EXPECT_EQ(part["observability"]["singular_values"][0], 900);
}

TEST(ChecksJson, CorrelationsAndTheVerticesCovarianceAreWrittenWhereAskedFor) {
  Product product;
  product.parts = {Sample()};
  EXPECT_FALSE(Json::parse(ProductToJson(product, kFiles))["parts"][0].contains("vertex_covariance"));
  product.parts[0].vertex_covariance = {Eigen::Matrix3d::Identity() * 0.04};
  const Json part = Json::parse(ProductToJson(product, kFiles))["parts"][0];
  EXPECT_EQ(part["covariance"]["correlation"][0][6], 0.25);
  EXPECT_EQ(part["covariance"]["correlation"][6][6], 1);
  EXPECT_EQ(part["vertex_covariance"][0][1][1], 0.04);
}

TEST(ChecksJson, PicturesCamerasAndScaleAreWritten) {
  Product product;
  product.checks =
      SurveyChecks{{{1, 7, 0.04, "part-1", "length", 1.2, 0.2, true}},
                   {{"cam1", -1, {0.3, 0, 0}, {0.01, 0.01, 0.01}, {1, 0, 0}, {0.1, 0.1, 0.1}, 90, true},
                    {"hand", 0, {}, {}, {}, {}, 0, false}},
                   {"gantry", 0, 40},
                   {0.02, 0.1, 0.03},
                   GroundCheck{{1200, 600}, 4.1, 0.2, {2, -1}, {0.1, 0.1}}};
  const Json checks = Json::parse(ProductToJson(product, kFiles))["checks"];
  EXPECT_EQ(checks["leave_one_out"][0]["image"], "images/b.png");
  EXPECT_EQ(checks["leave_one_out"][0]["outlying"], true);
  EXPECT_EQ(checks["cameras"][0]["moved"], true);
  EXPECT_FALSE(checks["cameras"][0].contains("image"));
  EXPECT_EQ(checks["cameras"][1]["image"], "images/a.png");
  EXPECT_EQ(checks["scale"]["from"], "gantry");
  EXPECT_EQ(checks["ground"]["height"], 4.1);
  EXPECT_EQ(checks["ground"]["slope_mm_per_m"][1], -1);
  EXPECT_EQ(checks["systematic_px"]["contact"], 0.1);
  EXPECT_EQ(checks["systematic_px"].size(), 5u);
  EXPECT_TRUE(checks["systematic_px"].contains("shadowed"));
}

}  // namespace
}  // namespace vss
