// From pictures of boards to the lens, over rigs of every kind: each rendered, found and calibrated, against
// the lens that rendered it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vss/calibrate/intrinsic.h"
#include "vss/feature/marks_synthetic.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using synthetic::BoardPose;
using synthetic::Render;
using synthetic::Scene;
using testing::HasSubstr;

struct RigKind {
  const char* name;
  Scene scene;
  TargetSpec target;
  int views = 9;
  double tilt_deg = 30;
  double fill = 0.75;    // of the picture's smaller side by the board's larger
  double max_px = 0.03;  // of the map pixel -> ray, root mean square over the picture
  bool opencv = false;
};
void PrintTo(const RigKind& rig, std::ostream* os) { *os << rig.name; }

Scene SceneOf(int width, int height, double f, double k1, double noise = 1.2) {
  Scene s;
  s.width_px = width, s.height_px = height;
  // Observed to ideal: as Weng's model has it, so that the lens itself is no source of error.
  s.lens = {LensModel::kWeng,
            f,
            0.99 * f,
            0.5 * width + 4.3,
            0.5 * height - 3.1,
            {k1, 2e-4, -1e-4, 4e-4, -2e-4, 0.3 * k1 * k1},
            6,
            0.01};
  s.noise_levels = noise;
  s.subsamples = 4;
  return s;
}

TargetSpec Discs(int columns, int rows, double pitch, double share = 0.5) {
  TargetSpec t;
  t.pattern = TargetPattern::kDiscs;
  t.columns = columns, t.rows = rows, t.pitch_mm = pitch, t.diameter_mm = share * pitch;
  return t;
}

TargetSpec Corners(TargetPattern pattern, int columns, int rows, double pitch) {
  TargetSpec t;
  t.pattern = pattern;
  t.columns = columns, t.rows = rows, t.pitch_mm = pitch;
  if (pattern == TargetPattern::kCharuco) t.marker_mm = 0.6 * pitch;
  return t;
}

// Tilted in turn to all sides, its middle over the whole picture: several views hang over the border.
RigidTransform PoseOf(const RigKind& rig, int i) {
  const TargetSpec& t = rig.target;
  const double board = t.pitch_mm * std::max(t.columns, t.rows),
               side = std::min(rig.scene.width_px, rig.scene.height_px);
  const double distance = rig.scene.lens.fx_px * board / (rig.fill * side) * (1 + 0.1 * (i % 3));
  const double golden = 2.39996 * i, radius = 0.3 * std::sqrt((i + 0.5) / rig.views);
  const Vector2d at(radius * std::cos(golden) * rig.scene.width_px / rig.scene.lens.fx_px,
                    radius * std::sin(golden) * rig.scene.height_px / rig.scene.lens.fy_px);
  return BoardPose(t, distance, RadFromDeg(rig.tilt_deg * (i % 4 == 3 ? 0.4 : 1)), 1.7 * i, 0.35 * i, at);
}

std::vector<BoardPicture> PicturesOf(const RigKind& rig) {
  std::vector<BoardPicture> pictures;
  for (int i = 0; i < rig.views; ++i) {
    Scene s = rig.scene;
    s.seed = static_cast<unsigned>(i + 1);
    BoardPicture p{fmt::format("board{}.png", i), s.width_px, s.height_px, {}, ""};
    auto marks = FindMarks(Render(s, rig.target, PoseOf(rig, i)).view(), rig.target);
    if (marks)
      p.board = std::move(*marks);
    else
      p.why_unusable = marks.error().message;
    pictures.push_back(std::move(p));
  }
  return pictures;
}

