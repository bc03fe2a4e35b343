#include "vss/export/csv.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include "vss/export/sample_product.h"

namespace vss {
namespace {

using Row = std::map<std::string, std::string>;

std::vector<Row> RowsOf(const std::string& csv) {
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  const auto names = Fields(line);
  std::vector<Row> rows;
  while (std::getline(lines, line)) {
    const auto fields = Fields(line);
    EXPECT_EQ(fields.size(), names.size()) << line;
    Row row;
    for (std::size_t i = 0; i < std::min(names.size(), fields.size()); ++i) row[names[i]] = fields[i];
    rows.push_back(row);
  }
  return rows;
}

double At(const Row& row, const std::string& name) { return std::stod(row.at(name)); }

TEST(PartsCsv, HasARowForEveryPartAndAColumnForEveryDimension) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = EveryKind(knowledge);
  const auto rows = RowsOf(PartsCsv(product));
  ASSERT_EQ(rows.size(), product.parts.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Part& part = product.parts[i];
    EXPECT_EQ(rows[i].at("part"), part.id);
    EXPECT_EQ(rows[i].at("kind"), part.kind);
    EXPECT_NEAR(At(rows[i], "x_world_mm"), part.world_from_part.translation.x(), 1e-4);
    EXPECT_NEAR(At(rows[i], "world_from_part_yx"), part.world_from_part.rotation(1, 0), 1e-8);
    for (const auto& d : part.dimensions) {
      EXPECT_NEAR(At(rows[i], d.name + "_mm"), d.value_mm, 1e-4);
      EXPECT_EQ(rows[i].at(d.name + "_observable"), "yes");
    }
  }
  EXPECT_EQ(rows[0].count("hole_diameter_mm"), 1u);
}

TEST(PartsCsv, LeavesEmptyWhatIsNotKnownAndQuotesWhatSeparates) {
  Product product = PlateWithUpright(Shipped());
  product.parts[0].dimensions[0].sigma_mm = std::nan("");
  product.parts[0].dimensions[1].observable = false;
  product.parts[0].stands_on = "the \"left\", or right";
  const std::string csv = PartsCsv(product);
  EXPECT_NE(csv.find("\"the \"\"left\"\", or right\""), std::string::npos);
  const auto rows = RowsOf(csv);
  EXPECT_EQ(rows[0].at("length_sigma_mm"), "");
  EXPECT_EQ(rows[0].at("width_observable"), "no");
  EXPECT_EQ(rows[1].at("length_sigma_mm"), "0.25");
}

TEST(SeamsCsv, StartsEachRowWithAPointAndTheDirectionOfApproach) {
  const Product product = PlateWithUpright(Shipped());
  const std::string csv = SeamsCsv(product);
  EXPECT_EQ(csv.rfind("x_world_mm,y_world_mm,z_world_mm,i,j,k,", 0), 0u);
  const auto rows = RowsOf(csv);
  ASSERT_EQ(rows.size(), 2 * product.seams.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Seam& seam = product.seams[i / 2];
    const Eigen::Vector3d point = i % 2 == 0 ? seam.start : seam.end, approach = ApproachOf(seam);
    EXPECT_NEAR(At(rows[i], "x_world_mm"), point.x(), 1e-4);
    EXPECT_NEAR(At(rows[i], "z_world_mm"), point.z(), 1e-4);
    EXPECT_NEAR(At(rows[i], "k"), approach.z(), 1e-8);
    EXPECT_NEAR(std::hypot(At(rows[i], "i"), At(rows[i], "j"), At(rows[i], "k")), 1, 1e-8);
    EXPECT_NEAR(At(rows[i], "gap_mm"), 0.5, 1e-4);
    EXPECT_NEAR(At(rows[i], "length_mm"), 600, 1e-4);
    EXPECT_EQ(At(rows[i], "seam"), static_cast<double>(i / 2 + 1));
  }
}

}  // namespace
}  // namespace vss
