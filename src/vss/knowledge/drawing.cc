#include "vss/knowledge/drawing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "vss/knowledge/build_solid.h"
#include "vss/knowledge/define.h"
#include "vss/knowledge/program.h"
#include "vss/knowledge/repair.h"

namespace vss {
namespace {

constexpr double kWidth = 960, kMargin = 24;
constexpr double kSectionHeight = 340, kPoseWidth = 300, kPoseHeight = 240, kRow = 20;
constexpr int kSamplesPerEdge = 64;  // how finely a line changes from seen to hidden

std::string Escape(const std::string& text) {
  std::string out;
  for (char c : text) {
    if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '&')
      out += "&amp;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

std::string Text(double x, double y, const std::string& text, const std::string& attributes = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, attributes, Escape(text));
}

std::string Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const char* style) {
  return fmt::format("<line class=\"{}\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>\n", style,
                     a.x(), a.y(), b.x(), b.y());
}

std::string Millimetres(double mm) { return fmt::format("{:.6g}", mm); }

// --- the solid seen from a corner of the room ---

class IsometricView {
 public:
  IsometricView(const Solid& solid, const Eigen::Matrix3d& rested_from_part) : solid_(solid) {
    // Seen from the front, a little from the right and above.
    const Eigen::Matrix3d look = (Eigen::AngleAxisd(-55 * M_PI / 180, Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(-55 * M_PI / 180, Eigen::Vector3d::UnitZ()))
                                     .toRotationMatrix();
    view_from_part_ = look * rested_from_part;
    for (const SolidFace& face : solid.faces)
      for (const auto& t : face.triangles)
        triangles_.push_back({view_from_part_ * t[0], view_from_part_ * t[1], view_from_part_ * t[2]});
    for (const auto& t : triangles_)
      for (const auto& p : t) lo_ = lo_.cwiseMin(p), hi_ = hi_.cwiseMax(p);
  }

  std::string Draw(double x, double y, double width, double height) {
    scale_ = std::min(width / (hi_.x() - lo_.x()), height / (hi_.y() - lo_.y()));
    const Eigen::Vector3d middle = (lo_ + hi_) / 2;
    offset_ = Eigen::Vector2d(x + width / 2 - scale_ * middle.x(), y + height / 2 + scale_ * middle.y());
    std::string hidden, seen;
    for (const SolidEdge& e : solid_.edges) {
      if (e.weight == 0) continue;
      Curve({solid_.vertices[e.start].point_in_part, solid_.vertices[e.end].point_in_part}, seen, hidden);
    }
    for (const SolidCircle& c : solid_.circles) Curve(CirclePoints(c), seen, hidden);
    for (const SolidArc& a : solid_.arcs) Curve(ArcPoints(a), seen, hidden);
    Silhouettes(seen, hidden);
    return hidden + seen;
  }

 private:
  static std::vector<Eigen::Vector3d> CirclePoints(const SolidCircle& c) {
    const Eigen::Vector3d u = c.normal_in_part.unitOrthogonal(), v = c.normal_in_part.cross(u);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i <= 48; ++i) {
      const double a = 2 * M_PI * i / 48;
      points.push_back(c.center.point_in_part + c.radius_mm * (std::cos(a) * u + std::sin(a) * v));
    }
    return points;
  }

  std::vector<Eigen::Vector3d> ArcPoints(const SolidArc& arc) const {
    const Eigen::Vector3d m = arc.center.point_in_part;
    const Eigen::Vector3d a = solid_.vertices[arc.start].point_in_part - m,
                          b = solid_.vertices[arc.end].point_in_part - m;
    const Eigen::Vector3d n = a.cross(b).normalized();
    const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i <= 12; ++i) points.push_back(m + Eigen::AngleAxisd(angle * i / 12, n) * a);
    return points;
  }

