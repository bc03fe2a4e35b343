#include "vss/feature/marks.h"

#include <algorithm>
#include <cmath>

#include "vss/feature/marks_detect.h"

namespace vss {
namespace marks {

double FloatImage::Sample(double u, double v) const {
  const int u0 = std::clamp(static_cast<int>(u), 0, width - 2),
            v0 = std::clamp(static_cast<int>(v), 0, height - 2);
  const double a = u - u0, b = v - v0;
  return (1 - b) * ((1 - a) * At(u0, v0) + a * At(u0 + 1, v0)) +
         b * ((1 - a) * At(u0, v0 + 1) + a * At(u0 + 1, v0 + 1));
}

FloatImage ToFloat(const GreyView& image) {
  FloatImage out{image.width, image.height, std::vector<float>(std::size_t(image.width) * image.height)};
  const float scale = static_cast<float>(1 / image.MaxValue());
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) out.At(u, v) = scale * image.At(u, v);
  return out;
}

FloatImage Halved(const FloatImage& image) {
  FloatImage out{image.width / 2, image.height / 2,
                 std::vector<float>(std::size_t(image.width / 2) * (image.height / 2))};
  for (int v = 0; v < out.height; ++v)
    for (int u = 0; u < out.width; ++u)
      out.At(u, v) = 0.25f * (image.At(2 * u, 2 * v) + image.At(2 * u + 1, 2 * v) +
                              image.At(2 * u, 2 * v + 1) + image.At(2 * u + 1, 2 * v + 1));
  return out;
}

FloatImage Smoothed(const FloatImage& image, double sigma_px) {
  const int radius = static_cast<int>(std::ceil(3 * sigma_px));
  std::vector<float> kernel(2 * radius + 1);
  float sum = 0;
  for (int i = -radius; i <= radius; ++i)
    sum += kernel[i + radius] = static_cast<float>(std::exp(-0.5 * i * i / (sigma_px * sigma_px)));
  for (float& k : kernel) k /= sum;
  FloatImage rows = image, out = image;
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) {
      float s = 0;
      for (int i = -radius; i <= radius; ++i)
        s += kernel[i + radius] * image.At(std::clamp(u + i, 0, image.width - 1), v);
      rows.At(u, v) = s;
    }
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) {
      float s = 0;
      for (int i = -radius; i <= radius; ++i)
        s += kernel[i + radius] * rows.At(u, std::clamp(v + i, 0, image.height - 1));
      out.At(u, v) = s;
    }
  return out;
}

}  // namespace marks

Result<BoardMarks> FindMarks(const GreyView& image, const TargetSpec& target) {
  constexpr int kMinMarks = 6;  // a homography needs 4; 6 leave something to check it by
  if (image.width < 32 || image.height < 32)
    return InputError("a picture of {} x {} px is too small for a target", image.width, image.height);
  BoardMarks board = target.pattern == TargetPattern::kDiscs ? marks::FindDiscs(image, target)
                                                             : marks::FindCorners(image, target);
  const int found = static_cast<int>(board.marks.size());
  const char* what = target.pattern == TargetPattern::kDiscs ? "discs" : "corners";
  if (found < kMinMarks)
    return InputError("found {} {} of a grid where at least {} are needed", found, what, kMinMarks);
  const auto [c0, c1] = std::minmax_element(board.marks.begin(), board.marks.end(),
                                            [](const Mark& a, const Mark& b) { return a.column < b.column; });
  const auto [r0, r1] = std::minmax_element(board.marks.begin(), board.marks.end(),
                                            [](const Mark& a, const Mark& b) { return a.row < b.row; });
  if (c0->column == c1->column || r0->row == r1->row)
    return InputError("the {} {} found lie on one line, which says nothing of the plane", found, what);
  std::sort(board.marks.begin(), board.marks.end(), [](const Mark& a, const Mark& b) {
    return std::pair(a.row, a.column) < std::pair(b.row, b.column);
  });
  return board;
}

}  // namespace vss
