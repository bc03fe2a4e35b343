// Ellipses and arcs of them on synthetic pictures: recall, precision, error over the Cramer-Rao bound (levels
// and blur known), honesty of the covariance, time. accuracy_arcs [PICTURES]
#include <fmt/format.h>

#include <cstdlib>
#include <ctime>

#include "accuracy/line_scenes.h"
#include "vss/feature/ellipse_fit.h"
#include "vss/geometry/rigid_transform.h"

using namespace vss;
using namespace vss::bench;

namespace {

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

// An ellipse cut by the line through `on` with the normal `keep`: what lies on that side is there.
struct TrueArc {
  Ellipse ellipse;
  Vector2d on, keep;
  bool bright;

  bool Has(const Vector2d& p) const { return (p - on).dot(keep) > 0; }
};

struct ArcScene {
  GreyImage image;
  std::vector<TrueArc> arcs;
};

constexpr int kSize = 512;
constexpr int kFine = 8;  // places a pixel, along each axis, at which the shape is asked

// Adds the arc's region, seen through blur and pixels.
void Draw(const TrueArc& arc, const Condition& c, cv::Mat& grey) {
  const int reach = static_cast<int>(arc.ellipse.axes.x() + 6 * c.blur) + 3,
            u0 = int(arc.ellipse.center.x()) - reach, v0 = int(arc.ellipse.center.y()) - reach, n = 2 * reach;
  cv::Mat fine(n * kFine, n * kFine, CV_32F), blurred, coarse;
  const double cs = std::cos(arc.ellipse.angle_rad), sn = std::sin(arc.ellipse.angle_rad);
  for (int y = 0; y < fine.rows; ++y)
    for (int x = 0; x < fine.cols; ++x) {
      const Vector2d p(u0 + (x + 0.5) / kFine - 0.5, v0 + (y + 0.5) / kFine - 0.5),
          d = p - arc.ellipse.center;
      const double a = (cs * d.x() + sn * d.y()) / arc.ellipse.axes.x(),
                   b = (-sn * d.x() + cs * d.y()) / arc.ellipse.axes.y();
      fine.at<float>(y, x) = a * a + b * b < 1 && arc.Has(p) ? 1.0f : 0.0f;
    }
  const int kernel = 2 * static_cast<int>(5 * c.blur * kFine) + 1;
  cv::GaussianBlur(fine, blurred, {kernel, kernel}, c.blur * kFine, 0, cv::BORDER_CONSTANT);
  cv::resize(blurred, coarse, {n, n}, 0, 0, cv::INTER_AREA);
  for (int v = std::max(0, v0); v < std::min(kSize, v0 + n); ++v)
    for (int u = std::max(0, u0); u < std::min(kSize, u0 + n); ++u)
      grey.at<float>(v, u) +=
          static_cast<float>((arc.bright ? 1 : -1) * c.contrast) * coarse.at<float>(v - v0, u - u0);
}

// Nine a picture, 12 to 60 px and half as wide at least; whole ones, or 40 to 60 % of the contour.
ArcScene MakeArcs(const Condition& c, bool whole, unsigned seed) {
  std::mt19937 random(seed);
  auto real = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  ArcScene scene{GreyImage(kSize, kSize, 8), {}};
  cv::Mat grey(kSize, kSize, CV_32F, cv::Scalar(120));
  for (int i = 0; i < 9; ++i) {
    TrueArc arc;
    arc.ellipse.axes.x() = real(12, 60), arc.ellipse.axes.y() = arc.ellipse.axes.x() * real(0.5, 0.85);
    arc.ellipse.angle_rad = real(-1.5, 1.5);
    const double room = 85 - arc.ellipse.axes.x() - 8;
    arc.ellipse.center = {85 + 170 * (i % 3) + real(-room, room), 85 + 170 * (i / 3) + real(-room, room)};
    arc.bright = real(0, 1) < 0.5;
    // The chord between two of the ellipse's points.
    const double from = real(0, 2 * kPi), to = from + 2 * kPi * real(0.4, 0.6);
    const Vector2d a = arc.ellipse.PointAt(from), b = arc.ellipse.PointAt(to);
    arc.on = whole ? Vector2d(arc.ellipse.center - Vector2d(1e4, 0)) : a;
    arc.keep = whole ? Vector2d(1, 0) : Vector2d(a.y() - b.y(), b.x() - a.x()).normalized();
    if (!arc.Has(arc.ellipse.PointAt(0.5 * (from + to)))) arc.keep = -arc.keep;
    if (whole) arc.keep = {1, 0};
    scene.arcs.push_back(arc);
    Draw(arc, c, grey);
  }
  std::normal_distribution<double> noise(0, c.noise);
  for (int v = 0; v < kSize; ++v)
    for (int u = 0; u < kSize; ++u)
      scene.image.Row8(v)[u] =
          static_cast<std::uint8_t>(std::clamp(std::lround(grey.at<float>(v, u) + noise(random)), 0L, 255L));
  return scene;
}

// Covariance of centre, axes and angle by the Cramer-Rao bound.
Matrix5d Bound(const TrueArc& arc, const Condition& c) {
  constexpr int kSteps = 2000;
  Matrix5d information = Matrix5d::Zero();
  for (int i = 0; i < kSteps; ++i) {
    const double t = 2 * kPi * (i + 0.5) / kSteps, step = 2 * kPi / kSteps;
    const Vector2d p = arc.ellipse.PointAt(t);
    if (!arc.Has(p)) continue;
    const double length = (arc.ellipse.PointAt(t + step / 2) - arc.ellipse.PointAt(t - step / 2)).norm();
    Vector5d j;
    arc.ellipse.Distance(p, &j);
    information += j * j.transpose() * length / std::pow(BoundPerPixel(c), 2);
  }
  return information.inverse();
}

struct Figures {
  int arcs = 0, found = 0, given = 0, right = 0;
  double center2 = 0, axes2 = 0, squared = 0, center_px2 = 0, axes_px2 = 0, bound_center = 0, bound_axes = 0,
         ms = 0;
};

void Judge(const ArcScene& scene, const std::vector<EllipticalArc>& found, const Condition& c, Figures& f) {
  constexpr double kSameCenterPx = 2, kSameAxes = 0.1;
  std::vector<char> right(found.size(), 0);
  for (const auto& t : scene.arcs) {
    ++f.arcs;
    const EllipticalArc* best = nullptr;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto& a = found[i];
      const double reach = std::max(kSameCenterPx, kSameAxes * t.ellipse.axes.x());
      if ((a.center - t.ellipse.center).norm() > reach ||
          (a.axes - t.ellipse.axes).cwiseAbs().maxCoeff() > reach)
        continue;
      right[i] = 1;
      if (!best || a.num_points > best->num_points) best = &a;
    }
    if (!best) continue;
    ++f.found;
    const Matrix5d bound = Bound(t, c);
    Vector5d e;
    e << best->center - t.ellipse.center, best->axes - t.ellipse.axes,
        std::remainder(best->angle_rad - t.ellipse.angle_rad, kPi);
    f.center2 += 0.5 * (e[0] * e[0] / bound(0, 0) + e[1] * e[1] / bound(1, 1));
    f.axes2 += 0.5 * (e[2] * e[2] / bound(2, 2) + e[3] * e[3] / bound(3, 3));
    f.center_px2 += 0.5 * e.head<2>().squaredNorm(), f.axes_px2 += 0.5 * e.segment<2>(2).squaredNorm();
    f.bound_center += 0.5 * (bound(0, 0) + bound(1, 1)), f.bound_axes += 0.5 * (bound(2, 2) + bound(3, 3));
    f.squared += e.dot(best->covariance.inverse() * e) / 5;
  }
  f.given += int(found.size());
  for (const char r : right) f.right += r;
}

}  // namespace

