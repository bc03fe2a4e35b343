// Synthetic pictures of rectangles and ellipses whose edges are known exactly, the Cramer-Rao bound of what
// they tell, and the line detectors that are compared.
#pragma once
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>
#ifdef VSS_HAVE_XIMGPROC
#include <opencv2/ximgproc.hpp>
#endif

#include "vss/feature/line_image.h"

namespace vss::bench {

using Eigen::Vector2d;

struct TrueEdge {
  Vector2d start, end;  // bright side to the left as seen on the screen
};

struct Condition {
  double contrast, noise, blur;
};

struct LineScene {
  GreyImage image;
  std::vector<TrueEdge> edges;
};

inline double Phi(double x) { return 0.5 * std::erfc(-x * M_SQRT1_2); }

// What a pixel's area adds to the blur's variance, taken in kSub x kSub places of the pixel.
inline constexpr int kSub = 3;

struct Box {
  Vector2d center;
  double half_length, half_width, angle;
  bool bright;

  // Share of the rectangle at a point, seen through a Gaussian blur: exact.
  double At(const Vector2d& p, double blur) const {
    const Vector2d d = p - center;
    const double c = std::cos(angle), s = std::sin(angle), x = c * d.x() + s * d.y(),
                 y = -s * d.x() + c * d.y();
    return (Phi((x + half_length) / blur) - Phi((x - half_length) / blur)) *
           (Phi((y + half_width) / blur) - Phi((y - half_width) / blur));
  }
  double Radius() const { return std::hypot(half_length, half_width); }
};

inline std::vector<Box> PlaceBoxes(int size, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Box> boxes;
  const int wanted = 12 * size * size / (512 * 512);
  for (int i = 0; i < 400 * wanted / 12 && int(boxes.size()) < wanted; ++i) {
    Box b{{size * unit(random), size * unit(random)},
          15 + 65 * unit(random),
          8 + 40 * unit(random),
          M_PI * unit(random),
          unit(random) < 0.5};
    const double r = b.Radius() + 8;
    bool free = b.center.x() > r && b.center.y() > r && b.center.x() < size - r && b.center.y() < size - r;
    for (const auto& o : boxes) free = free && (o.center - b.center).norm() > o.Radius() + b.Radius() + 10;
    if (free) boxes.push_back(b);
  }
  return boxes;
}

inline LineScene MakeScene(int size, const Condition& c, unsigned seed) {
  std::mt19937 random(seed);
  const auto boxes = PlaceBoxes(size, random);
  cv::Mat grey(size, size, CV_32F, cv::Scalar(120));
  for (const auto& b : boxes) {
    const int r = static_cast<int>(b.Radius() + 6 * c.blur) + 2, cu = static_cast<int>(b.center.x()),
              cv_ = static_cast<int>(b.center.y());
    for (int v = std::max(0, cv_ - r); v < std::min(size, cv_ + r); ++v)
      for (int u = std::max(0, cu - r); u < std::min(size, cu + r); ++u) {
        // The pixel's area (1/12) beyond its kSub^2 places (1/12 (1 - 1/kSub^2)) goes into the blur: exact to
        // second order.
        const double blur = std::sqrt(c.blur * c.blur + 1.0 / (12 * kSub * kSub));
        double sum = 0;
        for (int j = 0; j < kSub; ++j)
          for (int i = 0; i < kSub; ++i)
            sum += b.At({u + (i + 0.5) / kSub - 0.5, v + (j + 0.5) / kSub - 0.5}, blur);
        grey.at<float>(v, u) += static_cast<float>((b.bright ? 1 : -1) * c.contrast * sum / (kSub * kSub));
      }
  }
  LineScene scene{GreyImage(size, size, 8), {}};
  std::normal_distribution<double> normal(0, 1);
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u)
      scene.image.Row8(v)[u] = static_cast<std::uint8_t>(std::clamp(
          std::lround(grey.at<float>(v, u) + (c.noise > 0 ? c.noise * normal(random) : 0)), 0L, 255L));
  for (const auto& b : boxes) {
    const Vector2d x(std::cos(b.angle), std::sin(b.angle)), y(-x.y(), x.x());
    const Vector2d corner[4] = {
        b.center + b.half_length * x + b.half_width * y, b.center + b.half_length * x - b.half_width * y,
        b.center - b.half_length * x - b.half_width * y, b.center - b.half_length * x + b.half_width * y};
    for (int i = 0; i < 4; ++i) {
      const Vector2d p = corner[i], q = corner[(i + 1) % 4];
      scene.edges.push_back(b.bright ? TrueEdge{p, q} : TrueEdge{q, p});
    }
  }
  return scene;
}

// Standard deviation of an edge's place from one pixel of its length, levels and blur known (8 bit rounding
// included).
inline double BoundPerPixel(const Condition& c) {
  const double blur = std::sqrt(c.blur * c.blur + 1.0 / 12), variance = c.noise * c.noise + 1.0 / 12;
  return std::sqrt(2 * std::sqrt(M_PI) * blur * variance) / c.contrast;
}

struct FoundEdge {
  Vector2d start, end;
  double sigma_offset = 0, sigma_angle = 0;
};

struct Detector {
  std::string name;
  std::vector<FoundEdge> (*find)(const GreyImage&);
};

inline cv::Mat MatOf(const GreyImage& image) {
  const GreyView v = image.view();
  return cv::Mat(v.height, v.width, CV_8U, const_cast<void*>(v.data), std::size_t(v.stride_bytes));
}

inline std::vector<FoundEdge> FindVss(const GreyImage& image) {
  static thread_local LineWorkspace workspace;
  std::vector<FoundEdge> out;
  for (const auto& s : DetectLines(image.view(), nullptr, {}, &workspace).segments)
    out.push_back({s.start, s.end, s.sigma_offset_px, s.sigma_angle_rad});
  return out;
}

inline std::vector<FoundEdge> EdgesOf(const std::vector<cv::Vec4f>& lines, double shift) {
  std::vector<FoundEdge> out;
  for (const auto& l : lines) out.push_back({{l[0] + shift, l[1] + shift}, {l[2] + shift, l[3] + shift}});
  return out;
}

inline std::vector<FoundEdge> FindLsd(const GreyImage& image) {
  static thread_local auto lsd = cv::createLineSegmentDetector();
  std::vector<cv::Vec4f> lines;
  lsd->detect(MatOf(image), lines);
  return EdgesOf(
      lines, 0.125);  // at its default scale OpenCV's LSD is shifted by this; the comparison is without it
}

#ifdef VSS_HAVE_XIMGPROC
inline std::vector<FoundEdge> FindFld(const GreyImage& image) {
  static thread_local auto fld = cv::ximgproc::createFastLineDetector();
  std::vector<cv::Vec4f> lines;
  fld->detect(MatOf(image), lines);
  return EdgesOf(lines, 0);
}
inline std::vector<FoundEdge> FindEd(const GreyImage& image) {
  static thread_local auto ed = cv::ximgproc::createEdgeDrawing();
  std::vector<cv::Vec4f> lines;
  ed->detectEdges(MatOf(image));
  ed->detectLines(lines);
  return EdgesOf(lines, 0);
}
#endif

inline std::vector<Detector> Detectors() {
  std::vector<Detector> all = {{"VSS", FindVss}, {"LSD", FindLsd}};
#ifdef VSS_HAVE_XIMGPROC
  all.push_back({"FastLine", FindFld});
  all.push_back({"EdgeDraw", FindEd});
#endif
  return all;
}

}  // namespace vss::bench
