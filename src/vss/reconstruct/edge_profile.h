// The place of a step edge in the grey values of a small strip across it, sub-pixel, with the steps of
// neighbouring edges modelled in the same fit.
//
// Model (grey values proportional to light): g(p) = base + sum_j contrast_j * Phi((d_j(p) - offset_j) /
// blur), d_j the signed distance (px) of pixel p from the predicted curve j, Phi the normal distribution
// function: the step seen through a lens and a pixel of finite size. Fitted to the pixels themselves (nothing
// is resampled, so nothing depends on where the edge lies between pixels) by Gauss-Newton from the best of a
// grid of offsets.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "vss/image/grey_image.h"

namespace vss {

// A curve near `point` (img, px): signed distance d(p) = (p - point) . normal - curvature * s^2 / 2, where s
// is the distance along.
struct ProfileCurve {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();  // unit
  double curvature = 0;                               // 1/px

  double Distance(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d q = p - point;
    const double s = q.x() * normal.y() - q.y() * normal.x();
    return q.dot(normal) - curvature * s * s / 2;
  }
};

inline constexpr double kAnySlope = 0.05;  // of the contrast, per px: light beside an edge in any picture

struct ProfileRequest {
  ProfileCurve curve;
  double half_length_px = 4;                     // of the strip along the curve
  double reach_minus_px = 4, reach_plus_px = 4;  // of the strip against and along the normal
  double search_px = 1;                          // |offset| is looked for up to here
  double blur_px = 0.7, blur_sigma_px = 0.15;    // what is known of the step's blur beforehand
  double slope_sigma = kAnySlope;                // and of how light changes on either side of it, 1/px
  std::span<const ProfileCurve>
      neighbours;  // other edges that cross the strip lengthwise; at most kMaxNeighbours
};
inline constexpr int kMaxNeighbours = 3;

struct ProfileFit {
  double offset_px = 0;  // along the normal
  double sigma_px = 0;   // of the offset, from the scatter of the strip's pixels
  double contrast = 0;   // grey levels: plus side less minus side
  double blur_px = 0;
  // How light changes on the minus and the plus side, of the contrast per px, as the pixels alone have it.
  std::array<double, 2> slope{}, slope_sigma{};
  double rms = 0;  // grey levels
  int num_pixels = 0;
  bool saturated =
      false;  // one side is at the sensor's limit: the edge from what is darker, sigma accordingly
};

// A side beyond the sensor's limit is measured from the darker one; its sigma holds where the light is up to
// some twice the limit, beyond that the edge is drawn too far out (AnOverexposedSideLeavesAnHonestEdge).
// Empty where the strip holds too few pixels, no step, or the fit runs out of the search range. `noise` is
// the picture's noise in grey levels where known (0: not): sigma is never better than that allows.
std::optional<ProfileFit> FitProfile(const GreyView& image, const ProfileRequest& request, double noise);

}  // namespace vss
