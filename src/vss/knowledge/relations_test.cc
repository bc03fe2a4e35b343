#include "vss/knowledge/relations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "vss/knowledge/object_model.h"

namespace vss {
namespace {

using Eigen::Vector3d;
using Force = ObjectRelation::Force;
using Kind = ObjectRelation::Kind;

const KnowledgeBase& Knowledge() {
  static const KnowledgeBase knowledge = *LoadKnowledge({}, ".");
  return knowledge;
}

RelatedSolid Place(const std::string& kind, const std::vector<double>& dimensions_mm, const Vector3d& at,
                   double yaw_deg = 0) {
  const auto solid = Knowledge().Find(kind)->Instantiate(dimensions_mm);
  EXPECT_TRUE(solid) << solid.error().message;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(yaw_deg * M_PI / 180, Vector3d::UnitZ()).toRotationMatrix();
  RelatedSolid out{kind, {}, turn * Vector3d::UnitX()};
  for (const SolidFace& face : solid->faces)
    for (const auto& t : face.triangles)
      out.triangles.push_back({turn * t[0] + at, turn * t[1] + at, turn * t[2] + at});
  return out;
}

double Distance(const RelatedSolid& a, const RelatedSolid& b) {
  return DistanceOf(a.triangles, b.triangles, 1e6);
}

TEST(DistanceOf, IsThatOfFacesEdgesAndCorners) {
  const RelatedSolid cube = Place("box", {100, 100, 100}, {0, 0, 0});
  EXPECT_NEAR(Distance(cube, Place("box", {100, 100, 100}, {150, 0, 0})), 50, 1e-9);      // face to face
  EXPECT_NEAR(Distance(cube, Place("box", {100, 100, 100}, {130, 140, 0})), 50, 1e-9);    // edge to edge
  EXPECT_NEAR(Distance(cube, Place("box", {100, 100, 100}, {120, 130, 160})), 70, 1e-9);  // corner to corner
  EXPECT_NEAR(Distance(cube, Place("box", {100, 100, 100}, {50 + 50 * std::sqrt(2) + 7, 0, 0}, 45)), 7, 1e-9);
  EXPECT_NEAR(Distance(cube, Place("box", {100, 100, 100}, {100, 0, 0})), 0, 1e-9);  // they touch
  EXPECT_NEAR(Distance(cube, Place("box", {300, 20, 20}, {0, 0, 40})), 0, 1e-9);     // one runs through
  EXPECT_EQ(DistanceOf(cube.triangles, Place("box", {100, 100, 100}, {500, 0, 0}).triangles, 30), 30);
}

TEST(DistanceOf, IsAsFarAsTheNearestOfManyPoints) {
  // Against dense samples of two triangles: never more than theirs, and less by no more than their spacing.
  std::mt19937 random(5);
  const auto number = [&] { return 200.0 * random() / std::mt19937::max() - 100; };
  for (int trial = 0; trial < 60; ++trial) {
    std::array<Triangle3, 2> t;
    for (Triangle3& triangle : t)
      for (Vector3d& p : triangle) p = Vector3d(number(), number(), number());
    constexpr int kSteps = 24;
    std::array<std::vector<Vector3d>, 2> points;
    for (int k = 0; k < 2; ++k)
      for (int i = 0; i <= kSteps; ++i)
        for (int j = 0; j <= kSteps - i; ++j)
          points[k].push_back(t[k][0] + (t[k][1] - t[k][0]) * i / kSteps + (t[k][2] - t[k][0]) * j / kSteps);
    double sampled = INFINITY;
    for (const Vector3d& p : points[0])
      for (const Vector3d& q : points[1]) sampled = std::min(sampled, (p - q).norm());
    const double distance = DistanceOf({&t[0], 1}, {&t[1], 1}, 1e6);
    EXPECT_LE(distance, sampled + 1e-9);
    EXPECT_GE(distance, sampled - 2 * 350.0 / kSteps);
  }
}

ObjectRelation Relation(Force force, Kind kind, std::vector<std::string> kinds, double weight,
                        std::vector<std::string> others = {}, double within_mm = 0) {
  return {force, kind, std::move(kinds), std::move(others), within_mm, weight, ""};
}

// A bracket in the corner between a plate that lies and one that stands.
struct Corner {
  RelatedSolid base = Place("box", {1000, 600, 20}, {0, 0, 0});
  RelatedSolid wall = Place("box", {600, 20, 400}, {-210, 0, 20}, 90);
  RelatedSolid bracket = Place("bracket", {300, 300, 15, 40}, {-50, 0, 20});
};

TEST(RelationLogOdds, AddsTheWeightOfWhatHolds) {
  const Corner c;
  const std::vector<RelatedSolid> others{c.base, c.wall};
  const std::vector<ObjectRelation> between{
      Relation(Force::kPrefers, Kind::kBetween, {"box"}, 3, {"box", "tee"})};
  EXPECT_EQ(RelationLogOdds(between, c.bracket, others, 2), 3);
  EXPECT_EQ(RelationLogOdds(between, c.bracket, {&others[0], 1}, 2), 0);  // one plate is no corner
  const RelatedSolid away = Place("bracket", {300, 300, 15, 40}, {100, 0, 20});
  EXPECT_EQ(RelationLogOdds(between, away, others, 2), 0);
  EXPECT_EQ(RelationLogOdds(between, away, others, 160), 3);  // unsure by more than it is away
}

TEST(RelationLogOdds, TakesTheWeightOffWhereWhatIsExpectedIsMissing) {
  const Corner c;
  const std::vector<RelatedSolid> others{c.base, c.wall};
  const std::vector<ObjectRelation> expects{Relation(Force::kExpects, Kind::kTouching, {"tee"}, 2)};
  const std::vector<ObjectRelation> avoids{Relation(Force::kAvoids, Kind::kTouching, {"box"}, 1.5)};
  EXPECT_EQ(RelationLogOdds(expects, c.bracket, others, 2), -2);
  EXPECT_EQ(RelationLogOdds(avoids, c.bracket, others, 2), -1.5);
  EXPECT_EQ(RelationLogOdds(avoids, c.bracket, {}, 2), 0);
  EXPECT_EQ(RelationLogOdds({}, c.bracket, others, 2), 0);
  const std::vector<ObjectRelation> both{expects[0], avoids[0]};
  EXPECT_EQ(RelationLogOdds(both, c.bracket, others, 2), -3.5);
}

TEST(RelationLogOdds, AsksForDirectionsOfPartsWithinReach) {
  const RelatedSolid girder = Place("tee", {2000, 200, 300, 20, 20}, {0, 0, 0});
  const std::vector<ObjectRelation> across{
      Relation(Force::kPrefers, Kind::kPerpendicular, {"tee"}, 1, {}, 50)};
  const std::vector<ObjectRelation> along{Relation(Force::kPrefers, Kind::kParallel, {"tee"}, 1, {}, 50)};
  const auto odds = [&](const std::vector<ObjectRelation>& relation, double y, double yaw_deg) {
    return RelationLogOdds(relation, Place("box", {800, 20, 290}, {0, y, 0}, yaw_deg), {&girder, 1}, 2);
  };
  EXPECT_EQ(odds(across, 530, 90), 1);
  EXPECT_EQ(odds(across, 530, 87), 1);
  EXPECT_EQ(odds(across, 530, 80), 0);
  EXPECT_EQ(odds(across, 560, 90), 0);  // 60 mm beside the flange
  EXPECT_EQ(odds(along, 150, 0), 1);
  EXPECT_EQ(odds(along, 150, 178), 1);
  EXPECT_EQ(odds(along, 530, 90), 0);
}

TEST(Relations, AreReadFromTheLanguage) {
  const auto of = [](const std::string& items) {
    return ParseObject(
        "object o {\n  dimension w: 10 mm .. 100 mm\n" + items +
            "\n  extrude x from -50 mm to 50 mm { outline { a (-w/2, 0 mm) b (w/2, 0 mm) c (0 mm, w) } }\n}",
        "o.kb");
  };
  const auto object = of(
      "  let far = 2*100 mm\n  expects touching tee or box\n  prefers near pipe within far weight 1.5 "
      "\"drains\"\n"
      "  avoids between box and tee or box within 5 mm weight 4\n  prefers perpendicular to tee within 1 m");
  ASSERT_TRUE(object) << object.error().message;
  const auto relations = (*object)->relations();
  ASSERT_EQ(relations.size(), 4u);
  EXPECT_EQ(Describe(relations[0]), "expects touching tee or box");
  EXPECT_EQ(relations[0].weight, 2);
  EXPECT_EQ(Describe(relations[1]), "prefers near pipe within 200 mm");
  EXPECT_EQ(relations[1].weight, 1.5);
  EXPECT_EQ(relations[1].reason, "drains");
  EXPECT_EQ(Describe(relations[2]), "avoids between box and tee or box within 5 mm");
  EXPECT_EQ(Describe(relations[3]), "prefers perpendicular to tee within 1000 mm");
  const std::pair<std::string, std::string> errors[] = {
      {"  expects box",
       "o.kb:3:11: expected touching, near, parallel, perpendicular or between, found 'box'"},
      {"  expects parallel tee", "o.kb:3:20: expected 'to', found 'tee'"},
      {"  prefers near box",
       "o.kb:4:3: expected within, found 'extrude'; say how near: near box within 200 mm"},
      {"  prefers near box within w", "o.kb:3:27: 'w' is a dimension"},
      {"  prefers near box within 3", "o.kb:3:27: the distance must be a length, but this is a plain number"},
      {"  prefers near box within 0 mm - 3 mm", "o.kb:3:3: the distance is -3 mm; write 0 mm or more"},
      {"  prefers between box or tee", "o.kb:4:3: expected 'and', found 'extrude'"},
      {"  avoids touching box weight 30", "o.kb:3:30: expected a number from 0 to 10, found '30'"},
  };
  for (const auto& [items, error] : errors) {
    const auto wrong = of(items);
    ASSERT_FALSE(wrong) << items;
    EXPECT_THAT(wrong.error().message, testing::StartsWith(error));
  }
}

}  // namespace
}  // namespace vss
