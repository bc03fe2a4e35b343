// Corners of a checkerboard: saddles of the grey values with four alternating sectors, linked along the edges
// between them, measured by the grey-value model.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "vss/feature/marks_detect.h"
#include "vss/feature/marks_lattice.h"

namespace vss::marks {
namespace {

using Eigen::Vector2d;

constexpr double kPi = 3.14159265358979323846;
constexpr double kDetectionBlurPx = 1.2;  // of the level: suppresses noise, keeps squares of 8 px apart
constexpr double kRingRadiusPx = 4.0;     // of the level
constexpr int kRingSamples = 32;
constexpr double kOppositeTolerance =
    0.45;  // rad: opposite arms of a corner lie on one line; blur and noise bend them
constexpr double kArmTolerance = 0.25;  // rad: direction to the next corner against the arm
constexpr double kMinContrast = 0.03;   // of full scale
constexpr double kMaxWindowPx = 12;     // beyond, a lens bends the edges by more than the window gains

struct Arm {
  double angle = 0;     // rad, from u to v
  bool rising = false;  // bright at larger angles
};

struct Corner {
  Vector2d place;
  std::array<Arm, 4> arms;
};

double AngleBetween(double a, double b) {
  const double d = std::remainder(a - b, 2 * kPi);
  return std::abs(d);
}

std::optional<Corner> RingTest(const FloatImage& image, const Vector2d& p) {
  if (!image.Inside(p.x(), p.y(), kRingRadiusPx + 1)) return std::nullopt;
  std::array<double, kRingSamples> ring, sorted;
  for (int i = 0; i < kRingSamples; ++i) {
    const double a = 2 * kPi * i / kRingSamples;
    ring[i] = image.Sample(p.x() + kRingRadiusPx * std::cos(a), p.y() + kRingRadiusPx * std::sin(a));
  }
  sorted = ring;
  std::sort(sorted.begin(), sorted.end());
  const double low = sorted[kRingSamples / 10], high = sorted[kRingSamples - 1 - kRingSamples / 10],
               middle = 0.5 * (low + high);
  if (high - low < kMinContrast) return std::nullopt;
  Corner corner{p, {}};
  int n = 0;
  for (int i = 0; i < kRingSamples; ++i) {
    const double a = ring[i] - middle, b = ring[(i + 1) % kRingSamples] - middle;
    if ((a < 0) == (b < 0)) continue;
    if (n == 4) return std::nullopt;
    corner.arms[n++] = {2 * kPi * (i + a / (a - b)) / kRingSamples, b > a};
  }
  if (n != 4) return std::nullopt;
  for (int i = 0; i < 2; ++i)
    if (AngleBetween(corner.arms[i].angle + kPi, corner.arms[i + 2].angle) > kOppositeTolerance)
      return std::nullopt;
  return corner;
}

std::vector<Corner> FindSaddles(const FloatImage& level) {
  const FloatImage image = Smoothed(level, kDetectionBlurPx);
  const int w = image.width, h = image.height;
  FloatImage saddle{w, h, std::vector<float>(image.value.size(), 0)};
  float strongest = 0;
  for (int v = 1; v < h - 1; ++v)
    for (int u = 1; u < w - 1; ++u) {
      const float c = 2 * image.At(u, v), xx = image.At(u + 1, v) + image.At(u - 1, v) - c,
                  yy = image.At(u, v + 1) + image.At(u, v - 1) - c;
      const float xy = 0.25f * (image.At(u + 1, v + 1) + image.At(u - 1, v - 1) - image.At(u + 1, v - 1) -
                                image.At(u - 1, v + 1));
      saddle.At(u, v) = xy * xy - xx * yy;
      strongest = std::max(strongest, saddle.At(u, v));
    }
  // The response goes with the contrast squared: corners of a fifth of the strongest contrast still count.
  const float threshold = 0.04f * strongest;
  std::vector<Corner> corners;
  for (int v = 3; v < h - 3; ++v)
    for (int u = 3; u < w - 3; ++u) {
      const float s = saddle.At(u, v);
      if (!(s > threshold)) continue;
      bool top = true;
      for (int dv = -2; dv <= 2 && top; ++dv)
        for (int du = -2; du <= 2 && top; ++du)
          top = (du == 0 && dv == 0) || saddle.At(u + du, v + dv) < s ||
                (saddle.At(u + du, v + dv) == s && (dv > 0 || (dv == 0 && du > 0)));
      if (!top) continue;
      const auto peak = [](double a, double b, double c) {
        return a + c < 2 * b ? std::clamp(0.5 * (a - c) / (a - 2 * b + c), -0.5, 0.5) : 0.0;
      };
      const Vector2d p(u + peak(saddle.At(u - 1, v), s, saddle.At(u + 1, v)),
                       v + peak(saddle.At(u, v - 1), s, saddle.At(u, v + 1)));
      if (const auto corner = RingTest(image, p)) corners.push_back(*corner);
    }
  return corners;
}

// For each arm the nearest corner along it that has an arm back, with the bright side on the same side of the
// edge.
std::vector<std::vector<int>> Links(const std::vector<Corner>& corners) {
  const int n = static_cast<int>(corners.size());
  std::vector<std::array<int, 4>> nearest(n);
  for (int p = 0; p < n; ++p)
    for (int a = 0; a < 4; ++a) {
      double best = 1e18;
      nearest[p][a] = -1;
      for (int q = 0; q < n; ++q) {
        if (p == q) continue;
        const Vector2d d = corners[q].place - corners[p].place;
        const double distance = d.norm(), angle = std::atan2(d.y(), d.x());
        if (distance >= best || AngleBetween(angle, corners[p].arms[a].angle) > kArmTolerance) continue;
        for (const Arm& back : corners[q].arms)
          if (back.rising != corners[p].arms[a].rising &&
              AngleBetween(angle + kPi, back.angle) < kArmTolerance)
            best = distance, nearest[p][a] = q;
      }
    }
  std::vector<std::vector<int>> links(n);
  for (int p = 0; p < n; ++p)
    for (int q : nearest[p])
      if (q >= 0 && std::find(nearest[q].begin(), nearest[q].end(), p) != nearest[q].end())
        links[p].push_back(q);
  return links;
}

// The window may see nothing but the two edges: it follows the distance to the next edges; coded squares come
// nearer.
double WindowRadius(const LocalSteps& steps, const TargetSpec& target) {
  constexpr double kShare = 0.33, kMinWindowPx = 2.5;
  const double area = std::abs(steps.column.x() * steps.row.y() - steps.column.y() * steps.row.x());
  const double height = area / std::max(steps.column.norm(), steps.row.norm());
  double share = kShare;
  if (target.pattern == TargetPattern::kCharuco)
    share = std::min(share, 0.9 * 0.5 * std::sqrt(2.0) * (1 - target.marker_mm / target.pitch_mm));
  return std::clamp(share * height, kMinWindowPx, kMaxWindowPx);
}

std::optional<Mark> MeasureAt(const GreyView& image, const Vector2d& place, const LocalSteps& steps,
                              const TargetSpec& target, int column, int row) {
  const auto fit =
      FitCorner(image, place, steps.column.normalized(), steps.row.normalized(), WindowRadius(steps, target));
  if (!fit) return std::nullopt;
  return Mark{fit->corner, column, row, fit->sigma_px, fit->blur_px, fit->contrast, 0, 0};
}

BoardMarks Measure(const GreyView& image, const std::vector<Mark>& rough, const TargetSpec& target) {
  BoardMarks board;
  const auto steps = StepsOf(rough);
  for (std::size_t i = 0; i < rough.size(); ++i) {
    if (!steps[i].has_column || !steps[i].has_row) continue;
    if (const auto mark = MeasureAt(image, rough[i].img, steps[i], target, rough[i].column, rough[i].row))
      board.marks.push_back(*mark);
    else
      ++board.num_rejected;
  }
  return board;
}

}  // namespace

BoardMarks FindCorners(const GreyView& image, const TargetSpec& target) {
  constexpr int kMinSide = 120;  // px: below, a level holds no board
  FloatImage level = ToFloat(image);
  std::vector<Mark> rough;
  for (double scale = 1; std::min(level.width, level.height) >= kMinSide; level = Halved(level), scale *= 2) {
    // Level pixel x lies at scale * x + (scale - 1) / 2 of the picture.
    const auto corners = FindSaddles(level);
    if (corners.size() > 20000) continue;  // texture of this scale; a coarser level shows the board
    std::vector<Vector2d> points;
    for (const Corner& c : corners) points.push_back(scale * c.place + Vector2d::Constant(0.5 * (scale - 1)));
    const auto labels = LabelLattice(points, Links(corners));
    if (labels.size() <= rough.size()) continue;
    rough.clear();
    for (const auto& label : labels) rough.push_back({points[label.point], label.column, label.row});
  }
  BoardMarks board = Measure(image, rough, target);
  if (target.pattern == TargetPattern::kCharuco)
    AnchorByMarkers(image, target, board);
  else
    AnchorByEnds(image.width, image.height, target, board);
  return board;
}

}  // namespace vss::marks