std::vector<RigKind> Kinds() {
  std::vector<RigKind> kinds;
  const Scene usual = SceneOf(400, 340, 440, 0.06);
  kinds.push_back({"Usual", usual, Discs(11, 9, 70), 9, 30, 0.75, 0.02, false});
  kinds.push_back({"AsOpenCv", usual, Discs(11, 9, 70), 9, 30, 0.75, 0.03, true});
  kinds.push_back(
      {"Checkerboard", usual, Corners(TargetPattern::kCheckerboard, 9, 7, 40), 9, 30, 0.75, 0.03, false});
  kinds.push_back({"Charuco", usual, Corners(TargetPattern::kCharuco, 7, 6, 40), 10, 30, 0.8, 0.05, false});
  RigKind distinguished{"DistinguishedDiscs", usual, Discs(10, 8, 50, 0.4), 9, 30, 0.75, 0.03, false};
  distinguished.target.distinguished = {{{5, 4}, {7, 4}, {5, 3}}};
  distinguished.target.distinguished_diameter_mm = 29;
  kinds.push_back(distinguished);
  kinds.push_back({"FinePitch", usual, Discs(23, 17, 3), 8, 30, 0.9, 0.03, false});
  kinds.push_back({"FewLargeDiscs", usual, Discs(5, 4, 150), 12, 30, 0.8, 0.08, false});
  kinds.push_back({"LargePicture", SceneOf(960, 720, 1050, 0.05), Discs(9, 7, 70), 6, 30, 0.75, 0.03, false});
  kinds.push_back({"WideAngle", SceneOf(400, 340, 220, 0.16), Discs(13, 11, 70), 12, 30, 0.75, 0.05, false});
  kinds.push_back({"Tele", SceneOf(400, 340, 2200, 0.3), Discs(11, 9, 70), 12, 40, 0.75, 0.06, false});
  kinds.push_back({"FourViews", usual, Discs(11, 9, 70), 4, 30, 0.8, 0.08, false});
  kinds.push_back({"Noisy", SceneOf(400, 340, 440, 0.06, 9), Discs(11, 9, 70), 10, 30, 0.75, 0.08, false});
  RigKind dim{"DimAndVignetted", usual, Discs(11, 9, 70), 9, 30, 0.75, 0.06, false};
  dim.scene.vignetting = 0.6, dim.scene.exposure = 0.35;
  kinds.push_back(dim);
  kinds.push_back({"StrongTilt", usual, Discs(11, 9, 70), 10, 55, 0.75, 0.03, false});
  RigKind blurred{"Blurred", usual, Discs(9, 7, 70), 9, 30, 0.8, 0.05, false};
  blurred.scene.blur_px = 1.8;
  kinds.push_back(blurred);
  RigKind corners_blurred{
      "BlurredCorners", usual, Corners(TargetPattern::kCheckerboard, 8, 6, 40), 9, 30, 0.8, 0.08, false};
  corners_blurred.scene.blur_px = 1.8;
  kinds.push_back(corners_blurred);
  RigKind white{"LightDiscsOnADarkBoard", usual, Discs(11, 9, 70), 9, 30, 0.75, 0.03, false};
  white.scene.inverted = true;
  kinds.push_back(white);
  return kinds;
}

class BoardRig : public testing::TestWithParam<RigKind> {};

TEST_P(BoardRig, GivesTheLensThatRenderedIt) {
  const RigKind& rig = GetParam();
  const auto pictures = PicturesOf(rig);
  CalibrationOptions options;
  options.opencv = rig.opencv;
  const auto r = CalibrateIntrinsics("cam1", rig.target, pictures, {0, 0}, options);
  ASSERT_TRUE(r) << r.error().message;
  EXPECT_EQ(static_cast<int>(r->views.size()), rig.views) << fmt::format("{}", fmt::join(r->warnings, "\n"));
  EXPECT_THAT(r->dropped, testing::SizeIs(testing::Le(2u)));
  const PictureMap off = LensDifference(rig.scene.lens, r->intrinsics, r->width_px, r->height_px);
  EXPECT_LT(off.rms, rig.max_px);
  // What is predicted is what comes out: one draw of a map of some eight numbers; 0.01 px is the marks' own
  // error.
  EXPECT_LT(off.rms, 3 * 1.41 * r->uncertainty_px.rms + 0.01) << r->uncertainty_px.rms;
  RecordProperty("map_px", std::to_string(off.rms));
  if (std::getenv("VSS_SHOW_FIGURES"))
    fmt::print("{:24} map {:.4f} px (predicted {:.4f}), rms {:.4f}, {} marks dropped, {}\n", rig.name,
               off.rms, r->uncertainty_px.rms, r->solution.rms_px, r->dropped.size(),
               fmt::join(r->warnings, "; "));
}

INSTANTIATE_TEST_SUITE_P(Kinds, BoardRig, testing::ValuesIn(Kinds()),
                         [](const auto& info) { return std::string(info.param.name); });

// ---- What is refused, from the picture on ----

std::string Refusal(const RigKind& rig, const TargetSpec& said, const std::vector<BoardPicture>& pictures) {
  const auto r = CalibrateIntrinsics("cam1", said, pictures, {0.01, 0.01}, {});
  (void)rig;
  return r ? "accepted" : r.error().message;
}

TEST(Boards, ThatAllFaceTheCameraAreRefused) {
  RigKind rig{"", SceneOf(360, 320, 400, 0.05), Discs(9, 7, 70), 6, 0, 0.6};
  EXPECT_THAT(Refusal(rig, rig.target, PicturesOf(rig)), HasSubstr("tilt the board"));
}

TEST(Boards, OfACharucoWithAnotherLayoutAreRefused) {
  RigKind rig{"", SceneOf(360, 320, 400, 0.05), Corners(TargetPattern::kCharuco, 7, 6, 40), 4, 30, 0.8};
  const auto with = [&](const TargetSpec& said) {
    auto pictures = PicturesOf(rig);
    for (int i = 0; i < rig.views; ++i) {
      Scene s = rig.scene;
      s.seed = static_cast<unsigned>(i + 1);
      pictures[i].board = *FindMarks(Render(s, rig.target, PoseOf(rig, i)).view(), said);
    }
    return Refusal(rig, said, pictures);
  };
  TargetSpec other = rig.target;
  other.first_square_white = true;
  EXPECT_THAT(with(other),
              HasSubstr("correct the target's dictionary, columns, rows and first_square_white"));
  other = rig.target;
  other.columns = 8;
  EXPECT_THAT(with(other), HasSubstr("correct the target's"));
}

}  // namespace
}  // namespace vss
