#include "vss/survey/survey.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "vss/base/files.h"
#include "vss/image/grey_image.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::string CameraText(const std::string& id, bool with_place) {
  std::string text = "format = \"vss-camera/1\"\nid = \"" + id +
                     "\"\nwidth = 8\nheight = 6\n[intrinsics]\nmodel = \"pinhole\"\n" +
                     "focal_length = [10, 10]\nprincipal_point = [4, 3]\n";
  if (with_place)
    text +=
        "[pose]\ngantry = [0, 100, 0]\nrotation = [[1, 0, 0], [0, -1, 0], [0, 0, -1]]\ntranslation = [0, 0, "
        "3000]\n";
  return text;
}

constexpr char kSurvey[] =
    "format = \"vss-survey/1\"\n"                      // 1
    "name = \"two\"\n"                                 // 2
    "cameras = [\"cam1.toml\", \"hand.toml\"]\n"       // 3
    "knowledge = [\"box\", \"my.kb\"]\n"               // 4
    "[gantry]\n"                                       // 5
    "axes = [[0, 1, 0], [1, 0, 0], [0, 0, 1]]\n"       // 6
    "[parameters]\n"                                   // 7
    "\"lines.min_length_px\" = 20\n"                   // 8
    "seams.max_gap_mm = 2\n"                           // 9
    "[[image]]\n"                                      // 10
    "file = \"a.png\"\n"                               // 11
    "camera = \"cam1\"\n"                              // 12
    "gantry = [10, 120, 0]\n"                          // 13
    "[[image]]\n"                                      // 14
    "file = \"b.png\"\n"                               // 15
    "camera = \"hand\"\n"                              // 16
    "rotation = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]\n"  // 17
    "translation = [1, 2, 3]\n";                       // 18

class SurveyFile : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    const GreyImage picture(8, 6, 8), large(9, 6, 8);
    ASSERT_TRUE(WritePng(folder_ / "a.png", picture.view()));
    ASSERT_TRUE(WritePng(folder_ / "b.png", picture.view()));
    ASSERT_TRUE(WritePng(folder_ / "large.png", large.view()));
    ASSERT_TRUE(WriteFileAtomically(folder_ / "text.png", "no picture"));
    ASSERT_TRUE(WriteFileAtomically(folder_ / "empty.png", ""));
    ASSERT_TRUE(WriteFileAtomically(folder_ / "cam1.toml", CameraText("cam1", true)));
    ASSERT_TRUE(WriteFileAtomically(folder_ / "twin.toml", CameraText("cam1", true)));
    ASSERT_TRUE(WriteFileAtomically(folder_ / "hand.toml", CameraText("hand", false)));
  }
  void TearDown() override { fs::remove_all(folder_); }
  Result<Survey> Read(const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(folder_ / "survey.toml", text));
    return ReadSurvey(folder_);
  }
  fs::path folder_ = fs::temp_directory_path() / fmt::format("vss-survey-{}", ::getpid());
};

TEST_F(SurveyFile, TellsPicturesTheirPlacesKnowledgeAndParameters) {
  const auto survey = Read(kSurvey);
  ASSERT_TRUE(survey) << survey.error().message;
  EXPECT_EQ(survey->name, "two");
  EXPECT_THAT(survey->knowledge, ElementsAre("box", "my.kb"));
  EXPECT_THAT(survey->parameters, ElementsAre(testing::Pair("lines.min_length_px", 20.0),
                                              testing::Pair("seams.max_gap_mm", 2.0)));
  ASSERT_EQ(survey->images.size(), 2u);
  EXPECT_EQ(survey->images[1].file, "b.png");
  EXPECT_EQ(survey->cameras[std::size_t(survey->images[1].camera)].id, "hand");
  EXPECT_EQ(survey->images[1].cam_from_world.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(survey->images[1].gantry_mm);
}

TEST_F(SurveyFile, MovesACameraWithTheGantryAlongItsAxes) {
  const auto survey = Read(kSurvey);
  ASSERT_TRUE(survey) << survey.error().message;
  // 10 along the first axis (world y) and 20 along the second (world x) from where the camera was calibrated.
  const Eigen::Vector3d centre = survey->images[0].cam_from_world.Inverse().translation;
  EXPECT_LT((centre - Eigen::Vector3d(20, 10, 3000)).norm(), 1e-9);
}

TEST_F(SurveyFile, LetsAFixedCameraStandWhereItWasCalibrated) {
  const auto survey = Read(
      "format = \"vss-survey/1\"\ncameras = [\"cam1.toml\"]\n[[image]]\nfile = \"a.png\"\ncamera = "
      "\"cam1\"\n");
  ASSERT_TRUE(survey) << survey.error().message;
  EXPECT_EQ(survey->images[0].cam_from_world.translation, Eigen::Vector3d(0, 0, 3000));
}

TEST_F(SurveyFile, TakesCamerasFromAnotherFolderById) {
  fs::create_directories(folder_ / "rig" / "cameras");
  std::string other = CameraText("cam1", true);
  other.replace(other.find("3000"), 4, "2000");
  ASSERT_TRUE(WriteFileAtomically(folder_ / "rig" / "cameras" / "x.toml", other));
  ASSERT_TRUE(WriteFileAtomically(folder_ / "rig" / "y.toml", CameraText("hand", false)));
  ASSERT_TRUE(WriteFileAtomically(folder_ / "survey.toml", kSurvey));
  fs::remove(folder_ / "cam1.toml");
  const auto survey = ReadSurvey(folder_ / "survey.toml", folder_ / "rig");
  ASSERT_TRUE(survey) << survey.error().message;
  EXPECT_EQ(survey->cameras[0].cam_from_world->translation.z(), 2000);
  const auto none = ReadSurvey(folder_, folder_ / "nowhere");
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, HasSubstr("no such folder of cameras"));
}

