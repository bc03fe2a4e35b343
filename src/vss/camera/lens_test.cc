#include "vss/camera/lens.h"

#include <gtest/gtest.h>

namespace vss {
namespace {

Intrinsics Lens(LensModel model) {
  Intrinsics k{model, 531, 542, 261.8, 258.9, {}, 0, 0.016};
  if (model == LensModel::kOpenCv) k.distortion = {-0.156, 0.0148, 6e-4, -7.5e-4, 0.001, 0.01, -0.002, 0.0003, 1e-4, -2e-5, 3e-4, 1e-5};
  if (model == LensModel::kWeng) k.distortion = {0.061, 2e-4, -1e-4, 4e-4, -3e-4, 0.01};
  return k;
}

class LensTest : public testing::TestWithParam<LensModel> {};

TEST_P(LensTest, UnprojectUndoesProject) {
  const Intrinsics k = Lens(GetParam());
  for (double x = -450; x <= 450; x += 150)
    for (double y = -450; y <= 450; y += 150) {
      const Eigen::Vector3d p(x, y, 1000);
      const auto img = k.Project(p);
      ASSERT_TRUE(img);
      EXPECT_LT((*k.Unproject(*img) - p.normalized()).norm(), 1e-12);
    }
}

TEST_P(LensTest, JacobiansAreTheNumericDifferences) {
  const Intrinsics k = Lens(GetParam());
  const Eigen::Vector3d p(310, -220, 900);
  Eigen::Matrix<double, 2, 3> j;
  const auto img = k.Project(p, &j);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d h = 1e-3 * Eigen::Vector3d::Unit(i);
    EXPECT_LT(((*k.Project(p + h) - *k.Project(p - h)) / 2e-3 - j.col(i)).norm(), 1e-6);
  }
  Eigen::Matrix<double, 3, 2> ju;
  ASSERT_TRUE(k.Unproject(*img, &ju));
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d h = 1e-3 * Eigen::Vector2d::Unit(i);
    EXPECT_LT(((*k.Unproject(*img + h) - *k.Unproject(*img - h)) / 2e-3 - ju.col(i)).norm(), 1e-8);
  }
}

INSTANTIATE_TEST_SUITE_P(Models, LensTest, testing::Values(LensModel::kPinhole, LensModel::kOpenCv, LensModel::kWeng));

TEST(Lens, SaysNothingOfPointsBehindTheCameraOrBeyondTheFold) {
  EXPECT_FALSE(Lens(LensModel::kPinhole).Project({1, 1, -5}));
  Intrinsics k = Lens(LensModel::kOpenCv);
  k.distortion = {-0.3};
  EXPECT_FALSE(k.Project({2000, 0, 1000}));  // r = 2 is past the turning point 1/sqrt(0.9)
}

}  // namespace
}  // namespace vss
