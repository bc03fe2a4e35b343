#include <algorithm>
#include <map>

#include "vss/feature/marks_detect.h"

namespace vss::marks {
namespace {

using Eigen::Vector2d;
using Label = std::pair<int, int>;

std::map<Label, int> IndexOf(const std::vector<Mark>& marks) {
  std::map<Label, int> index;
  for (std::size_t i = 0; i < marks.size(); ++i) index[{marks[i].column, marks[i].row}] = static_cast<int>(i);
  return index;
}

struct Extent {
  int min_column = 0, max_column = 0, min_row = 0, max_row = 0;
  int columns() const { return max_column - min_column + 1; }
  int rows() const { return max_row - min_row + 1; }
};

Extent ExtentOf(const std::vector<Mark>& marks) {
  Extent e{1 << 20, -(1 << 20), 1 << 20, -(1 << 20)};
  for (const Mark& m : marks) {
    e.min_column = std::min(e.min_column, m.column), e.max_column = std::max(e.max_column, m.column);
    e.min_row = std::min(e.min_row, m.row), e.max_row = std::max(e.max_row, m.row);
  }
  return e;
}

// Is the lattice's end in direction (dc, dr) the end of the board? So it is where the next marks would lie
// well inside the picture.
bool EndsInside(const std::vector<Mark>& marks, const std::map<Label, int>& index, const Extent& e, int dc,
                int dr, int width, int height) {
  constexpr double kMarginSteps = 0.8;  // a mark that near to the border is cut, and not looked for
  int inside = 0, all = 0;
  for (const Mark& m : marks) {
    const bool at_end = dc > 0   ? m.column == e.max_column
                        : dc < 0 ? m.column == e.min_column
                        : dr > 0 ? m.row == e.max_row
                                 : m.row == e.min_row;
    const auto before = index.find({m.column - dc, m.row - dr});
    if (!at_end || before == index.end()) continue;
    const Vector2d step = m.img - marks[before->second].img, far = m.img + (1 + kMarginSteps) * step;
    ++all;
    inside += far.x() >= 0 && far.y() >= 0 && far.x() <= width - 1 && far.y() <= height - 1;
  }
  return all >= 2 && 2 * inside > all;
}

void Move(const Placement& placement, std::vector<Mark>& marks) {
  for (Mark& m : marks) {
    const auto [c, r] = placement(m.column, m.row);
    m.column = c, m.row = r;
  }
}

}  // namespace

std::array<int, 2> Placement::operator()(int c, int r) const {
  for (int i = 0; i < (quarter_turns & 3); ++i) std::swap(c, r), c = -c;
  return {c + column, r + row};
}

std::vector<LocalSteps> StepsOf(const std::vector<Mark>& marks) {
  const auto index = IndexOf(marks);
  std::vector<LocalSteps> steps(marks.size());
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const auto along = [&](int dc, int dr, Vector2d& step, bool& has) {
      const auto next = index.find({marks[i].column + dc, marks[i].row + dr}),
                 before = index.find({marks[i].column - dc, marks[i].row - dr});
      const bool n = next != index.end(), b = before != index.end();
      has = n || b;
      if (n && b)
        step = 0.5 * (marks[next->second].img - marks[before->second].img);
      else if (n)
        step = marks[next->second].img - marks[i].img;
      else if (b)
        step = marks[i].img - marks[before->second].img;
    };
    along(1, 0, steps[i].column, steps[i].has_column);
    along(0, 1, steps[i].row, steps[i].has_row);
  }
  return steps;
}

void AnchorByEnds(int width, int height, const TargetSpec& target, BoardMarks& board) {
  board.anchored = false;
  if (board.marks.empty()) return;
  const auto index = IndexOf(board.marks);
  const Extent e = ExtentOf(board.marks);
  const auto ends = [&](int dc, int dr) { return EndsInside(board.marks, index, e, dc, dr, width, height); };
  const bool low_c = ends(-1, 0), high_c = ends(1, 0), low_r = ends(0, -1), high_r = ends(0, 1);
  // Quarter-turn 1 maps columns to rows; how far each reading is from what the target says.
  const auto misfit = [&](int w, int h, bool w_complete, bool h_complete) {
    const auto axis = [](int seen, bool complete, int expected) {
      return seen > expected ? 100 * (seen - expected) : complete ? expected - seen : 0;
    };
    return axis(w, w_complete, target.columns) + axis(h, h_complete, target.rows);
  };
  const bool complete_c = low_c && high_c, complete_r = low_r && high_r;
  const int upright = misfit(e.columns(), e.rows(), complete_c, complete_r),
            turned = misfit(e.rows(), e.columns(), complete_r, complete_c);
  const bool turn =
      turned < upright || (turned == upright && (e.columns() > e.rows()) != (target.columns > target.rows));
  Placement placement{turn ? 1 : 0, 0, 0};
  const auto a = placement(e.min_column, e.min_row), b = placement(e.max_column, e.max_row);
  const int min_c = std::min(a[0], b[0]), min_r = std::min(a[1], b[1]);
  board.columns_seen = turn ? e.rows() : e.columns();
  board.rows_seen = turn ? e.columns() : e.rows();
  board.columns_complete = turn ? complete_r : complete_c;
  board.rows_complete = turn ? complete_c : complete_r;
  // The turn maps (c, r) to (-r, c): the low end of the new columns is the high end of the old rows.
  const bool low_columns = turn ? high_r : low_c, high_columns = turn ? low_r : high_c;
  const bool low_rows = turn ? low_c : low_r, high_rows = turn ? high_c : high_r;
  const bool column_known = board.columns_seen == target.columns || low_columns || high_columns;
  const bool row_known = board.rows_seen == target.rows || low_rows || high_rows;
  placement.column = -min_c + (!low_columns && high_columns ? target.columns - board.columns_seen : 0);
  placement.row = -min_r + (!low_rows && high_rows ? target.rows - board.rows_seen : 0);
  const bool turn_known = upright != turned || target.columns == target.rows;
  const bool fits = board.columns_seen <= target.columns && board.rows_seen <= target.rows;
  board.anchored = column_known && row_known && turn_known && fits;
  if (!board.anchored) placement.column = -min_c, placement.row = -min_r;
  Move(placement, board.marks);
}

}  // namespace vss::marks
