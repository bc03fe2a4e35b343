#include "vss/feature/normal_equations.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>

namespace vss {
namespace {

using Matrix4d = Eigen::Matrix4d;
using Vector4d = Eigen::Vector4d;

Matrix4d SomeMatrix() {
  Matrix4d a;
  a << 3, 1, 0, 2, 1, 4, 1, 0, 0, 1, 5, 1, 2, 0, 1, 6;
  return a;
}

TEST(Cholesky, SolvesAndInverts) {
  const Matrix4d a = SomeMatrix();
  const Vector4d g(1, -2, 3, 0.5);
  const Cholesky<4> solver(a);
  ASSERT_TRUE(solver.ok());
  EXPECT_LT((a * solver.Solve(g) - g).norm(), 1e-12);
  const Matrix4d inverse = a.inverse();
  EXPECT_LT((solver.InverseOfFirst<2>() - inverse.topLeftCorner<2, 2>()).norm(), 1e-12);
}

TEST(Cholesky, TellsWhatTheLastUnknownsGain) {
  const Matrix4d a = SomeMatrix();
  const Vector4d g(1, -2, 3, 0.5);
  const double all = g.dot(a.inverse() * g);
  const double first = g.head<2>().dot(a.topLeftCorner<2, 2>().inverse() * g.head<2>());
  EXPECT_NEAR(Cholesky<4>(a).Forward(g).tail<2>().squaredNorm(), all - first, 1e-12);
}

TEST(Cholesky, SaysThatAMatrixIsNotPositiveDefinite) {
  Matrix4d a = SomeMatrix();
  a(3, 3) = 0;
  EXPECT_FALSE(Cholesky<4>(a).ok());
  a(3, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Cholesky<4>(a).ok());
}

}  // namespace
}  // namespace vss
