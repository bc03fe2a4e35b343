// The rendered rig, end to end, against its truth.
#include "vss/calibrate/calibrate.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "vss/calibrate/cube_geometry.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

const fs::path kRig = fs::path(VSS_SOURCE_DIR) / "../shared/calibration/rig-1";

struct Truth {
  Intrinsics lens;
  RigidTransform cam_from_world;
};

Truth TruthOf(const std::string& id) {
  const auto json = nlohmann::json::parse(std::ifstream(kRig / "truth.json"));
  Truth t;
  for (const auto& c : json["cube"]["cameras"]) {
    if (c["id"] != id) continue;
    const auto& l = c["lens"];
    t.lens = {LensModel::kOpenCv,
              c["fx"],
              c["fy"],
              c["cx"],
              c["cy"],
              {l["k1"], l["k2"], l["p1"], l["p2"], l["k3"]},
              5,
              0};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) t.cam_from_world.rotation(i, j) = c["r"][i][j];
      t.cam_from_world.translation[i] = c["t"][i];
    }
  }
  return t;
}

// Root mean square angle between the world directions of both cameras' pixels.
double RaysApartRad(const Truth& t, const Camera& c) {
  double sum = 0;
  for (int j = 0; j < 12; ++j)
    for (int i = 0; i < 12; ++i) {
      const Vector2d p((c.width_px - 1) * i / 11.0, (c.height_px - 1) * j / 11.0);
      sum += (t.cam_from_world.rotation.transpose() * *t.lens.Unproject(p) -
              c.cam_from_world->rotation.transpose() * *c.intrinsics.Unproject(p))
                 .squaredNorm();
    }
  return std::sqrt(sum / 144);
}

// One camera of each kind of board: all four are the benchmark's.
CalibrationJob JobOf(const std::vector<std::string>& cameras) {
  CalibrationJob job = *ReadCalibrationJob(kRig);
  const auto other = [&](const auto& j) {
    return std::find(cameras.begin(), cameras.end(), j.camera) == cameras.end();
  };
  job.intrinsic.erase(std::remove_if(job.intrinsic.begin(), job.intrinsic.end(), other), job.intrinsic.end());
  job.extrinsic.erase(std::remove_if(job.extrinsic.begin(), job.extrinsic.end(), other), job.extrinsic.end());
  return job;
}

#define NEEDS_RIG() \
  if (!fs::exists(kRig / "truth.json")) GTEST_SKIP() << "NOT TESTED: " << kRig << " is not there"

TEST(Calibrate, RenderedRigComesOutAsItIs) {
  NEEDS_RIG();
  for (bool opencv : {false, true}) {
    CalibrationOptions options;
    options.opencv = opencv;
    const auto calibration = Calibrate(JobOf({"cam2", "cam4"}), options, 2, {});
    ASSERT_TRUE(calibration) << calibration.error().message;
    ASSERT_EQ(calibration->cameras.size(), 2u);
    for (const auto& c : calibration->cameras) {
      const Truth t = TruthOf(c.camera.id);
      EXPECT_EQ(c.lens->views.size(), 14u);
      EXPECT_LT(LensDifference(t.lens, c.camera.intrinsics, 512, 512).rms, 0.05) << c.camera.id;
      EXPECT_LT(
          (c.camera.cam_from_world->Inverse().translation - t.cam_from_world.Inverse().translation).norm(),
          0.5)
          << c.camera.id;
      EXPECT_LT(RaysApartRad(t, c.camera), 0.2e-3) << c.camera.id;
    }
  }
}

TEST(Calibrate, WhatIsWrittenReadsBackWithItsCovariance) {
  NEEDS_RIG();
  const auto calibration = Calibrate(JobOf({"cam4"}), {}, 2, {});
  ASSERT_TRUE(calibration);
  const fs::path out = fs::path(testing::TempDir()) / "calibrate_out";
  fs::remove_all(out);
  ASSERT_TRUE(WriteCalibration(*calibration, out));
  const auto camera = ReadCamera(out / "cameras/cam4.toml");
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_TRUE(camera->quality->covariance.isApprox(calibration->cameras[0].camera.quality->covariance, 1e-9));
  EXPECT_EQ(camera->quality->covariance.rows(), 4 + camera->intrinsics.num_distortion + 6);
  EXPECT_TRUE(fs::exists(out / "report.html"));
  EXPECT_TRUE(nlohmann::json::accept(std::ifstream(out / "calibration.json")));
  EXPECT_FALSE(fs::exists(out / ".calibration.part"));
}

TEST(Calibrate, OneStopLeavesFourPlacesUnlessOneIsNamed) {
  NEEDS_RIG();
  CalibrationJob job = JobOf({"cam2"});
  job.extrinsic[0].images.resize(1);
  const auto undecided = Calibrate(job, {}, 2, {});
  ASSERT_FALSE(undecided);
  EXPECT_NE(undecided.error().message.find("camera_near"), std::string::npos) << undecided.error().message;
  const Truth t = TruthOf("cam2");
  job.extrinsic[0].camera_near_mm = t.cam_from_world.Inverse().translation + Vector3d(300, -400, 200);
  const auto decided = Calibrate(job, {}, 2, {});
  ASSERT_TRUE(decided) << decided.error().message;
  EXPECT_LT((decided->cameras[0].camera.cam_from_world->Inverse().translation -
             t.cam_from_world.Inverse().translation)
                .norm(),
            3);
}

