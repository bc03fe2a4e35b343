// What a good calibrator refuses, drops or warns of: each with its sentence.
#include "vss/calibrate/intrinsic.h"

#include <gtest/gtest.h>

#include <random>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const Intrinsics kLens{LensModel::kOpenCv, 600, 600, 255, 250, {-0.1, 0.01, 3e-4, -2e-4}, 4, 0};

TargetSpec Board() {
  TargetSpec t;
  t.pattern = TargetPattern::kCheckerboard;
  t.columns = 9, t.rows = 7, t.pitch_mm = 50;
  return t;
}

BoardPicture Picture(int index, const RigidTransform& pose, double noise_px, int columns = 9, int rows = 7,
                     const Vector2d& pitch = {50, 50}) {
  std::mt19937 random(index + 1);
  std::normal_distribution<double> noise(0, noise_px);
  BoardPicture p{fmt::format("board{}.png", index), 512, 512, {}, ""};
  p.board.anchored = p.board.columns_complete = p.board.rows_complete = true;
  p.board.columns_seen = columns, p.board.rows_seen = rows;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const auto img = kLens.Project(pose * Vector3d(pitch.x() * c, pitch.y() * r, 0));
      if (!img) continue;
      Mark m;
      m.img = *img + Vector2d(noise(random), noise(random));
      m.column = c, m.row = r, m.sigma_px = noise_px, m.blur_px = 0.7;
      p.board.marks.push_back(m);
    }
  return p;
}

RigidTransform Pose(double tilt_deg, double axis, double turn, double z) {
  const Eigen::Matrix3d r =
      RotationFromVector(RadFromDeg(tilt_deg) * Vector3d(std::cos(axis), std::sin(axis), 0)) *
      RotationFromVector(turn * Vector3d::UnitZ());
  return {r, Vector3d(30 * std::cos(3 * turn), 30 * std::sin(5 * axis), z) - r * Vector3d(200, 150, 0)};
}

std::vector<BoardPicture> GoodPictures(int n = 8) {
  std::vector<BoardPicture> pictures;
  for (int i = 0; i < n; ++i) pictures.push_back(Picture(i, Pose(20 + 3 * i, 2.4 * i, 0.4 * i, 640), 0.03));
  return pictures;
}

std::string Refusal(const std::vector<BoardPicture>& pictures, const TargetSpec& target = Board(),
                    const Vector2d& pitch = {0.01, 0.01}) {
  const auto result = CalibrateIntrinsics("cam1", target, pictures, pitch, {});
  return result ? "accepted" : result.error().message;
}

bool Mentions(const std::vector<std::string>& sentences, const std::string& words) {
  return std::any_of(sentences.begin(), sentences.end(),
                     [&](const auto& s) { return s.find(words) != std::string::npos; });
}

TEST(Intrinsic, GoodPicturesGiveTheLensWithinItsSigma) {
  CalibrationOptions options;
  options.opencv = true;
  const auto r = CalibrateIntrinsics("cam1", Board(), GoodPictures(12), {0, 0}, options);
  ASSERT_TRUE(r) << r.error().message;
  const double sigma = std::sqrt(r->covariance(0, 0));
  EXPECT_LT(std::abs(r->intrinsics.fx_px - kLens.fx_px), 4 * sigma);
  EXPECT_LT(sigma, 0.5);
  EXPECT_NEAR(r->holdout_px, 0.0424, 0.006);
  EXPECT_FALSE(r->next_view.empty());
}

TEST(Intrinsic, WengsModelDescribesABrownLensToAHundredthOfAPixel) {
  const auto r = CalibrateIntrinsics("cam1", Board(), GoodPictures(12), {0.01, 0.01}, {});
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_LT(LensDifference(kLens, r->intrinsics, 512, 512).rms, 0.05);
}

TEST(Intrinsic, RefusesOneViewAndTwo) {
  for (int views : {1, 2}) {
    const std::string said = Refusal(GoodPictures(views));
    EXPECT_NE(said.find(fmt::format(
                  "{} of {} pictures show a usable board, but a calibration needs at least 3", views, views)),
              std::string::npos)
        << said;
  }
}