  // Where a cylinder turns away from the eye: edges between its facets of which one is seen from behind.
  void Silhouettes(std::string& seen, std::string& hidden) {
    for (const SolidFace& face : solid_.faces) {
      if (!face.is_cylinder) continue;
      const std::size_t facets = face.triangles.size() / 2;
      const auto front = [&](std::size_t i) {
        const auto& t = face.triangles[2 * i];
        return (view_from_part_ * (t[1] - t[0]).cross(t[2] - t[0])).z() > 0;
      };
      for (std::size_t i = 0; i < facets; ++i) {
        const std::size_t next = (i + 1) % facets;
        if (front(i) == front(next)) continue;
        const auto& quad = face.triangles[2 * next];                       // a0, b0, b1
        const auto& other = face.triangles[2 * next + 1];                  // a0, b1, a1
        if ((face.triangles[2 * i][1] - quad[0]).norm() > 1e-6) continue;  // the ends of a rounding
        Curve({quad[0], other[2]}, seen, hidden);
      }
    }
  }

  void Curve(const std::vector<Eigen::Vector3d>& points_in_part, std::string& seen, std::string& hidden) {
    const std::size_t pieces = points_in_part.size() - 1;
    const int samples = std::max<int>(4, kSamplesPerEdge / static_cast<int>(pieces));
    Eigen::Vector3d start = view_from_part_ * points_in_part[0];
    bool was_hidden = false, first = true;
    for (std::size_t i = 0; i < pieces; ++i) {
      const Eigen::Vector3d a = view_from_part_ * points_in_part[i],
                            b = view_from_part_ * points_in_part[i + 1];
      for (int k = 0; k < samples; ++k) {
        const bool is_hidden = Hidden(a + (b - a) * ((k + 0.5) / samples));
        const Eigen::Vector3d here = a + (b - a) * (static_cast<double>(k) / samples);
        if (!first && is_hidden != was_hidden) {
          Stroke(start, here, was_hidden, seen, hidden);
          start = here;
        }
        was_hidden = is_hidden;
        first = false;
      }
      Stroke(start, b, was_hidden, seen, hidden);
      start = b;
      first = true;
    }
  }

  void Stroke(const Eigen::Vector3d& a, const Eigen::Vector3d& b, bool is_hidden, std::string& seen,
              std::string& hidden) const {
    (is_hidden ? hidden : seen) += Line(OnPage(a), OnPage(b), is_hidden ? "hidden" : "seen");
  }
  Eigen::Vector2d OnPage(const Eigen::Vector3d& p) const {
    return {offset_.x() + scale_ * p.x(), offset_.y() - scale_ * p.y()};
  }

  // Is there material between the point and the eye, which is far off along +z?
  bool Hidden(const Eigen::Vector3d& p) const {
    const double near = (hi_ - lo_).norm() * 1e-6;  // less is the point's own face
    for (const auto& t : triangles_) {
      const Eigen::Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
      if (std::abs(n.z()) < 1e-12) continue;
      const double z = t[0].z() + (n.x() * (t[0].x() - p.x()) + n.y() * (t[0].y() - p.y())) / n.z();
      if (z < p.z() + near) continue;
      int left = 0, right = 0;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d &a = t[i], &b = t[(i + 1) % 3];
        const double side = (b.x() - a.x()) * (p.y() - a.y()) - (b.y() - a.y()) * (p.x() - a.x());
        left += side > 0;
        right += side < 0;
      }
      if (left == 0 || right == 0) return true;
    }
    return false;
  }

  const Solid& solid_;
  Eigen::Matrix3d view_from_part_;
  std::vector<std::array<Eigen::Vector3d, 3>> triangles_;
  Eigen::Vector3d lo_ = Eigen::Vector3d::Constant(1e300), hi_ = -lo_;
  double scale_ = 1;
  Eigen::Vector2d offset_{0, 0};
};

// --- the cross section with its dimensions ---

struct ProfilePoint {
  std::string name;
  Dual u, v;
};

