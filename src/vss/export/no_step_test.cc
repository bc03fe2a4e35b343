#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vss/export/export.h"

namespace vss {
namespace {

TEST(Step, SaysThatItIsNotPartOfThisBuild) {
  EXPECT_FALSE(CanWriteStep());
  const auto files = ExportProduct({}, {}, std::vector<std::string>{"csv", "step"});
  ASSERT_FALSE(files);
  EXPECT_THAT(files.error().message, testing::HasSubstr("STEP is not part of this build"));
}

}  // namespace
}  // namespace vss
