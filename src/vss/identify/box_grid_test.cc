#include "vss/identify/box_grid.h"

#include <gtest/gtest.h>

#include <random>

namespace vss {
namespace {

Eigen::AlignedBox2d RandomBox(std::mt19937& random) {
  std::uniform_real_distribution<double> place(-5000, 5000), share(0, 1);
  const Eigen::Vector2d corner(place(random), place(random));
  // A few as long as all that there is.
  const double size = share(random) < 0.05 ? 10000 : 400;
  return {corner, corner + Eigen::Vector2d(size * share(random), size * share(random))};
}

TEST(BoxGridTest, FindsEveryBoxThatMeetsAnotherOnceAndInOrder) {
  std::mt19937 random(5);
  BoxGrid grid(130);
  std::vector<Eigen::AlignedBox2d> boxes;
  for (int i = 0; i < 500; ++i) {
    boxes.push_back(RandomBox(random));
    grid.Add(boxes.back());
  }
  std::vector<int> found;
  for (int i = 0; i < 200; ++i) {
    const Eigen::AlignedBox2d asked = RandomBox(random);
    std::vector<int> expected;
    for (int k = 0; k < int(boxes.size()); ++k)
      if (boxes[std::size_t(k)].intersects(asked)) expected.push_back(k);
    grid.Find(asked, found);
    EXPECT_EQ(found, expected);
  }
}

TEST(BoxGridTest, ABoxWithoutEndIsMetEverywhere) {
  BoxGrid grid(100);
  const auto far = Eigen::Vector2d::Constant(1e9);
  grid.Add({-far, far});
  std::vector<int> found;
  grid.Find({Eigen::Vector2d(7, 7), Eigen::Vector2d(8, 8)}, found);
  EXPECT_EQ(found, std::vector<int>{0});
}

}  // namespace
}  // namespace vss