class SectionView {
 public:
  SectionView(const Definition& definition, const std::vector<double>& x)
      : definition_(definition), values_(EvaluateDual(definition.program, x)) {
    for (const ProfileLoop& loop : definition.extrusion.loops) {
      if (loop.is_circle) {
        const double r = values_[loop.radius].value;
        Grow(values_[loop.u].value - r, values_[loop.v].value - r);
        Grow(values_[loop.u].value + r, values_[loop.v].value + r);
      }
      for (const Corner& c : loop.corners) {
        points_.push_back({c.name, values_[c.u], values_[c.v]});
        Grow(values_[c.u].value, values_[c.v].value);
      }
    }
  }

  std::string Draw(double x, double y, double width, double height) {
    const double room = 90;  // for the dimension lines
    scale_ =
        std::min((width - 2 * room) / (hi_.x() - lo_.x()), (height - 2 * room + 40) / (hi_.y() - lo_.y()));
    const Eigen::Vector2d middle = (lo_ + hi_) / 2;
    offset_ = {x + width / 2 - scale_ * middle.x(), y + height / 2 - 20 + scale_ * middle.y()};
    std::string out = "<path class=\"section\" d=\"";
    for (const ProfileLoop& loop : definition_.extrusion.loops) out += LoopPath(loop);
    out += "\"/>\n";
    for (const ProfilePoint& p : points_) {
      const Eigen::Vector2d at = OnPage(p.u.value, p.v.value);
      out += Text(at.x() + 4, at.y() - 4, p.name, "class=\"corner\"");
    }
    return out + DimensionLines() + Radii();
  }

  // Dimensions that no line or radius shows.
  bool Shows(int dimension) const { return shown_.count(dimension) > 0; }

 private:
  void Grow(double u, double v) {
    lo_ = lo_.cwiseMin(Eigen::Vector2d(u, v));
    hi_ = hi_.cwiseMax(Eigen::Vector2d(u, v));
  }
  Eigen::Vector2d OnPage(double u, double v) const {
    return {offset_.x() + scale_ * u, offset_.y() - scale_ * v};
  }

  std::string LoopPath(const ProfileLoop& loop) const {
    if (loop.is_circle) {
      const double r = values_[loop.radius].value * scale_;
      const Eigen::Vector2d m = OnPage(values_[loop.u].value, values_[loop.v].value);
      return fmt::format("M{0:.1f} {1:.1f}a{2:.1f} {2:.1f} 0 1 0 {3:.1f} 0a{2:.1f} {2:.1f} 0 1 0 {4:.1f} 0Z ",
                         m.x() - r, m.y(), r, 2 * r, -2 * r);
    }
    std::string path;
    const std::size_t n = loop.corners.size();
    for (std::size_t i = 0; i < n; ++i) {
      const auto at = [&](std::size_t k) {
        const Corner& c = loop.corners[k % n];
        return OnPage(values_[c.u].value, values_[c.v].value);
      };
      const Eigen::Vector2d p = at(i);
      const char move = path.empty() ? 'M' : 'L';
      if (loop.corners[i].round < 0) {
        path += fmt::format("{}{:.1f} {:.1f} ", move, p.x(), p.y());
        continue;
      }
      const Eigen::Vector2d a = (at(i + n - 1) - p).normalized(), b = (at(i + 1) - p).normalized();
      const double r = values_[loop.corners[i].round].value * scale_;
      const double t = r * std::sqrt((1 + a.dot(b)) / std::max(1 - a.dot(b), 1e-9));
      const Eigen::Vector2d in = p + t * a, out = p + t * b;
      path += fmt::format("{}{:.1f} {:.1f} A{:.1f} {:.1f} 0 0 {} {:.1f} {:.1f} ", move, in.x(), in.y(), r, r,
                          a.x() * b.y() - a.y() * b.x() < 0 ? 1 : 0, out.x(), out.y());
    }
    return path + "Z ";
  }

