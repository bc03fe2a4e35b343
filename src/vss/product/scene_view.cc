#include "vss/product/scene_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "vss/identify/contour.h"
#include "vss/image/thumbnail.h"
#include "vss/product/overlay.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Eigen::AlignedBox3d BoundsOf(const Product& product) {
  Eigen::AlignedBox3d box;
  for (const auto& part : product.parts) {
    for (const auto& v : part.vertices) box.extend(v);
    for (const auto& c : part.circles) {
      box.extend(Vector3d(c.center.array() - c.radius_mm));
      box.extend(Vector3d(c.center.array() + c.radius_mm));
    }
  }
  for (const auto& u : product.unknown) {
    box.extend(Vector3d(u.center - u.extent / 2));
    box.extend(Vector3d(u.center + u.extent / 2));
  }
  return box;
}

// Every vertex, and the corners of a square about every circle.
std::vector<Vector3d> CornersOf(const Product& product) {
  std::vector<Vector3d> points;
  for (const auto& part : product.parts) {
    points.insert(points.end(), part.vertices.begin(), part.vertices.end());
    for (const auto& c : part.circles) {
      const Vector3d u = c.radius_mm * c.normal.unitOrthogonal(), v = c.normal.normalized().cross(u);
      for (const double a : {-1.0, 1.0})
        for (const double b : {-1.0, 1.0}) points.push_back(c.center + a * u + b * v);
    }
  }
  return points;
}

// Where a part's name stands: the middle of its vertices and rims.
Vector3d MiddleOf(const Part& part) {
  Eigen::AlignedBox3d box;
  for (const auto& v : part.vertices) box.extend(v);
  for (const auto& c : part.circles) box.extend(c.center);
  return box.isEmpty() ? part.world_from_part.translation : Vector3d(box.center());
}

// A round step of the grid, so that some ten lines cross the drawing.
double GridStep(double extent_mm) {
  for (const double step : {50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0})
    if (extent_mm / step <= 12) return step;
  return 10000;
}

std::string Line(const Vector2d& a, const Vector2d& b, const std::string& style) {
  return fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>", a.x(), a.y(), b.x(), b.y(), style);
}

std::string Text(const Vector2d& at, double size, const std::string& text, const std::string& style) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.1f}\" {}>{}</text>", at.x(), at.y(),
                     size, style, Escaped(text));
}

// ---------------------------------------------------------------------------------------------- from above

Vector2d FromAbove(const Vector3d& p) { return {p.x(), -p.y()}; }

std::string PlanGrid(const Eigen::AlignedBox2d& frame, double step_mm, double text_mm) {
  std::string out = "<g stroke=\"#d8dee6\" stroke-width=\"1\">";
  std::string labels;
  const auto first = [&](double from) { return std::ceil(from / step_mm) * step_mm; };
  const std::string style = "vector-effect=\"non-scaling-stroke\"";
  for (double x = first(frame.min().x()); x <= frame.max().x(); x += step_mm) {
    out += Line({x, frame.min().y()}, {x, frame.max().y()}, style);
    labels += Text({x, frame.max().y() - 0.3 * text_mm}, text_mm, fmt::format("{:g}", x / 1000 + 0.0),
                   "fill=\"#7a8794\" text-anchor=\"middle\"");
  }
  for (double y = first(frame.min().y()); y <= frame.max().y(); y += step_mm) {
    out += Line({frame.min().x(), y}, {frame.max().x(), y}, style);
    labels += Text({frame.min().x() + 0.3 * text_mm, y - 0.25 * text_mm}, text_mm,
                   fmt::format("{:g}", -y / 1000 + 0.0), "fill=\"#7a8794\"");
  }
  return out + "</g>" + labels;
}

// The faces that look up, flat, in the part's colour.
std::string PlanFaces(const WorldSolid& solid, const std::string& color) {
  std::string d;
  for (const auto& face : solid.faces)
    for (const auto& t : face.triangles)
      if ((t[1] - t[0]).cross(t[2] - t[0]).z() > 0)
        d += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}Z", t[0].x(), -t[0].y(), t[1].x(),
                         -t[1].y(), t[2].x(), -t[2].y());
  return fmt::format("<path d=\"{}\" fill=\"{}\" fill-opacity=\".16\" stroke=\"none\"/>", d, color);
}

