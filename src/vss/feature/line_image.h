// The line image of a picture: straight segments and elliptical arcs, sub-pixel, with covariance.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/camera/lens.h"
#include "vss/image/grey_image.h"

namespace vss {

enum class SegmentEnd { kFree, kJunction, kBorder };  // ends alone, at another line, at the picture's border

// A straight edge. The bright side lies to the left of start -> end as seen on the screen (v down).
// `start`, `end` (px, img) as taken; `ideal_start`, `ideal_end` (px, ideal) without distortion: the same
// where no lens is known. The supporting line is known to
//   sigma_offset_px (at the midpoint, across the line) and sigma_angle_rad, uncorrelated.
struct LineSegment {
  Eigen::Vector2d start = {0, 0}, end = {0, 0};
  Eigen::Vector2d ideal_start = {0, 0}, ideal_end = {0, 0};
  double sigma_offset_px = 0;
  double sigma_angle_rad = 0;
  double contrast = 0;  // grey levels between the two sides
  double blur_px = 0;   // sigma of the edge profile
  double rms_distance_px = 0;
  int num_points = 0;
  SegmentEnd start_kind = SegmentEnd::kFree, end_kind = SegmentEnd::kFree;
  int start_junction = -1, end_junction = -1;  // index of the other segment, or -1
};

// An arc of an ellipse. Semi-axes in px; `angle_rad` of the first axis against u, towards v; `from_rad`,
// `to_rad` are parameter angles: point(t) = center + R(angle) (axes.x cos t, axes.y sin t), from < to <= from
// + 2 pi. The `ideal_*` values describe the same contour without distortion (fitted there).
struct EllipticalArc {
  Eigen::Vector2d center = {0, 0}, axes = {0, 0};
  double angle_rad = 0, from_rad = 0, to_rad = 0;
  Eigen::Vector2d ideal_center = {0, 0}, ideal_axes = {0, 0};
  double ideal_angle_rad = 0, ideal_from_rad = 0, ideal_to_rad = 0;
  bool bright_inside = false;
  Eigen::Matrix<double, 5, 5> covariance =
      Eigen::Matrix<double, 5, 5>::Zero();  // ideal centre u, v, axes a, b, angle
  double contrast = 0, blur_px = 0, rms_distance_px = 0;
  int num_points = 0;
};

struct LineImage {
  std::string image;  // file name of the picture
  int width_px = 0, height_px = 0;
  double noise_sigma = 0;  // grey levels
  bool lens_known = false;
  std::vector<LineSegment> segments;
  std::vector<EllipticalArc> arcs;
};

struct LineOptions {
  double min_length_px = 6;
  double edge_threshold = 3.2;  // of the gradient's noise
  double min_contrast = 2;      // grey levels
  double min_significance = 8;  // mean gradient over what noise and texture explain
  double tolerance_px = 0.7;
  double max_gap_px = 30;
  bool arcs = true;
};
std::span<const ParameterOf<LineOptions>> LineParameters();

// Buffers that repeated calls share; one a thread.
class LineWorkspace {
 public:
  struct Buffers;
  LineWorkspace();
  ~LineWorkspace();
  LineWorkspace(LineWorkspace&&) noexcept;
  LineWorkspace& operator=(LineWorkspace&&) noexcept;
  Buffers& buffers() { return *buffers_; }

 private:
  std::unique_ptr<Buffers> buffers_;
};

// The lines of `image`. `lens`: straightens edge points before lines are fitted; null where it is not known.
// Never fails: a picture without edges has no lines. The same bytes for the same input, always.
LineImage DetectLines(const GreyView& image, const Intrinsics* lens, const LineOptions& options,
                      LineWorkspace* workspace = nullptr);

// The same into `lines`, whose memory is used again: with a workspace and lines that have seen pictures as
// large and as rich, nothing is allocated.
void DetectLines(const GreyView& image, const Intrinsics* lens, const LineOptions& options,
                 LineWorkspace& workspace, LineImage& lines);

// Format vss-lines/1.
std::string LineImageToJson(const LineImage& lines);

}  // namespace vss
