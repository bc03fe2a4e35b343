// vss calibrate, vss camera check and vss target as a user runs them, on rendered pictures; every kind of bad
// input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "program.h"
#include "vss/calibrate/cube_synthetic.h"
#include "vss/calibrate/intrinsic.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;
using synthetic::BoardPose;
using synthetic::LookAt;
using synthetic::Scene;
using testing::HasSubstr;
using testing::Not;

Scene SmallCamera() {
  Scene s;
  s.width_px = 320, s.height_px = 280;
  s.lens = {LensModel::kWeng, 400, 400, 162.2, 137.6, {0.05, 2e-4, -1e-4, 4e-4, -2e-4, 0.001}, 6, 0.01};
  s.noise_levels = 1.2;
  return s;
}

TargetSpec Board() {
  TargetSpec t;
  t.columns = 8, t.rows = 6, t.pitch_mm = 70, t.diameter_mm = 36;
  return t;
}

const CubeSpec kCube{600, {900, 700, 0}, 0.3};
const std::vector<Vector3d> kStops{{0, 0, 0}, {260, -60, 0}, {-150, 240, 0}};

RigidTransform Place() {
  return LookAt(kCube.position_mm + Vector3d(-900, 700, 1800), kCube.position_mm + Vector3d(0, 0, 250), 0.2);
}

// The pictures are rendered once; every test copies the folder.
const fs::path& Pictures() {
  static const fs::path folder = [] {
    const fs::path f = fs::temp_directory_path() / ("vss-calibrate-pictures-" + std::to_string(::getpid()));
    fs::create_directories(f / "board");
    fs::create_directories(f / "cube");
    Scene s = SmallCamera();
    for (int i = 0; i < 7; ++i) {
      s.seed = static_cast<unsigned>(i + 1);
      const Vector2d at(0.2 * std::cos(2.4 * i), 0.17 * std::sin(2.4 * i));
      const auto pose = BoardPose(Board(), 900 + 70 * (i % 3), RadFromDeg(22 + 3 * i), 1.7 * i, 0.3 * i, at);
      EXPECT_TRUE(WritePng(f / "board" / fmt::format("b{}.png", i), Render(s, Board(), pose).view()));
    }
    // The board stands still while the gantry moves.
    const auto still = BoardPose(Board(), 1500, 0.4, 0.6, 0.2);
    fs::create_directories(f / "still");
    for (int i = 0; i < 3; ++i) {
      RigidTransform pose = still;
      pose.translation -= Vector3d(100.0 * i, -40.0 * i, 0);
      EXPECT_TRUE(WritePng(f / "still" / fmt::format("s{}.png", i), Render(s, Board(), pose).view()));
    }
    for (std::size_t i = 0; i < kStops.size(); ++i) {
      RigidTransform place = Place();
      place.translation -= place.rotation * kStops[i];
      EXPECT_TRUE(WritePng(f / "cube" / fmt::format("c{}.png", i), RenderCube(s, kCube, {}, place).view()));
    }
    return f;
  }();
  return folder;
}

class RemovePictures : public testing::Environment {
  void TearDown() override { fs::remove_all(Pictures()); }
};
const auto* const remove_pictures = testing::AddGlobalTestEnvironment(new RemovePictures);

void MakeJob(const fs::path& folder) {
  fs::create_directories(folder);
  fs::copy(Pictures(), folder, fs::copy_options::recursive);
  WriteAll(folder / "calibration.toml",
           "format = \"vss-calibration/1\"\n"                                                          // 1
           "name = \"small\"\n"                                                                        // 2
           "[[intrinsic]]\n"                                                                           // 3
           "camera = \"cam1\"\n"                                                                       // 4
           "pixel_pitch = [0.01, 0.01]\n"                                                              // 5
           "target = { pattern = \"discs\", columns = 8, rows = 6, pitch = 70.0, diameter = 36.0 }\n"  // 6
           "images = [\"board/*.png\"]\n"                                                              // 7
           "lens = \"8 mm\"\n"                                                                         // 8
           "[[extrinsic]]\n"                                                                           // 9
           "camera = \"cam1\"\n"                                                                       // 10
           "cube = { size = 600.0, position = [900.0, 700.0, 0.0], yaw = 17.188733853924695 }\n"       // 11
           "images = [ { file = \"cube/c0.png\", gantry = [0.0, 0.0, 0.0] },\n"                        // 12
           "           { file = \"cube/c1.png\", gantry = [260.0, -60.0, 0.0] },\n"                    // 13
           "           { file = \"cube/c2.png\", gantry = [-150.0, 240.0, 0.0] } ]\n");                // 14
}

