#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "vss/base/files.h"
#include "vss/camera/camera.h"

namespace vss {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr char kHead[] = "format = \"vss-camera/1\"\nid = \"cam1\"\nwidth = 512\nheight = 500\n";
constexpr char kOpenCv[] =
    "[intrinsics]\nmodel = \"opencv\"\nfocal_length = [525.1, 533]\nprincipal_point = [257.1, 251.9]\n"
    "distortion = [-0.1, 0.01, 1e-4, 2e-4, 0]\n";
constexpr char kPose[] =
    "[pose]\ngantry = [0, 10, 20]\nrotation = [[-0.0375, 0.9993, 0.0043], [0.9433, 0.0368, -0.3298], "
    "[-0.3297, -0.0083, -0.9441]]\n"
    "translation = [6.456, 119.599, 3201.866]\n";

class CameraFile : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  Result<Camera> Read(const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(folder_ / "cam1.toml", text));
    return ReadCamera(folder_ / "cam1.toml");
  }
  std::string ErrorOf(const std::string& text) {
    const auto camera = Read(text);
    EXPECT_FALSE(camera);
    return camera ? "" : camera.error().message;
  }
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / fmt::format("vss-camera-{}", ::getpid());
};

TEST_F(CameraFile, TellsLensPlaceAndResponse) {
  const auto camera = Read(std::string(kHead) + "response = \"srgb\"\n" + kOpenCv + kPose);
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(camera->id, "cam1");
  EXPECT_EQ(camera->width_px, 512);
  EXPECT_EQ(camera->height_px, 500);
  EXPECT_EQ(camera->response, Response::kSrgb);
  EXPECT_EQ(camera->intrinsics.model, LensModel::kOpenCv);
  EXPECT_DOUBLE_EQ(camera->intrinsics.fy_px, 533);
  EXPECT_EQ(camera->intrinsics.num_distortion, 5);
  EXPECT_EQ(camera->gantry_mm, Eigen::Vector3d(0, 10, 20));
  EXPECT_DOUBLE_EQ(camera->cam_from_world->translation.z(), 3201.866);
}

