#include "vss/identify/open_ends.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vss {
namespace {

class OpenEnds : public testing::Test {
 protected:
  OpenEnds() {
    bar_.model = knowledge_.Find("box");
    bar_.dimensions_mm = {400, 20, 13};
    solid_ = PlaceSolid(bar_, false);
    shown_.assign(solid_.edges.size(), {12, 1200, 1000});
  }

  // The bar's two ends, of four edges each, as the pictures show each edge.
  void Ends(const EdgeShown& one, const EdgeShown& other) {
    const auto at = [&](int vertex) { return solid_.vertices[std::size_t(vertex)].point.x(); };
    for (std::size_t i = 0; i < solid_.edges.size(); ++i) {
      const double from = at(solid_.edges[i].start), to = at(solid_.edges[i].end);
      if (std::abs(from - to) < 1) shown_[i] = from < 0 ? one : other;
    }
  }

  KnowledgeBase knowledge_ = *LoadKnowledge({}, ".");
  PlacedObject bar_;
  WorldSolid solid_;
  std::vector<EdgeShown> shown_;
};

TEST_F(OpenEnds, ABarWithoutEitherEndLacksBoth) {
  EXPECT_EQ(MissingEnds(solid_, shown_), 0);
  Ends({12, 40, 1}, {12, 40, 0});
  EXPECT_EQ(MissingEnds(solid_, shown_), 2);
}

TEST_F(OpenEnds, WhatIsHigherThanACableIsThickIsNoLengthOfOne) {
  Ends({12, 40, 0}, {12, 40, 0});
  bar_.dimensions_mm = {400, 20, 59};
  EXPECT_EQ(MissingEnds(PlaceSolid(bar_, false), shown_), 2);
  bar_.dimensions_mm = {400, 20, 61};
  EXPECT_EQ(MissingEnds(PlaceSolid(bar_, false), shown_), 0);
}

TEST_F(OpenEnds, OneEndMayBeMissedOrHidden) {
  Ends({12, 40, 2}, {12, 40, 24});
  EXPECT_EQ(MissingEnds(solid_, shown_), 1);
  Ends({12, 40, 2}, {0, 0, 0});
  EXPECT_EQ(MissingEnds(solid_, shown_), 1);
}

TEST_F(OpenEnds, EndsOfAFewPixelsAreNotFoundAsLines) {
  Ends({12, 20, 0}, {12, 20, 0});
  EXPECT_EQ(MissingEnds(solid_, shown_), 0);
}

TEST_F(OpenEnds, WhereTheSidesAreNotFoundTheirEndsSayNothing) {
  for (auto& s : shown_) s.supported_px = 100;
  Ends({12, 40, 0}, {12, 40, 0});
  EXPECT_EQ(MissingEnds(solid_, shown_), 0);
}

}  // namespace
}  // namespace vss