  // A pair of corners whose distance along u or v is one dimension, whatever the others are.
  std::string DimensionLines() {
    std::string out;
    double below = 0, beside = 0;
    for (int d = 0; d < static_cast<int>(definition_.dimensions.size()); ++d) {
      for (const bool horizontal : {true, false}) {
        if (shown_.count(d)) break;
        const auto pair = PairOf(d, horizontal);
        if (!pair.first) continue;
        shown_.insert(d);
        double& level = horizontal ? below : beside;
        level += 22;
        const Eigen::Vector2d a = OnPage(pair.first->u.value, pair.first->v.value),
                              b = OnPage(pair.second->u.value, pair.second->v.value);
        const Eigen::Vector2d corner = OnPage(lo_.x(), lo_.y());
        const Eigen::Vector2d p = horizontal ? Eigen::Vector2d(a.x(), corner.y() + level)
                                             : Eigen::Vector2d(corner.x() - level, a.y());
        const Eigen::Vector2d q = horizontal ? Eigen::Vector2d(b.x(), corner.y() + level)
                                             : Eigen::Vector2d(corner.x() - level, b.y());
        out += Line(a, p, "help") + Line(b, q, "help") + Line(p, q, "dimension");
        const std::string label = definition_.dimensions[d].name;
        if (horizontal)
          out += Text((p.x() + q.x()) / 2, p.y() - 4, label, "text-anchor=\"middle\"");
        else
          out += Text(p.x() - 3, (p.y() + q.y()) / 2, label, "text-anchor=\"end\"");
      }
    }
    return out;
  }

  bool IsDimension(const Dual& difference, int d) const {
    if (difference.value < 1e-9) return false;
    for (int i = 0; i < difference.by_dimension.size(); ++i)
      if (std::abs(difference.by_dimension[i] - (i == d ? 1 : 0)) > 1e-9) return false;
    return true;
  }

  std::pair<const ProfilePoint*, const ProfilePoint*> PairOf(int d, bool horizontal) const {
    for (const ProfilePoint& p : points_)
      for (const ProfilePoint& q : points_)
        if (IsDimension(horizontal ? q.u - p.u : q.v - p.v, d)) return {&p, &q};
    return {nullptr, nullptr};
  }

  std::string Radii() {
    std::string out;
    const auto label = [&](const Dual& radius, double u, double v) {
      std::string names;
      for (int d = 0; d < radius.by_dimension.size(); ++d) {
        const double slope = radius.by_dimension[d];
        if (slope == 0) continue;
        shown_.insert(d);
        const std::string& name = definition_.dimensions[d].name;
        names += fmt::format("{}{}{}",
                             slope < 0       ? " - "
                             : names.empty() ? ""
                                             : " + ",
                             std::abs(slope) == 1     ? name
                             : std::abs(slope) == 0.5 ? name + "/2"
                                                      : fmt::format("{:.3g} {}", std::abs(slope), name),
                             "");
      }
      const Eigen::Vector2d m = OnPage(u, v);
      out += Text(m.x(), m.y(), "R " + (names.empty() ? Millimetres(radius.value) : names),
                  "text-anchor=\"middle\"");
    };
    for (const ProfileLoop& loop : definition_.extrusion.loops) {
      if (loop.is_circle)
        label(values_[loop.radius], values_[loop.u].value,
              values_[loop.v].value + (loop.is_outline ? -0.5 * values_[loop.radius].value : 0));
      for (const Corner& c : loop.corners)
        if (c.round >= 0) label(values_[c.round], values_[c.u].value, values_[c.v].value);
    }
    return out;
  }

  const Definition& definition_;
  std::vector<Dual> values_;
  std::vector<ProfilePoint> points_;
  std::set<int> shown_;
  Eigen::Vector2d lo_{1e300, 1e300}, hi_{-1e300, -1e300};
  double scale_ = 1;
  Eigen::Vector2d offset_{0, 0};
};

