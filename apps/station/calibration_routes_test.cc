#include <thread>

#include "routes_fixture.h"

namespace vss::station {
namespace {

const fs::path kRig = fs::path(VSS_SOURCE_DIR) / "../shared/calibration/rig-1";

// The sample with a calibration job of one of its cameras, cam4, beside it.
class CalibrationRoutesTest : public RoutesTest {
 protected:
  void SetUp() override {
    if (!fs::exists(kRig / "calibration.toml")) GTEST_SKIP() << "NOT TESTED: " << kRig << " is not there";
    fs::create_directories(outside_ / "rig");
    fs::copy(kRig / "board_cam4", outside_ / "rig/board_cam4");
    fs::copy(kRig / "cube", outside_ / "rig/cube");
    WriteJob("cam4");
  }
  void WriteJob(const std::string& camera) {
    std::ofstream(outside_ / "rig/calibration.toml")
        << "format = \"vss-calibration/1\"\nname = \"one camera\"\n[[intrinsic]]\ncamera = \"" << camera
        << "\"\npixel_pitch = [0.0160, 0.0160]\n"
        << "target = { pattern = \"checkerboard\", columns = 12, rows = 9, pitch = 70.0 }\nimages = "
           "[\"board_cam4/*.png\"]\n"
        << "[[extrinsic]]\ncamera = \"" << camera
        << "\"\ncube = { size = 800.0, position = [3000.0, 1500.0, 0.0], yaw = 18.0 }\n"
        << "images = [ { file = \"cube/cam4_cube0.png\", gantry = [2700.0, 1400.0, 0.0] }, { file = "
           "\"cube/cam4_cube1.png\", gantry = [3300.0, 1250.0, 0.0] },"
        << " { file = \"cube/cam4_cube2.png\", gantry = [2950.0, 1800.0, 0.0] } ]\n";
  }
  Json GetJson(const std::string& path) {
    std::string answer;
    EXPECT_EQ(Ask(Get(path, kHeaders), &answer), 200) << answer.substr(0, 500);
    return Json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  }
  Json Calibrated() {
    EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}}), 202);
    while (workspace_->RunState()["state"] == "running")
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return workspace_->RunState();
  }
  Json ResidualOf(const std::string& id) {
    const Json survey = GetJson("/api/survey");
    for (const auto& camera : survey["cameras"])
      if (camera["id"] == id) return camera["residual_px"];
    return "none";
  }
};

TEST_F(CalibrationRoutesTest, CalibratesAndTakesTheCamerasOverAsAStepThatIsUndone) {
  EXPECT_EQ(GetJson("/api/calibration")["jobs"], Json::array({"../rig/calibration.toml"}));
  EXPECT_EQ(Ask(Get("/api/calibration/report.html", kHeaders)), 404);
  const Json run = Calibrated();
  ASSERT_EQ(run["state"], "done") << run.dump();
  EXPECT_EQ(run["job"], "calibration");
  std::string answer;
  EXPECT_EQ(Ask(Get("/api/calibration/report.html", kHeaders), &answer), 200);
  EXPECT_NE(answer.find("<h1>Calibration one camera</h1>"), answer.npos);
  EXPECT_EQ(Ask(Get("/api/calibration/cameras/cam4.toml", kHeaders), &answer), 200);
  EXPECT_NE(answer.find("vss-camera/1"), answer.npos);
  const Json state = GetJson("/api/state?since=0");
  for (const auto& item : state["items"])
    if (item["kind"] == "calibration") {
      EXPECT_FALSE(item["value"].contains("report"));
      EXPECT_EQ(item["value"]["cameras"][0]["id"], "cam4");
    }

  EXPECT_TRUE(ResidualOf("cam4").is_null());
  const auto center_of = [&] {
    for (const auto& image : workspace_->survey().images)
      if (workspace_->survey().cameras[std::size_t(image.camera)].id == "cam4")
        return image.cam_from_world.Inverse().translation;
    return Eigen::Vector3d(0, 0, 0);
  };
  const Eigen::Vector3d own = center_of();
  EXPECT_EQ(Command({{"do", "take_cameras"}, {"version", 0}}, &answer), 200) << answer;
  EXPECT_LT(ResidualOf("cam4").get<double>(), 0.2);
  EXPECT_TRUE(ResidualOf("cam1").is_null());
  const double moved = (center_of() - own).norm();
  EXPECT_GT(moved, 0);
  EXPECT_LT(moved, 1);  // the rig is that of the survey
  EXPECT_EQ(Ask(Get("/api/pictures/0/lines", kHeaders)), 200);
  EXPECT_EQ(Command({{"do", "undo"}}), 200);
  EXPECT_TRUE(ResidualOf("cam4").is_null());
  EXPECT_EQ(center_of(), own);
  EXPECT_EQ(Command({{"do", "redo"}}), 200);
  EXPECT_FALSE(ResidualOf("cam4").is_null());

  // Another station on the folder begins where this one was.
  server_.reset();
  routes_.reset();
  workspace_.reset();
  workspace_ = Workspace::Open(outside_ / "survey", {1}).value();
  EXPECT_NE(center_of(), own);
}

