#include "vss/identify/measured_contours.h"

#include <gtest/gtest.h>

namespace vss {
namespace {

// Of the shipped kinds at their usual dimensions: legs and flanges that lie have two ends each, a box has no
// ledge.
TEST(MeasureContours, KnowsLedgesByTheirEnds) {
  const KnowledgeBase knowledge = *LoadKnowledge({}, ".");
  SceneIndex scene;
  auto ledges = [&](const std::string& kind, std::vector<double> dimensions_mm) {
    PlacedObject o;
    o.model = knowledge.Find(kind);
    o.dimensions_mm = std::move(dimensions_mm);
    const WorldSolid solid = PlaceSolid(o, false);
    const auto found = MeasureContours(solid, {}, scene, {}).ledge_ends;
    for (const auto& ends : found)
      for (int e : ends) {
        const auto& edge = solid.edges[std::size_t(e)];
        const Eigen::Vector3d along =
            solid.vertices[std::size_t(edge.end)].point - solid.vertices[std::size_t(edge.start)].point;
        EXPECT_NEAR(along.x(), 0, 1e-9) << kind;  // across the length
        EXPECT_NEAR(along.z(), 0, 1e-9) << kind;
      }
    std::vector<std::size_t> sizes;
    for (const auto& ends : found) sizes.push_back(ends.size());
    return sizes;
  };
  EXPECT_EQ(ledges("box", {1000, 200, 100}), (std::vector<std::size_t>{}));
  EXPECT_EQ(ledges("angle", {1000, 200, 150, 20}), (std::vector<std::size_t>{2}));
  EXPECT_EQ(ledges("i_beam", {1000, 200, 300, 20, 20}), (std::vector<std::size_t>{2, 2}));
  EXPECT_EQ(ledges("channel", {1000, 250, 100, 20, 20}), (std::vector<std::size_t>{2}));
}

}  // namespace
}  // namespace vss
