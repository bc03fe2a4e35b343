// Coded squares: the bits of the markers between the corners say which corners they are.
#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <map>

#include "vss/feature/marks_detect.h"
#include "vss/image/marker_dictionary.h"

namespace vss::marks {
namespace {

using Eigen::Vector2d;

// The unit square to the cell's four corners (Heckbert 1989).
struct Cell {
  Eigen::Matrix3d h;
  explicit Cell(const std::array<Vector2d, 4>& p) {  // (0,0) (1,0) (1,1) (0,1)
    const Vector2d s = p[0] - p[1] + p[2] - p[3], d1 = p[1] - p[2], d2 = p[3] - p[2];
    const double det = d1.x() * d2.y() - d2.x() * d1.y();
    const double g = (s.x() * d2.y() - d2.x() * s.y()) / det, k = (d1.x() * s.y() - s.x() * d1.y()) / det;
    h << p[1].x() - p[0].x() + g * p[1].x(), p[3].x() - p[0].x() + k * p[3].x(), p[0].x(),  //
        p[1].y() - p[0].y() + g * p[1].y(), p[3].y() - p[0].y() + k * p[3].y(), p[0].y(), g, k, 1;
  }
  Vector2d At(double x, double y) const { return (h * Eigen::Vector3d(x, y, 1)).hnormalized(); }
};

// The bits of a marker in the cell, in the cell's own directions; empty where its border is not dark.
std::optional<std::uint64_t> ReadBits(const FloatImage& image, const Cell& cell, double share, int side) {
  constexpr double kMinContrast = 0.08;
  const int n = side + 2;
  std::vector<double> value(n * n);
  for (int v = 0; v < n; ++v)
    for (int u = 0; u < n; ++u) {
      double sum = 0;
      for (double dv : {0.3, 0.5, 0.7})
        for (double du : {0.3, 0.5, 0.7}) {
          const Vector2d p = cell.At(0.5 + share * ((u + du) / n - 0.5), 0.5 + share * ((v + dv) / n - 0.5));
          if (!image.Inside(p.x(), p.y(), 1)) return std::nullopt;
          sum += image.Sample(p.x(), p.y());
        }
      value[v * n + u] = sum / 9;
    }
  const auto [low, high] = std::minmax_element(value.begin(), value.end());
  if (*high - *low < kMinContrast) return std::nullopt;
  const double threshold = 0.5 * (*low + *high);
  int light_border = 0;
  std::uint64_t bits = 0;
  for (int v = 0; v < n; ++v)
    for (int u = 0; u < n; ++u) {
      const bool white = value[v * n + u] > threshold;
      if (u == 0 || v == 0 || u == n - 1 || v == n - 1)
        light_border += white;
      else if (white)
        bits |= std::uint64_t{1} << ((v - 1) * side + u - 1);
    }
  if (light_border > 1) return std::nullopt;
  return bits;
}

// The bits as seen along the board's axes, for a board turned by `turns` (see Placement) and, maybe,
// mirrored.
std::uint64_t Turned(std::uint64_t bits, int side, int turns, bool mirror) {
  std::uint64_t out = 0;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      int u = x, v = y;
      for (int i = 0; i < turns; ++i) {  // the inverse of (c, r) -> (-r, c) is (x, y) -> (y, -x)
        const int before = u;
        u = v, v = side - 1 - before;
      }
      if (mirror) u = side - 1 - u;
      if (bits >> (v * side + u) & 1) out |= std::uint64_t{1} << (y * side + x);
    }
  return out;
}

// Squares with markers, in the order of their ids: (column, row) of the square, 0, 0 at the top left.
std::vector<std::array<int, 2>> MarkedSquares(const TargetSpec& t) {
  std::vector<std::array<int, 2>> squares;
  for (int r = 0; r <= t.rows; ++r)
    for (int c = 0; c <= t.columns; ++c)
      if ((c + r) % 2 == (t.first_square_white ? 0 : 1)) squares.push_back({c, r});
  return squares;
}

// How often each place of the board (quarter-turns, column, row) was voted for.
using Votes = std::map<std::array<int, 3>, int>;

// The places of the board that the marker in the cell at (column, row) allows. False: it is none of the
// board.
bool Vote(std::uint64_t bits, const MarkerDictionary& dictionary,
          const std::vector<std::array<int, 2>>& squares, int column, int row, bool mirror, Votes& votes) {
  constexpr int kMaxWrongBits = 1;
  bool any = false;
  for (int turns = 0; turns < 4; ++turns) {
    const std::uint64_t seen = Turned(bits, dictionary.side, turns, mirror);
    for (std::size_t id = 0; id < std::min(squares.size(), dictionary.bits.size()); ++id) {
      if (std::popcount(seen ^ dictionary.bits[id]) > kMaxWrongBits) continue;
      const Placement turn{turns, 0, 0};
      const auto a = turn(column, row), b = turn(column + 1, row + 1);
      ++votes[{turns, squares[id][0] - 1 - std::min(a[0], b[0]), squares[id][1] - 1 - std::min(a[1], b[1])}];
      any = true;
    }
  }
  return any;
}

Votes::const_iterator Best(const Votes& votes) {
  return std::max_element(votes.begin(), votes.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; });
}

}  // namespace