// Edges and rims; what lies under another face is dashed.
std::string PlanEdges(const Part& part, const Occluders& occluders, const std::string& color) {
  constexpr double kHigh_mm = 1e6, kMargin_mm = 1;
  constexpr int kPieces = 24;
  std::string seen, hidden;
  const auto add = [&](const Vector3d& a, const Vector3d& b) {
    if ((FromAbove(a) - FromAbove(b)).norm() < 1e-6) return;
    const Vector3d middle = (a + b) / 2;
    const bool free = occluders.Free(Vector3d(middle.x(), middle.y(), kHigh_mm), middle, kMargin_mm);
    (free ? seen : hidden) += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x(), -a.y(), b.x(), -b.y());
  };
  const auto along = [&](const auto& curve) {
    for (int i = 0; i < kPieces; ++i)
      add(curve(static_cast<double>(i) / kPieces), curve((i + 1.0) / kPieces));
  };
  for (const auto& [i, j] : part.edges) {
    const Vector3d &a = part.vertices[static_cast<std::size_t>(i)],
                   &b = part.vertices[static_cast<std::size_t>(j)];
    along([&](double t) { return Vector3d(a + t * (b - a)); });
  }
  for (const auto& c : part.circles) {
    const Vector3d u = c.normal.unitOrthogonal(), v = c.normal.normalized().cross(u);
    along([&](double t) {
      return Vector3d(c.center + c.radius_mm * (std::cos(2 * kPi * t) * u + std::sin(2 * kPi * t) * v));
    });
  }
  const std::string style =
      fmt::format("fill=\"none\" stroke=\"{}\" vector-effect=\"non-scaling-stroke\"", color);
  return fmt::format("<path d=\"{}\" {} stroke-width=\"1\" stroke-dasharray=\"3 3\" stroke-opacity=\".7\"/>",
                     hidden, style) +
         fmt::format("<path d=\"{}\" {} stroke-width=\"1.7\" stroke-linecap=\"round\"/>", seen, style);
}

std::string CameraMarks(std::span<const View> views, const Eigen::AlignedBox2d& frame, double size_mm) {
  std::string d;
  for (const auto& view : views) {
    const Vector2d p = FromAbove(view.center_in_world);
    if (frame.contains(p))
      d += fmt::format("M{:.1f} {:.1f}h{:.1f}M{:.1f} {:.1f}v{:.1f}", p.x() - size_mm, p.y(), 2 * size_mm,
                       p.x(), p.y() - size_mm, 2 * size_mm);
  }
  return fmt::format(
      "<path d=\"{}\" fill=\"none\" stroke=\"#9aa7b4\" stroke-width=\"1\" "
      "vector-effect=\"non-scaling-stroke\"/>",
      d);
}

// -------------------------------------------------------------------------------------------- at an angle

// Orthographic, from the south-east and above, with a z-buffer.
class AngledRenderer {
 public:
  AngledRenderer(std::span<const Vector3d> points, int width_px, int max_height_px) : width_(width_px) {
    const double azimuth = RadFromDeg(-62), elevation = RadFromDeg(38);
    forward_ = {-std::cos(elevation) * std::cos(azimuth), -std::cos(elevation) * std::sin(azimuth),
                -std::sin(elevation)};
    right_ = forward_.cross(Vector3d::UnitZ()).normalized();
    up_ = right_.cross(forward_);
    Eigen::AlignedBox2d frame;
    for (const auto& point : points) frame.extend(Vector2d(right_.dot(point), -up_.dot(point)));
    const double margin = 0.06 * frame.sizes().maxCoeff() + 1;
    frame.min().array() -= margin;
    frame.max().array() += margin;
    scale_ = std::min(width_px / frame.sizes().x(), max_height_px / frame.sizes().y());
    width_ = static_cast<int>(std::ceil(frame.sizes().x() * scale_));
    height_ = static_cast<int>(std::ceil(frame.sizes().y() * scale_));
    origin_ = frame.min();
    const std::size_t count = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    depth_.assign(count, std::numeric_limits<float>::infinity());
    rgb_.assign(3 * count, 255);
  }

