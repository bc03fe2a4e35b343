#include "vss/product/nominal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>

#include "vss/base/files.h"
#include "vss/product/make_part.h"

namespace vss {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class Nominal : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }

  Part Built(const std::string& id, const std::string& kind, const std::vector<double>& dims,
             const Eigen::Vector3d& at, double yaw_rad, double sigma = 0.2) const {
    IdentifiedPart found;
    found.object.model = knowledge_.Find(kind);
    found.object.dimensions_mm = dims;
    found.object.placement << at, yaw_rad, 0, 0;
    Part part = MakePart(found, id, {});
    const auto n = static_cast<Eigen::Index>(6 + dims.size());
    part.covariance = Eigen::MatrixXd::Identity(n, n) * sigma * sigma;
    part.covariance.block<3, 3>(3, 3) *= 1e-6;
    for (auto& d : part.dimensions) d.sigma_mm = sigma;
    return part;
  }

  Result<std::vector<NominalPart>> Read(const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(path_, text));
    return ReadNominal(path_, knowledge_);
  }

  static const Deviation& Of(const PartDeviation& part, const std::string& name) {
    for (const auto& d : part.deviations)
      if (d.name == name) return d;
    ADD_FAILURE() << "no deviation of " << name;
    return part.deviations.front();
  }

  KnowledgeBase knowledge_ = *LoadKnowledge({}, ".");
  std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / fmt::format("vss-nominal-{}.toml", ::getpid());
};

TEST_F(Nominal, SaysWhatDiffersAndWhetherThePicturesAreSure) {
  Product product;
  product.parts = {Built("part-1", "box", {1203, 300.1, 20}, {100, 200, 0}, 0.5)};
  const std::vector<NominalPart> designed = {
      {"base", "box", {{"length", 1200}, {"width", 300}, {"height", 20}}, Eigen::Vector3d(101, 200, 0), 0.5}};
  const auto c = CompareWithNominal(designed, product, {});
  ASSERT_EQ(c.parts.size(), 1u);
  EXPECT_EQ(c.parts[0].matched_by, "place");
  EXPECT_NEAR(Of(c.parts[0], "length").difference(), 3, 1e-9);
  EXPECT_NEAR(Of(c.parts[0], "length").sigmas(), 15, 1e-9);
  EXPECT_TRUE(Of(c.parts[0], "length").significant);
  EXPECT_NEAR(Of(c.parts[0], "width").difference(), 0.1, 1e-9);
  EXPECT_FALSE(Of(c.parts[0], "width").significant);
  EXPECT_NEAR(Of(c.parts[0], "x").difference(), -1, 1e-9);
  EXPECT_TRUE(Of(c.parts[0], "x").significant);
  EXPECT_NEAR(Of(c.parts[0], "yaw").difference(), 0, 1e-9);
  EXPECT_TRUE(c.missing.empty());
  EXPECT_TRUE(c.extra.empty());
  EXPECT_THAT(DeviationTable(c), HasSubstr("+3.00"));
}

TEST_F(Nominal, PairsPartsOfOneKindByPlaceWhateverTheirIds) {
  Product product;
  product.parts = {Built("part-1", "box", {500, 300, 20}, {2000, 0, 0}, 0),
                   Built("part-2", "box", {510, 300, 20}, {0, 0, 0}, 0),
                   Built("part-3", "tee", {500, 100, 100, 10, 10}, {0, 900, 0}, 0)};
  const std::vector<NominalPart> designed = {
      {"part-1", "box", {{"length", 500}}, Eigen::Vector3d(10, 0, 0), {}},
      {"part-2", "box", {}, Eigen::Vector3d(2010, 0, 0), {}},
      {"far", "tee", {}, Eigen::Vector3d(0, 0, 0), {}}};
  const auto c = CompareWithNominal(designed, product, {});
  ASSERT_EQ(c.parts.size(), 2u);
  EXPECT_EQ(c.parts[0].part, "part-2");
  EXPECT_EQ(c.parts[1].part, "part-1");
  EXPECT_THAT(c.missing, ElementsAre("far"));
  EXPECT_THAT(c.extra, ElementsAre("part-3"));
}

TEST_F(Nominal, WithoutAPlaceTheIdAndThenTheSizeDecide) {
  Product product;
  product.parts = {Built("part-1", "box", {500, 300, 20}, {0, 0, 0}, 0),
                   Built("part-2", "box", {800, 300, 20}, {0, 900, 0}, 0),
                   Built("part-3", "box", {1100, 300, 20}, {0, 1800, 0}, 0)};
  const std::vector<NominalPart> designed = {{"long", "box", {{"length", 1090}}, {}, {}},
                                             {"part-2", "box", {{"length", 1105}}, {}, {}},
                                             {"short", "box", {{"length", 510}}, {}, {}}};
  const auto c = CompareWithNominal(designed, product, {});
  ASSERT_EQ(c.parts.size(), 3u);
  EXPECT_EQ(c.parts[0].part, "part-3");
  EXPECT_EQ(c.parts[0].matched_by, "size");
  EXPECT_EQ(c.parts[1].part, "part-2");
  EXPECT_EQ(c.parts[1].matched_by, "id");
  EXPECT_EQ(c.parts[2].part, "part-1");
}

