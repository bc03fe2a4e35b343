#include "vss/identify/unknown.h"

#include <gtest/gtest.h>

namespace vss {
namespace {

using Eigen::Vector3d;

WorldLine Line(const Vector3d& start, const Vector3d& end) {
  WorldLine l;
  l.start = start;
  l.end = end;
  l.num_views = 6;
  l.num_stops = 2;
  return l;
}

// The top edges of a block 400 x 300 mm, and one of its uprights.
std::vector<WorldLine> Block(double height) {
  return {Line({0, 0, height}, {400, 0, height}), Line({400, 0, height}, {400, 300, height}),
          Line({400, 300, height}, {0, 300, height}), Line({0, 300, height}, {0, 0, height}),
          Line({0, 0, 0}, {0, 0, height})};
}

TEST(FindUnknown, TellsWhereEdgesOfAnUnknownObjectAre) {
  auto lines = Block(200);
  for (auto& l : Block(150)) {  // another, two metres away
    l.start.x() += 2000;
    l.end.x() += 2000;
    lines.push_back(l);
  }
  const auto groups = FindUnknown(lines, {}, {}, 5);
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_EQ(groups[0].num_lines, 5);
  EXPECT_LT((groups[0].center - Vector3d(200, 150, 100)).norm(), 1e-9);
  EXPECT_LT((groups[0].extent - Vector3d(400, 300, 200)).norm(), 1e-9);
}

TEST(FindUnknown, TakesWhatLiesFlatForPaintOrShadow) {
  EXPECT_TRUE(FindUnknown(Block(10), {}, {}, 5).empty());
}

TEST(FindUnknown, IsSilentWhereAPartIsKnown) {
  const Eigen::AlignedBox3d part(Vector3d(-5, -5, 0), Vector3d(405, 305, 205));
  EXPECT_TRUE(FindUnknown(Block(200), {}, {&part, 1}, 5).empty());
}

TEST(FindUnknown, WantsEdgesThatSeveralStationsSaw) {
  auto lines = Block(200);
  for (auto& l : lines) l.num_stops = 1;
  EXPECT_TRUE(FindUnknown(lines, {}, {}, 5).empty());
}

}  // namespace
}  // namespace vss
