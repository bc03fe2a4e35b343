#include "vss/feature/marks.h"

#include <gtest/gtest.h>

#include "vss/feature/marks_synthetic.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using synthetic::BoardPose;
using synthetic::Render;
using synthetic::Scene;

Scene SmallScene() {
  Scene s;
  s.width_px = s.height_px = 360;
  s.lens = {LensModel::kPinhole, 520, 520, 180.3, 179.2, {}, 0, 0};
  s.noise_levels = 1.5;
  return s;
}

TargetSpec Discs() {
  TargetSpec t;
  t.pattern = TargetPattern::kDiscs;
  t.columns = 9, t.rows = 7, t.pitch_mm = 70, t.diameter_mm = 36;
  return t;
}

TargetSpec Checkerboard() {
  TargetSpec t;
  t.pattern = TargetPattern::kCheckerboard;
  t.columns = 8, t.rows = 6, t.pitch_mm = 70;
  return t;
}

Vector2d TrueCorner(const Scene& s, const TargetSpec& t, const RigidTransform& pose, const Mark& m) {
  const Vector2d p = t.PointOnBoard(m.column, m.row);
  return *s.lens.Project(pose * Vector3d(p.x(), p.y(), 0));
}

// The centroid of the disc's picture, which is the centre of its ellipse.
Vector2d TrueEllipseCentre(const Scene& s, const TargetSpec& t, const RigidTransform& pose, const Mark& m) {
  const Vector2d p = t.PointOnBoard(m.column, m.row);
  double area = 0;
  Vector2d moment(0, 0), before;
  for (int i = 0; i <= 72; ++i) {
    const double a = 2 * kPi * i / 72, r = 0.5 * t.diameter_mm;
    const Vector2d q = *s.lens.Project(pose * Vector3d(p.x() + r * std::cos(a), p.y() + r * std::sin(a), 0));
    if (i > 0) {
      const double cross = before.x() * q.y() - q.x() * before.y();
      area += cross, moment += cross * (before + q);
    }
    before = q;
  }
  return moment / (3 * area);
}

GreyImage Mirrored(const GreyImage& image) {
  GreyImage mirror(image.width(), image.height(), 16);
  const GreyView view = image.view();
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u) mirror.Row16(v)[u] = view.Row16(v)[image.width() - 1 - u];
  return mirror;
}

template <class Truth>
double RmsPerCoordinate(const BoardMarks& board, const Truth& truth) {
  double sum = 0;
  for (const Mark& m : board.marks) sum += (m.img - truth(m)).squaredNorm();
  return std::sqrt(sum / (2 * board.marks.size()));
}

TEST(Marks, DiscsOfTiltedBoardsAreFoundToAHundredthOfAPixel) {
  for (double tilt_deg : {0.0, 25.0, 45.0}) {
    Scene s = SmallScene();
    s.subsamples = 10;  // the picture itself must be finer than what is measured
    const TargetSpec t = Discs();
    const RigidTransform pose = BoardPose(t, 1500, RadFromDeg(tilt_deg), 0.7, 0.05);
    const auto board = FindMarks(Render(s, t, pose).view(), t);
    ASSERT_TRUE(board) << board.error().message;
    EXPECT_EQ(board->marks.size(), 63u) << tilt_deg;
    EXPECT_TRUE(board->anchored);
    EXPECT_LT(RmsPerCoordinate(*board, [&](const Mark& m) { return TrueEllipseCentre(s, t, pose, m); }), 0.01)
        << tilt_deg;
  }
}

TEST(Marks, CornersOfTiltedBoardsAreFoundToAFiftiethOfAPixel) {
  for (double tilt_deg : {0.0, 30.0, 45.0}) {
    const Scene s = SmallScene();
    const TargetSpec t = Checkerboard();
    const RigidTransform pose = BoardPose(t, 1400, RadFromDeg(tilt_deg), 2.1, 0.1);
    const auto board = FindMarks(Render(s, t, pose).view(), t);
    ASSERT_TRUE(board) << board.error().message;
    EXPECT_EQ(board->marks.size(), 48u) << tilt_deg;
    EXPECT_LT(RmsPerCoordinate(*board, [&](const Mark& m) { return TrueCorner(s, t, pose, m); }), 0.02)
        << tilt_deg;
  }
}

TEST(Marks, ReportedSigmaIsTheScatter) {
  Scene s = SmallScene();
  s.width_px = s.height_px = 48;
  s.subsamples = 16;
  s.noise_levels = 4;  // noise, not what the model of the blur leaves, makes the sigma
  s.lens.cx_px = 23.7, s.lens.cy_px = 24.4;
  TargetSpec t = Discs();
  const RigidTransform pose{Eigen::Matrix3d::Identity(), Vector3d(0, 0, 1200)};
  t.columns = t.rows = 1;
  double predicted = 0;
  std::vector<Vector2d> found;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    s.seed = seed;
    const GreyImage image = Render(s, t, pose);
    const auto fit = FitDisc(image.view(), Vector2d(24, 24), 7.8 * Eigen::Matrix2d::Identity(), 4);
    ASSERT_TRUE(fit);
    predicted += fit->sigma_px / 40;
    found.push_back(fit->centre);
  }
  Vector2d mean(0, 0);
  for (const auto& p : found) mean += p / 40;
  double scatter = 0;
  for (const auto& p : found) scatter += (p - mean).squaredNorm() / (2 * 39);
  EXPECT_NEAR(std::sqrt(scatter) / predicted, 1, 0.3);  // 78 degrees of freedom: 8 % sigma
}