TEST(Intrinsic, RefusesMarksOnOneLine) {
  auto pictures = GoodPictures();
  for (auto& p : pictures) std::erase_if(p.board.marks, [](const Mark& m) { return m.row != 3; });
  const std::string said = Refusal(pictures);
  EXPECT_NE(said.find("on one line"), std::string::npos) << said;
}

TEST(Intrinsic, RefusesNoPicture) { EXPECT_NE(Refusal({}).find("no picture"), std::string::npos); }

TEST(Intrinsic, RefusesBoardsThatAllFaceTheCamera) {
  std::vector<BoardPicture> pictures;
  for (int i = 0; i < 8; ++i) pictures.push_back(Picture(i, Pose(0, 0, 0.3 * i, 600 + 40 * i), 0.03));
  EXPECT_NE(Refusal(pictures).find("tilt the board"), std::string::npos) << Refusal(pictures);
}

TEST(Intrinsic, RefusesParallelBoards) {
  std::vector<BoardPicture> pictures;
  for (int i = 0; i < 8; ++i) {
    RigidTransform pose = Pose(30, 0.5, 0.2, 640);
    pose.translation += Vector3d(12 * i - 40, 8 * (i % 3), 15 * i);
    pictures.push_back(Picture(i, pose, 0.03));
  }
  EXPECT_NE(Refusal(pictures).find("tilt the board"), std::string::npos) << Refusal(pictures);
}

TEST(Intrinsic, RefusesTwoOrientationsOnly) {
  std::vector<BoardPicture> pictures;
  for (int i = 0; i < 8; ++i) {
    RigidTransform pose = Pose(30, i % 2 ? 0.5 : 2.5, 0.2, 640);
    pose.translation += Vector3d(12 * i - 40, 8 * (i % 3), 15 * i);
    pictures.push_back(Picture(i, pose, 0.03));
  }
  EXPECT_NE(Refusal(pictures).find("orientations only"), std::string::npos) << Refusal(pictures);
}

TEST(Intrinsic, RefusesAMirroredBoard) {
  auto pictures = GoodPictures();
  for (auto& p : pictures) p.board.mirrored = true;
  EXPECT_NE(Refusal(pictures).find("mirrored"), std::string::npos);
}

TEST(Intrinsic, RefusesMarksCountedFromBehind) {
  auto pictures = GoodPictures();
  for (auto& p : pictures)
    for (Mark& m : p.board.marks) m.column = 8 - m.column;
  EXPECT_NE(Refusal(pictures), "accepted");
}

TEST(Intrinsic, RefusesWrongCounts) {
  TargetSpec more = Board();
  more.columns = 10;
  EXPECT_NE(Refusal(GoodPictures(), more).find("9 x 7"), std::string::npos) << Refusal(GoodPictures(), more);
  TargetSpec fewer = Board();
  fewer.rows = 6;
  EXPECT_NE(Refusal(GoodPictures(), fewer).find("correct the target's counts"), std::string::npos);
}

TEST(Intrinsic, RefusesAWrongAspectOfTheBoard) {
  std::vector<BoardPicture> pictures;
  // Alike turned, so that a stretched board passes for stretched pixels: the data sheet tells.
  for (int i = 0; i < 8; ++i)
    pictures.push_back(Picture(i, Pose(20 + 3 * i, 2.4 * i, 0, 640), 0.03, 9, 7, {58, 50}));
  const std::string said = Refusal(pictures);
  EXPECT_NE(said.find("along rows and columns"), std::string::npos) << said;
  // Turned in its plane, the board tells by itself.
  for (double stretch : {1.02, 0.97}) {
    pictures.clear();
    for (int i = 0; i < 8; ++i)
      pictures.push_back(Picture(i, Pose(20 + 3 * i, 2.4 * i, 0.4 * i, 640), 0.03, 9, 7, {50, 50 * stretch}));
    const std::string turned = Refusal(pictures, Board(), {0, 0});
    EXPECT_NE(turned.find(stretch > 1 ? "2.0 % farther apart" : "3.0 % less far apart"), std::string::npos)
        << turned;
  }
}

