#include "vss/export/export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "vss/export/sample_product.h"

namespace vss {
namespace {

using testing::HasSubstr;
using Formats = std::vector<std::string>;

std::vector<std::string> NamesOf(const std::vector<ExportedFile>& files) {
  std::vector<std::string> names;
  for (const auto& file : files) names.push_back(file.name);
  return names;
}

TEST(Export, WritesTheFilesOfTheFormatsThatAreWanted) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = PlateWithUpright(knowledge);
  const auto files = ExportProduct(product, knowledge, Formats{"csv", "glb"});
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_EQ(NamesOf(*files), (Formats{"workpiece.glb", "parts.csv", "seams.csv"}));
  for (const auto& file : *files) EXPECT_FALSE(file.content.empty());
}

TEST(Export, SaysWhichFormatsThereAre) {
  const auto none = ExportProduct({}, {}, Formats{});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, HasSubstr("step, glb or csv"));
  const auto other = ExportProduct({}, {}, Formats{"dxf"});
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().message, HasSubstr("\"dxf\""));
  EXPECT_EQ(ExportFormats().size(), 3u);
}

TEST(Export, NamesThePartThatTheKnowledgeBaseDoesNotDescribe) {
  const KnowledgeBase knowledge = Shipped();
  Product product = PlateWithUpright(knowledge);
  product.parts[1].kind = "trough";
  const auto files = ExportProduct(product, knowledge, Formats{"glb"});
  ASSERT_FALSE(files);
  EXPECT_THAT(files.error().message, HasSubstr("part-2 is a trough"));
  EXPECT_TRUE(ExportProduct(product, knowledge, Formats{"csv"}));
}

TEST(Export, RefusesDimensionsThatMakeNoSolid) {
  const KnowledgeBase knowledge = Shipped();
  Product product = PlateWithUpright(knowledge);
  product.parts[0].dimensions[2].value_mm = -5;
  EXPECT_THAT(ExportProduct(product, knowledge, Formats{"glb"}).error().message, HasSubstr("make no box"));
  product.parts[0].dimensions[2].value_mm = std::nan("");
  EXPECT_THAT(ExportProduct(product, knowledge, Formats{"glb"}).error().message,
              HasSubstr("`height` of part-1"));
  product.parts[0].dimensions.pop_back();
  EXPECT_THAT(ExportProduct(product, knowledge, Formats{"glb"}).error().message,
              HasSubstr("no dimension `height`"));
}

TEST(Export, TakesAPlateThatMeasuresALittleWiderThanLong) {
  const KnowledgeBase knowledge = Shipped();
  Product product = PlateWithUpright(knowledge);
  product.parts[0].dimensions[0].value_mm = 799.9;
  EXPECT_TRUE(ExportProduct(product, knowledge, Formats{"glb"}));
}

}  // namespace
}  // namespace vss
