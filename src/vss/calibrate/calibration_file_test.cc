// Every mistake in calibration.toml is told in one sentence with file, line and remedy.
#include "vss/calibrate/calibration_file.h"

#include <gtest/gtest.h>

#include <fstream>

namespace vss {
namespace {

namespace fs = std::filesystem;

class CalibrationFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / "calibration_file";
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "board");
    for (const char* name : {"board/b.png", "board/a.png", "cube.png"}) std::ofstream(folder_ / name) << "x";
  }
  Result<CalibrationJob> Read(const std::string& text) {
    std::ofstream(folder_ / "calibration.toml") << "format = \"vss-calibration/1\"\n" << text;
    return ReadCalibrationJob(folder_);
  }
  std::string Complaint(const std::string& text) {
    const auto job = Read(text);
    return job ? "accepted" : job.error().message;
  }
  fs::path folder_;
};

const char* const kGood =
    "[[intrinsic]]\ncamera = \"cam1\"\npixel_pitch = [0.016, 0.016]\ntarget = { pattern = \"discs\", columns "
    "= 13, rows = 11, pitch = 70.0, diameter = 36.0 }\nimages = [\"board/*.png\"]\nserial = \"A17\"\n"
    "[[extrinsic]]\ncamera = \"cam1\"\ncube = { size = 800.0, position = [3000.0, 1500.0, 0.0], yaw = 18.0 "
    "}\ncamera_near = [1.0, 2.0, 3000.0]\nimages = [ { file = \"cube.png\", gantry = [1.0, 2.0, 3.0] } ]\n";

TEST_F(CalibrationFile, GoodOneIsReadWithItsPicturesInOrder) {
  const auto job = Read(kGood);
  ASSERT_TRUE(job) << job.error().message;
  ASSERT_EQ(job->intrinsic.size(), 1u);
  ASSERT_EQ(job->intrinsic[0].images.size(), 2u);
  EXPECT_EQ(job->intrinsic[0].images[0].name, "board/a.png");
  EXPECT_EQ(job->intrinsic[0].about.at("serial"), "A17");
  EXPECT_DOUBLE_EQ(job->intrinsic[0].target.diameter_mm, 36);
  ASSERT_EQ(job->extrinsic.size(), 1u);
  EXPECT_NEAR(job->extrinsic[0].cube.yaw_rad, RadFromDeg(18), 1e-12);
  EXPECT_EQ(*job->extrinsic[0].images[0].gantry_mm, Eigen::Vector3d(1, 2, 3));
}

TEST_F(CalibrationFile, EveryMistakeNamesItsLineAndTheRemedy) {
  const auto with = [](std::string from, const std::string& to) {
    std::string text = kGood;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  const std::pair<std::string, std::string> cases[] = {
      {with("\"discs\"", "\"dots\""), "calibration.toml:5: "},
      {with("columns = 13", "columns = 2"), "calibration.toml:5: "},
      {with("columns = 13", "columns = \"many\""), "calibration.toml:5: "},
      {with("pitch = 70.0", "pitch = -1"), "calibration.toml:5: "},
      {with("diameter = 36.0", "diameter = 80.0"), "calibration.toml:5: "},
      {with("board/*.png", "board/*.tif"), "calibration.toml:6: "},
      {with("board/*.png", "nowhere/*.png"), "calibration.toml:6: "},
      {with("board/*.png", "board/c.png"), "calibration.toml:6: "},
      {with("[0.016, 0.016]", "[0.016]"), "calibration.toml:4: "},
      {with("size = 800.0", "size = 0"), "calibration.toml:10: "},
      {with("position = [3000.0, 1500.0, 0.0], ", ""), "calibration.toml:10: "},
      {with("camera_near = [1.0, 2.0, 3000.0]", "camera_near = [1.0, nan, 3000.0]"), "calibration.toml:11: "},
      {with("gantry = [1.0, 2.0, 3.0]", "gantry = [1.0]"), "calibration.toml:12: "},
      {with("camera = \"cam1\"", "camera = \"../cam1\""), "calibration.toml:3: "},
  };
  for (const auto& [text, where] : cases) {
    const std::string complaint = Complaint(text);
    EXPECT_NE(complaint.find(where), std::string::npos) << complaint << "\nfor\n" << text;
    EXPECT_EQ(complaint.find('\n'), std::string::npos) << complaint;
  }
}

TEST_F(CalibrationFile, RefusesACubeOfACameraWithoutALens) {
  std::string text = kGood;
  text.replace(text.rfind("cam1"), 4, "cam2");
  EXPECT_NE(Complaint(text).find("no [[intrinsic]]"), std::string::npos) << Complaint(text);
}

TEST_F(CalibrationFile, RefusesTwoJobsForOneCamera) {
  EXPECT_NE(
      Complaint(std::string(kGood) + std::string(kGood).substr(0, std::string(kGood).find("[[extrinsic]]")))
          .find("of its own already"),
      std::string::npos);
}

TEST_F(CalibrationFile, RefusesNothingToDo) {
  EXPECT_NE(Complaint("name = \"x\"\n").find("nothing to calibrate"), std::string::npos);
}

TEST_F(CalibrationFile, RefusesAnotherFormatAndAMissingFolder) {
  std::ofstream(folder_ / "calibration.toml") << "format = \"vss-survey/1\"\n";
  EXPECT_FALSE(ReadCalibrationJob(folder_));
  EXPECT_NE(ReadCalibrationJob(folder_ / "missing").error().message.find("missing"), std::string::npos);
}

}  // namespace
}  // namespace vss