TEST(Intrinsic, WarnsOfABoardThatIsAThousandthsPartOff) {
  std::vector<BoardPicture> pictures;
  for (int i = 0; i < 8; ++i)
    pictures.push_back(Picture(i, Pose(20 + 3 * i, 2.4 * i, 0.4 * i, 640), 0.03, 9, 7, {50, 50.2}));
  const auto r = CalibrateIntrinsics("cam1", Board(), pictures, {0, 0}, {});
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_TRUE(Mentions(r->warnings, "0.4 % farther apart"));
}

TEST(Intrinsic, RefusesMixedPictureSizes) {
  auto pictures = GoodPictures();
  pictures[3].width_px = 640;
  EXPECT_NE(Refusal(pictures).find("board3.png has 640 x 512"), std::string::npos) << Refusal(pictures);
}

TEST(Intrinsic, RefusesDiscsOfAnotherSizeThanGiven) {
  TargetSpec t = Board();
  t.pattern = TargetPattern::kDiscs;
  t.diameter_mm = 35;
  auto pictures = GoodPictures();
  for (auto& p : pictures)
    for (Mark& m : p.board.marks) m.diameter_share = 0.5, m.size_px = 10;
  EXPECT_NE(Refusal(pictures, t).find("measure pitch and diameter"), std::string::npos)
      << Refusal(pictures, t);
}

TEST(Intrinsic, DropsAMarkSevenPixelsOffAndReportsIt) {
  auto pictures = GoodPictures();
  pictures[2].board.marks[10].img += Vector2d(7, 0);
  const auto r = CalibrateIntrinsics("cam1", Board(), pictures, {0, 0}, {});
  ASSERT_TRUE(r) << r.error().message;
  ASSERT_EQ(r->dropped.size(), 1u);
  EXPECT_EQ(r->dropped[0].file, "board2.png");
  EXPECT_EQ(r->dropped[0].column, 1);
  EXPECT_EQ(r->dropped[0].row, 1);
  EXPECT_NEAR(r->dropped[0].distance_px, 7, 0.3);
  EXPECT_TRUE(Mentions(r->warnings, "dropped as wrong"));
  EXPECT_LT(r->solution.rms_px, 0.06);
}

TEST(Intrinsic, PutsAsideAViewWhoseBoardMoved) {
  auto pictures = GoodPictures(9);
  for (std::size_t i = 0; i < pictures[4].board.marks.size(); ++i)
    if (pictures[4].board.marks[i].column > 4) pictures[4].board.marks[i].img += Vector2d(3, 2);
  const auto r = CalibrateIntrinsics("cam1", Board(), pictures, {0, 0}, {});
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_FALSE(r->quality[4].used);
  EXPECT_TRUE(Mentions(r->warnings, "board4.png was not used"));
  EXPECT_LT(r->solution.rms_px, 0.06);
}

TEST(Intrinsic, WarnsOfABlurredView) {
  auto pictures = GoodPictures();
  for (Mark& m : pictures[5].board.marks) m.blur_px = 2.5;
  const auto r = CalibrateIntrinsics("cam1", Board(), pictures, {0, 0}, {});
  ASSERT_TRUE(r);
  EXPECT_TRUE(Mentions(r->warnings, "board5.png is blurred"));
}

TEST(Intrinsic, RefusesWhenTooManyPicturesShowNothingAndSaysWhy) {
  auto pictures = GoodPictures(4);
  pictures[0].why_unusable = pictures[1].why_unusable =
      "found 0 corners of a grid where at least 6 are needed";
  EXPECT_NE(Refusal(pictures).find("board0.png: found 0 corners"), std::string::npos) << Refusal(pictures);
}

}  // namespace
}  // namespace vss
