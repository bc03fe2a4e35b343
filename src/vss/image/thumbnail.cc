#include "vss/image/thumbnail.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace vss {

GreyImage ShrinkTo(const GreyView& image, int max_side_px) {
  cv::Mat small(image.height, image.width, image.bits == 8 ? CV_8U : CV_16U, const_cast<void*>(image.data),
                std::size_t(image.stride_bytes));
  if (image.bits == 16) small.convertTo(small, CV_8U, 1 / 257.0);
  const double scale = static_cast<double>(max_side_px) / std::max(image.width, image.height);
  if (scale < 1) {
    const cv::Size size(std::max(1, int(std::lround(image.width * scale))),
                        std::max(1, int(std::lround(image.height * scale))));
    cv::Mat shrunk;
    cv::resize(small, shrunk, size, 0, 0, cv::INTER_AREA);
    small = shrunk;
  }
  GreyImage out(small.cols, small.rows, 8);
  for (int v = 0; v < small.rows; ++v) std::memcpy(out.Row8(v), small.ptr(v), std::size_t(small.cols));
  return out;
}

std::vector<std::uint8_t> EncodeRgbPng(const std::vector<std::uint8_t>& rgb, int width, int height) {
  const cv::Mat in(height, width, CV_8UC3, const_cast<std::uint8_t*>(rgb.data()));
  cv::Mat bgr;
  cv::cvtColor(in, bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", bgr, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9});
  return bytes;
}

}  // namespace vss
