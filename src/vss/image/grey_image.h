// Grey pictures of 8 or 16 bit. (0, 0) is the centre of the top-left pixel, u to the right, v down.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "vss/base/result.h"

namespace vss {

// A picture that somebody else owns. Row v starts at data + v * stride_bytes.
struct GreyView {
  const void* data = nullptr;
  int width = 0, height = 0;
  std::ptrdiff_t stride_bytes = 0;
  int bits = 8;  // 8: uint8_t, 16: uint16_t pixels

  const std::uint8_t* Row8(int v) const { return static_cast<const std::uint8_t*>(data) + v * stride_bytes; }
  const std::uint16_t* Row16(int v) const {
    return reinterpret_cast<const std::uint16_t*>(static_cast<const std::uint8_t*>(data) + v * stride_bytes);
  }
  int At(int u, int v) const { return bits == 8 ? Row8(v)[u] : Row16(v)[u]; }
  double MaxValue() const { return bits == 8 ? 255.0 : 65535.0; }
};

// Owns its pixels, rows without gaps.
class GreyImage {
 public:
  GreyImage() = default;
  GreyImage(int width, int height, int bits) : width_(width), height_(height), bits_(bits), bytes_(std::size_t(width) * height * (bits / 8)) {}
  int width() const { return width_; }
  int height() const { return height_; }
  int bits() const { return bits_; }
  std::uint8_t* Row8(int v) { return bytes_.data() + std::size_t(v) * width_; }
  std::uint16_t* Row16(int v) { return reinterpret_cast<std::uint16_t*>(bytes_.data()) + std::size_t(v) * width_; }
  GreyView view() const { return {bytes_.data(), width_, height_, std::ptrdiff_t(width_) * (bits_ / 8), bits_}; }

 private:
  int width_ = 0, height_ = 0, bits_ = 8;
  std::vector<std::uint8_t> bytes_;
};

// Largest picture that is read: beyond it a header is taken for an attack or a mistake.
inline constexpr std::int64_t kMaxPixels = std::int64_t{20000} * 20000;

// PNG, JPEG, TIFF or PGM by their first bytes; 8 or 16 bit; colour becomes grey (Rec. 601). A truncated file is an error.
Result<GreyImage> ReadImage(const std::filesystem::path& path);
// Only the size, from the header; cheap.
struct ImageSize { int width = 0, height = 0; };
Result<ImageSize> ReadImageSize(const std::filesystem::path& path);

// sRGB grey values to values proportional to light, 16 bit (IEC 61966-2-1).
GreyImage LinearFromSrgb(const GreyView& srgb);

// Smaller by a whole factor >= 1: each pixel the mean of factor x factor; what is left over at the right and below is dropped.
GreyImage Reduced(const GreyView& image, int factor);

// PNG bytes of a picture (for reports and overlays). 8 bit.
std::vector<std::uint8_t> EncodePng(const GreyView& image);
std::vector<std::uint8_t> EncodeJpeg(const GreyView& image, int quality);
Status WritePng(const std::filesystem::path& path, const GreyView& image);

}  // namespace vss