  int width() const { return width_; }
  int height() const { return height_; }

  Vector2d Place(const Vector3d& p) const {
    return (Vector2d(right_.dot(p), -up_.dot(p)) - origin_) * scale_;
  }

  // Fills a triangle nearer than what is there. `owns_depth` false: only paints (a shadow on the ground).
  void Fill(const std::array<Vector3d, 3>& t, const Eigen::Array3d& color, bool owns_depth) {
    Vector2d p[3];
    double z[3];
    for (std::size_t i = 0; i < 3; ++i) {
      p[i] = Place(t[i]);
      z[i] = forward_.dot(t[i]);
    }
    const double area = Cross(p[1] - p[0], p[2] - p[0]);
    if (std::abs(area) < 1e-9) return;
    const int u0 = std::max(0, static_cast<int>(std::floor(std::min({p[0].x(), p[1].x(), p[2].x()}))));
    const int u1 =
        std::min(width_ - 1, static_cast<int>(std::ceil(std::max({p[0].x(), p[1].x(), p[2].x()}))));
    const int v0 = std::max(0, static_cast<int>(std::floor(std::min({p[0].y(), p[1].y(), p[2].y()}))));
    const int v1 =
        std::min(height_ - 1, static_cast<int>(std::ceil(std::max({p[0].y(), p[1].y(), p[2].y()}))));
    for (int v = v0; v <= v1; ++v)
      for (int u = u0; u <= u1; ++u) {
        const Vector2d q(u, v);
        const double a = Cross(p[1] - q, p[2] - q) / area, b = Cross(p[2] - q, p[0] - q) / area,
                     c = 1 - a - b;
        if (a < 0 || b < 0 || c < 0) continue;
        const std::size_t at =
            static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(u);
        const auto depth = static_cast<float>(a * z[0] + b * z[1] + c * z[2]);
        if (depth >= depth_[at]) continue;
        if (owns_depth) depth_[at] = depth;
        for (std::size_t k = 0; k < 3; ++k)
          rgb_[3 * at + k] = static_cast<std::uint8_t>(
              std::clamp(color[static_cast<Eigen::Index>(k)], 0.0, 1.0) * 255 + 0.5);
      }
  }

  bool Visible(const Vector3d& point) const {
    constexpr double kBias_mm = 4;  // an edge lies on its faces; a pixel covers a few millimetres of them
    const Vector2d p = Place(point);
    const int u = static_cast<int>(std::lround(p.x())), v = static_cast<int>(std::lround(p.y()));
    if (u < 0 || v < 0 || u >= width_ || v >= height_) return true;
    return forward_.dot(point) <= depth_[static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) +
                                         static_cast<std::size_t>(u)] +
                                      kBias_mm + 1.5 / scale_;
  }

  // Averages blocks of `factor` pixels.
  std::vector<std::uint8_t> Shrunk(int factor, int* width, int* height) const {
    *width = width_ / factor;
    *height = height_ / factor;
    std::vector<std::uint8_t> out(static_cast<std::size_t>(3 * *width * *height));
    for (int v = 0; v < *height; ++v)
      for (int u = 0; u < *width; ++u)
        for (int k = 0; k < 3; ++k) {
          int sum = 0;
          for (int j = 0; j < factor; ++j)
            for (int i = 0; i < factor; ++i)
              sum += rgb_[static_cast<std::size_t>(3 * ((v * factor + j) * width_ + u * factor + i) + k)];
          out[static_cast<std::size_t>(3 * (v * *width + u) + k)] =
              static_cast<std::uint8_t>(sum / (factor * factor));
        }
    return out;
  }

 private:
  static double Cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

  int width_ = 0, height_ = 0;
  double scale_ = 1;
  Vector2d origin_;
  Vector3d forward_, right_, up_;
  std::vector<float> depth_;
  std::vector<std::uint8_t> rgb_;
};

