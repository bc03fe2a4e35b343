#include "vss/identify/edge_response.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr double kStepPx = 0.5;   // of the profile across the piece
constexpr int kSidePoints = 3;    // of each side: 1.5 px
constexpr int kMaxHalf = 16;      // points of the profile on either side of the middle
constexpr double kAlongPx = 1.2;  // between the points along the piece

template <class Pixel>
double Bilinear(const GreyView& picture, double u, double v) {
  const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
  const double fu = u - u0, fv = v - v0;
  const auto* row = reinterpret_cast<const Pixel*>(static_cast<const std::uint8_t*>(picture.data) +
                                                   v0 * picture.stride_bytes) +
                    u0;
  const auto* next =
      reinterpret_cast<const Pixel*>(reinterpret_cast<const std::uint8_t*>(row) + picture.stride_bytes);
  const double top = row[0] + fu * (row[1] - row[0]), bottom = next[0] + fu * (next[1] - next[0]);
  return top + fv * (bottom - top);
}

template <class Pixel>
std::optional<EdgeResponse> Respond(const GreyView& picture, const Vector2d& middle, const Vector2d& tangent,
                                    double length_px, double reach_px) {
  const int reach = std::min(static_cast<int>(std::lround(reach_px / kStepPx)), kMaxHalf - kSidePoints);
  const int half = reach + kSidePoints;
  const Vector2d normal(-tangent.y(), tangent.x());
  const int along = std::max(1, static_cast<int>(length_px / kAlongPx));
  const Vector2d extent = tangent.cwiseAbs() * (length_px / 2) + normal.cwiseAbs() * (half * kStepPx);
  const Vector2d lo = middle - extent, hi = middle + extent;
  if (!(lo.x() >= 0 && lo.y() >= 0 && hi.x() < picture.width - 1 && hi.y() < picture.height - 1))
    return std::nullopt;
  std::array<double, 2 * kMaxHalf + 1> profile{};
  for (int k = 0; k < along; ++k) {
    const Vector2d at = middle + tangent * (length_px * ((k + 0.5) / along - 0.5));
    for (int i = -half; i <= half; ++i) {
      const Vector2d p = at + normal * (i * kStepPx);
      profile[std::size_t(i + kMaxHalf)] += Bilinear<Pixel>(picture, p.x(), p.y());
    }
  }
  EdgeResponse best;
  for (int o = -reach; o <= reach; ++o) {
    double plus = 0, minus = 0;
    for (int k = 1; k <= kSidePoints; ++k) {
      plus += profile[std::size_t(o + k + kMaxHalf)];
      minus += profile[std::size_t(o - k + kMaxHalf)];
    }
    const double step = (plus - minus) / (kSidePoints * along);
    if (std::abs(step) > std::abs(best.step))
      best = {step, o * kStepPx, std::max(plus, minus) / (kSidePoints * along)};
  }
  return best;
}

}  // namespace

std::optional<EdgeResponse> RespondToEdge(const GreyView& picture, const Vector2d& middle,
                                          const Vector2d& tangent, double length_px, double reach_px) {
  return picture.bits == 8 ? Respond<std::uint8_t>(picture, middle, tangent, length_px, reach_px)
                           : Respond<std::uint16_t>(picture, middle, tangent, length_px, reach_px);
}

double TypicalResponse(const GreyView& picture, double length_px, double reach_px) {
  constexpr int kPlaces = 24, kDirections = 4;  // places along each side of the picture
  constexpr double kLeast = 0.3;                // of the picture's rounding to whole grey values
  std::vector<double> steps;
  for (int a = 0; a < kPlaces; ++a)
    for (int b = 0; b < kPlaces; ++b)
      for (int d = 0; d < kDirections; ++d) {
        const double angle = (d + 0.5 * ((a + b) % 2)) * std::numbers::pi / kDirections;
        const Vector2d middle((a + 0.5) / kPlaces * picture.width, (b + 0.5) / kPlaces * picture.height);
        if (const auto r =
                RespondToEdge(picture, middle, {std::cos(angle), std::sin(angle)}, length_px, reach_px))
          steps.push_back(std::abs(r->step));
      }
  if (steps.empty()) return kLeast;
  std::nth_element(steps.begin(), steps.begin() + std::ptrdiff_t(steps.size() / 2), steps.end());
  return std::max(kLeast, steps[steps.size() / 2]);
}

}  // namespace vss