std::string Table(const Definition& definition, const std::vector<double>& x, double y) {
  std::string out =
      Text(kMargin, y, "dimension", "class=\"head\"") + Text(200, y, "range, mm", "class=\"head\"") +
      Text(360, y, "drawn at, mm", "class=\"head\"") + Text(480, y, "what it is", "class=\"head\"");
  for (std::size_t i = 0; i < x.size(); ++i) {
    const DimensionDef& d = definition.dimensions[i];
    const double row = y + kRow * static_cast<double>(i + 1);
    out += Text(kMargin, row, d.name) +
           Text(200, row, Millimetres(d.min_mm) + " .. " + Millimetres(d.max_mm)) +
           Text(360, row, Millimetres(x[i])) + Text(480, row, d.help);
  }
  return out;
}

constexpr const char* kStyle =
    "<style>text{font:12px sans-serif;fill:#222}.title{font-size:18px;font-weight:600}.head{fill:#666}"
    ".corner{font-size:11px;fill:#06c}.seen{stroke:#222;stroke-width:1.4;stroke-linecap:round}"
    ".hidden{stroke:#999;stroke-width:.7;stroke-dasharray:3 "
    "3}.section{fill:#dde5ee;fill-rule:evenodd;stroke:#222;stroke-width:1.4}"
    ".help{stroke:#bbb;stroke-width:.6}.dimension{stroke:#c40;stroke-width:1}</style>\n";

struct Page {
  std::string elements;
  double height = 0;
};

// One variant: title, cross section, poses, table.
Page DrawVariant(const Definition& definition) {
  const std::vector<double> x =
      UsualDimensions(definition, std::vector<std::optional<double>>(definition.dimensions.size()));
  const Solid solid = BuildSolid(definition, x);
  const int columns = 3, num_poses = static_cast<int>(definition.resting_poses.size());
  const double poses_top = 60 + kSectionHeight;
  const double table_top = poses_top + (num_poses + columns - 1) / columns * kPoseHeight + 30;
  Page page;
  page.height = table_top + kRow * static_cast<double>(x.size() + 1) + kMargin;
  std::string& out = page.elements;
  const std::string variant = definition.variant.empty() ? "" : ", " + definition.variant;
  out += Text(kMargin, 34, definition.kind + ": " + definition.title + variant, "class=\"title\"");
  const char* const across[] = {"cross section, y to the right, z up; extruded along x",
                                "cross section, x to the right, z up; extruded along y",
                                "cross section, x to the right, y up; extruded along z"};
  out += Text(kMargin, 54, across[definition.extrusion.axis], "class=\"head\"");
  out += SectionView(definition, x).Draw(kMargin, 60, kWidth - 2 * kMargin, kSectionHeight);
  for (int p = 0; p < num_poses; ++p) {
    const double left = kMargin + p % columns * kPoseWidth, top = poses_top + p / columns * kPoseHeight;
    const RestingPose& pose = definition.resting_poses[p];
    out += Text(left, top + 14, "pose " + pose.name + (definition.propped[p] ? " (held)" : ""),
                "class=\"head\"");
    out +=
        IsometricView(solid, pose.rested_from_part).Draw(left, top + 24, kPoseWidth - 20, kPoseHeight - 40);
  }
  out += Table(definition, x, table_top);
  return page;
}

}  // namespace

Result<std::string> DrawKnowledge(const std::string& text, const std::string& file) {
  VSS_ASSIGN(const std::vector<Definition> variants, Define(text, file));
  std::string pages;
  double height = 0;
  for (const Definition& definition : variants) {
    const Page page = DrawVariant(definition);
    pages += variants.size() == 1
                 ? page.elements
                 : fmt::format("<g transform=\"translate(0 {:.0f})\">\n{}</g>\n", height, page.elements);
    height += page.height;
  }
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 "
             "{0:.0f} "
             "{1:.0f}\">\n{2}<rect width=\"{0:.0f}\" height=\"{1:.0f}\" fill=\"#fff\"/>\n",
             kWidth, height, kStyle) +
         pages + "</svg>\n";
}

}  // namespace vss
