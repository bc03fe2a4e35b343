#include "cut.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace vss::station {
namespace {

using Eigen::Vector3d;

class CutTest : public testing::Test {
 protected:
  void SetUp() override {
    const std::vector<std::string> shipped;
    knowledge = LoadKnowledge(shipped, ".").value();
  }
  PlacedObject At(const std::string& kind, std::vector<double> dimensions_mm) {
    PlacedObject object;
    object.model = knowledge.Find(kind);
    object.placement << 300, -200, 40, 0.7, 0, 0;
    object.dimensions_mm = std::move(dimensions_mm);
    return object;
  }
  CutAxis Along(const PlacedObject& object, const std::string& name) {
    for (const auto& cut : CutAxesOf(*object.model, object.dimensions_mm))
      if (object.model->dimensions()[cut.dimension].name == name) return cut;
    ADD_FAILURE() << "a " << object.model->kind() << " cannot be cut along its " << name;
    return {};
  }
  static double ValueOf(const PlacedObject& object, const std::string& name) {
    const auto defs = object.model->dimensions();
    for (std::size_t i = 0; i < defs.size(); ++i)
      if (defs[i].name == name) return object.dimensions_mm[i];
    return NAN;
  }
  // How far the nearest vertex of `object` is from each of `points`, at most.
  static double Missed(const PlacedObject& object, const std::vector<Vector3d>& points) {
    const WorldSolid solid = PlaceSolid(object, false);
    double most = 0;
    for (const auto& p : points) {
      double least = INFINITY;
      for (const auto& v : solid.vertices) least = std::min(least, (v.point - p).norm());
      most = std::max(most, least);
    }
    return most;
  }
  KnowledgeBase knowledge;
};

TEST_F(CutTest, KnowsWhatCanBeCut) {
  const auto names = [&](const std::string& kind) { return CutDimensionsOf(*knowledge.Find(kind)); };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names("box"), (Names{"length", "width", "height"}));
  EXPECT_EQ(names("holed_plate"), (Names{"length", "width", "height"}));
  EXPECT_EQ(names("i_beam"), Names{"length"});
  EXPECT_EQ(names("bracket"), (Names{"length", "thickness"}));
  EXPECT_EQ(names("pipe"), Names{"height"});
}

// The corners of the whole are corners of the pieces, and the new corners of both are at the same places.
TEST_F(CutTest, PiecesOfABoxFillItAlongEachOfItsSides) {
  const PlacedObject box = At("box", {900, 400, 250});
  for (const char* name : {"length", "width", "height"}) {
    const CutAxis cut = Along(box, name);
    const auto low = PieceOf(box, cut, 0, 0.3, knowledge), high = PieceOf(box, cut, 0.3, 1, knowledge);
    ASSERT_TRUE(low && high);
    double volume = 0;
    for (const auto& piece : {*low, *high}) {
      EXPECT_GE(piece.dimensions_mm[0], piece.dimensions_mm[1]) << "the longer side is the length";
      volume += piece.dimensions_mm[0] * piece.dimensions_mm[1] * piece.dimensions_mm[2];
    }
    EXPECT_NEAR(volume, 900. * 400 * 250, 1e-3);
    const WorldSolid whole = PlaceSolid(box, false);
    int of_low = 0, of_high = 0;
    for (const auto& v : whole.vertices) {
      of_low += Missed(*low, {v.point}) < 1e-6;
      of_high += Missed(*high, {v.point}) < 1e-6;
    }
    EXPECT_EQ(of_low, 4) << name;
    EXPECT_EQ(of_high, 4) << name;
    int shared = 0;
    for (const auto& v : PlaceSolid(*low, false).vertices) shared += Missed(*high, {v.point}) < 1e-6;
    EXPECT_EQ(shared, 4) << name << ": they touch in the cut";
  }
}

TEST_F(CutTest, AKneePlateBecomesTwoOfItsHeight) {
  const PlacedObject bracket = At("bracket", {600, 300, 12, 40});
  const CutAxis cut = Along(bracket, "length");
  const auto low = PieceOf(bracket, cut, 0, 0.4, knowledge), high = PieceOf(bracket, cut, 0.4, 1, knowledge);
  ASSERT_TRUE(low && high);
  EXPECT_NEAR(ValueOf(*low, "length"), 240, 1e-9);
  EXPECT_NEAR(ValueOf(*high, "length"), 360, 1e-9);
  EXPECT_NEAR(ValueOf(*high, "height"), 300, 1e-9);
  const Vector3d x = PlaceSolid(bracket, false).world_from_part.rotation.col(0);
  EXPECT_NEAR((PlaceSolid(*high, false).world_from_part.translation -
               PlaceSolid(*low, false).world_from_part.translation - 300 * x)
                  .norm(),
              0, 1e-6);
}