TEST_F(SurveyFile, RepeatsTheWarningsOfACalibration) {
  ASSERT_TRUE(WriteFileAtomically(folder_ / "cam1.toml",
                                  CameraText("cam1", true) + "[quality]\nwarnings = [\"two views only\"]\n"));
  const auto survey = Read(kSurvey);
  ASSERT_TRUE(survey) << survey.error().message;
  EXPECT_THAT(survey->warnings, ElementsAre("camera cam1: two views only"));
}

TEST_F(SurveyFile, SaysThatAFolderIsNoSurvey) {
  EXPECT_THAT(ReadSurvey(folder_ / "none").error().message, HasSubstr("there is no such survey"));
  EXPECT_THAT(ReadSurvey(folder_).error().message, HasSubstr("there is no survey.toml"));
}

struct Mistake {
  const char* name;
  std::string from, to;
  const char* place;
  const char* says;
};

class SurveyMistakes : public SurveyFile, public testing::WithParamInterface<Mistake> {};

TEST_P(SurveyMistakes, AreToldWithFileLineAndRemedy) {
  std::string text = kSurvey;
  const Mistake& mistake = GetParam();
  const auto at = text.find(mistake.from);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, mistake.from.size(), mistake.to);
  const auto survey = Read(text);
  ASSERT_FALSE(survey);
  EXPECT_EQ(survey.error().code, ErrorCode::kInput);
  EXPECT_THAT(survey.error().message, AllOf(HasSubstr(mistake.place), HasSubstr(mistake.says)));
  EXPECT_EQ(survey.error().message.find('\n'), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(
    All, SurveyMistakes,
    testing::Values(
        Mistake{"format", "vss-survey/1", "vss-survey/9", "survey.toml:1", "\"vss-survey/1\" is needed"},
        Mistake{"no_format", "format = \"vss-survey/1\"\n", "", "survey.toml:1", "`format` is missing"},
        Mistake{"syntax", "axes = [[0, 1, 0]", "axes = [[0, 1, 0", "survey.toml:", "not valid TOML"},
        Mistake{"no_cameras", "cameras = [\"cam1.toml\", \"hand.toml\"]\n", "", "survey.toml:1",
                "`cameras` is missing"},
        Mistake{"empty_cameras", "[\"cam1.toml\", \"hand.toml\"]", "[]", "survey.toml:3", "empty list"},
        Mistake{"cameras_text", "[\"cam1.toml\", \"hand.toml\"]", "\"cam1.toml\"", "survey.toml:3",
                "must be a list"},
        Mistake{"camera_missing", "hand.toml", "foot.toml", "survey.toml:3", "does not exist"},
        Mistake{"camera_is_folder", "hand.toml", ".", ".", "a file is needed"},
        Mistake{"camera_id_twice", "\"hand.toml\"", "\"twin.toml\"", "survey.toml:3", "id of its own"},
        Mistake{"camera_of_wrong_format", "hand.toml", "survey.toml", "survey.toml:1",
                "\"vss-camera/1\" is needed"},
        Mistake{"empty_knowledge", "[\"box\", \"my.kb\"]", "[]", "survey.toml:4", "empty list"},
        Mistake{"axes_flat", "[1, 0, 0]", "[0, 2, 0]", "survey.toml:6", "axes in one plane"},
        Mistake{"axes_nan", "[1, 0, 0]", "[nan, 0, 0]", "survey.toml:6", "not a finite number"},
        Mistake{"parameter_text", "= 20", "= \"20\"", "survey.toml:8", "must be a number, true or false"},
        Mistake{"parameter_inf", "= 20", "= inf", "survey.toml:8", "not a finite number"},
        Mistake{"parameter_unknown", "lines.min_length_px", "lines.min_lenght_px", "survey.toml:8",
                "did you mean lines.min_length_px?"},
        Mistake{"parameter_out_of_range", "seams.max_gap_mm = 2", "seams.max_gap_mm = -2", "survey.toml:9",
                "outside its range"},
        Mistake{"no_file", "file = \"a.png\"\n", "", "survey.toml:10", "`file` is missing in image[1]"},
        Mistake{"picture_missing", "a.png", "c.png", "survey.toml:11", "there is no such picture"},
        Mistake{"picture_is_text", "a.png", "text.png", "survey.toml:11", "not a picture"},
        Mistake{"picture_is_empty", "a.png", "empty.png", "survey.toml:11", "the file is empty"},
        Mistake{"picture_is_folder", "a.png", "..", "survey.toml:11", "not a file"},
        Mistake{"picture_is_device", "a.png", "/dev/zero", "survey.toml:11", "not a file"},
        Mistake{"picture_with_control_character", "a.png", "a\\u0000.png", "survey.toml:11",
                "control characters"},
        Mistake{"picture_of_other_size", "a.png", "large.png", "survey.toml:11",
                "has 9 x 6 pixels, but camera \"cam1\""},
        Mistake{"picture_twice", "b.png", "./a.png", "survey.toml:15", "twice"},
        Mistake{"camera_unknown", "camera = \"cam1\"", "camera = \"cam7\"", "survey.toml:12",
                "the cameras are: cam1, hand"},
        Mistake{"gantry_two", "[10, 120, 0]", "[10, 120]", "survey.toml:13", "must have 3 numbers, it has 2"},
        Mistake{"gantry_nan", "[10, 120, 0]", "[10, nan, 0]", "survey.toml:13", "not a finite number"},
        Mistake{"rotation_is_none", "rotation = [[0, 1, 0]", "rotation = [[0, 2, 0]", "survey.toml:17",
                "off orthonormal by"},
        Mistake{"rotation_alone", "translation = [1, 2, 3]\n", "", "survey.toml:14",
                "`translation` is missing"},
        Mistake{"both_places", "translation = [1, 2, 3]\n", "translation = [1, 2, 3]\ngantry = [0, 0, 0]\n",
                "survey.toml:19", "leave one of them out"},
        Mistake{"hand_camera_on_gantry", "camera = \"cam1\"", "camera = \"hand\"", "survey.toml:13",
                "no place of its own"},
        Mistake{"image_is_no_list",
                "[[image]]\nfile = \"a.png\"\ncamera = \"cam1\"\ngantry = [10, 120, 0]\n[[image]]", "[image]",
                "survey.toml:10", "must be a list"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST_F(SurveyFile, SaysThatPicturesAreMissing) {
  const auto survey = Read("format = \"vss-survey/1\"\ncameras = [\"cam1.toml\"]\n");
  ASSERT_FALSE(survey);
  EXPECT_THAT(survey.error().message, AllOf(HasSubstr("survey.toml:1"), HasSubstr("`image` is missing")));
}

TEST_F(SurveyFile, ReadsEverySharedSurvey) {
  const fs::path shared = fs::path(VSS_SOURCE_DIR) / ".." / "shared";
  if (!fs::exists(shared / "surveys")) GTEST_SKIP() << "no shared surveys beside the source folder";
  for (const auto& entry : fs::directory_iterator(shared / "surveys")) {
    const auto survey = ReadSurvey(entry.path());
    ASSERT_TRUE(survey) << survey.error().message;
    EXPECT_GE(survey->images.size(), 16u);
  }
  const auto hand_held = ReadSurvey(shared / "real" / "t-joint");
  ASSERT_TRUE(hand_held) << hand_held.error().message;
  EXPECT_EQ(hand_held->cameras[0].response, Response::kSrgb);
}

}  // namespace
}  // namespace vss
