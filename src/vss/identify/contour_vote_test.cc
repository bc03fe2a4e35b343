#include "vss/identify/contour_vote.h"

#include <gtest/gtest.h>

namespace vss {
namespace {

TEST(IndependentPieces, AShortContourIsOneObservation) {
  EXPECT_DOUBLE_EQ(IndependentPieces(4), 0.5);
  EXPECT_DOUBLE_EQ(IndependentPieces(8), 1);
  EXPECT_DOUBLE_EQ(IndependentPieces(24), 1);
  EXPECT_DOUBLE_EQ(IndependentPieces(50), 2);
  double before = 0;
  for (double px = 0; px < 1000; px += 5) {
    EXPECT_GE(IndependentPieces(px), before);
    before = IndependentPieces(px);
  }
}

TEST(OpenLedges, ALedgeWhoseEndsAreRatherNotThereCosts) {
  MeasuredContours measured;
  measured.ledge_ends = {{0, 1}, {2, 3}};
  EXPECT_EQ(OpenLedges(measured, std::vector{3.0, -1.0, 2.0, 0.0}), 0);
  const double one = OpenLedges(measured, std::vector{1.0, -3.0, 2.0, 0.0});
  EXPECT_LT(one, 0);
  EXPECT_DOUBLE_EQ(OpenLedges(measured, std::vector{1.0, -3.0, -2.0, 0.0}), 2 * one);
}

}  // namespace
}  // namespace vss
