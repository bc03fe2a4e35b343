#include "vss/image/grey_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "vss/image/thumbnail.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class GreyImageFile : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path Write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  std::string Bytes(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  // A ramp in OpenCV's own hands, so that the reader is checked against somebody else's writer.
  fs::path WriteRamp(const std::string& name, int type) {
    cv::Mat m(30, 40, type);
    for (int v = 0; v < m.rows; ++v)
      for (int u = 0; u < m.cols; ++u) {
        if (type == CV_8U) m.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(3 * u + 4 * v);
        if (type == CV_16U) m.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(1000 * u + 500 * v);
        if (type == CV_8UC3) m.at<cv::Vec3b>(v, u) = {10, 100, 200};
      }
    cv::imwrite((folder_ / name).string(), m);
    return folder_ / name;
  }
  std::string ErrorOf(const fs::path& path) {
    const auto image = ReadImage(path);
    EXPECT_FALSE(image);
    return image ? "" : image.error().message;
  }
  fs::path folder_ = fs::temp_directory_path() / fmt::format("vss-image-{}", ::getpid());
};

TEST_F(GreyImageFile, ReadsPngTiffAndPgmOfEightAndSixteenBitToTheValue) {
  for (const std::string ending : {"png", "tiff", "pgm"})
    for (const int type : {CV_8U, CV_16U}) {
      const auto image = ReadImage(WriteRamp("ramp." + ending, type));
      ASSERT_TRUE(image) << image.error().message;
      EXPECT_EQ(image->bits(), type == CV_8U ? 8 : 16);
      EXPECT_EQ(image->width(), 40);
      EXPECT_EQ(image->height(), 30);
      EXPECT_EQ(image->view().At(7, 20), type == CV_8U ? 101 : 17000) << ending;
    }
}

TEST_F(GreyImageFile, TellsTheSizeFromTheHeaderAsFromThePixels) {
  for (const std::string ending : {"png", "tiff", "pgm", "jpg"}) {
    const auto size = ReadImageSize(WriteRamp("ramp." + ending, CV_8U));
    ASSERT_TRUE(size) << size.error().message;
    EXPECT_EQ(size->width, 40) << ending;
    EXPECT_EQ(size->height, 30) << ending;
  }
}

TEST_F(GreyImageFile, TurnsColourToGrey) {
  const auto image = ReadImage(WriteRamp("colour.png", CV_8UC3));
  ASSERT_TRUE(image);
  EXPECT_NEAR(image->view().At(5, 5), 0.299 * 200 + 0.587 * 100 + 0.114 * 10, 1);
}

TEST_F(GreyImageFile, GoesByTheFirstBytesNotByTheName) {
  const fs::path png = WriteRamp("ramp.png", CV_8U);
  EXPECT_TRUE(ReadImage(Write("ramp.txt", Bytes(png))));
  EXPECT_THAT(ErrorOf(Write("text.png", "this is no picture")), HasSubstr("not a picture"));
}

TEST_F(GreyImageFile, NeverTakesACutOffPictureForAWholeOne) {
  for (const std::string ending : {"png", "jpg", "pgm"}) {
    const std::string whole = Bytes(WriteRamp("ramp." + ending, CV_8U));
    for (const double share : {0.05, 0.3, 0.6, 0.95})
      EXPECT_THAT(ErrorOf(Write("cut." + ending, whole.substr(0, std::size_t(share * double(whole.size()))))),
                  AllOf(HasSubstr("cut." + ending), HasSubstr(";")))
          << ending << share;
  }
}

TEST_F(GreyImageFile, SaysWhatIsMissing) {
  EXPECT_THAT(ErrorOf(folder_ / "none.png"), HasSubstr("there is no such picture"));
  EXPECT_THAT(ErrorOf(folder_), HasSubstr("not a file"));
  EXPECT_THAT(ErrorOf(Write("empty.png", "")), HasSubstr("the file is empty"));
}

TEST_F(GreyImageFile, RefusesAHeaderThatPromisesAnAbsurdSizeWithoutReservingIt) {
  const std::string header("P5\n100000 100000\n255\n");
  EXPECT_THAT(ErrorOf(Write("bomb.pgm", header)), HasSubstr("more than"));
  std::string png = Bytes(WriteRamp("ramp.png", CV_8U));
  png.replace(16, 8, std::string("\x00\x01\x86\xa0\x00\x01\x86\xa0", 8));
  EXPECT_THAT(ErrorOf(Write("bomb.png", png)), HasSubstr("more than"));
}

TEST(LinearFromSrgb, FollowsTheStandardsCurve) {
  GreyImage image(3, 1, 8);
  image.Row8(0)[0] = 0;
  image.Row8(0)[1] = 128;
  image.Row8(0)[2] = 255;
  const GreyImage linear = LinearFromSrgb(image.view());
  EXPECT_EQ(linear.bits(), 16);
  EXPECT_EQ(linear.view().At(0, 0), 0);
  EXPECT_NEAR(linear.view().At(1, 0) / 65535.0, std::pow((128 / 255.0 + 0.055) / 1.055, 2.4), 1e-5);
  EXPECT_EQ(linear.view().At(2, 0), 65535);
}

TEST(ShrinkTo, KeepsTheMeanAndNeverEnlarges) {
  GreyImage image(40, 20, 16);
  for (int v = 0; v < 20; ++v)
    for (int u = 0; u < 40; ++u) image.Row16(v)[u] = static_cast<std::uint16_t>((u + v) % 2 ? 0 : 65535);
  const GreyImage small = ShrinkTo(image.view(), 10);
  EXPECT_EQ(small.width(), 10);
  EXPECT_EQ(small.height(), 5);
  EXPECT_NEAR(small.view().At(3, 3), 127.5, 1);
  EXPECT_EQ(ShrinkTo(image.view(), 400).width(), 40);
}

TEST(GreyImage, IsReducedToMeansAndDropsWhatIsLeftOver) {
  GreyImage image(7, 5, 16);
  for (int v = 0; v < 5; ++v)
    for (int u = 0; u < 7; ++u) image.Row16(v)[u] = static_cast<std::uint16_t>(1000 * v + 10 * u);
  const GreyImage small = Reduced(image.view(), 2);
  ASSERT_EQ(small.width(), 3);
  ASSERT_EQ(small.height(), 2);
  EXPECT_EQ(small.view().At(0, 0), 505);
  EXPECT_EQ(small.view().At(2, 1), 2545);
}

}  // namespace
}  // namespace vss