TEST_F(CalibrationRoutesTest, SaysWhyItCannot) {
  std::string answer;
  EXPECT_EQ(Command({{"do", "take_cameras"}}, &answer), 400);
  EXPECT_NE(answer.find("nothing was calibrated yet"), answer.npos);
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../../etc/calibration.toml"}}, &answer), 400);
  EXPECT_NE(answer.find("there is no calibration job"), answer.npos);
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}, {"model", "fisheye"}}, &answer),
            400);
  EXPECT_NE(answer.find("choose weng or opencv"), answer.npos);
  EXPECT_EQ(Command({{"do", "calibrate"},
                     {"job", "../rig/calibration.toml"},
                     {"values", {{"calibrate.outlier_sigmas", -1}}}},
                    &answer),
            400);
  EXPECT_NE(answer.find("outside its range"), answer.npos);
  fs::remove(outside_ / "rig/cube/cam4_cube1.png");
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}}, &answer), 422);
  EXPECT_NE(answer.find("cam4_cube1.png"), answer.npos) << answer;
}

TEST_F(CalibrationRoutesTest, RefusesCamerasThatTheSurveyDoesNotHave) {
  WriteJob("overhead");
  ASSERT_EQ(Calibrated()["state"], "done");
  std::string answer;
  EXPECT_EQ(Command({{"do", "take_cameras"}}, &answer), 422);
  EXPECT_NE(answer.find("the calibration is of overhead, and the survey's cameras are cam1"), answer.npos)
      << answer;
}

TEST_F(CalibrationRoutesTest, CancelsAndNothingChanged) {
  const auto revision = workspace_->store().State().revision;
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}}), 202);
  EXPECT_EQ(Command({{"do", "run"}}), 400);  // one at a time
  EXPECT_EQ(Command({{"do", "cancel"}}), 200);
  while (workspace_->RunState()["state"] == "running")
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(workspace_->RunState()["state"], "cancelled");
  EXPECT_EQ(workspace_->store().State().revision, revision);
}

TEST_F(RoutesTest, FindsCalibrationJobsInTheSurveyAndBesideItAndNowhereElse) {
  fs::create_directories(outside_ / "survey/boards");
  fs::create_directories(outside_ / "rig/deeper");
  fs::create_directories(outside_ / "empty");
  const fs::path elsewhere = fs::temp_directory_path() / fmt::format("vss-elsewhere-{}", ::getpid());
  fs::create_directories(elsewhere);
  for (const fs::path& folder : {outside_ / "survey", outside_ / "survey/boards", outside_ / "rig",
                                 outside_ / "rig/deeper", elsewhere})
    std::ofstream(folder / "calibration.toml") << "format = \"vss-calibration/1\"\n";
  fs::create_directory_symlink(elsewhere, outside_ / "link");
  std::vector<std::string> names;
  for (const auto& job : FindCalibrationJobs(outside_ / "survey")) names.push_back(job.name);
  EXPECT_EQ(names, (std::vector<std::string>{"boards/calibration.toml", "calibration.toml",
                                             "../rig/calibration.toml"}));
  fs::remove_all(elsewhere);
}

}  // namespace
}  // namespace vss::station
