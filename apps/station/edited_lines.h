// The lines of a picture as VSS found them and as the operator changed them.
#pragma once
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manual_fit.h"
#include "vss/feature/line_image.h"

namespace vss::station {

// The lines of one picture as the operator left them.
struct EditedLines {
  LineImage found;                   // by VSS; a line's number is its index
  std::vector<bool> removed;         // of the segments of `found`
  std::vector<bool> removed_arcs;    // of the arcs of `found`
  std::map<int, LineSegment> drawn;  // by number, from kFirstDrawnLine
  std::map<int, EllipticalArc> drawn_arcs;
  std::int64_t version = 0;  // of the item with the operator's edits

  const LineSegment* Find(int line) const;       // null where there is none, or it was removed
  const EllipticalArc* FindArc(int line) const;  // likewise
};

// `found` with the operator's edits: {"removed": [...], "drawn": [...], "arcs": [...], "removed_arcs":
// [...]}, as line_commands.cc writes them. What an edit removed is known again by its place, for numbers
// change with the detector's parameters.
EditedLines WithEdits(const LineImage& found, const Json& edits, const Intrinsics& lens);

// The arc's point (img) at the angle `t` of its ellipse.
Eigen::Vector2d PointAt(const EllipticalArc& arc, double t);

// Why a line that was drawn (img) cannot be taken; empty where it can.
std::optional<std::string> BadDrawnLine(const LineSegment& drawn);

Pick PickOfSegment(int image, int line, const LineSegment& segment);
Pick PickOfArc(int image, int line, const EllipticalArc& arc);
// A line of picture `image` (or an arc, where `is_circle`) as the contour of an object. `file`: for the error
// where it is gone.
Result<Pick> MakePick(const EditedLines& lines, const std::string& file, int image, int line, int contour,
                      bool is_circle);

// The segments and arcs of a picture as Views gives them to identification: what was removed is left out,
// what was drawn is at the end. The station's numbers of the segments and of the arcs: by their index.
struct FlatLineImage {
  LineImage lines;
  std::vector<int> segment_numbers, arc_numbers;
};
FlatLineImage FlatLines(const EditedLines& lines);

// The ideal ends of a drawn line.
void Straighten(const Intrinsics& lens, LineSegment& segment);

}  // namespace vss::station