TEST_F(CutTest, AHoleStaysWhereItIsAndTheOtherPieceIsAPlainPlate) {
  const PlacedObject plate = At("holed_plate", {1000, 400, 20, 120, 250, 50});
  const Vector3d hole = PlaceSolid(plate, false).circles.front().center.point;
  for (const char* name : {"length", "width"}) {
    SCOPED_TRACE(name);
    const CutAxis cut = Along(plate, name);
    const double at = std::string(name) == "length" ? 0.4 : 0.3;  // beside the hole
    const auto low = PieceOf(plate, cut, 0, at, knowledge), high = PieceOf(plate, cut, at, 1, knowledge);
    ASSERT_TRUE(low && high);
    EXPECT_EQ(low->model->kind(), "box");
    EXPECT_NEAR(ValueOf(*low, "height"), 20, 1e-9);
    EXPECT_EQ(high->model->kind(), "holed_plate");
    EXPECT_GE(ValueOf(*high, "length"), ValueOf(*high, "width"));
    EXPECT_NEAR(ValueOf(*high, "hole_diameter"), 120, 1e-9);
    EXPECT_NEAR((PlaceSolid(*high, false).circles.front().center.point - hole).norm(), 0, 1e-6);
  }
}

// 400 x 1000 with a hole off its middle, cut to 400 x 300: the longer side now runs the other way, and the
// hole's place with it.
TEST_F(CutTest, AHoleStaysWhereItIsWhenLengthAndWidthAreExchanged) {
  const PlacedObject plate = At("holed_plate", {1000, 400, 20, 80, 380, -60});
  const Vector3d hole = PlaceSolid(plate, false).circles.front().center.point;
  const auto piece = PieceOf(plate, Along(plate, "length"), 0.7, 1, knowledge);
  ASSERT_TRUE(piece) << piece.error().message;
  EXPECT_NEAR(ValueOf(*piece, "length"), 400, 1e-9);
  EXPECT_NEAR(ValueOf(*piece, "width"), 300, 1e-9);
  EXPECT_NEAR((PlaceSolid(*piece, false).circles.front().center.point - hole).norm(), 0, 1e-6);
}

TEST_F(CutTest, SaysWhereItCannotCut) {
  const PlacedObject plate = At("holed_plate", {1000, 400, 20, 120, 0, 0});
  const auto through = PieceOf(plate, Along(plate, "length"), 0, 0.5, knowledge);
  ASSERT_FALSE(through);
  EXPECT_EQ(through.error().message, "the cut goes through a hole; cut beside it");
  const auto narrow = PieceOf(plate, Along(plate, "length"), 0.4395, 1, knowledge);
  ASSERT_FALSE(narrow) << "half a millimetre is left beside the hole";
  EXPECT_NE(narrow.error().message.find("is no holed_plate any more"), std::string::npos);
}

TEST_F(CutTest, OnePlateOnTheOther) {
  const PlacedObject box = At("box", {900, 400, 60});
  const auto high = PieceOf(box, Along(box, "height"), 0.25, 1, knowledge);
  ASSERT_TRUE(high);
  EXPECT_NEAR(high->placement[2], 40 + 15, 1e-9) << "it stands on the lower one";
  EXPECT_NEAR(ValueOf(*high, "height"), 45, 1e-9);
}

TEST_F(CutTest, APipeIsCutAcross) {
  const PlacedObject pipe = At("pipe", {300, 800, 10});
  const auto high = PieceOf(pipe, Along(pipe, "height"), 0.5, 1, knowledge);
  ASSERT_TRUE(high);
  EXPECT_NEAR(ValueOf(*high, "height"), 400, 1e-9);
  EXPECT_NEAR(high->placement[2], 440, 1e-9);
}

TEST_F(CutTest, TwoPiecesAreStretchedToTheWhole) {
  const PlacedObject box = At("box", {900, 400, 60});
  const CutAxis cut = Along(box, "width");
  const auto low = PieceOf(box, cut, 0, 0.5, knowledge);
  ASSERT_TRUE(low);
  const PlacedObject whole = Stretched(*low, Along(*low, "width"), {-100, 300}, knowledge);
  std::vector<Vector3d> corners;
  for (const auto& v : PlaceSolid(box, false).vertices) corners.push_back(v.point);
  EXPECT_LT(Missed(whole, corners), 1e-6);
}

}  // namespace
}  // namespace vss::station