int main(int argc, char** argv) {
  const int pictures = argc > 1 ? std::max(1, std::atoi(argv[1])) : 6;
  fmt::print("{:44}{:>8}{:>10}{:>12}{:>10}{:>22}{:>22}{:>12}{:>8}\n", "", "recall", "precision", "centre/CR",
             "axes/CR", "centre px (CR)", "axes px (CR)", "error^2/s^2", "ms");
  for (const bool whole : {true, false}) {
    for (const Condition c :
         {Condition{80, 2, 1}, Condition{40, 2, 0.7}, Condition{80, 5, 1.5}, Condition{80, 0, 1}}) {
      Figures f;
      LineWorkspace workspace;
      for (int i = 0; i < pictures; ++i) {
        const ArcScene scene = MakeArcs(c, whole, 1000 + unsigned(i));
        constexpr int kRounds = 5;
        double best = 1e9;
        LineImage lines;
        for (int r = 0; r < kRounds; ++r) {
          const std::clock_t start = std::clock();
          DetectLines(scene.image.view(), nullptr, {}, workspace, lines);
          best = std::min(best, 1e3 * double(std::clock() - start) / CLOCKS_PER_SEC);
        }
        f.ms += best / pictures;
        Judge(scene, lines.arcs, c, f);
      }
      const double n = std::max(1, f.found);
      fmt::print("{:44}{:8.3f}{:10.3f}{:12.2f}{:10.2f}{:12.4f} ({:.4f}){:13.4f} ({:.4f}){:12.2f}{:8.2f}\n",
                 fmt::format("{}, C {} noise {} blur {}", whole ? "whole" : "40 to 60 % visible", c.contrast,
                             c.noise, c.blur),
                 double(f.found) / f.arcs, double(f.right) / std::max(1, f.given), std::sqrt(f.center2 / n),
                 std::sqrt(f.axes2 / n), std::sqrt(f.center_px2 / n), std::sqrt(f.bound_center / n),
                 std::sqrt(f.axes_px2 / n), std::sqrt(f.bound_axes / n), f.squared / n, f.ms);
    }
  }
}
