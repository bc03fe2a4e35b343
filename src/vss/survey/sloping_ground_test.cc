// The sample survey, with a world whose plane z = 0 is not the floor.
#include <gtest/gtest.h>

#include <filesystem>

#include "vss/product/compare.h"
#include "vss/survey/run_survey.h"

namespace vss {
namespace {

const std::filesystem::path kSample = std::filesystem::path(VSS_SOURCE_DIR) / "examples" / "sample";

// Mean distance of the found parts' vertices from the true ones; infinite where a part is missed.
double MeanError(const std::vector<TruePart>& truth, const Product& product) {
  double sum = 0, n = 0;
  for (const auto& part : CompareWithTruth(truth, product).parts) {
    if (part.part < 0) return INFINITY;
    for (double e : part.errors_mm) sum += e, ++n;
  }
  return sum / n;
}

TEST(SlopingGround, IsFoundAndThePartsKeepTheirAccuracy) {
  auto survey = ReadSurvey(kSample);
  ASSERT_TRUE(survey) << survey.error().message;
  auto truth = ReadTruth(kSample / "truth.json");
  ASSERT_TRUE(truth) << truth.error().message;
  SurveyOptions options;
  const auto level = RunSurvey(*survey, options, {});
  ASSERT_TRUE(level) << level.error().message;
  EXPECT_FALSE(level->product.checks->ground);

  // The floor rises by 2 mm a metre along x and falls by 1 along y.
  const RigidTransform moved{RotationFromVector({-0.001, -0.002, 0}), {0, 0, 3}};
  for (auto& image : survey->images) image.cam_from_world = image.cam_from_world * moved.Inverse();
  const Eigen::Vector3d shift = moved.translation;
  for (auto& part : *truth) {
    for (auto& v : part.vertices) v = moved.rotation * v + shift;
    for (auto& c : part.circles) c.center = moved.rotation * c.center + shift;
  }
  const auto sloping = RunSurvey(*survey, options, {});
  ASSERT_TRUE(sloping) << sloping.error().message;
  const auto& ground = sloping->product.checks->ground;
  ASSERT_TRUE(ground);
  EXPECT_NEAR(ground->slope_mm_per_m.x(), 2, 4 * ground->slope_sigma_mm_per_m.x());
  EXPECT_NEAR(ground->slope_mm_per_m.y(), -1, 4 * ground->slope_sigma_mm_per_m.y());
  EXPECT_NEAR(ground->height_mm, 3 + 2e-3 * ground->at.x() - 1e-3 * ground->at.y(), 4 * ground->sigma_mm);
  EXPECT_LT(ground->sigma_mm, 0.5);
  EXPECT_LT(MeanError(*truth, sloping->product), 0.7);
}

}  // namespace
}  // namespace vss