void Replace(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = ReadAll(file);
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  WriteAll(file, text);
}

Outcome Calibrated(const Scratch& scratch, const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments{"calibrate", (scratch / "job").string(), "-o",
                                     (scratch / "out").string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return RunProgram(scratch, arguments);
}

TEST(Calibration, FromPicturesToCameraFilesWithBothModels) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  for (const std::string model : {"weng", "opencv"}) {
    const Outcome run = Calibrated(scratch, {"--model", model});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("7 views"));
    const auto camera = ReadCamera(scratch / "out/cameras/cam1.toml");
    ASSERT_TRUE(camera) << camera.error().message;
    EXPECT_EQ(camera->intrinsics.model, model == "weng" ? LensModel::kWeng : LensModel::kOpenCv);
    EXPECT_LT(LensDifference(SmallCamera().lens, camera->intrinsics, 320, 280).rms, 0.06);
    EXPECT_LT((camera->cam_from_world->Inverse().translation - Place().Inverse().translation).norm(), 3);
    EXPECT_EQ(camera->quality->about.at("lens"), "8 mm");
    const auto json = nlohmann::json::parse(ReadAll(scratch / "out/calibration.json"));
    EXPECT_EQ(json["cameras"][0]["id"], "cam1");
    EXPECT_THAT(ReadAll(scratch / "out/report.html"), HasSubstr("cam1"));
  }
}

TEST(Calibration, ABoardThatStandsStillWhileTheGantryMovesConfirmsItsPitch) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  Replace(
      scratch / "job/calibration.toml", "\"board/*.png\"",
      "\"board/*.png\", { file = \"still/s0.png\", gantry = [0, 0, 0] }, { file = \"still/s1.png\", gantry = "
      "[100, -40, 0] }");
  const Outcome run = Calibrated(scratch);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("9 views"));
}

TEST(Calibration, SameInputGivesTheSameBytesWithAnyNumberOfThreads) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  std::string first[3];
  for (const std::string threads : {"1", "2"}) {
    ASSERT_EQ(Calibrated(scratch, {"--threads", threads}).exit_code, 0);
    int i = 0;
    for (const std::string name : {"cameras/cam1.toml", "calibration.json", "report.html"}) {
      const std::string text = ReadAll(scratch / ("out/" + name));
      if (threads == "1")
        first[i] = text;
      else
        EXPECT_EQ(text, first[i]) << name;
      ++i;
    }
  }
}