TEST(Marks, BoardPartlyOutOfViewIsUsed) {
  const Scene s = SmallScene();
  const TargetSpec t = Discs();
  const RigidTransform pose = BoardPose(t, 1000, 0.4, 1.0, 0.1, {0.25, 0.2});
  const auto board = FindMarks(Render(s, t, pose).view(), t);
  ASSERT_TRUE(board) << board.error().message;
  EXPECT_GT(board->marks.size(), 15u);
  EXPECT_LT(board->marks.size(), 63u);
  EXPECT_LT(board->columns_seen, 9);
}

TEST(Marks, DistinguishedDiscsTellHalfATurnAndAMirror) {
  const Scene s = SmallScene();
  TargetSpec t = Discs();
  t.distinguished = {{{2, 2}, {5, 2}, {2, 5}}};
  t.distinguished_diameter_mm = 54;
  const RigidTransform turned = BoardPose(t, 1500, 0.3, 0.4, kPi);
  const auto board = FindMarks(Render(s, t, turned).view(), t);
  ASSERT_TRUE(board) << board.error().message;
  EXPECT_TRUE(board->anchored);
  EXPECT_FALSE(board->mirrored);
  EXPECT_LT(RmsPerCoordinate(*board, [&](const Mark& m) { return TrueCorner(s, t, turned, m); }), 0.1);
  const auto seen = FindMarks(Mirrored(Render(s, t, turned)).view(), t);
  ASSERT_TRUE(seen) << seen.error().message;
  EXPECT_TRUE(seen->mirrored);
}

TargetSpec Charuco() {
  TargetSpec t;
  t.pattern = TargetPattern::kCharuco;
  t.columns = 6, t.rows = 5, t.pitch_mm = 70, t.marker_mm = 46, t.dictionary = "4x4_50";
  return t;
}

TEST(Marks, CodedCornersAreKnownHoweverTheBoardIsTurned) {
  const Scene s = SmallScene();
  for (bool white : {false, true})
    for (double turn : {0.1, 1.7, 3.2, 4.8}) {
      TargetSpec t = Charuco();
      t.first_square_white = white;
      const RigidTransform pose = BoardPose(t, 1200, 0.4, 0.9, turn);
      const auto board = FindMarks(Render(s, t, pose).view(), t);
      ASSERT_TRUE(board) << board.error().message;
      EXPECT_EQ(board->marks.size(), 30u) << turn;
      EXPECT_TRUE(board->by_codes && board->anchored && !board->mirrored);
      EXPECT_LT(RmsPerCoordinate(*board, [&](const Mark& m) { return TrueCorner(s, t, pose, m); }), 0.03)
          << turn;
    }
}

TEST(Marks, CodedBoardPartlyOutOfViewKeepsItsLabels) {
  const Scene s = SmallScene();
  const TargetSpec t = Charuco();
  const RigidTransform pose = BoardPose(t, 800, 0.4, 1.0, 0.6, {0.2, 0.15});
  const auto board = FindMarks(Render(s, t, pose).view(), t);
  ASSERT_TRUE(board) << board.error().message;
  EXPECT_GT(board->marks.size(), 8u);
  EXPECT_LT(board->marks.size(), 30u);
  EXPECT_TRUE(board->by_codes);
  EXPECT_LT(RmsPerCoordinate(*board, [&](const Mark& m) { return TrueCorner(s, t, pose, m); }), 0.03);
}

TEST(Marks, CodedBoardTellsAMirrorAndAnotherLayout) {
  const Scene s = SmallScene();
  const TargetSpec t = Charuco();
  const GreyImage image = Render(s, t, BoardPose(t, 1200, 0.3, 0.4, 0.5));
  const auto mirrored = FindMarks(Mirrored(image).view(), t);
  ASSERT_TRUE(mirrored) << mirrored.error().message;
  EXPECT_TRUE(mirrored->mirrored);
  TargetSpec other = t;
  other.first_square_white = true;
  const auto seen = FindMarks(image.view(), other);
  ASSERT_TRUE(seen) << seen.error().message;
  EXPECT_TRUE(seen->codes_disagree && !seen->mirrored);
  other = t;
  other.columns = 8;
  const auto wider = FindMarks(image.view(), other);
  ASSERT_TRUE(wider) << wider.error().message;
  EXPECT_TRUE(wider->codes_disagree);
}

TEST(Marks, PictureWithoutABoardSaysSo) {
  GreyImage blank(200, 150, 8);
  for (int v = 0; v < 150; ++v) std::fill(blank.Row8(v), blank.Row8(v) + 200, 90);
  for (const TargetSpec& t : {Discs(), Checkerboard()}) {
    const auto board = FindMarks(blank.view(), t);
    ASSERT_FALSE(board);
    EXPECT_NE(board.error().message.find("found 0"), std::string::npos) << board.error().message;
  }
}

}  // namespace
}  // namespace vss
