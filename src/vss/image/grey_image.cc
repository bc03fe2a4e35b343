#include "vss/image/grey_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "vss/base/files.h"

namespace vss {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::uint32_t Read(const Bytes& b, std::size_t at, int n, bool big_endian) {
  std::uint32_t value = 0;
  for (int i = 0; i < n; ++i) value |= std::uint32_t(b[at + (big_endian ? n - 1 - i : i)]) << (8 * i);
  return value;
}

enum class Format { kNone, kPng, kJpeg, kTiff, kPgm };

Format FormatOf(const Bytes& b) {
  auto starts = [&](std::initializer_list<int> magic) {
    return b.size() >= magic.size() && std::equal(magic.begin(), magic.end(), b.begin());
  };
  if (starts({0x89, 'P', 'N', 'G', 0x0d, 0x0a, 0x1a, 0x0a})) return Format::kPng;
  if (starts({0xff, 0xd8, 0xff})) return Format::kJpeg;
  if (starts({'I', 'I', 42, 0}) || starts({'M', 'M', 0, 42})) return Format::kTiff;
  if (starts({'P', '5'}) || starts({'P', '2'})) return Format::kPgm;
  return Format::kNone;
}

// Width and height from the header; zero where the header is cut off.
ImageSize HeaderSize(const Bytes& b, Format format) {
  const std::size_t n = b.size();
  if (format == Format::kPng && n >= 24) return {int(Read(b, 16, 4, true) & 0x7fffffff), int(Read(b, 20, 4, true) & 0x7fffffff)};
  if (format == Format::kPgm) {
    std::size_t at = 2;
    auto number = [&] {
      while (at < n && (std::isspace(b[at]) || b[at] == '#')) {
        if (b[at] == '#') while (at < n && b[at] != '\n') ++at;
        else ++at;
      }
      std::int64_t value = 0;
      while (at < n && std::isdigit(b[at]) && value < (1 << 30)) value = 10 * value + (b[at++] - '0');
      return int(std::min<std::int64_t>(value, 1 << 30));
    };
    const int w = number();
    return {w, number()};
  }
  if (format == Format::kJpeg) {
    for (std::size_t at = 2; at + 9 < n;) {
      if (b[at] != 0xff) { ++at; continue; }
      const int marker = b[at + 1];
      if (marker == 0xff) { ++at; continue; }
      if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc)
        return {int(Read(b, at + 7, 2, true)), int(Read(b, at + 5, 2, true))};
      if (marker == 0xd8 || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd7)) at += 2;
      else at += 2 + Read(b, at + 2, 2, true);
    }
  }
  if (format == Format::kTiff && n >= 8) {
    const bool big = b[0] == 'M';
    const std::size_t dir = Read(b, 4, 4, big);
    if (dir + 2 > n) return {};
    ImageSize size;
    const int entries = int(Read(b, dir, 2, big));
    for (int i = 0; i < entries; ++i) {
      const std::size_t at = dir + 2 + 12 * std::size_t(i);
      if (at + 12 > n) return {};
      const int tag = int(Read(b, at, 2, big)), type = int(Read(b, at + 2, 2, big));
      const auto value = Read(b, at + 8, type == 3 ? 2 : 4, big);
      if (tag == 256) size.width = int(value & 0x7fffffff);
      if (tag == 257) size.height = int(value & 0x7fffffff);
    }
    return size;
  }
  return {};
}

// CRC-32 of ISO 3309, as PNG uses it.
std::uint32_t Crc32(const std::uint8_t* data, std::size_t size) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      t[i] = i;
      for (int k = 0; k < 8; ++k) t[i] = t[i] & 1 ? 0xedb88320u ^ (t[i] >> 1) : t[i] >> 1;
    }
    return t;
  }();
  std::uint32_t crc = 0xffffffffu;
  for (std::size_t i = 0; i < size; ++i) crc = table[(crc ^ data[i]) & 0xff] ^ (crc >> 8);
  return ~crc;
}

// Every chunk there to IEND, each with its check sum. (libpng would complain on stderr by itself.)
bool PngChunksAreSound(const Bytes& b) {
  for (std::size_t at = 8; at + 12 <= b.size();) {
    const std::size_t length = Read(b, at, 4, true);
    if (length > b.size() - at - 12 || Crc32(&b[at + 4], length + 4) != Read(b, at + 8 + length, 4, true)) return false;
    if (std::equal(&b[at + 4], &b[at + 8], "IEND")) return true;
    at += 12 + length;
  }
  return false;
}

// A PNG ends with IEND and a JPEG with EOI; decoders fill what is missing with grey and say nothing.
bool IsWhole(const Bytes& b, Format format, const ImageSize& size) {
  if (format == Format::kPng) return PngChunksAreSound(b);
  if (format == Format::kJpeg) {
    static constexpr std::uint8_t kEnd[] = {0xff, 0xd9};
    return std::find_end(b.begin(), b.end(), kEnd, kEnd + 2) != b.end();
  }
  if (format == Format::kPgm && b[1] == '5') return b.size() >= std::size_t(size.width) * size.height;
  return true;
}

struct Loaded {
  Bytes bytes;
  Format format;
  ImageSize size;
};

