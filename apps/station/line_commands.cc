// The operator's edits of a picture's lines.
#include <algorithm>
#include <cmath>

#include "edit.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

// The operator's edits of one picture's lines, as they are kept.
struct LineEdits {
  Json value;
  std::string file;
  std::shared_ptr<const EditedLines> lines;
};

Result<LineEdits> EditsOf(const Context& c, int image) {
  LineEdits out;
  VSS_ASSIGN(out.lines, c.workspace.Lines(image));
  out.file = c.workspace.image_files()[std::size_t(image)];
  const auto item = c.workspace.store().Get("lines", out.file);
  out.value = item ? *item->value
                   : Json{{"drawn", Json::array()}, {"removed", Json::array()}, {"next", kFirstDrawnLine}};
  return out;
}

int NextNumber(LineEdits& edits) {
  const int number = edits.value.value("next", kFirstDrawnLine);
  edits.value["next"] = number + 1;
  return number;
}

int Draw(LineEdits& edits, const LineSegment& s) {
  const int number = NextNumber(edits);
  edits.value["drawn"].push_back({{"line", number},
                                  {"start", {s.start.x(), s.start.y()}},
                                  {"end", {s.end.x(), s.end.y()}},
                                  {"sigma_px", s.sigma_offset_px},
                                  {"contrast", s.contrast}});
  return number;
}

void EraseNumber(Json& list, int line) {
  list.erase(std::remove_if(list.begin(), list.end(), [&](const Json& d) { return d.at("line") == line; }),
             list.end());
}

Status Remove(LineEdits& edits, int line) {
  const LineSegment* s = edits.lines->Find(line);
  if (!s) return UsageError("there is no line number {} in {}", line, edits.file);
  if (line >= kFirstDrawnLine) {
    EraseNumber(edits.value["drawn"], line);
  } else {
    edits.value["removed"].push_back(
        {{"line", line}, {"start", {s->start.x(), s->start.y()}}, {"end", {s->end.x(), s->end.y()}}});
  }
  return {};
}

Status RemoveArc(LineEdits& edits, int line) {
  const EllipticalArc* a = edits.lines->FindArc(line);
  if (!a) return UsageError("there is no curve number {} in {}", line, edits.file);
  if (line >= kFirstDrawnLine) {
    EraseNumber(edits.value["arcs"], line);
  } else {
    const Vector2d middle = PointAt(*a, (a->from_rad + a->to_rad) / 2);
    edits.value["removed_arcs"].push_back({{"line", line},
                                           {"center", {a->center.x(), a->center.y()}},
                                           {"axes", {a->axes.x(), a->axes.y()}},
                                           {"middle", {middle.x(), middle.y()}}});
  }
  return {};
}

Change ChangeOf(const LineEdits& edits, std::optional<std::int64_t> version) {
  return {"lines", edits.file, edits.value, version};
}

}  // namespace

Result<Edit> DrawLine(const Context& c) {
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  VSS_ASSIGN(const auto segment,
             c.workspace.Snap(image, PointOf(c.body.at("start")), PointOf(c.body.at("end"))));
  VSS_ASSIGN(auto edits, EditsOf(c, image));
  const int number = Draw(edits, segment);
  const bool snapped = segment.contrast > 0;
  return Edit{fmt::format("draw a line in {}", edits.file),
              {ChangeOf(edits, c.version)},
              {{"line", number}, {"snapped", snapped}, {"sigma_px", segment.sigma_offset_px}}};
}

// Three points of a curve.
Result<Edit> DrawArc(const Context& c) {
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  const Json& points = c.body.at("points");
  if (points.size() != 3) return UsageError("a curve is drawn by three points, not by {}", points.size());
  VSS_ASSIGN(const auto arc, c.workspace.SnapArc(image, {PointOf(points.at(0)), PointOf(points.at(1)),
                                                         PointOf(points.at(2))}));
  VSS_ASSIGN(auto edits, EditsOf(c, image));
  const int number = NextNumber(edits);
  edits.value["arcs"].push_back({{"line", number},
                                 {"center", {arc.center.x(), arc.center.y()}},
                                 {"axes", {arc.axes.x(), arc.axes.y()}},
                                 {"angle_rad", arc.angle_rad},
                                 {"from_rad", arc.from_rad},
                                 {"to_rad", arc.to_rad},
                                 {"contrast", arc.contrast},
                                 {"bright_inside", arc.bright_inside},
                                 {"rms_px", arc.rms_distance_px},
                                 {"points", arc.num_points}});
  return Edit{fmt::format("draw a curve in {}", edits.file),
              {ChangeOf(edits, c.version)},
              {{"line", number}, {"snapped", arc.contrast > 0}, {"rms_px", arc.rms_distance_px}}};
}

