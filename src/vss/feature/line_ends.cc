// The ends of segments: where lines meet, or where the picture shows no more of the edge.
#include <algorithm>
#include <cmath>

#include "vss/feature/grey_sample.h"
#include "vss/feature/line_refine.h"
#include "vss/feature/strip_frame.h"
#include "vss/feature/strip_surroundings.h"

namespace vss {
namespace {

using Eigen::Vector2d;

// Difference of the two sides of the line at a place of it (ideal).
double StepAt(const RefineContext& x, const Vector2d& at, const Vector2d& along) {
  const Vector2d left(along.y(), -along.x());
  double sum = 0;
  for (const double side : {1.25, 2.25})
    sum +=
        Sample(x.image, ImgOf(x.lens, at + side * left)) - Sample(x.image, ImgOf(x.lens, at - side * left));
  return sum / 2;
}

bool Inside(const GreyView& image, const Vector2d& p, double border) {
  return p.x() >= border && p.y() >= border && p.x() <= image.width - 1 - border &&
         p.y() <= image.height - 1 - border;
}

// How far (px, ideal, outward positive) the edge goes on beyond its raw end:
// the cut that explains the steps seen best as full contrast before it and none
// behind (the largest cumulated sum of step minus half a contrast).
double FreeEnd(const RefineContext& x, const Vector2d& end, const Vector2d& outward, const Vector2d& along,
               double contrast, double length) {
  constexpr double kInsidePx = 5, kStepPx = 0.5;
  constexpr double kGiveUpPx = 4;  // so much of missing edge ends the search
  const double inside = std::min(kInsidePx, length / 2), most = std::max(8.0, 0.5 * length);
  double sum = 0, best = 0, cut = -inside;
  for (double a = -inside; a < most; a += kStepPx) {
    const Vector2d p = end + a * outward;
    if (!Inside(x.image, ImgOf(x.lens, p), 0)) break;
    sum += kStepPx * (StepAt(x, p, along) / contrast - 0.5);
    if (sum > best) best = sum, cut = a + 0.5 * kStepPx;
    if (sum < best - 0.5 * kGiveUpPx) break;
  }
  return cut;
}

struct Meeting {
  int other = -1;
  Vector2d at = {0, 0};
  double miss_px = 1e9;        // of both ends, when it is a corner
  bool at_others_end = false;  // a corner, not somewhere on the other
};

// Where the line of segment `i`, near its end, meets the line of another
// segment that is there.
Meeting FindMeeting(const std::vector<LineSegment>& all, std::size_t i, bool at_end,
                    const std::vector<std::uint32_t>& nearby) {
  constexpr double kReachPx = 5;     // an end lies no farther from its corner:
                                     // rounding of the corner, and what cuts leave
  constexpr double kMinSine = 0.17;  // 10 degrees
  const LineSegment& s = all[i];
  const Vector2d end = at_end ? s.ideal_end : s.ideal_start, d = (s.ideal_end - s.ideal_start).normalized();
  Meeting best;
  for (const auto j : nearby) {
    const LineSegment& o = all[j];
    const Vector2d e = o.ideal_end - o.ideal_start;
    const double length = e.norm();
    if (!(length > 0)) continue;
    const Vector2d f = e / length;
    const double sine = d.x() * f.y() - d.y() * f.x();
    if (std::abs(sine) < kMinSine) continue;
    const Vector2d w = o.ideal_start - end;
    const double along = (w.x() * f.y() - w.y() * f.x()) / sine;  // of the crossing, from the end
    const Vector2d cross = end + along * d;
    const double on_other = (cross - o.ideal_start).dot(f);
    const double beyond = std::max({0.0, -on_other, on_other - length});
    if (std::abs(along) > kReachPx || beyond > kReachPx) continue;
    const double cost = std::abs(along) + beyond;
    const bool corner = std::min(std::abs(on_other), std::abs(on_other - length)) < kReachPx;
    if (cost < best.miss_px) best = {static_cast<int>(j), cross, cost, corner};
  }
  return best;
}

void SetEnd(const Intrinsics* lens, LineSegment& s, bool at_end, const Vector2d& ideal) {
  (at_end ? s.ideal_end : s.ideal_start) = ideal;
  (at_end ? s.end : s.start) = ImgOf(lens, ideal);
}

void MarkBorders(const GreyView& image, LineSegment& s) {
  constexpr double kBorderPx = 4;
  if (!Inside(image, s.start, kBorderPx)) s.start_kind = SegmentEnd::kBorder;
  if (!Inside(image, s.end, kBorderPx)) s.end_kind = SegmentEnd::kBorder;
}

// Whether `s` tells of the same edge as the longer `o`: the same polarity, lying along it. The ends of one
// that no fit has put in its place are as good as noise; its middle tells.
bool Repeats(const LineSegment& s, bool fitted, const LineSegment& o) {
  constexpr double kMinCosine = 0.9, kMinRawCosine = 0.8, kOvershootPx = 3;
  const Vector2d d = s.ideal_end - s.ideal_start, e = o.ideal_end - o.ideal_start;
  const double length = e.norm(), cosine = fitted ? kMinCosine : kMinRawCosine;
  if (d.squaredNorm() >= e.squaredNorm() || d.dot(e) < cosine * d.norm() * length) return false;
  const double limit = SameEdgePx(std::hypot(o.blur_px, 0.29));
  auto lies_on = [&](const Vector2d& p) {
    const Vector2d w = p - o.ideal_start;
    const double along = w.dot(e) / length;
    return std::abs(w.x() * e.y() - w.y() * e.x()) <= limit * length && along >= -kOvershootPx &&
           along <= length + kOvershootPx;
  };
  return fitted ? lies_on(s.ideal_start) && lies_on(s.ideal_end)
                : lies_on(0.5 * (s.ideal_start + s.ideal_end));
}

void DropRepeated(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  b.grid.Build(x.image, segments);
  b.kept.assign(segments.size(), 1);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    b.grid.FindNearby(segments, i, kNearPx);
    for (const auto j : b.grid.nearby)
      if (Repeats(segments[i], b.fitted[i] || !b.fitted[j], segments[j])) b.kept[i] = 0;
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < segments.size(); ++i)
    if (b.kept[i]) b.moved[kept] = b.moved[i], b.fitted[kept] = b.fitted[i], segments[kept++] = segments[i];
  segments.resize(kept), b.moved.resize(kept);
}

}  // namespace

