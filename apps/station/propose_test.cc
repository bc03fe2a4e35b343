#include "propose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "edited_lines.h"
#include "vss/identify/four_views.h"
#include "vss/knowledge/object_model.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

class Propose : public testing::Test {
 protected:
  void Draw(const std::string& kind, std::vector<double> dimensions_mm) {
    knowledge = LoadKnowledge(std::vector<std::string>{kind}, ".").value();
    truth.model = question.model = knowledge.Find(kind);
    truth.placement << 80, -40, 0, 0.6, 0, 0;
    truth.dimensions_mm = std::move(dimensions_mm);
    scene.Draw(truth);
    for (auto& image : scene.lines)
      for (auto& l : image.segments) {
        l.sigma_offset_px = 0.05;
        l.sigma_angle_rad = 0.001;
      }
  }
  Result<Proposal> Proposed(bool some = false) const {
    return ProposeContours(
        question, scene.views,
        [this](const std::vector<int>& images) {
          std::vector<LineImage> out;
          for (int i : images) out.push_back(scene.lines[std::size_t(i)]);
          return out;
        },
        1, some);
  }
  // Lines of the first pictures in no order, each said to be edge 0.
  void PickShuffled(std::size_t count, int pictures) {
    question.picks.clear();
    for (int image = 0; image < pictures; ++image) {
      const auto& segments = scene.lines[std::size_t(image)].segments;
      for (std::size_t i = 0; i < segments.size(); ++i)
        question.picks.push_back(PickOfSegment(image, int(i), segments[i]));
    }
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
  void ExpectFound(std::size_t count, int pictures) {
    for (int round = 0; round < 3; ++round) {
      PickShuffled(count, pictures);
      const auto proposal = Proposed();
      ASSERT_TRUE(proposal) << proposal.error().message;
      FitQuestion again = question;
      for (std::size_t i = 0; i < again.picks.size(); ++i)
        again.picks[i].contour = proposal->readings[0].contours[i];
      again.start = proposal->readings[0].object;
      EXPECT_LT(ErrorOf(FitPicks(again, scene.views)->object), 10) << "round " << round;
    }
  }

  test::FourViews scene;
  KnowledgeBase knowledge;
  PlacedObject truth;
  FitQuestion question;
  std::mt19937 random{5};
};

TEST_F(Propose, FindsWhichLineOfABoxIsWhichInAnyOrder) {
  Draw("box", {900, 400, 250});
  ExpectFound(12, 4);
}

TEST_F(Propose, FindsWhichLineOfAProfileIsWhichInAnyOrder) {
  Draw("angle", {900, 200, 150, 20});
  ExpectFound(14, 2);
}

TEST_F(Propose, ReadsOneLineByWhatStandsAroundIt) {
  Draw("box", {900, 400, 250});
  PickShuffled(1, 1);
  const auto proposal = Proposed();
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_EQ(proposal->readings[0].contours.size(), 1u);
}

TEST_F(Propose, SaysTheSameEachTime) {
  Draw("box", {900, 400, 250});
  PickShuffled(6, 2);
  const auto first = Proposed(), second = Proposed();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->readings[0].contours, second->readings[0].contours);
  EXPECT_EQ(first->readings[0].object.State(), second->readings[0].object.State());
}

TEST_F(Propose, IsSureWhereManyLinesOfABlockAgree) {
  Draw("box", {900, 400, 250});
  PickShuffled(12, 2);
  const auto proposal = Proposed();
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_TRUE(proposal->decided);
}

TEST_F(Propose, IsNotSureWhereTheLinesDoNotSayWhereItStands) {
  Draw("box", {900, 400, 250});
  PickShuffled(1, 1);
  const auto proposal = Proposed();
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_FALSE(proposal->decided);
}

TEST_F(Propose, IsNotSureWhereLinesLieOnTwoContoursAtOnce) {
  Draw("box", {900, 400, 3});  // from above its upper and its lower edges are one line each
  PickShuffled(100, 1);
  std::erase_if(question.picks, [this](const Pick& p) {
    const auto& s = scene.lines[0].segments[std::size_t(p.line)];
    return (s.ideal_end - s.ideal_start).norm() < 20;
  });
  question.picks.resize(std::min<std::size_t>(question.picks.size(), 5));
  const auto proposal = Proposed();
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_FALSE(proposal->decided);
  ASSERT_EQ(proposal->readings.size(), 2u);
  EXPECT_NE(proposal->readings[0].contours, proposal->readings[1].contours);
}

TEST_F(Propose, LeavesOutLinesOfABoxThatAreNotTheObjects) {
  Draw("box", {900, 400, 250});
  PickShuffled(9, 1);
  for (int i = 0; i < 2; ++i) {
    Pick shadow = question.picks[0];
    shadow.line = -1;
    shadow.ideal_start = {20.0 + 7 * i, 30}, shadow.ideal_end = {60, 33.0 + 90 * i};
    question.picks.insert(question.picks.begin() + 2 * i, shadow);
  }
  EXPECT_FALSE(Proposed());
  const auto proposal = Proposed(true);
  ASSERT_TRUE(proposal) << proposal.error().message;
  const auto& contours = proposal->readings[0].contours;
  ASSERT_EQ(contours.size(), question.picks.size());
  EXPECT_EQ(contours[0], kNoContour);
  EXPECT_EQ(contours[2], kNoContour);
  EXPECT_EQ(std::count(contours.begin(), contours.end(), kNoContour), 2);
}

TEST_F(Propose, RefusesLinesThatAreNoneOfTheObject) {
  Draw("box", {900, 400, 250});
  EXPECT_FALSE(Proposed()) << "no line";
  PickShuffled(8, 2);
  for (std::size_t i = 0; i < question.picks.size(); ++i)
    question.picks[i].ideal_end = question.picks[i].ideal_start +
                                  Vector2d(40 * std::cos(0.7 * double(i)), 40 * std::sin(0.7 * double(i)));
  const auto proposal = Proposed();
  ASSERT_FALSE(proposal);
  EXPECT_NE(proposal.error().message.find("explains these 8 lines"), std::string::npos);
}

}  // namespace
}  // namespace vss::station