Result<Edit> RemoveLine(const Context& c) {
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  VSS_ASSIGN(auto edits, EditsOf(c, image));
  VSS_ASSIGN(const int line, IntOf(c.body, "line"));
  if (c.body.value("circle", false)) {
    VSS_RETURN_IF_ERROR(RemoveArc(edits, line));
  } else {
    VSS_RETURN_IF_ERROR(Remove(edits, line));
  }
  return Edit{fmt::format("remove a {} in {}", c.body.value("circle", false) ? "curve" : "line", edits.file),
              {ChangeOf(edits, c.version)}};
}

Result<Edit> SplitLine(const Context& c) {
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  VSS_ASSIGN(auto edits, EditsOf(c, image));
  VSS_ASSIGN(const int line, IntOf(c.body, "line"));
  const LineSegment* found = edits.lines->Find(line);
  if (!found) return UsageError("there is no line number {} in {}", line, edits.file);
  const LineSegment s = *found;
  const Vector2d at = PointOf(c.body.at("at")), d = s.end - s.start;
  const double t = (at - s.start).dot(d) / d.squaredNorm();
  if (!(t * d.norm() > 3 && (1 - t) * d.norm() > 3))
    return UsageError("split the line at least 3 px from its ends");
  VSS_RETURN_IF_ERROR(Remove(edits, line));
  LineSegment a = s, b = s;
  a.end = b.start = s.start + t * d;
  const int first = Draw(edits, a), second = Draw(edits, b);
  return Edit{fmt::format("split a line in {}", edits.file),
              {ChangeOf(edits, c.version)},
              {{"lines", {first, second}}}};
}

Result<Edit> MergeLines(const Context& c) {
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  VSS_ASSIGN(auto edits, EditsOf(c, image));
  VSS_ASSIGN(const int first, IntOf(c.body, "line"));
  VSS_ASSIGN(const int second, IntOf(c.body, "with"));
  const LineSegment *p = edits.lines->Find(first), *q = edits.lines->Find(second);
  if (!p || !q || first == second) return UsageError("two lines of {} are needed to merge them", edits.file);
  const LineSegment a = *p, b = *q;
  const Vector2d d = (a.end - a.start).normalized();
  double from = INFINITY, to = -INFINITY;
  Vector2d start = a.start, end = a.end;
  for (const auto& v : {a.start, a.end, b.start, b.end}) {
    const double t = d.dot(v);
    if (t < from) from = t, start = v;
    if (t > to) to = t, end = v;
  }
  constexpr double kMaxAside = 3;  // px that the ends of one line may lie beside the other
  const Vector2d n(-d.y(), d.x());
  if (std::max(std::abs(n.dot(b.start - a.start)), std::abs(n.dot(b.end - a.start))) >
      kMaxAside + 0.05 * (to - from))
    return UsageError("these two lines do not lie on one straight line");
  VSS_RETURN_IF_ERROR(Remove(edits, first));
  VSS_RETURN_IF_ERROR(Remove(edits, second));
  VSS_ASSIGN(const auto merged, c.workspace.Snap(image, start, end));
  const int number = Draw(edits, merged);
  return Edit{
      fmt::format("merge two lines in {}", edits.file), {ChangeOf(edits, c.version)}, {{"line", number}}};
}

// Moves one end of a line to where the operator points, along the line.
Result<Edit> ExtendLine(const Context& c) {
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  VSS_ASSIGN(auto edits, EditsOf(c, image));
  VSS_ASSIGN(const int line, IntOf(c.body, "line"));
  const LineSegment* found = edits.lines->Find(line);
  if (!found) return UsageError("there is no line number {} in {}", line, edits.file);
  LineSegment s = *found;
  const Vector2d to = PointOf(c.body.at("to")), d = (s.end - s.start).normalized();
  const Vector2d on_line = s.start + d * d.dot(to - s.start);
  if (!c.workspace.Inside(image, on_line))
    return UsageError("this line leaves the picture; extend it less far");
  ((to - s.start).norm() < (to - s.end).norm() ? s.start : s.end) = on_line;
  if ((s.end - s.start).dot(d) < 3) return UsageError("a line is at least 3 px long");
  VSS_RETURN_IF_ERROR(Remove(edits, line));
  const int number = Draw(edits, s);
  return Edit{
      fmt::format("extend a line in {}", edits.file), {ChangeOf(edits, c.version)}, {{"line", number}}};
}

}  // namespace vss::station
