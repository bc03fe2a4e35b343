#include "vss/reconstruct/findings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "vss/reconstruct/adjustment_scene.h"

namespace vss {
namespace {

using namespace test;
using testing::HasSubstr;

// What ReconstructScene has before it adds its findings.
Reconstruction Started(const Adjustment& a) {
  Reconstruction out;
  for (std::size_t p = 0; p < a.parts.size(); ++p) {
    ReconstructedPart& part = out.parts.emplace_back();
    part.object = a.parts[p].object;
    part.covariance = a.PartCovariance(static_cast<int>(p));
    part.observable = a.parts[p].free;
    for (const auto& d : part.object.model->dimensions()) part.dimensions.emplace_back().name = d.name;
  }
  return out;
}

// Moves what `view` measured by `shift_px`, as if its camera had been pushed.
void Push(int view, const Eigen::Vector2d& shift_px, std::vector<ObservationGroup>& groups) {
  for (auto& g : groups)
    if (g.view == view)
      for (auto& o : g.observations) o.measured += shift_px;
}

TEST(Findings, EveryEdgeOfEveryViewHasItsResidual) {
  const Scene scene;
  Adjustment a = scene.Make();
  std::mt19937 random(1);
  Observe(a, 0.03, random, a.groups);
  a.Solve(10, true);
  a.ComputeCovariance();
  Reconstruction out = Started(a);
  AddEdgeFindings(a, out);
  EXPECT_EQ(out.parts[0].edges.size() + out.parts[1].edges.size(), a.groups.size());
  for (const auto& part : out.parts) {
    EXPECT_LT(part.residual_px, 0.05);
    EXPECT_GT(part.views.size(), 4u);
    EXPECT_TRUE(part.remarks.empty()) << part.remarks[0];
  }
  EXPECT_TRUE(out.warnings.empty());
}

TEST(Findings, AnEdgeThatLiesElsewhereInItsViewsIsNamedByItsPlace) {
  const Scene scene;
  Adjustment a = scene.Make();
  std::mt19937 random(2);
  Observe(a, 0.03, random, a.groups);
  a.Solve(10, true);
  a.ComputeCovariance();
  // As if another kind had been there: one edge lies two pixels off everywhere.
  std::map<std::pair<int, int>, int> views;
  for (const auto& g : a.groups) ++views[{g.part, g.contour}];
  const auto [part, contour] = std::max_element(views.begin(), views.end(), [](const auto& x, const auto& y) {
                                 return x.second < y.second;
                               })->first;
  for (auto& g : a.groups)
    if (g.contour == contour && g.part == part) g.mean_px = 2;
  Reconstruction out = Started(a);
  AddEdgeFindings(a, out);
  const auto& remarks = out.parts[static_cast<std::size_t>(part)].remarks;
  ASSERT_FALSE(remarks.empty());
  EXPECT_THAT(remarks[0], HasSubstr("the edge from ("));
  EXPECT_THAT(remarks[0], HasSubstr("of another kind"));
}

TEST(Findings, AViewThatContradictsTheOthersIsNotBelievedAndTheOthersAreNotBlamed) {
  const Scene scene;
  Adjustment a = scene.Make();
  std::mt19937 random(3);
  Observe(a, 0.02, random, a.groups);
  constexpr int kView = 5;
  Push(kView, {0.6, -0.45}, a.groups);
  a.Solve(12, true);
  a.ComputeCovariance();
  Reconstruction out = Started(a);
  AddEdgeFindings(a, out);
  AddInfluences(a, out);
  bool outlying = false;
  for (const auto& i : out.influences) outlying |= i.view == kView && i.outlying;
  for (const auto& i : out.influences)
    if (i.view != kView) {
      EXPECT_FALSE(i.outlying) << i.view;
    }
  int used = 0, all = 0;
  for (const auto& part : out.parts)
    for (const auto& e : part.edges)
      if (e.view == kView) used += e.used, ++all;
  EXPECT_GT(all, 4);
  EXPECT_TRUE(outlying || used < all);
}

TEST(Findings, TheScaleIsTheCarriagesUnlessALengthIsKnown) {
  const Scene scene;
  Adjustment a = scene.Make();
  std::mt19937 random(4);
  Observe(a, 0.02, random, a.groups);
  a.Solve(10, true);
  a.ComputeCovariance();
  Reconstruction out = Started(a);
  AddScale(a, 0.5, out);
  EXPECT_EQ(out.scale.from, ScaleFinding::From::kGantry);
  EXPECT_GT(out.scale.sigma, 0);
  a.options.known_lengths = {{0, 0, 900 * 1.004, 0.05}};
  a.Solve(12, true);
  a.ComputeCovariance();
  AddScale(a, 0.5, out);
  EXPECT_EQ(out.scale.from, ScaleFinding::From::kKnownLength);
  ASSERT_EQ(out.warnings.size(), 1u);
  EXPECT_THAT(out.warnings[0], HasSubstr("disagree"));
}

}  // namespace
}  // namespace vss
