#include "vss/identify/seed.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vss {
namespace {

using Eigen::Vector3d;

WorldLine LineOf(const WorldSolid& solid, const SolidEdge& edge, WorldLine::Direction kind) {
  WorldLine l;
  l.kind = kind;
  l.start = solid.vertices[std::size_t(edge.start)].point;
  l.end = solid.vertices[std::size_t(edge.end)].point;
  l.num_views = 5;
  l.px2_per_mm2 = Eigen::Matrix3d::Identity() * 0.1;
  return l;
}

struct Bracket {
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"bracket"}, ".");
  PlacedObject truth;
  WorldSolid solid;
  std::vector<WorldLine> slanted, upright;  // the upright ones at its tall end

  Bracket() {
    truth.model = knowledge.Find("bracket");
    truth.placement << 1200, 400, 0, 0.7, 0, 0;
    truth.dimensions_mm = {300, 420, 20, 60};
    solid = PlaceSolid(truth, false);
    for (const auto& e : solid.edges) {
      const Vector3d d =
          solid.vertices[std::size_t(e.end)].point - solid.vertices[std::size_t(e.start)].point;
      const double rise = std::abs(d.z()) / d.norm();
      if (rise > 0.1 && rise < 0.9)
        slanted.push_back(LineOf(solid, e, WorldLine::Direction::kInclined));
      else if (rise > 0.99 && d.norm() > 400)
        upright.push_back(LineOf(solid, e, WorldLine::Direction::kVertical));
    }
  }

  // The seed that is nearest to the truth in length, height and nose.
  double BestMm(const std::vector<WorldLine>& lines) const {
    SceneIndex scene;
    scene.mm_per_px = 3;
    const SeedContext context{.scene = scene, .lines = lines, .circles = {}, .mm_per_px = 3};
    double best = INFINITY;
    const auto templates = MakeTemplates(knowledge);
    const auto pairs = ParallelPairs(context, FarthestPairMm(templates));
    for (const auto& t : templates) {
      if (t.resting_pose != 0) continue;
      for (const auto& seed : Seeds(t, context, pairs, 0)) {
        double worst = 0;
        for (std::size_t d : {0, 1, 3})
          worst = std::max(worst, std::abs(seed.object.dimensions_mm[d] - truth.dimensions_mm[d]));
        best = std::min(best, worst);
      }
    }
    return best;
  }
};

TEST(Seeds, ABracketFromOneSlantedAndOneUprightEdge) {
  const Bracket bracket;
  ASSERT_EQ(bracket.slanted.size(), 2u);
  ASSERT_EQ(bracket.upright.size(), 2u);
  int found = 0;  // one of the two uprights is of the slanted one's face
  for (const auto& u : bracket.upright) found += bracket.BestMm({bracket.slanted[0], u}) < 5;
  EXPECT_GE(found, 1);
}

TEST(Seeds, NoBracketFromEdgesOfTwoPlanes) {
  const Bracket bracket;
  WorldLine away = bracket.upright[0];
  const Vector3d across(-std::sin(0.7), std::cos(0.7), 0);
  away.start += 100 * across;
  away.end += 100 * across;
  EXPECT_TRUE(std::isinf(bracket.BestMm({bracket.slanted[0], away})));
}

}  // namespace
}  // namespace vss
