#include "edited_lines.h"

#include <cmath>

#include "snap.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

Vector2d Point(const Json& j) { return {j.at(0).get<double>(), j.at(1).get<double>()}; }

LineSegment DrawnFromJson(const Json& j, const Intrinsics& lens) {
  LineSegment s;
  s.start = Point(j.at("start"));
  s.end = Point(j.at("end"));
  s.sigma_offset_px = j.value("sigma_px", 0.3);
  s.contrast = j.value("contrast", 0.0);
  s.sigma_angle_rad = std::sqrt(12.0) * s.sigma_offset_px / std::max(1.0, (s.end - s.start).norm());
  Straighten(lens, s);
  return s;
}

std::optional<EllipticalArc> DrawnArcFromJson(const Json& j, const Intrinsics& lens) {
  EllipticalArc arc;
  arc.center = Point(j.at("center"));
  arc.axes = Point(j.at("axes"));
  arc.angle_rad = j.at("angle_rad").get<double>();
  arc.from_rad = j.at("from_rad").get<double>();
  arc.to_rad = j.at("to_rad").get<double>();
  arc.contrast = j.value("contrast", 0.0);
  arc.bright_inside = j.value("bright_inside", false);
  arc.rms_distance_px = j.value("rms_px", 1.0);
  arc.num_points = j.value("points", 1);
  if (!arc.center.allFinite() || !arc.axes.allFinite() || !(arc.axes.minCoeff() > 0) ||
      !StraightenArc(lens, arc))
    return std::nullopt;
  return arc;
}

std::vector<Vector2d> ArcPoints(const EllipticalArc& a) {
  std::vector<Vector2d> points;
  constexpr int kPoints = 9;
  const Eigen::Rotation2Dd turn(a.ideal_angle_rad);
  for (int k = 0; k < kPoints; ++k) {
    const double t = a.ideal_from_rad + (a.ideal_to_rad - a.ideal_from_rad) * (k + 0.5) / kPoints;
    points.push_back(a.ideal_center +
                     turn * Vector2d(a.ideal_axes.x() * std::cos(t), a.ideal_axes.y() * std::sin(t)));
  }
  return points;
}

// Numbers of lines hold only while the detector's parameters are the same: the place decides.
constexpr double kSamePlacePx = 0.5;
bool SameSegment(const LineSegment& s, const Json& removed) {
  return (s.start - Point(removed.at("start"))).norm() < kSamePlacePx &&
         (s.end - Point(removed.at("end"))).norm() < kSamePlacePx;
}
bool SameArc(const EllipticalArc& a, const Json& removed) {
  return (a.center - Point(removed.at("center"))).norm() < kSamePlacePx &&
         (a.axes - Point(removed.at("axes"))).norm() < kSamePlacePx &&
         (PointAt(a, (a.from_rad + a.to_rad) / 2) - Point(removed.at("middle"))).norm() < kSamePlacePx;
}

}  // namespace

Vector2d PointAt(const EllipticalArc& a, double t) {
  return a.center +
         Eigen::Rotation2Dd(a.angle_rad) * Vector2d(a.axes.x() * std::cos(t), a.axes.y() * std::sin(t));
}

std::optional<std::string> BadDrawnLine(const LineSegment& s) {
  if (!s.start.allFinite() || !s.end.allFinite()) return "its ends are not numbers";
  if ((s.end - s.start).norm() < 2) return "it is shorter than 2 px";
  return std::nullopt;
}

EditedLines WithEdits(const LineImage& found, const Json& edits, const Intrinsics& lens) {
  EditedLines out;
  out.found = found;
  out.removed.assign(found.segments.size(), false);
  out.removed_arcs.assign(found.arcs.size(), false);
  for (const auto& r : edits.value("removed", Json::array()))
    for (std::size_t i = 0; i < found.segments.size(); ++i)
      if (SameSegment(found.segments[i], r)) out.removed[i] = true;
  for (const auto& r : edits.value("removed_arcs", Json::array()))
    for (std::size_t i = 0; i < found.arcs.size(); ++i)
      if (SameArc(found.arcs[i], r)) out.removed_arcs[i] = true;
  for (const auto& d : edits.value("drawn", Json::array())) {
    const LineSegment s = DrawnFromJson(d, lens);
    if (!BadDrawnLine(s)) out.drawn[d.at("line").get<int>()] = s;
  }
  for (const auto& d : edits.value("arcs", Json::array()))
    if (const auto arc = DrawnArcFromJson(d, lens)) out.drawn_arcs[d.at("line").get<int>()] = *arc;
  return out;
}

