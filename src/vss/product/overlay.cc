#include "vss/product/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>

#include "vss/identify/contour.h"
#include "vss/image/thumbnail.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kJpegQuality = 82;
constexpr double kSampleSpacing_px =
    6;  // a lens bends lines so little that chords of this length follow them

std::string PathOf(std::span<const Vector2d> points) {
  std::string d;
  for (std::size_t i = 0; i < points.size(); ++i)
    d += fmt::format("{}{:.2f} {:.2f}", i == 0 ? "M" : "L", points[i].x(), points[i].y());
  return d;
}

// The curve of a contour: t in [0, 1] to a world point.
using Curve = std::function<Vector3d(double)>;

// Samples a curve and cuts it where it leaves the picture or becomes hidden.
class ContourCutter {
 public:
  ContourCutter(const View& view, const Occluders& occluders, std::vector<ProjectedContour>& out)
      : view_(view), occluders_(occluders), out_(out) {}

  void Add(int part, const Curve& curve, double length_mm) {
    const int steps = StepsFor(curve, length_mm);
    std::optional<Vector2d> last = Project(curve(0));
    bool open = false;
    for (int i = 0; i < steps; ++i) {
      const std::optional<Vector2d> next = Project(curve((i + 1.0) / steps));
      if (last && next) {
        const bool hidden = Hidden(curve((i + 0.5) / steps));
        if (!open || out_.back().hidden != hidden) out_.push_back({part, hidden, {*last}});
        out_.back().points.push_back(*next);
      }
      open = last && next;
      last = next;
    }
  }

 private:
  // A point on a solid's edge lies on its faces: rays stop this far before it.
  static constexpr double kMargin_mm = 1.0;

  bool Hidden(const Vector3d& point) const {
    return !occluders_.Free(view_.center_in_world, point, kMargin_mm);
  }

  // Points a little beyond the picture are kept, so that contours run out of it.
  std::optional<Vector2d> Project(const Vector3d& point) const {
    const auto img = view_.camera->intrinsics.Project(view_.cam_from_world * point);
    const double beyond = 0.1 * std::max(view_.camera->width_px, view_.camera->height_px);
    if (!img || img->x() < -beyond || img->y() < -beyond || img->x() > view_.camera->width_px + beyond ||
        img->y() > view_.camera->height_px + beyond)
      return std::nullopt;
    return img;
  }

  int StepsFor(const Curve& curve, double length_mm) const {
    constexpr int kMin = 4, kMax = 400;
    const double depth_mm = std::max(100.0, (curve(0.5) - view_.center_in_world).norm());
    return std::clamp(
        static_cast<int>(length_mm * view_.camera->intrinsics.fx_px / depth_mm / kSampleSpacing_px), kMin,
        kMax);
  }

  const View& view_;
  const Occluders& occluders_;
  std::vector<ProjectedContour>& out_;
};

Curve StraightCurve(const Vector3d& a, const Vector3d& b) {
  return [a, b](double t) { return Vector3d(a + t * (b - a)); };
}

Curve CircleCurve(const Vector3d& center, const Vector3d& normal, double radius_mm) {
  const Vector3d u = normal.normalized().unitOrthogonal(), v = normal.normalized().cross(u);
  return [=](double t) {
    return Vector3d(center + radius_mm * (std::cos(2 * kPi * t) * u + std::sin(2 * kPi * t) * v));
  };
}

// The two lines along which a cylinder turns away from the camera, from rim to rim.
void AddLimbs(const WorldSolid& solid, int part, const View& view, ContourCutter& cutter) {
  std::map<std::pair<int, int>, std::vector<Vector3d>> limbs;
  for (const auto& sample : SampleContour(solid, view, kSampleSpacing_px, 2))
    if (sample.source == ContourSample::Source::kLimb && sample.visible)
      limbs[{sample.index, sample.limb_side}].push_back(sample.point_in_world);
  for (const auto& [key, points] : limbs)
    if (points.size() > 1)
      cutter.Add(part, StraightCurve(points.front(), points.back()), (points.back() - points.front()).norm());
}

// A straight segment as the lens bends it.
std::vector<Vector2d> BentSegment(const LineSegment& s, const Intrinsics* lens) {
  constexpr double kStraight_px =
      64;  // pieces of this length are straight to a tenth of a pixel in any usual lens
  const int pieces = lens ? 1 + static_cast<int>((s.end - s.start).norm() / kStraight_px) : 1;
  std::vector<Vector2d> points = {s.start};
  for (int i = 1; i < pieces; ++i) {
    const Vector2d ideal = s.ideal_start + (s.ideal_end - s.ideal_start) * (static_cast<double>(i) / pieces);
    if (const auto img = lens->ImgFromNormalized(lens->NormalizedFromIdeal(ideal))) points.push_back(*img);
  }
  points.push_back(s.end);
  return points;
}

std::vector<Vector2d> ArcPoints(const EllipticalArc& arc) {
  constexpr int kSteps = 48;
  std::vector<Vector2d> points;
  for (int i = 0; i <= kSteps; ++i) {
    const double t = arc.from_rad + (arc.to_rad - arc.from_rad) * i / kSteps;
    const Vector2d p(arc.axes.x() * std::cos(t), arc.axes.y() * std::sin(t));
    const double c = std::cos(arc.angle_rad), s = std::sin(arc.angle_rad);
    points.emplace_back(arc.center.x() + c * p.x() - s * p.y(), arc.center.y() + s * p.x() + c * p.y());
  }
  return points;
}

