#include "vss/feature/strip_frame.h"

#include <algorithm>

namespace vss {

using Eigen::Vector2d;

Vector2d ImgOf(const Intrinsics* lens, const Vector2d& ideal) {
  if (!lens) return ideal;
  return lens->ImgFromNormalized(lens->NormalizedFromIdeal(ideal)).value_or(ideal);
}

Vector2d IdealOf(const Intrinsics* lens, const Vector2d& img) {
  if (!lens) return img;
  const auto n = lens->NormalizedFromImg(img);
  return n ? lens->IdealFromNormalized(*n) : img;
}

StripFrame FrameOf(const Intrinsics* lens, const LineSegment& s) {
  StripFrame f;
  const Vector2d chord = s.end - s.start;
  const double length = chord.norm();
  f.middle = 0.5 * (s.start + s.end);
  f.along = chord / length;
  f.across = {f.along.y(), -f.along.x()};
  f.from = -0.5 * length, f.to = 0.5 * length;
  if (!lens) return f;
  for (int i = 0; i < StripFrame::kNodes; ++i) {
    const double share = double(i) / (StripFrame::kNodes - 1);
    const Vector2d d = ImgOf(lens, s.ideal_start + (s.ideal_end - s.ideal_start) * share) - f.middle;
    f.node[i] = f.along.dot(d), f.difference[i] = f.across.dot(d);
  }
  for (int k = 1; k < StripFrame::kNodes; ++k)
    for (int i = StripFrame::kNodes - 1; i >= k; --i)
      f.difference[i] = (f.difference[i] - f.difference[i - 1]) / (f.node[i] - f.node[i - k]);
  return f;
}

Vector2d InFrame(const StripFrame& f, const Vector2d& p) {
  const Vector2d d = p - f.middle;
  const double a = f.along.dot(d);
  return {a, f.across.dot(d) - f.Sag(std::clamp(a, f.from, f.to))};
}

}  // namespace vss