TEST(Calibration, CameraFileIsCheckedConvertedAndHeldAgainstTheCube) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  ASSERT_EQ(Calibrated(scratch).exit_code, 0);
  const std::string file = (scratch / "out/cameras/cam1.toml").string(), job = (scratch / "job").string(),
                    other = (scratch / "cv.toml").string();
  const Outcome check = RunProgram(scratch, {"camera", "check", file, "--at", "500", "0", "0"});
  EXPECT_EQ(check.exit_code, 0) << check.err;
  EXPECT_THAT(check.out, HasSubstr("is sound"));
  EXPECT_THAT(check.out, HasSubstr("At gantry (500, 0, 0) it is at (5"));
  const Outcome convert = RunProgram(scratch, {"camera", "check", file, "--to", "opencv", "-o", other});
  EXPECT_EQ(convert.exit_code, 0) << convert.err;
  EXPECT_THAT(convert.out, HasSubstr("px at most"));
  const auto a = ReadCamera(file), b = ReadCamera(other);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(b->intrinsics.model, LensModel::kOpenCv);
  double worst = 0;
  for (int v = 0; v < 280; v += 40)
    for (int u = 0; u < 320; u += 40)
      worst = std::max(
          worst, (*b->intrinsics.ImgFromNormalized(*a->intrinsics.NormalizedFromImg({u, v})) - Vector2d(u, v))
                     .norm());
  const auto at = convert.out.find("px RMS and ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_LE(worst, std::stod(convert.out.substr(at + 11)) + 1e-4);
  const Outcome still = RunProgram(scratch, {"camera", "check", file, "--cube", job});
  EXPECT_EQ(still.exit_code, 0) << still.err;
  EXPECT_THAT(still.out, HasSubstr("hangs where its file says"));
  auto moved = *a;
  moved.cam_from_world->rotation = RotationFromVector({0.004, 0.003, 0}) * moved.cam_from_world->rotation;
  WriteAll(scratch / "moved.toml", CameraToToml(moved));
  const Outcome knocked =
      RunProgram(scratch, {"camera", "check", (scratch / "moved.toml").string(), "--cube", job});
  EXPECT_EQ(knocked.exit_code, 1);
  EXPECT_THAT(knocked.err, HasSubstr("has moved"));
}

// A survey of the cube's own pictures.
void MakeSurvey(const fs::path& folder) {
  fs::create_directories(folder / "images");
  fs::copy_file(Pictures() / "cube/c0.png", folder / "images/c0.png");
  fs::copy_file(Pictures() / "cube/c1.png", folder / "images/c1.png");
  WriteAll(folder / "survey.toml",
           "format = \"vss-survey/1\"\ncameras = [\"cam1.toml\"]\nknowledge = [\"box\"]\n[[image]]\nfile = "
           "\"images/c0.png\"\ncamera = \"cam1\"\ngantry = [0, 0, 0]\n[[image]]\nfile = "
           "\"images/c1.png\"\ncamera = \"cam1\"\ngantry = [260, -60, 0]\n");
}

TEST(Calibration, AWarningStandsInTheCameraFileAndEverySurveyRepeatsIt) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  Replace(scratch / "job/calibration.toml", "[-150.0, 240.0, 0.0]", "[-150.0, 240.0, 5.0]");
  const Outcome run = Calibrated(scratch);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("check the displacements"));
  EXPECT_THAT(ReadAll(scratch / "out/cameras/cam1.toml"), HasSubstr("check the displacements"));
  MakeSurvey(scratch / "survey");
  const Outcome survey =
      RunProgram(scratch, {"survey", (scratch / "survey").string(), "-o", (scratch / "product").string(),
                           "--cameras", (scratch / "out").string(), "--progress", "none"});
  ASSERT_EQ(survey.exit_code, 0) << survey.err;
  EXPECT_THAT(survey.out + survey.err, HasSubstr("check the displacements"));
  EXPECT_THAT(survey.out + survey.err, Not(HasSubstr("camera cam1: camera cam1")));
  EXPECT_THAT(ReadAll(scratch / "product/product.json"), HasSubstr("check the displacements"));
  EXPECT_THAT(ReadAll(scratch / "product/report.html"), HasSubstr("check the displacements"));
}

TEST(Calibration, CalibratedGantryAxesStandInTheCameraFileAndSurveysUseThem) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  // The carriage moves 1.25 % less than its scale says.
  Replace(scratch / "job/calibration.toml", "[260.0, -60.0, 0.0]", "[263.25, -60.0, 0.0]");
  Replace(scratch / "job/calibration.toml", "[-150.0, 240.0, 0.0]", "[-151.875, 240.0, 0.0]");
  Replace(scratch / "job/calibration.toml", "name = ", "gantry = { calibrate = true }\nname = ");
  const Outcome run = Calibrated(scratch);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Gantry axis x: a millimetre of displacement moves the cameras by 0.98"));
  const auto camera = ReadCamera(scratch / "out/cameras/cam1.toml");
  ASSERT_TRUE(camera) << camera.error().message;
  ASSERT_TRUE(camera->gantry_axes);
  EXPECT_NEAR((*camera->gantry_axes)(0, 0), 260 / 263.25, 3e-3);
  EXPECT_GT(camera->gantry_axes_sigma(0, 0), 0);
  MakeSurvey(scratch / "survey");
  Replace(scratch / "survey/survey.toml", "[260, -60, 0]", "[263.25, -60, 0]");
  const Outcome survey = RunProgram(
      scratch, {"survey", (scratch / "survey").string(), "-o", (scratch / "product").string(), "--cameras",
                (scratch / "out").string(), "--set", "identify.min_log_odds=0", "--progress", "none"});
  EXPECT_NE(survey.exit_code, 3) << survey.err;
  const Outcome said = RunProgram(scratch, {"camera", "check", (scratch / "out/cameras/cam1.toml").string(),
                                            "--cube", (scratch / "job").string()});
  EXPECT_EQ(said.exit_code, 0) << said.err;
}