Eigen::Array3d ColorOf(const std::string& hex) {
  const auto channel = [&](std::size_t at) { return std::stoi(hex.substr(at, 2), nullptr, 16) / 255.0; };
  return {channel(1), channel(3), channel(5)};
}

const Vector3d kToLight = Vector3d(-0.35, -0.55, 1).normalized();

void PaintSolid(const WorldSolid& solid, const Eigen::Array3d& color, AngledRenderer& renderer) {
  for (const auto& face : solid.faces)
    for (const auto& t : face.triangles) {
      const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
      const double light = 0.52 + 0.48 * std::max(0.0, normal.dot(kToLight));
      renderer.Fill(t, (0.35 + 0.65 * color) * light, true);
    }
}

// What the light cannot reach on the ground: every triangle, moved along the light to z = 0.
void PaintShadow(const WorldSolid& solid, AngledRenderer& renderer) {
  for (const auto& face : solid.faces)
    for (auto t : face.triangles) {
      for (auto& corner : t) corner -= kToLight * (corner.z() / kToLight.z());
      renderer.Fill(t, Eigen::Array3d(0.86, 0.875, 0.89), false);
    }
}

std::string AngledEdges(const Part& part, const AngledRenderer& renderer, double shrink) {
  constexpr int kPieces = 160;
  std::string d;
  const auto along = [&](const auto& curve) {
    bool drawing = false;
    for (int i = 0; i <= kPieces; ++i) {
      const Vector3d point = curve(static_cast<double>(i) / kPieces);
      const bool visible = renderer.Visible(point);
      const Vector2d p = renderer.Place(point) / shrink;
      if (visible && !drawing) d += fmt::format("M{:.1f} {:.1f}", p.x(), p.y());
      if (visible && drawing &&
          (i == kPieces || !renderer.Visible(curve((i + 1.0) / kPieces)) || part.edges.empty() || i % 8 == 0))
        d += fmt::format("L{:.1f} {:.1f}", p.x(), p.y());
      drawing = visible;
    }
  };
  for (const auto& [i, j] : part.edges) {
    const Vector3d &a = part.vertices[static_cast<std::size_t>(i)],
                   &b = part.vertices[static_cast<std::size_t>(j)];
    along([&](double t) { return Vector3d(a + t * (b - a)); });
  }
  for (const auto& c : part.circles) {
    const Vector3d u = c.normal.unitOrthogonal(), v = c.normal.normalized().cross(u);
    along([&](double t) {
      return Vector3d(c.center + c.radius_mm * (std::cos(2 * kPi * t) * u + std::sin(2 * kPi * t) * v));
    });
  }
  return fmt::format(
      "<path d=\"{}\" fill=\"none\" stroke=\"#1d2733\" stroke-width=\"1.1\" stroke-linecap=\"round\"/>", d);
}

std::string Label(const Vector2d& at, const std::string& text, const std::string& color) {
  const double width = 7.2 * static_cast<double>(text.size()) + 10;
  return fmt::format(
             "<g><rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"18\" rx=\"9\" fill=\"#fff\" "
             "fill-opacity=\".9\" stroke=\"{}\"/>",
             at.x() - width / 2, at.y() - 9, width, color) +
         Text({at.x(), at.y() + 4}, 11.5, text,
              "text-anchor=\"middle\" fill=\"#1d2733\" font-weight=\"600\"") +
         "</g>";
}

}  // namespace

