#include "vss/product/designation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "vss/product/make_part.h"

namespace vss {
namespace {

using testing::HasSubstr;

const KnowledgeBase& Knowledge() {
  static const KnowledgeBase knowledge = *LoadKnowledge({}, ".");
  return knowledge;
}

// A part as reconstruction gives it: `observed` by dimension, every sigma 0.2 mm, the others known by their
// range.
ReconstructedPart Reconstructed(const std::string& kind, std::vector<double> dimensions_mm,
                                std::vector<bool> observed) {
  ReconstructedPart part;
  part.object.model = Knowledge().Find(kind);
  part.object.dimensions_mm = dimensions_mm;
  part.object.placement << 500, 300, 0, 0.4, 0, 0;
  part.covariance = Eigen::MatrixXd::Identity(part.object.StateSize(), part.object.StateSize()) * 0.04;
  part.covariance.diagonal().segment<3>(3).setConstant(1e-8);  // rad
  for (std::size_t i = 0; i < dimensions_mm.size(); ++i) {
    ReconstructedDimension d;
    d.name = part.object.model->dimensions()[i].name;
    d.value_mm = dimensions_mm[i];
    d.sigma_mm = observed[i] ? 0.2 : 30;
    d.observable = observed[i];
    if (!observed[i]) d.origin = "kept as identified";
    part.covariance(6 + Eigen::Index(i), 6 + Eigen::Index(i)) = d.sigma_mm * d.sigma_mm;
    part.dimensions.push_back(d);
  }
  return part;
}

TEST(Designate, GivesTheHiddenWebOfABeamTheCataloguesThickness) {
  ReconstructedPart part =
      Reconstructed("i_beam", {2000, 100.6, 200.4, 12, 8.7}, {true, true, true, false, true});
  const Designation size = Designate(part);
  EXPECT_EQ(size.name, "IPE 200");
  EXPECT_EQ(size.standard, "EN 10365");
  EXPECT_EQ(*size.nominal_mm[2], 200);
  EXPECT_FALSE(size.nominal_mm[0]);
  EXPECT_EQ(part.object.dimensions_mm[3], 5.6);
  EXPECT_EQ(part.dimensions[3].value_mm, 5.6);
  EXPECT_FALSE(part.dimensions[3].observable);
  EXPECT_THAT(part.dimensions[3].origin, HasSubstr("IPE 200 of EN 10365"));
  EXPECT_NEAR(part.dimensions[3].sigma_mm, 0.7 / std::sqrt(3), 1e-12);  // no better than the mill
  EXPECT_NEAR(part.covariance(9, 9), 0.49 / 3, 1e-12);
  EXPECT_EQ(part.object.dimensions_mm[1], 100.6);  // what was measured stays as it was measured
  EXPECT_EQ(part.dimensions[1].sigma_mm, 0.2);
  ASSERT_EQ(part.vertex_sigma.size(), 24u);
  for (const auto& s : part.vertex_sigma) EXPECT_LT(s.maxCoeff(), 1);
}

TEST(Designate, LeavesAPartAloneWhoseSizeIsNotDetermined) {
  ReconstructedPart part = Reconstructed("angle", {2000, 100, 100, 11}, {true, true, true, false});
  part.covariance = Eigen::MatrixXd::Identity(10, 10);
  const ReconstructedPart before = part;
  const Designation size = Designate(part);
  EXPECT_EQ(size.name, "");
  EXPECT_EQ(size.candidates.size(), 3u);
  EXPECT_EQ(part.object.dimensions_mm, before.object.dimensions_mm);
  EXPECT_EQ(part.covariance, before.covariance);
  EXPECT_EQ(part.dimensions[3].origin, "kept as identified");
}

TEST(Designate, KeepsTheEdgesThatWereMeasuredWhereTheyAre) {
  // An angle whose foot ends under something: its width is not seen, its upright leg is.
  ReconstructedPart part = Reconstructed("angle", {2000, 180, 160, 15}, {true, false, true, true});
  const WorldSolid before = PlaceSolid(part.object, false);
  // The upright leg's edges: both ends of its top, along the part.
  for (std::size_t i = 0; i < before.edges.size(); ++i) {
    const auto &a = before.vertices[std::size_t(before.edges[i].start)].point,
               &b = before.vertices[std::size_t(before.edges[i].end)].point;
    if (std::min(a.z(), b.z()) < 159) continue;
    EdgeResidual e;
    e.index = int(i);
    part.edges.push_back(e);
  }
  ASSERT_EQ(part.edges.size(), 4u);
  const Designation size = Designate(part);
  EXPECT_EQ(size.name, "L 160x160x15");
  EXPECT_EQ(part.object.dimensions_mm[1], 160);
  const WorldSolid after = PlaceSolid(part.object, false);
  for (std::size_t i = 0; i < before.vertices.size(); ++i) {
    if (before.vertices[i].point.z() < 159) continue;
    EXPECT_LT((before.vertices[i].point - after.vertices[i].point).norm(), 1e-3);
  }
  // Seen with its foot's edge, the width could not be another.
  ReconstructedPart seen = Reconstructed("angle", {2000, 180, 160, 15}, {true, false, true, true});
  for (int i = 0; i < int(before.edges.size()); ++i) {
    EdgeResidual e;
    e.index = i;
    seen.edges.push_back(e);
  }
  Designate(seen);
  EXPECT_EQ(seen.object.dimensions_mm[1], 180);
  EXPECT_EQ(seen.dimensions[1].origin, "kept as identified");
}

TEST(SetGeometry, ForgetsTheSizeThatOtherDimensionsTold) {
  Part part;
  part.designation = "IPE 200";
  part.designation_candidates = {"IPE 200"};
  SetGeometry(Reconstructed("box", {900, 200, 20}, {true, true, true}).object, part);
  EXPECT_EQ(part.kind, "box");
  EXPECT_EQ(part.designation, "");
  EXPECT_TRUE(part.designation_candidates.empty());
  EXPECT_FALSE(part.has_features);
}

}  // namespace
}  // namespace vss
