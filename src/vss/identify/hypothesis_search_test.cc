#include "vss/identify/hypothesis_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "vss/identify/four_views.h"
#include "vss/identify/seed.h"

namespace vss {
namespace {

using Eigen::Vector3d;

// Stiffeners side by side, as on a panel.
struct Panel : test::FourViews {
  static constexpr double kSpacingMm = 190, kWidthMm = 110;
  KnowledgeBase knowledge = *LoadKnowledge(std::vector<std::string>{"tee"}, ".");
  std::vector<PlacedObject> tees;
  std::vector<WorldLine> tops;  // their upper long edges

  Panel() {
    for (int i = -3; i <= 3; ++i) {
      PlacedObject o;
      o.model = knowledge.Find("tee");
      o.placement << 0, i * kSpacingMm, 0, 0, 0, 0;
      o.dimensions_mm = {900, kWidthMm, 150, 12, 12};
      tees.push_back(o);
      Draw(o);
      for (double side : {-kWidthMm / 2, kWidthMm / 2}) {
        WorldLine l;
        l.start = Vector3d(-450, i * kSpacingMm + side, 150);
        l.end = Vector3d(450, i * kSpacingMm + side, 150);
        l.num_views = 4;
        l.num_stops = 4;
        l.px2_per_mm2 = Eigen::Matrix3d::Identity() * 0.03;
        tops.push_back(l);
      }
    }
  }
};

TEST(Promising, AnEdgesNearestPartnerIsTriedWhateverItsOtherPartnersScore) {
  const Panel panel;
  const SceneIndex index = MakeSceneIndex(panel.views, 1.5, 1);
  const SeedContext context{.scene = index, .lines = panel.tops, .circles = {}, .mm_per_px = index.mm_per_px};
  const auto templates = MakeTemplates(panel.knowledge);
  const auto pairs = ParallelPairs(context, FarthestPairMm(templates));
  const auto promising = Promising(Seeds(templates.front(), context, pairs, 0), context, 1);
  for (const PlacedObject& tee : panel.tees) {
    const bool kept = std::any_of(promising.begin(), promising.end(), [&](const Hypothesis& h) {
      return std::abs(h.object.placement[1] - tee.placement[1]) < 5 &&
             std::abs(h.object.dimensions_mm[1] - Panel::kWidthMm) < 5;
    });
    EXPECT_TRUE(kept) << "the tee at y = " << tee.placement[1];
  }
}

}  // namespace
}  // namespace vss