// ---- Bad input ----

struct BadJob {
  const char* name;
  std::function<void(const fs::path& job)> spoil;
  const char* place;
  const char* remedy;
};
void PrintTo(const BadJob& bad, std::ostream* os) { *os << bad.name; }

std::function<void(const fs::path&)> InJob(const std::string& from, const std::string& to) {
  return [=](const fs::path& job) { Replace(job / "calibration.toml", from, to); };
}

class BadCalibration : public testing::TestWithParam<BadJob> {};

TEST_P(BadCalibration, IsOneSentenceAndNothingIsWritten) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  GetParam().spoil(scratch / "job");
  const Outcome run = Calibrated(scratch, {"--progress", "none"});
  EXPECT_EQ(run.exit_code, 1) << run.err << run.out;
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_THAT(run.err, HasSubstr(GetParam().place));
  EXPECT_THAT(run.err, HasSubstr(GetParam().remedy));
  EXPECT_EQ(run.out, "");
  EXPECT_FALSE(fs::exists(scratch / "out"));
}

void Halve(const fs::path& file) { fs::resize_file(file, fs::file_size(file) / 2); }

INSTANTIATE_TEST_SUITE_P(
    All, BadCalibration,
    testing::Values(
        BadJob{"NoFile", [](const fs::path& j) { fs::remove(j / "calibration.toml"); }, "calibration.toml",
               ""},
        BadJob{"WrongFormat", InJob("vss-calibration/1", "vss-camera/1"), "calibration.toml:1",
               "\"vss-calibration/1\" is needed"},
        BadJob{"NotToml", InJob("name = ", "name = = "), "calibration.toml:2", "not valid TOML"},
        BadJob{"NothingThatMatches", InJob("board/*.png", "board/*.tif"), "calibration.toml:7",
               "correct the pattern"},
        BadJob{"CubePictureMissing", [](const fs::path& j) { fs::remove(j / "cube/c1.png"); },
               "calibration.toml:13", "correct the name"},
        BadJob{"BoardPictureTruncated", [](const fs::path& j) { Halve(j / "board/b2.png"); }, "board/b2.png",
               "copy the file again"},
        BadJob{"CubePictureTruncated", [](const fs::path& j) { Halve(j / "cube/c1.png"); }, "cube/c1.png",
               "copy the file again"},
        BadJob{"NotAPicture", [](const fs::path& j) { WriteAll(j / "board/b3.png", "# a text\n"); },
               "board/b3.png", "not a picture"},
        BadJob{"EmptyPicture", [](const fs::path& j) { WriteAll(j / "cube/c0.png", ""); }, "cube/c0.png",
               "the file is empty"},
        BadJob{"MixedPictureSizes",
               [](const fs::path& j) {
                 ASSERT_TRUE(WritePng(j / "board/b4.png", GreyImage(320, 200, 8).view()));
               },
               "b4.png has 320 x 200 px", "take the odd ones out"},
        BadJob{"CubeOfAnotherSetting",
               [](const fs::path& j) {
                 ASSERT_TRUE(WritePng(j / "cube/c2.png", GreyImage(640, 280, 8).view()));
               },
               "c2.png has 640 x 280 px", "same setting"},
        BadJob{"NotANumber", InJob("[0.0, 0.0, 0.0] }", "[0.0, nan, 0.0] }"), "calibration.toml:12",
               "not a finite number"},
        BadJob{"NegativePixelPitch", InJob("[0.01, 0.01]", "[0.01, -0.01]"), "calibration.toml:5", "above 0"},
        BadJob{"UnknownPattern", InJob("\"discs\"", "\"dots\""), "calibration.toml:6", "known are"},
        BadJob{"DiscsThatTouch", InJob("diameter = 36.0", "diameter = 70.0"), "calibration.toml:6",
               "smaller"},
        BadJob{"SamePictureTwice", InJob("cube/c1.png", "cube/c0.png"), "calibration.toml:13", "second time"},
        BadJob{"CubeWithoutLens", InJob("camera = \"cam1\"\ncube", "camera = \"cam2\"\ncube"),
               "calibration.toml:9", "camera_file"},
        BadJob{"CameraFileMissing",
               InJob("camera = \"cam1\"\ncube", "camera = \"cam2\"\ncamera_file = \"lens.toml\"\ncube"),
               "lens.toml", ""},
        BadJob{"LensTwice",
               InJob("camera = \"cam1\"\ncube", "camera = \"cam1\"\ncamera_file = \"board/b0.png\"\ncube"),
               "calibration.toml:9", "take one of them out"},
        BadJob{"AxesInAPlane",
               InJob("name = ", "gantry = { axes = [[1, 0, 0], [1, 0, 0], [0, 0, 1]] }\nname = "),
               "calibration.toml:2", "perpendicular"},
        BadJob{"WrongCounts", InJob("columns = 8", "columns = 7"), "camera cam1",
               "correct the target's counts"},
        BadJob{"WrongPattern",
               InJob("\"discs\", columns = 8, rows = 6, pitch = 70.0, diameter = 36.0",
                     "\"checkerboard\", columns = 8, rows = 6, pitch = 70.0"),
               "camera cam1", "needs at least 3"},
        BadJob{"WrongDiscSize", InJob("diameter = 36.0", "diameter = 28.0"), "camera cam1",
               "measure pitch and diameter"},
        BadJob{"WrongPitchByKnownMoves",
               [](const fs::path& j) {
                 Replace(
                     j / "calibration.toml", "\"board/*.png\"",
                     "\"board/*.png\", { file = \"still/s0.png\", gantry = [0, 0, 0] }, { file = "
                     "\"still/s1.png\", gantry = [100, -40, 0] }, { file = \"still/s2.png\", gantry = [200, "
                     "-80, 0] }");
                 Replace(j / "calibration.toml", "pitch = 70.0, diameter = 36.0",
                         "pitch = 73.5, diameter = 37.8");
               },
               "4.8 % smaller than its pitch of 73.5 mm", "measure the pitch"},
        BadJob{"TwoViews", InJob("\"board/*.png\"", "\"board/b0.png\", \"board/b1.png\""), "2 of 2 pictures",
               "different directions"},
        BadJob{"WrongPixelAspect", InJob("[0.01, 0.01]", "[0.01, 0.012]"), "camera cam1",
               "check the pixel pitch"},
        BadJob{"CubeOfAnotherSize", InJob("size = 600.0", "size = 615.0"), "camera cam1", "measure the cube"},
        BadJob{"WrongDisplacement",
               [](const fs::path& j) {
                 Replace(j / "calibration.toml",
                         ",\n           { file = \"cube/c2.png\", gantry = [-150.0, 240.0, 0.0] }", "");
                 Replace(j / "calibration.toml", "[260.0, -60.0, 0.0]", "[290.0, -60.0, 20.0]");
                 Replace(j / "calibration.toml", "images = [ {",
                         "camera_near = [0.0, 1400.0, 1800.0]\nimages = [ {");
               },
               "camera cam1", "displacements"},
        BadJob{
            "OneStopWithoutARoughPlace",
            InJob("gantry = [0.0, 0.0, 0.0] },\n           { file = \"cube/c1.png\", gantry = [260.0, -60.0, "
                  "0.0] },\n           { file = \"cube/c2.png\", gantry = [-150.0, 240.0, 0.0] } ]",
                  "gantry = [0.0, 0.0, 0.0] } ]"),
            "looks alike", "camera_near"},
        BadJob{"NoCubeInThePicture",
               [](const fs::path& j) {
                 for (int i = 0; i < 3; ++i)
                   fs::copy_file(j / "board/b0.png", j / fmt::format("cube/c{}.png", i),
                                 fs::copy_options::overwrite_existing);
               },
               "no cube of 600 mm", "measure the cube"},
        BadJob{"AxesWithoutACube",
               [](const fs::path& j) {
                 std::string text = ReadAll(j / "calibration.toml");
                 text.resize(text.find("[[extrinsic]]"));
                 WriteAll(j / "calibration.toml", text + "[gantry]\ncalibrate = true\n");
               },
               "calibration.toml", "add an [[extrinsic]]"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(BadCalibrationCall, OutputThatCannotBeWrittenAndUnknownParametersAreTold) {
  const Scratch scratch;
  MakeJob(scratch / "job");
  WriteAll(scratch / "file", "in the way");
  const Outcome blocked =
      RunProgram(scratch, {"calibrate", (scratch / "job").string(), "-o", (scratch / "file").string()});
  EXPECT_EQ(blocked.exit_code, 1);
  EXPECT_THAT(blocked.err, HasSubstr("-o"));
  EXPECT_EQ(ReadAll(scratch / "file"), "in the way");
  for (const std::string set : {"calibrate.nonsense=1", "calibrate.outlier_sigmas",
                                "calibrate.outlier_sigmas=nan", "calibrate.outlier_sigmas=-1"}) {
    const Outcome run = Calibrated(scratch, {"--set", set});
    EXPECT_EQ(run.exit_code, 2) << set << run.err;
    EXPECT_FALSE(fs::exists(scratch / "out"));
  }
}

TEST(BadCalibrationCall, MachinesReadTheErrorToo) {
  const Scratch scratch;
  const Outcome run = RunProgram(
      scratch, {"calibrate", (scratch / "none").string(), "-o", (scratch / "out").string(), "--json"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, HasSubstr("\"exit_code\":1"));
  EXPECT_THAT(run.err, HasSubstr("there is no such folder"));
}

TEST(CameraCheck, UnsoundFilesAreRefusedInOneSentence) {
  const Scratch scratch;
  const std::string good =
      "format = \"vss-camera/1\"\nid = \"cam1\"\nwidth = 320\nheight = 280\n[intrinsics]\nmodel = "
      "\"opencv\"\n"
      "focal_length = [400.0, 400.0]\nprincipal_point = [160.0, 140.0]\ndistortion = [-0.1, 0.0, 0.0, 0.0]\n";
  const auto check = [&](const std::string& from, const std::string& to) {
    WriteAll(scratch / "cam.toml", good);
    if (!from.empty()) Replace(scratch / "cam.toml", from, to);
    return RunProgram(scratch, {"camera", "check", (scratch / "cam.toml").string()});
  };
  EXPECT_EQ(check("", "").exit_code, 0);
  const std::pair<std::pair<const char*, const char*>, const char*> cases[] = {
      {{"[-0.1, 0.0, 0.0, 0.0]", "[-3.0, 0.0, 0.0, 0.0]"}, "folds over"},
      {{"[400.0, 400.0]", "[400.0, nan]"}, "cam.toml:7"},
      {{"[400.0, 400.0]", "[-400.0, 400.0]"}, "cam.toml:7"},
      {{"width = 320", "width = 0"}, "cam.toml:3"},
      {{"opencv", "brown"}, "cam.toml:6"},
      {{"format = \"vss-camera/1\"\n", ""}, "cam.toml"}};
  for (const auto& [change, words] : cases) {
    const Outcome run = check(change.first, change.second);
    EXPECT_EQ(run.exit_code, 1) << words;
    EXPECT_THAT(run.err, HasSubstr(words));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
}

}  // namespace
}  // namespace vss