TEST(Calibrate, AWrongCubeSizeIsContradictedByTheMoves) {
  NEEDS_RIG();
  CalibrationJob job = JobOf({"cam2"});
  job.extrinsic[0].cube.size_mm = 820;
  const auto c = Calibrate(job, {}, 2, {});
  ASSERT_FALSE(c);
  EXPECT_NE(c.error().message.find("measure the cube"), std::string::npos) << c.error().message;
}

TEST(Calibrate, AWrongDisplacementIsWarnedOf) {
  NEEDS_RIG();
  CalibrationJob job = JobOf({"cam2"});
  *job.extrinsic[0].images[2].gantry_mm += Vector3d(0, 12, 0);
  const auto c = Calibrate(job, {}, 2, {});
  // Either the moves are called wrong, or the cube's size is, which the sentence leaves open.
  const std::string said = c ? fmt::format("{}", fmt::join(c->warnings, " ")) : c.error().message;
  EXPECT_NE(said.find("displacements"), std::string::npos) << said;
}

TEST(Calibrate, TheGantrysAxesAreFoundFromManyStops) {
  NEEDS_RIG();
  // The stops are written in a skewed frame: what the calibration must undo.
  CalibrationJob job = JobOf({"cam2", "cam4"});
  Eigen::Matrix3d skew = Eigen::Matrix3d::Identity();
  skew(0, 1) = 0.01, skew(1, 1) = 1.004;
  for (auto& e : job.extrinsic)
    for (auto& image : e.images) image.gantry_mm = skew.inverse() * *image.gantry_mm;
  job.calibrate_axes = true;
  const auto c = Calibrate(job, {}, 2, {});
  ASSERT_TRUE(c) << c.error().message;
  EXPECT_TRUE(c->axes->moved[0] && c->axes->moved[1] && !c->axes->moved[2]);
  EXPECT_NEAR(c->axes->axes(0, 1), 0.01, 1e-3);
  EXPECT_NEAR(c->axes->axes(1, 1), 1.004, 1e-3);
  EXPECT_NEAR(c->axes->axes(0, 0), 1, 1e-3);
}

TEST(Calibrate, ACameraThatMovedIsTold) {
  NEEDS_RIG();
  const CalibrationJob job = JobOf({"cam2"});
  const Truth t = TruthOf("cam2");
  Camera camera;
  camera.id = "cam2", camera.width_px = camera.height_px = 512, camera.intrinsics = t.lens,
  camera.cam_from_world = t.cam_from_world;
  std::vector<CubePicture> pictures;
  for (const auto& f : job.extrinsic[0].images)
    pictures.push_back({f.name, *ReadImage(f.path), *f.gantry_mm});
  const auto still = CheckAgainstCube(camera, job.extrinsic[0].cube, pictures, {});
  ASSERT_TRUE(still) << still.error().message;
  EXPECT_LT(still->rms_px, 0.3);
  camera.cam_from_world = RigidTransform{RotationFromVector(Vector3d(0, 0.004, 0)), Vector3d::Zero()} *
                          *camera.cam_from_world;  // about its own centre
  const auto moved = CheckAgainstCube(camera, job.extrinsic[0].cube, pictures, {});
  ASSERT_TRUE(moved) << moved.error().message;
  EXPECT_GT(moved->rms_px, 0.5);
  EXPECT_GT(moved->turned_mrad, 1);
}

TEST(Cube, ShowsNineEdgesFromAboveACorner) {
  const auto g = cube::GeometryOf({800, {0, 0, 0}, 0});
  EXPECT_EQ(cube::VisibleEdges(g, Vector3d(2000, 2000, 2000)).size(), 9u);
  EXPECT_EQ(cube::VisibleEdges(g, Vector3d(0, 0, 3000)).size(), 4u);
  for (const auto& f : g.face) {
    Vector3d middle = Vector3d::Zero();
    for (int c : f.corner) middle += 0.25 * g.corner[c];
    EXPECT_NEAR((middle - Vector3d(0, 0, 400)).normalized().dot(f.outward), 1, 1e-12);
  }
}

TEST(Cube, AnEdgeIsMeasuredToAFewHundredthsOfAPixel) {
  GreyImage image(40, 40, 16);
  const Vector2d n = Vector2d(0.9, 0.3).normalized();
  const double place = 27.37;  // n . x
  for (int v = 0; v < 40; ++v)
    for (int u = 0; u < 40; ++u)
      image.Row16(v)[u] = static_cast<std::uint16_t>(
          20000 + 15000 * std::erf((n.dot(Vector2d(u, v)) - place) / (std::sqrt(2.0) * 0.8)));
  const Vector2d p(20, 20);
  const auto edge = MeasureEdge(image.view(), p, n, 8, 2);
  ASSERT_TRUE(edge);
  EXPECT_NEAR(n.dot(p) + edge->offset_px, place, 0.01);
}

}  // namespace
}  // namespace vss
