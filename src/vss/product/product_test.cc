#include "vss/product/product.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "vss/base/files.h"

namespace vss {
namespace {

using testing::HasSubstr;

const std::vector<std::string> kFiles = {"images/a.png", "images/b.png"};

Product Sample() {
  Part plate;
  plate.id = "part-1";
  plate.kind = "holed_plate";
  plate.resting_pose = "flat";
  plate.world_from_part = {RotationFromVector({0, 0, 0.5}), {1200.5, -3, 0}};
  plate.yaw_rad = 0.5;
  plate.dimensions = {{"length", 1200.4, 0.31, true, ""},
                      {"height", 12, std::nan(""), false, "usual value of the knowledge base"}};
  plate.vertices = {{0, 0, 0}, {1, 0, 0}};
  plate.vertex_sigma = {{0.2, 0.2, 0.3}, {0.1, 0.1, 0.1}};
  plate.edges = {{0, 1}};
  plate.circles = {{{1, 2, 3}, {0, 0, 1}, 100}};
  plate.images = {1};
  plate.matches = {{1, 4, 2, false, 0.05}, {1, 0, 1, true, 0.1}};
  plate.picture_residuals = {{1, 0.07, 5}};
  plate.remarks = {"it leans by 1.2 degrees"};
  plate.covariance = Eigen::MatrixXd::Identity(8, 8) * 0.04;
  plate.residual_px = 0.08;
  plate.doubtful = true;
  plate.log_odds = 31.5;
  plate.runner_up = RunnerUp{"box", 12.25};
  Product product;
  product.survey = "lab \"1\"";
  product.parts = {plate};
  product.seams = {{"part-1", "part-2", {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}}};
  product.unknown = {{{5, 6, 7}, {1, 1, 1}, 9}};
  product.warnings = {"camera cam1: few views"};
  return product;
}

class ProductFile : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  Result<Product> Read(const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(path_, text));
    return ReadProduct(path_, kFiles);
  }
  std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / fmt::format("vss-product-{}.json", ::getpid());
};

TEST_F(ProductFile, HasTheFieldsOfTheContract) {
  const auto json = nlohmann::json::parse(ProductToJson(Sample(), kFiles));
  EXPECT_EQ(json["format"], "vss-product/1");
  EXPECT_EQ(json["units"], "mm");
  EXPECT_EQ(json["survey"], "lab \"1\"");
  const auto& part = json["parts"][0];
  EXPECT_EQ(part["id"], "part-1");
  EXPECT_EQ(part["kind"], "holed_plate");
  EXPECT_EQ(part["source"], "automatic");
  EXPECT_EQ(part["pose"]["position"], nlohmann::json({1200.5, -3.0, 0.0}));
  EXPECT_NEAR(part["pose"]["rotation"][1][0].get<double>(), std::sin(0.5), 1e-9);
  EXPECT_NEAR(part["pose"]["yaw"].get<double>(), 28.64789, 1e-5);
  EXPECT_EQ(part["dimensions"]["length"],
            nlohmann::json({{"value", 1200.4}, {"sigma", 0.31}, {"observable", true}}));
  EXPECT_EQ(part["dimensions"]["height"]["observable"], false);
  EXPECT_EQ(part["dimensions"]["height"]["sigma"], nullptr);
  EXPECT_EQ(part["dimensions"]["height"]["origin"], "usual value of the knowledge base");
  EXPECT_EQ(part["vertices"][1], nlohmann::json({1.0, 0.0, 0.0}));
  EXPECT_EQ(part["edges"], nlohmann::json({{0, 1}}));
  EXPECT_EQ(part["circles"][0]["radius"], 100.0);
  EXPECT_EQ(part["stands_on"], "ground");
  EXPECT_EQ(part["images"], nlohmann::json({"images/b.png"}));
  EXPECT_EQ(part["residual_px"], 0.08);
  EXPECT_EQ(part["doubtful"], true);
  EXPECT_EQ(part["runner_up"]["kind"], "box");
  EXPECT_EQ(json["seams"][0]["parts"], nlohmann::json({"part-1", "part-2"}));
  EXPECT_EQ(json["seams"][0]["end"], nlohmann::json({1.0, 0.0, 0.0}));
  EXPECT_EQ(json["unknown"][0]["lines"], 9);
}

TEST_F(ProductFile, ReadsBackToTheSameBytes) {
  const std::string text = ProductToJson(Sample(), kFiles);
  const auto product = Read(text);
  ASSERT_TRUE(product) << product.error().message;
  EXPECT_EQ(ProductToJson(*product, kFiles), text);
  EXPECT_EQ(product->parts[0].matches.size(), 2u);
  EXPECT_TRUE(std::isnan(product->parts[0].dimensions[1].sigma_mm));
}

TEST_F(ProductFile, WithoutPartsIsStillWhole) {
  const auto json = nlohmann::json::parse(ProductToJson({}, {}));
  EXPECT_TRUE(json["parts"].is_array());
  EXPECT_TRUE(json["seams"].is_array());
}

TEST_F(ProductFile, SaysWhatIsWrongWithAFile) {
  EXPECT_THAT(Read("{\n\"format\": \n").error().message, HasSubstr(":3: not valid JSON"));
  EXPECT_THAT(Read("[]").error().message, HasSubstr("`format`"));
  EXPECT_THAT(Read("{\"format\": \"vss-lines/1\"}").error().message, HasSubstr("`format`"));
  EXPECT_THAT(Read("{\"format\": \"vss-product/1\"}").error().message, HasSubstr("parts"));
  std::string text = ProductToJson(Sample(), kFiles);
  text.replace(text.find("[ [0,1] ]") == std::string::npos ? text.find("[[0,1]]") : text.find("[ [0,1] ]"), 7,
               "[[0,9]]");
  EXPECT_THAT(Read(text).error().message, HasSubstr("vertex that is not there"));
  EXPECT_FALSE(ReadProduct(path_.string() + ".none", kFiles));
}

}  // namespace
}  // namespace vss