std::string PlanSvg(const Product& product, const std::vector<std::optional<WorldSolid>>& solids,
                    std::span<const View> views) {
  const Eigen::AlignedBox3d bounds = BoundsOf(product);
  if (bounds.isEmpty()) return {};
  const double extent_mm = std::max(bounds.sizes().x(), bounds.sizes().y());
  const double margin_mm = 0.08 * extent_mm, text_mm = 0.018 * extent_mm;
  const Eigen::AlignedBox2d frame(Vector2d(bounds.min().x() - margin_mm, -bounds.max().y() - margin_mm),
                                  Vector2d(bounds.max().x() + margin_mm, -bounds.min().y() + margin_mm));
  std::string out = fmt::format(
      "<svg class=\"plan\" role=\"img\" aria-label=\"Plan of the workpiece\" viewBox=\"{:.1f} {:.1f} {:.1f} "
      "{:.1f}\">",
      frame.min().x(), frame.min().y(), frame.sizes().x(), frame.sizes().y());
  out += PlanGrid(frame, GridStep(extent_mm), text_mm);
  out += CameraMarks(views, frame, 0.6 * text_mm);
  Occluders occluders;
  for (std::size_t i = 0; i < solids.size(); ++i)
    if (solids[i]) occluders.Add(*solids[i], static_cast<int>(i));
  for (std::size_t i = 0; i < solids.size(); ++i)
    if (solids[i]) out += PlanFaces(*solids[i], PartColor(static_cast<int>(i)));
  for (std::size_t i = 0; i < product.parts.size(); ++i)
    out += PlanEdges(product.parts[i], occluders, PartColor(static_cast<int>(i)));
  for (const auto& seam : product.seams)
    out += Line(
        FromAbove(seam.start), FromAbove(seam.end),
        "stroke=\"#d40000\" stroke-width=\"3\" stroke-opacity=\".8\" vector-effect=\"non-scaling-stroke\"");
  for (const auto& u : product.unknown)
    out +=
        fmt::format(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
            "stroke=\"#777\" stroke-dasharray=\"6 4\" vector-effect=\"non-scaling-stroke\"/>",
            u.center.x() - u.extent.x() / 2, -u.center.y() - u.extent.y() / 2, u.extent.x(), u.extent.y()) +
        Text(FromAbove(u.center), text_mm, "unknown", "text-anchor=\"middle\" fill=\"#555\"");
  for (std::size_t i = 0; i < product.parts.size(); ++i)
    out += Text(FromAbove(MiddleOf(product.parts[i])), 1.15 * text_mm, product.parts[i].id,
                "class=\"name\" text-anchor=\"middle\" dominant-baseline=\"middle\"");
  return out + "</svg>";
}

std::string AngledSvg(const Product& product, const std::vector<std::optional<WorldSolid>>& solids) {
  const bool any = std::any_of(solids.begin(), solids.end(), [](const auto& s) { return s.has_value(); });
  if (BoundsOf(product).isEmpty() || !any) return {};
  const std::vector<Vector3d> points = CornersOf(product);
  constexpr int kWidth_px = 1200, kMaxHeight_px = 760, kSupersampling = 3;
  AngledRenderer renderer(points, kWidth_px * kSupersampling, kMaxHeight_px * kSupersampling);
  for (const auto& solid : solids)
    if (solid) PaintShadow(*solid, renderer);
  for (std::size_t i = 0; i < solids.size(); ++i)
    if (solids[i]) PaintSolid(*solids[i], ColorOf(PartColor(static_cast<int>(i))), renderer);
  int width = 0, height = 0;
  const std::vector<std::uint8_t> rgb = renderer.Shrunk(kSupersampling, &width, &height);
  std::string out = fmt::format(
      "<svg class=\"angled\" role=\"img\" aria-label=\"The workpiece at an angle\" viewBox=\"0 0 {0} "
      "{1}\"><image width=\"{0}\" height=\"{1}\" href=\"data:image/png;base64,{2}\"/>",
      width, height, Base64(EncodeRgbPng(rgb, width, height)));
  for (const auto& part : product.parts) out += AngledEdges(part, renderer, kSupersampling);
  for (std::size_t i = 0; i < product.parts.size(); ++i)
    out += Label(renderer.Place(MiddleOf(product.parts[i])) / kSupersampling, product.parts[i].id,
                 PartColor(static_cast<int>(i)));
  return out + "</svg>";
}

}  // namespace vss