TEST_F(Nominal, HalfATurnIsNoDeviationOfWhatIsAlikeBothWays) {
  Product product;
  product.parts = {Built("part-1", "box", {500, 300, 20}, {0, 0, 0}, 0.2 + kPi),
                   Built("part-2", "bracket", {300, 200, 15, 30}, {0, 900, 0}, 0.2 + kPi)};
  const std::vector<NominalPart> designed = {{"a", "box", {}, Eigen::Vector3d(0, 0, 0), 0.2},
                                             {"b", "bracket", {}, Eigen::Vector3d(0, 900, 0), 0.2}};
  const auto c = CompareWithNominal(designed, product, {});
  EXPECT_NEAR(Of(c.parts[0], "yaw").difference(), 0, 1e-9);
  EXPECT_NEAR(std::abs(Of(c.parts[1], "yaw").difference()), 180, 1e-9);
}

TEST_F(Nominal, ADesignThatCallsTheShorterSideLengthIsTheSamePlate) {
  Product product;
  product.parts = {Built("part-1", "holed_plate", {500, 300, 20, 80, 60, -25}, {0, 0, 0}, kPi / 2)};
  const std::vector<NominalPart> designed = {
      {"a",
       "holed_plate",
       {{"length", 300}, {"width", 500}, {"hole_diameter", 80}, {"hole_x", 25}, {"hole_y", 60}},
       Eigen::Vector3d(0, 0, 0),
       0.0}};
  const auto c = CompareWithNominal(designed, product, {});
  for (const auto& d : c.parts[0].deviations) EXPECT_NEAR(d.difference(), 0, 1e-9) << d.name;
}

TEST_F(Nominal, WhatIsNotObservableIsNoSignificantDeviation) {
  Product product;
  product.parts = {Built("part-1", "tee", {500, 100, 100, 10, 10}, {0, 0, 0}, 0)};
  product.parts[0].dimensions[3].observable = false;
  const std::vector<NominalPart> designed = {{"part-1", "tee", {{"web", 20}}, {}, {}}};
  const auto c = CompareWithNominal(designed, product, {});
  EXPECT_FALSE(Of(c.parts[0], "web").significant);
  EXPECT_THAT(DeviationTable(c), HasSubstr("not observable"));
}

TEST_F(Nominal, ReadsAListOfParts) {
  const auto parts = Read(R"(format = "vss-nominal/1"
[[part]]
id = "web 1"
kind = "tee"
position = [1200.0, 800.0, 0.0]
yaw = 30.0
dimensions = { length = 1200.0, web = 20 }
)");
  ASSERT_TRUE(parts) << parts.error().message;
  ASSERT_EQ(parts->size(), 1u);
  EXPECT_EQ((*parts)[0].id, "web 1");
  EXPECT_NEAR(*(*parts)[0].yaw_rad, kPi / 6, 1e-12);
  EXPECT_EQ((*parts)[0].dimensions_mm.size(), 2u);
}

TEST_F(Nominal, ReadsAProduct) {
  Product product;
  product.parts = {Built("part-1", "box", {500, 300, 20}, {0, 0, 0}, 0)};
  const auto parts = Read(ProductToJson(product, {}));
  ASSERT_TRUE(parts) << parts.error().message;
  EXPECT_EQ(parts->at(0).dimensions_mm.size(), 3u);
}

TEST_F(Nominal, ABadFileGivesOneSentenceWithItsLine) {
  const std::string top = "format = \"vss-nominal/1\"\n[[part]]\nid = \"a\"\n";
  const std::pair<std::string, std::string> cases[] = {
      {top + "kind = \"gear\"\n", "`part[1].kind` is \"gear\""},
      {top + "kind = \"box\"\ndimensions = { web = 3.0 }\n",
       "is no dimension of a box; it has length, width and height"},
      {top + "kind = \"box\"\ndimensions = { length = -3.0 }\n", "must be above 0"},
      {top + "kind = \"box\"\n", "neither dimensions nor a position"},
      {top + "kind = \"box\"\nposition = [1.0, 2.0]\n", "position"},
      {top + "kind = \"box\"\nposition = [1.0, 2.0, 0.0]\n[[part]]\nid = \"a\"\nkind = \"box\"\nposition = "
             "[1.0, 2.0, 0.0]\n",
       "has the id \"a\" of a part above"},
      {"format = \"vss-nominal/1\"\n", "part"},
      {"format = \"vss-survey/1\"\n", "vss-nominal/1"},
      {"{ \"format\": \"vss-product/1\", \"parts\": [] }", "has no parts"},
      {"", "format"}};
  for (const auto& [text, said] : cases) {
    const auto parts = Read(text);
    ASSERT_FALSE(parts) << text;
    EXPECT_THAT(parts.error().message, HasSubstr(path_.string())) << text;
    EXPECT_EQ(parts.error().message.find('\n'), std::string::npos);
    EXPECT_THAT(parts.error().message, HasSubstr(said)) << text;
  }
}

}  // namespace
}  // namespace vss