void AnchorByMarkers(const GreyView& picture, const TargetSpec& target, BoardMarks& board) {
  constexpr int kMinAgreed = 2, kMinRead = 4;
  constexpr double kMinAgreement = 0.6;  // of the markers read: the others may be texture, read by chance
  const auto dictionary = PredefinedMarkers(target.dictionary);
  const auto squares = MarkedSquares(target);
  const FloatImage image = ToFloat(picture);
  std::map<std::pair<int, int>, int> index;
  for (std::size_t i = 0; i < board.marks.size(); ++i)
    index[{board.marks[i].column, board.marks[i].row}] = static_cast<int>(i);
  Votes votes, mirrored;
  int read = 0;
  for (const auto& [label, first] : index) {
    if (!dictionary) break;
    std::array<Vector2d, 4> corner;
    bool whole = true;
    const std::array<std::pair<int, int>, 4> offset{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    for (int i = 0; i < 4 && whole; ++i) {
      const auto at = index.find({label.first + offset[i].first, label.second + offset[i].second});
      whole = at != index.end();
      if (whole) corner[i] = board.marks[at->second].img;
    }
    if (!whole) continue;
    const auto bits = ReadBits(image, Cell(corner), target.marker_mm / target.pitch_mm, dictionary->side);
    if (!bits) continue;
    const bool upright = Vote(*bits, *dictionary, squares, label.first, label.second, false, votes),
               turned_over =
                   Vote(*bits, *dictionary, squares, -label.first - 1, label.second, true, mirrored);
    read += upright || turned_over;
  }
  const auto best = Best(votes), best_mirrored = Best(mirrored);
  const int agreed = best == votes.end() ? 0 : best->second,
            agreed_mirrored = best_mirrored == mirrored.end() ? 0 : best_mirrored->second;
  const auto convincing = [&](int n) { return n >= kMinAgreed && n >= kMinAgreement * read; };
  if (!convincing(agreed)) {
    board.mirrored = convincing(agreed_mirrored) && agreed_mirrored >= kMinRead;
    // Markers that are read well but place the board differently are those of another board.
    board.codes_disagree = !board.mirrored && read >= kMinRead;
    AnchorByEnds(picture.width, picture.height, target, board);
    return;
  }
  const Placement placement{best->first[0], best->first[1], best->first[2]};
  std::vector<Mark> kept;
  for (Mark m : board.marks) {
    const auto label = placement(m.column, m.row);
    m.column = label[0], m.row = label[1];
    if (label[0] >= 0 && label[1] >= 0 && label[0] < target.columns && label[1] < target.rows)
      kept.push_back(m);
    else
      ++board.num_rejected;
  }
  // A whole side of corners beyond the target's: a layout whose ids are only shifted against the board's.
  const std::size_t outside = board.marks.size() - kept.size();
  board.codes_disagree = 2 * outside >= static_cast<std::size_t>(std::min(target.columns, target.rows));
  board.marks = kept;
  board.anchored = board.by_codes = true;
  // Codes say where a corner belongs, so nothing is to be counted.
  board.columns_seen = target.columns, board.rows_seen = target.rows;
}

}  // namespace vss::marks