bool ExtendEnds(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  constexpr double kSureCornerPx = 3;  // ends that miss their corner by no more need no search
  constexpr double kGrownShare = 0.2;
  b.before = segments;
  b.grid.Build(x.image, b.before);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (!b.moved[i]) continue;
    b.moved[i] = 0;
    LineSegment& s = segments[i];
    b.grid.FindNearby(b.before, i, kNearPx);
    const Vector2d d = (s.ideal_end - s.ideal_start).normalized();
    const double length = (s.ideal_end - s.ideal_start).norm();
    double beyond[2] = {0, 0};
    for (const int e : {0, 1}) {
      const Meeting m = FindMeeting(b.before, i, e == 1, b.grid.nearby);
      if (m.at_others_end && m.miss_px < kSureCornerPx) continue;
      beyond[e] = FreeEnd(x, e == 1 ? s.ideal_end : s.ideal_start, e == 1 ? d : -d, d, s.contrast, length);
    }
    if (beyond[0] + beyond[1] < -0.5 * length) continue;
    SetEnd(x.lens, s, false, s.ideal_start - beyond[0] * d);
    SetEnd(x.lens, s, true, s.ideal_end + beyond[1] * d);
    b.moved[i] = beyond[0] + beyond[1] > kGrownShare * length;
  }
  DropRepeated(x, segments, b);
  return std::find(b.moved.begin(), b.moved.end(), 1) != b.moved.end();
}

void JoinEnds(const RefineContext& x, std::vector<LineSegment>& segments, RefineBuffers& b) {
  b.before = segments;
  b.grid.Build(x.image, b.before);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    LineSegment& s = segments[i];
    b.grid.FindNearby(b.before, i, kNearPx);
    for (const bool at_end : {false, true}) {
      const Meeting m = FindMeeting(b.before, i, at_end, b.grid.nearby);
      if (m.other < 0) continue;
      SetEnd(x.lens, s, at_end, m.at);
      (at_end ? s.end_kind : s.start_kind) = SegmentEnd::kJunction;
      (at_end ? s.end_junction : s.start_junction) = m.other;
    }
    MarkBorders(x.image, s);
  }
}

void DropShort(double min_length_px, std::vector<LineSegment>& segments, RefineBuffers& b) {
  b.place.clear();
  int kept = 0;
  for (const auto& s : segments) {
    const bool cut = s.start_junction >= 0 || s.end_junction >= 0;
    b.place.push_back(!cut && (s.end - s.start).norm() < min_length_px ? -1 : kept++);
  }
  auto follow = [&](int& junction, SegmentEnd& kind) {
    if (junction < 0) return;
    junction = b.place[std::size_t(junction)];
    if (junction < 0) kind = SegmentEnd::kFree;
  };
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (b.place[i] < 0) continue;
    LineSegment& s = segments[std::size_t(b.place[i])] = segments[i];
    follow(s.start_junction, s.start_kind);
    follow(s.end_junction, s.end_kind);
  }
  segments.resize(std::size_t(kept));
}

}  // namespace vss