const LineSegment* EditedLines::Find(int line) const {
  if (const auto at = drawn.find(line); at != drawn.end()) return &at->second;
  if (line < 0 || std::size_t(line) >= found.segments.size() || removed[std::size_t(line)]) return nullptr;
  return &found.segments[std::size_t(line)];
}

const EllipticalArc* EditedLines::FindArc(int line) const {
  if (const auto at = drawn_arcs.find(line); at != drawn_arcs.end()) return &at->second;
  if (line < 0 || std::size_t(line) >= found.arcs.size() || removed_arcs[std::size_t(line)]) return nullptr;
  return &found.arcs[std::size_t(line)];
}

void Straighten(const Intrinsics& lens, LineSegment& s) {
  auto ideal = [&](const Vector2d& img) {
    const auto n = lens.NormalizedFromImg(img);
    return n ? lens.IdealFromNormalized(*n) : img;
  };
  s.ideal_start = ideal(s.start);
  s.ideal_end = ideal(s.end);
}

FlatLineImage FlatLines(const EditedLines& lines) {
  FlatLineImage flat{lines.found, {}, {}};
  LineImage& out = flat.lines;
  out.segments.clear();
  std::vector<int>& number = flat.segment_numbers;
  for (std::size_t i = 0; i < lines.found.segments.size(); ++i) {
    if (lines.removed[i]) continue;
    number.push_back(int(i));
    out.segments.push_back(lines.found.segments[i]);
    out.segments.back().start_junction = out.segments.back().end_junction = -1;
  }
  for (const auto& [line, segment] : lines.drawn) {
    number.push_back(line);
    out.segments.push_back(segment);
  }
  out.arcs.clear();
  for (std::size_t i = 0; i < lines.found.arcs.size(); ++i) {
    if (lines.removed_arcs[i]) continue;
    flat.arc_numbers.push_back(int(i));
    out.arcs.push_back(lines.found.arcs[i]);
  }
  for (const auto& [line, arc] : lines.drawn_arcs) {
    flat.arc_numbers.push_back(line);
    out.arcs.push_back(arc);
  }
  return flat;
}

Pick PickOfArc(int image, int line, const EllipticalArc& arc) {
  Pick pick;
  pick.image = image;
  pick.line = line;
  pick.is_circle = true;
  pick.ideal_points = ArcPoints(arc);
  pick.sigma_offset_px = std::max(0.02, arc.rms_distance_px / std::sqrt(std::max(1, arc.num_points)));
  return pick;
}

Pick PickOfSegment(int image, int line, const LineSegment& s) {
  Pick pick;
  pick.image = image;
  pick.line = line;
  pick.ideal_start = s.ideal_start;
  pick.ideal_end = s.ideal_end;
  pick.sigma_offset_px = s.sigma_offset_px;
  pick.sigma_angle_rad = s.sigma_angle_rad;
  return pick;
}

Result<Pick> MakePick(const EditedLines& lines, const std::string& file, int image, int line, int contour,
                      bool is_circle) {
  Pick pick;
  if (is_circle) {
    const EllipticalArc* arc = lines.FindArc(line);
    if (!arc) return UsageError("picture {} has no arc number {}; it may have been removed", file, line);
    pick = PickOfArc(image, line, *arc);
  } else {
    const LineSegment* segment = lines.Find(line);
    if (!segment) return UsageError("picture {} has no line number {}; it may have been removed", file, line);
    pick = PickOfSegment(image, line, *segment);
  }
  pick.contour = contour;
  return pick;
}

}  // namespace vss::station
