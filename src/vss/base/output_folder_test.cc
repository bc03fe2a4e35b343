#include "vss/base/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "vss/base/files.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class OutputFolderTest : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(base_); }
  void TearDown() override { fs::remove_all(base_); }
  int NumEntries() const {
    int n = 0;
    for ([[maybe_unused]] const auto& entry : fs::recursive_directory_iterator(base_)) ++n;
    return n;
  }
  fs::path base_ = fs::temp_directory_path() / fmt::format("vss-output-{}", ::getpid());
};

TEST_F(OutputFolderTest, HoldsAllFilesAfterCommitAndNothingElse) {
  auto out = OutputFolder::Open(base_ / "a" / "b");
  ASSERT_TRUE(out);
  out->Add("product.json", "{}");
  out->Add("overlays/x.svg", "<svg/>");
  EXPECT_EQ(NumEntries(), 2);  // the two folders
  ASSERT_TRUE(out->Commit());
  EXPECT_EQ(*ReadTextFile(base_ / "a/b/overlays/x.svg"), "<svg/>");
  EXPECT_EQ(NumEntries(), 5);
}

TEST_F(OutputFolderTest, GoesAgainWithoutCommit) {
  {
    auto out = OutputFolder::Open(base_ / "a" / "b");
    ASSERT_TRUE(out);
    out->Add("product.json", "{}");
  }
  EXPECT_EQ(NumEntries(), 0);
}

TEST_F(OutputFolderTest, LeavesAFolderThatWasThere) {
  ASSERT_TRUE(WriteFileAtomically(base_ / "mine.txt", "x"));
  { ASSERT_TRUE(OutputFolder::Open(base_)); }
  EXPECT_EQ(*ReadTextFile(base_ / "mine.txt"), "x");
}

TEST_F(OutputFolderTest, WritesNothingWhereOneFileCannotBeWritten) {
  auto out = OutputFolder::Open(base_ / "a");
  ASSERT_TRUE(out);
  out->Add("product.json", "{}");
  out->Add("product.json/inside", "no folder can be here");
  const Status status = out->Commit();
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message, HasSubstr("cannot be written"));
  EXPECT_FALSE(fs::exists(base_ / "a" / "product.json"));
}

TEST_F(OutputFolderTest, IsRefusedWhereAFileStandsInTheWay) {
  ASSERT_TRUE(WriteFileAtomically(base_ / "file", "x"));
  const auto out = OutputFolder::Open(base_ / "file");
  ASSERT_FALSE(out);
  EXPECT_THAT(out.error().message, HasSubstr("name another with -o"));
  EXPECT_FALSE(OutputFolder::Open(base_ / "file" / "below"));
}

TEST(OutputNames, AreTheStemsUnlessTwoWouldShareOne) {
  EXPECT_THAT(OutputNames({"images/a.png", "images/b.jpeg"}), ElementsAre("a", "b"));
  EXPECT_THAT(OutputNames({"cam1/a.png", "cam2/a.png", "c.png"}), ElementsAre("cam1_a", "cam2_a", "c"));
  EXPECT_THAT(OutputNames({"a.png", "a.jpg"}), ElementsAre("a_1", "a_2"));
  EXPECT_THAT(OutputNames({"../../a.png", "/etc/a.png"}), ElementsAre("a", "etc_a"));
}

}  // namespace
}  // namespace vss