Result<Loaded> LoadHeader(const std::filesystem::path& path, bool whole) {
  std::error_code ec;
  if (!std::filesystem::exists(path, ec)) return InputError("{}: there is no such picture; check the name", path.string());
  if (!std::filesystem::is_regular_file(path, ec)) return InputError("{}: this is not a file; name a picture", path.string());
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) return InputError("{}: cannot be read ({}); check its permissions", path.string(), std::strerror(errno));
  constexpr std::streamoff kHeaderBytes = 1 << 20;     // every header that we read ends before
  constexpr std::streamoff kMaxFileBytes = std::streamoff{1} << 31;
  const std::streamoff length = in.tellg();
  if (length > kMaxFileBytes) return InputError("{}: {} bytes are more than a picture may have ({})", path.string(), length, kMaxFileBytes);
  Loaded out;
  out.bytes.resize(std::size_t(whole ? length : std::min(length, kHeaderBytes)));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(out.bytes.data()), std::streamsize(out.bytes.size()));
  if (out.bytes.empty()) return InputError("{}: the file is empty; a PNG, JPEG, TIFF or PGM picture is needed", path.string());
  out.format = FormatOf(out.bytes);
  if (out.format == Format::kNone) return InputError("{}: not a picture; PNG, JPEG, TIFF and PGM are read", path.string());
  out.size = HeaderSize(out.bytes, out.format);
  if (out.size.width < 1 || out.size.height < 1)
    return InputError("{}: the picture's header is damaged or cut off; copy the file again", path.string());
  if (std::int64_t{out.size.width} * out.size.height > kMaxPixels)
    return InputError("{}: {} x {} pixels are more than the {} that a picture may have", path.string(), out.size.width, out.size.height, kMaxPixels);
  return out;
}

}  // namespace

Result<ImageSize> ReadImageSize(const std::filesystem::path& path) {
  VSS_ASSIGN(auto loaded, LoadHeader(path, false));
  return loaded.size;
}

Result<GreyImage> ReadImage(const std::filesystem::path& path) {
  VSS_ASSIGN(auto loaded, LoadHeader(path, true));
  if (!IsWhole(loaded.bytes, loaded.format, loaded.size)) return InputError("{}: the picture is cut off or damaged; copy the file again", path.string());
  cv::Mat decoded;
  try {
    decoded = cv::imdecode(loaded.bytes, cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    decoded.release();
  }
  if (decoded.empty()) return InputError("{}: the picture is damaged; copy the file again", path.string());
  if (decoded.depth() != CV_8U && decoded.depth() != CV_16U)
    return InputError("{}: its pixels are neither 8 nor 16 bit; convert it", path.string());
  cv::Mat grey = decoded;
  if (decoded.channels() == 3) cv::cvtColor(decoded, grey, cv::COLOR_BGR2GRAY);
  else if (decoded.channels() == 4) cv::cvtColor(decoded, grey, cv::COLOR_BGRA2GRAY);
  else if (decoded.channels() != 1) return InputError("{}: {} channels are not grey or colour; convert it", path.string(), decoded.channels());
  GreyImage image(grey.cols, grey.rows, grey.depth() == CV_8U ? 8 : 16);
  for (int v = 0; v < grey.rows; ++v) std::memcpy(image.bits() == 8 ? static_cast<void*>(image.Row8(v)) : image.Row16(v), grey.ptr(v), std::size_t(grey.cols) * (image.bits() / 8));
  return image;
}

GreyImage LinearFromSrgb(const GreyView& srgb) {
  const int levels = srgb.bits == 8 ? 256 : 65536;
  std::vector<std::uint16_t> table(static_cast<std::size_t>(levels));
  for (int i = 0; i < levels; ++i) {
    const double s = i / double(levels - 1);
    const double light = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    table[std::size_t(i)] = static_cast<std::uint16_t>(std::lround(light * 65535));
  }
  GreyImage out(srgb.width, srgb.height, 16);
  for (int v = 0; v < srgb.height; ++v)
    for (int u = 0; u < srgb.width; ++u) out.Row16(v)[u] = table[std::size_t(srgb.At(u, v))];
  return out;
}

namespace {
cv::Mat MatOf(const GreyView& image) {
  return cv::Mat(image.height, image.width, image.bits == 8 ? CV_8U : CV_16U, const_cast<void*>(image.data), std::size_t(image.stride_bytes));
}
cv::Mat Eight(const GreyView& image) {
  cv::Mat m = MatOf(image);
  if (image.bits == 16) m.convertTo(m, CV_8U, 1 / 257.0);
  return m;
}
}  // namespace

GreyImage Reduced(const GreyView& image, int factor) {
  GreyImage out(image.width / factor, image.height / factor, image.bits);
  const GreyView to = out.view();
  cv::Mat small = MatOf(to);
  cv::resize(MatOf(image)(cv::Rect(0, 0, to.width * factor, to.height * factor)), small, small.size(), 0, 0, cv::INTER_AREA);
  return out;
}

std::vector<std::uint8_t> EncodePng(const GreyView& image) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", Eight(image), bytes);
  return bytes;
}

std::vector<std::uint8_t> EncodeJpeg(const GreyView& image, int quality) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", Eight(image), bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return bytes;
}

Status WritePng(const std::filesystem::path& path, const GreyView& image) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", MatOf(image), bytes);
  return WriteFileAtomically(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace vss
