#include "propose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "vss/identify/contour.h"
#include "vss/knowledge/object_model.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

class Propose : public testing::Test {
 protected:
  void SetUp() override {
    const std::vector<std::string> names = {"box"};
    knowledge = LoadKnowledge(names, ".").value();
    camera.width_px = camera.height_px = 512;
    camera.intrinsics.fx_px = camera.intrinsics.fy_px = 520;
    camera.intrinsics.cx_px = camera.intrinsics.cy_px = 255.5;
    for (const Vector3d& eye : {Vector3d(-1200, -900, 3000), Vector3d(1300, 700, 3100)}) {
      Eigen::Matrix3d r;
      r.row(2) = -eye.normalized().transpose();
      r.row(0) = r.row(2).transpose().cross(Vector3d::UnitZ()).normalized().transpose();
      r.row(1) = r.row(2).transpose().cross(Vector3d(r.row(0).transpose())).transpose();
      views.push_back(MakeView(int(views.size()), camera, {r, -(r * eye)}, -1, nullptr));
    }
    truth.model = question.model = knowledge.Find("box");
    truth.placement << 80, -40, 0, 0.6, 0, 0;
    truth.dimensions_mm = {900, 400, 250};
    for (const auto& view : views) AddLines(view);
  }

  // The visible edges of the box, with noise, as the pictures' lines.
  void AddLines(const View& view) {
    std::normal_distribution<double> noise(0, 0.05);
    std::map<int, std::vector<Vector2d>> seen;
    for (const auto& s : SampleContour(PlaceSolid(truth, false), view, 4, 4))
      if (s.visible && s.source == ContourSample::Source::kEdge) seen[s.index].push_back(s.ideal);
    for (const auto& [edge, points] : seen) {
      Pick p;
      p.image = view.image;
      p.line = int(lines.size());
      p.contour = edge;
      p.ideal_start = points.front() + Vector2d(noise(random), noise(random));
      p.ideal_end = points.back() + Vector2d(noise(random), noise(random));
      p.sigma_offset_px = 0.05;
      p.sigma_angle_rad = 0.001;
      lines.push_back(p);
    }
  }
  Result<Proposal> Proposed() const {
    return ProposeContours(question, views, [this](int image) {
      std::vector<Pick> out;
      for (const auto& l : lines)
        if (l.image == image) out.push_back(l);
      return out;
    });
  }
  // The picks in no order, each said to be edge 0.
  void PickShuffled(std::size_t count) {
    question.picks = lines;
    std::shuffle(question.picks.begin(), question.picks.end(), random);
    question.picks.resize(std::min(count, question.picks.size()));
    for (auto& p : question.picks) p.contour = 0;
  }
  // Worst distance of a vertex of the truth from the nearest of `object`.
  double ErrorOf(const PlacedObject& object) const {
    double worst = 0;
    for (const auto& v : PlaceSolid(truth, false).vertices) {
      double least = INFINITY;
      for (const auto& o : PlaceSolid(object, false).vertices)
        least = std::min(least, (o.point - v.point).norm());
      worst = std::max(worst, least);
    }
    return worst;
  }

  Camera camera;
  std::vector<View> views;
  KnowledgeBase knowledge;
  PlacedObject truth;
  std::vector<Pick> lines;
  FitQuestion question;
  std::mt19937 random{5};
};

TEST_F(Propose, FindsWhichLineIsWhichInAnyOrder) {
  for (int round = 0; round < 8; ++round) {
    PickShuffled(12);
    const auto proposal = Proposed();
    ASSERT_TRUE(proposal) << proposal.error().message;
    EXPECT_TRUE(proposal->decided);
    EXPECT_LT(ErrorOf(proposal->readings[0].object), 2) << "round " << round;
  }
}

TEST_F(Propose, SaysThatOneLineDoesNotDecide) {
  question.picks = {lines.front()};
  const auto proposal = Proposed();
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_FALSE(proposal->decided);
  EXPECT_EQ(proposal->readings.size(), 2u);
}

TEST_F(Propose, SaysTheSameEachTime) {
  PickShuffled(6);
  const auto first = Proposed(), second = Proposed();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->readings[0].contours, second->readings[0].contours);
  EXPECT_EQ(first->readings[0].object.State(), second->readings[0].object.State());
}

TEST_F(Propose, RefusesLinesThatAreNoneOfTheObject) {
  question.picks.clear();
  EXPECT_FALSE(Proposed()) << "no line";
  PickShuffled(8);
  for (std::size_t i = 0; i < question.picks.size(); ++i)
    question.picks[i].ideal_end = question.picks[i].ideal_start +
                                  Vector2d(40 * std::cos(0.7 * double(i)), 40 * std::sin(0.7 * double(i)));
  const auto proposal = Proposed();
  ASSERT_FALSE(proposal);
  EXPECT_NE(proposal.error().message.find("explains these 8 lines"), std::string::npos);
}

}  // namespace
}  // namespace vss::station