TEST_F(CameraFile, MakesARotationRoundedByHandOrthonormal) {
  const auto camera = Read(std::string(kHead) + kOpenCv + kPose);
  ASSERT_TRUE(camera) << camera.error().message;
  const Eigen::Matrix3d& r = camera->cam_from_world->rotation;
  EXPECT_LT((r.transpose() * r - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LT(std::abs(r(0, 1) - 0.9993), 1e-3);
}

TEST_F(CameraFile, DerivesFocalLengthsOfWengsModelFromDistanceAndPitch) {
  const auto camera = Read(
      std::string(kHead) +
      "[intrinsics]\nmodel = \"weng\"\nimage_distance = 8.4\npixel_pitch = [0.0160, 0.0157]\n"
      "principal_point = [257.1, 251.9]\ndistortion = [0.061, 2.0e-4, -1.0e-4, 4.0e-4, -3.0e-4, 0.01]\n");
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_DOUBLE_EQ(camera->intrinsics.fx_px, 525);
  EXPECT_DOUBLE_EQ(camera->intrinsics.fy_px, 8.4 / 0.0157);
  EXPECT_EQ(camera->intrinsics.num_distortion, 6);
  EXPECT_FALSE(camera->cam_from_world);
}

TEST_F(CameraFile, ReadsBackWhatItWrites) {
  for (const LensModel model : {LensModel::kPinhole, LensModel::kOpenCv, LensModel::kWeng}) {
    Camera camera;
    camera.id = "left \"one\"";
    camera.width_px = 3456;
    camera.height_px = 2304;
    camera.response = Response::kSrgb;
    camera.intrinsics = {
        model, 3000, 3226.33786123456789, 1668.87, 1181, {}, 0, model == LensModel::kWeng ? 0.0157 : 0};
    if (model == LensModel::kOpenCv)
      camera.intrinsics.distortion = {-0.1, 0.2, 1e-5, -2e-17, 0.1, 1, 2, 3, 4, 5, 6, 7},
      camera.intrinsics.num_distortion = 12;
    if (model == LensModel::kWeng)
      camera.intrinsics.distortion = {0.061, 2e-4, -1e-4, 4e-4, -3e-4}, camera.intrinsics.num_distortion = 5;
    camera.cam_from_world = RigidTransform{RotationFromVector({0.1, -2, 0.3}), {1, 2, 1.0 / 3}};
    camera.gantry_mm = {0, 600, 0.1};
    const int n = 10 + camera.intrinsics.num_distortion;
    Eigen::MatrixXd root = Eigen::MatrixXd::Identity(n, n) * 0.01;
    root(1, 0) = 0.003;
    camera.quality = CalibrationQuality{0.08, 12, root * root.transpose(), {"few tilted views"}};
    const auto read = Read(CameraToToml(camera));
    ASSERT_TRUE(read) << read.error().message << CameraToToml(camera);
    EXPECT_EQ(read->id, camera.id);
    EXPECT_EQ(read->response, camera.response);
    EXPECT_EQ(read->intrinsics.model, model);
    EXPECT_NEAR(read->intrinsics.fx_px, camera.intrinsics.fx_px, 1e-9);
    EXPECT_NEAR(read->intrinsics.fy_px, camera.intrinsics.fy_px, 1e-9);
    EXPECT_EQ(read->intrinsics.distortion, camera.intrinsics.distortion);
    EXPECT_LT((read->cam_from_world->rotation - camera.cam_from_world->rotation).norm(), 1e-14);
    EXPECT_EQ(read->cam_from_world->translation, camera.cam_from_world->translation);
    EXPECT_EQ(read->gantry_mm, camera.gantry_mm);
    EXPECT_EQ(read->quality->covariance, camera.quality->covariance);
    EXPECT_EQ(read->quality->num_views, 12);
    EXPECT_EQ(read->quality->warnings, camera.quality->warnings);
  }
}

TEST_F(CameraFile, PassesOverFieldsThatItDoesNotKnow) {
  EXPECT_TRUE(
      Read(std::string(kHead) + "colour = \"red\"\n" + kOpenCv + "skew = 0\n[maker]\nname = \"x\"\n"));
}

TEST_F(CameraFile, TakesEveryCountOfOpenCvsCoefficientsAndNoOther) {
  for (int n = 1; n <= 14; ++n) {
    std::string list;
    for (int i = 0; i < n; ++i) list += i ? ", 0.01" : "0.01";
    const auto camera = Read(std::string(kHead) +
                             "[intrinsics]\nmodel = \"opencv\"\nfocal_length = [500, 500]\nprincipal_point = "
                             "[250, 250]\ndistortion = [" +
                             list + "]\n");
    const bool known = n == 4 || n == 5 || n == 8 || n == 12;
    EXPECT_EQ(bool(camera), known) << n;
    if (!known) {
      EXPECT_THAT(camera.error().message, AllOf(HasSubstr("cam1.toml:9"), HasSubstr("4, 5, 8 or 12")));
    }
  }
}

struct Mistake {
  const char* name;
  std::string from, to;
  const char* line;
  const char* says;
};

class CameraMistakes : public CameraFile, public testing::WithParamInterface<Mistake> {};

TEST_P(CameraMistakes, AreToldWithFileLineAndRemedy) {
  std::string text = std::string(kHead) + kOpenCv + kPose;
  const Mistake& mistake = GetParam();
  const auto at = text.find(mistake.from);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, mistake.from.size(), mistake.to);
  EXPECT_THAT(ErrorOf(text),
              AllOf(HasSubstr(std::string("cam1.toml:") + mistake.line), HasSubstr(mistake.says)));
}

INSTANTIATE_TEST_SUITE_P(
    All, CameraMistakes,
    testing::Values(
        Mistake{"format", "vss-camera/1", "vss-camera/2", "1", "\"vss-camera/1\" is needed"},
        Mistake{"no_format", "format = \"vss-camera/1\"\n", "", "1", "`format` is missing"},
        Mistake{"syntax", "width = 512", "width = = 512", "3", "not valid TOML"},
        Mistake{"no_id", "id = \"cam1\"\n", "", "1", "`id` is missing; add a line like: id = \"cam1\""},
        Mistake{"empty_id", "\"cam1\"", "\"\"", "2", "empty text"},
        Mistake{"width", "width = 512", "width = 0", "3", "whole number from 1"},
        Mistake{"width_text", "width = 512", "width = \"wide\"", "3", "whole number from 1"},
        Mistake{"height_fraction", "height = 500", "height = 500.5", "4", "whole number from 1"},
        Mistake{"no_intrinsics", "[intrinsics]", "[lens]", "1", "`intrinsics` is missing"},
        Mistake{"model", "\"opencv\"", "\"fisheye\"", "6", "known are"},
        Mistake{"focal_nan", "525.1", "nan", "7", "not a finite number"},
        Mistake{"focal_inf", "525.1", "inf", "7", "not a finite number"},
        Mistake{"focal_negative", "525.1", "-525.1", "7", "above 0"},
        Mistake{"focal_single", "[525.1, 533]", "525.1", "7", "list of numbers"},
        Mistake{"centre_three", "[257.1, 251.9]", "[257.1, 251.9, 1]", "8", "must have 2 numbers, it has 3"},
        Mistake{"distortion_text", "-0.1,", "\"a\",", "9", "must be a number"},
        Mistake{"rotation_off", "0.9993", "0.9893", "12", "off orthonormal by"},
        Mistake{"rotation_nan", "0.9993", "nan", "12", "not a finite number"},
        Mistake{"rotation_reflection", "[-0.0375, 0.9993, 0.0043]", "[0.0375, -0.9993, -0.0043]", "12",
                "reflection"},
        Mistake{"rotation_rows", "[-0.0375, 0.9993, 0.0043], ", "", "12", "3 rows"},
        Mistake{"no_translation", "translation = [6.456, 119.599, 3201.866]\n", "", "10",
                "`translation` is missing in pose"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST_F(CameraFile, SaysThatAFileIsMissing) {
  const auto camera = ReadCamera(folder_ / "none.toml");
  ASSERT_FALSE(camera);
  EXPECT_THAT(camera.error().message, AllOf(HasSubstr("none.toml"), HasSubstr("there is no such file")));
}

TEST(Camera, ReducedSeesTheMeanOfThePixels) {
  Camera camera;
  camera.width_px = 641;
  camera.height_px = 480;
  camera.intrinsics = {LensModel::kOpenCv, 500, 510, 321, 238, {-0.1, 0.01}, 2};
  constexpr int kFactor = 3;
  const Camera small = Reduced(camera, kFactor);
  EXPECT_EQ(small.width_px, 213);
  EXPECT_EQ(small.height_px, 160);
  const Eigen::Vector3d point(300, -200, 1000);
  const auto large_px = camera.intrinsics.Project(point), small_px = small.intrinsics.Project(point);
  ASSERT_TRUE(large_px && small_px);
  // The middle of the first block of 3 x 3 pixels is pixel (1, 1) there and (0, 0) here.
  EXPECT_NEAR(small_px->x(), (large_px->x() - 1) / kFactor, 1e-9);
  EXPECT_NEAR(small_px->y(), (large_px->y() - 1) / kFactor, 1e-9);
}

}  // namespace
}  // namespace vss