// Which part uses each line (or arc) of the picture; -1: none.
std::vector<int> UsedBy(const Product& product, int image, bool arcs, std::size_t count) {
  std::vector<int> used(count, -1);
  for (std::size_t p = 0; p < product.parts.size(); ++p)
    for (const auto& m : product.parts[p].matches)
      if (m.image == image && m.is_arc == arcs && m.line >= 0 && m.line < static_cast<int>(count))
        used[static_cast<std::size_t>(m.line)] = static_cast<int>(p);
  return used;
}

}  // namespace

std::vector<std::optional<WorldSolid>> SolidsOf(const Product& product, const KnowledgeBase& knowledge) {
  std::vector<std::optional<WorldSolid>> solids;
  for (const auto& part : product.parts) solids.push_back(SolidOfPart(part, knowledge));
  return solids;
}

std::vector<ProjectedContour> ProjectParts(const Product& product,
                                           const std::vector<std::optional<WorldSolid>>& solids,
                                           const View& view) {
  Occluders occluders;
  for (std::size_t i = 0; i < solids.size(); ++i)
    if (solids[i]) occluders.Add(*solids[i], static_cast<int>(i));
  std::vector<ProjectedContour> contours;
  ContourCutter cutter(view, occluders, contours);
  for (std::size_t i = 0; i < product.parts.size(); ++i) {
    const Part& part = product.parts[i];
    const int index = static_cast<int>(i);
    for (const auto& [a, b] : part.edges) {
      const Vector3d &start = part.vertices[static_cast<std::size_t>(a)],
                     &end = part.vertices[static_cast<std::size_t>(b)];
      cutter.Add(index, StraightCurve(start, end), (end - start).norm());
    }
    for (const auto& c : part.circles)
      cutter.Add(index, CircleCurve(c.center, c.normal, c.radius_mm), 2 * kPi * c.radius_mm);
    if (solids[i]) AddLimbs(*solids[i], index, view, cutter);
  }
  return contours;
}

std::string PartColor(int part) {
  // Twelve hues of like lightness, neighbours far apart.
  static constexpr std::array kColors = {"#2f8fff", "#ff7f0e", "#2ca866", "#e5484d", "#a46be8", "#14b8c4",
                                         "#e05fa8", "#8a9a00", "#b07040", "#5b6ee1", "#d9a400", "#3aa0a0"};
  return kColors[static_cast<std::size_t>(part) % kColors.size()];
}

std::string LineElements(const LineImage& lines, const Intrinsics* lens, const Product& product, int image) {
  std::map<int, std::string> paths;  // by part; -1: of none
  const auto segment_part = UsedBy(product, image, false, lines.segments.size());
  for (std::size_t i = 0; i < lines.segments.size(); ++i)
    paths[segment_part[i]] += PathOf(BentSegment(lines.segments[i], lens));
  const auto arc_part = UsedBy(product, image, true, lines.arcs.size());
  for (std::size_t i = 0; i < lines.arcs.size(); ++i) paths[arc_part[i]] += PathOf(ArcPoints(lines.arcs[i]));
  std::string out = "<g class=\"lines\" fill=\"none\" stroke-linecap=\"round\">";
  for (const auto& [part, d] : paths)
    out += part < 0 ? fmt::format(
                          "<path class=\"free\" d=\"{}\" stroke=\"#ffb020\" stroke-width=\"1.1\" "
                          "vector-effect=\"non-scaling-stroke\"/>",
                          d)
                    : fmt::format(
                          "<path class=\"used\" d=\"{}\" stroke=\"{}\" stroke-width=\"3.4\" "
                          "stroke-opacity=\".55\" vector-effect=\"non-scaling-stroke\"/>",
                          d, PartColor(part));
  return out + "</g>";
}

std::string ContourElements(std::span<const ProjectedContour> contours) {
  std::map<std::pair<int, bool>, std::string> paths;
  for (const auto& c : contours) paths[{c.part, c.hidden}] += PathOf(c.points);
  std::string out = "<g class=\"parts\" fill=\"none\" stroke-linejoin=\"round\">";
  for (const auto& [key, d] : paths)
    out += fmt::format(
        "<path class=\"{}\" d=\"{}\" stroke=\"{}\" stroke-width=\"1.2\"{} "
        "vector-effect=\"non-scaling-stroke\"/>",
        key.second ? "hidden" : "seen", d, PartColor(key.first),
        key.second ? " stroke-dasharray=\"4 4\" stroke-opacity=\".8\"" : "");
  return out + "</g>";
}

std::string OverlaySvg(const GreyView& picture, const std::string& elements, int max_side_px) {
  // Pixel (0, 0) is a square about (0, 0): the picture begins half a pixel before it.
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-0.5 -0.5 {0} {1}\" width=\"{0}\" height=\"{1}\">"
      "<image x=\"-0.5\" y=\"-0.5\" width=\"{0}\" height=\"{1}\" preserveAspectRatio=\"none\" "
      "href=\"{2}\"/>{3}</svg>\n",
      picture.width, picture.height, JpegDataUri(picture, max_side_px), elements);
}

std::string LineOverlaySvg(const GreyView& picture, const LineImage& lines, const Intrinsics* lens) {
  return OverlaySvg(picture, LineElements(lines, lens, {}, 0), std::max(picture.width, picture.height));
}

std::string JpegDataUri(const GreyView& picture, int max_side_px) {
  return "data:image/jpeg;base64," + Base64(EncodeJpeg(ShrinkTo(picture, max_side_px).view(), kJpegQuality));
}

std::string Base64(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8 | (k < left ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k <= left ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

std::string Escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

}  // namespace vss
