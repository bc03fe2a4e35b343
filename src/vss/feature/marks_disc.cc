// Discs: blobs of every threshold, a lattice in the metric of the discs' own ellipses, the grey-value model.
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vss/feature/marks_detect.h"
#include "vss/feature/marks_lattice.h"

namespace vss::marks {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr int kThresholds =
    24;  // between the picture's dark and light ends: a disc against its board spans several
constexpr int kMinBlobPixels = 12;          // a disc of 4 px: smaller ones are noise
constexpr double kMaxBlobShare = 0.05;      // of the picture: three by three discs hardly fit if larger
constexpr double kEllipseTolerance = 0.12;  // area against that of the ellipse with the same moments
constexpr double kMaxAxisRatio = 6;         // seen at 80 degrees of tilt

struct Blob {
  Vector2d centre;
  Matrix2d shape;  // |shape^-1 x| = 1 on the contour
  double misfit = 1;
  int levels = 1;
};

struct Component {
  double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  bool border = false;
};

std::optional<Blob> BlobOf(const Component& c, double max_pixels) {
  if (c.border || c.n < kMinBlobPixels || c.n > max_pixels) return std::nullopt;
  Blob blob;
  blob.centre = Vector2d(c.u, c.v) / c.n;
  Matrix2d second;
  second << c.uu / c.n - blob.centre.x() * blob.centre.x(), c.uv / c.n - blob.centre.x() * blob.centre.y(), 0,
      c.vv / c.n - blob.centre.y() * blob.centre.y();
  second(1, 0) = second(0, 1);
  const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(second);
  if (!(eigen.eigenvalues()[0] > 0.05) ||
      eigen.eigenvalues()[1] > kMaxAxisRatio * kMaxAxisRatio * eigen.eigenvalues()[0])
    return std::nullopt;
  blob.shape = 2 * eigen.operatorSqrt();
  blob.misfit = std::abs(c.n / (3.14159265358979 * blob.shape.determinant()) - 1);
  if (blob.misfit > kEllipseTolerance) return std::nullopt;
  return blob;
}

// The connected parts (8 neighbours) of the pixels below (`dark`) or above `threshold`.
void BlobsAt(const FloatImage& image, float threshold, bool dark, std::vector<int>& label,
             std::vector<int>& stack, std::vector<Blob>& blobs) {
  const int w = image.width, h = image.height;
  const double max_pixels = kMaxBlobShare * w * h;
  const auto in = [&](int i) { return (image.value[i] < threshold) == dark; };
  label.assign(image.value.size(), 0);
  for (int start = 0; start < w * h; ++start) {
    if (label[start] || !in(start)) continue;
    Component c;
    label[start] = 1;
    stack.assign(1, start);
    while (!stack.empty()) {
      const int i = stack.back();
      stack.pop_back();
      const int u = i % w, v = i / w;
      c.n += 1, c.u += u, c.v += v, c.uu += double(u) * u, c.uv += double(u) * v, c.vv += double(v) * v;
      c.border |= u == 0 || v == 0 || u == w - 1 || v == h - 1;
      for (int dv = -1; dv <= 1; ++dv)
        for (int du = -1; du <= 1; ++du) {
          const int uu = u + du, vv = v + dv;
          if (uu < 0 || vv < 0 || uu >= w || vv >= h || label[vv * w + uu] || !in(vv * w + uu)) continue;
          label[vv * w + uu] = 1;
          stack.push_back(vv * w + uu);
        }
    }
    if (const auto blob = BlobOf(c, max_pixels)) blobs.push_back(*blob);
  }
}

// One blob for all the levels at which it was seen: the one in the middle of them.
std::vector<Blob> Merge(const std::vector<std::vector<Blob>>& by_level) {
  std::vector<std::vector<Blob>> groups;
  for (const auto& level : by_level)
    for (const Blob& b : level) {
      const auto same = std::find_if(groups.begin(), groups.end(), [&](const auto& g) {
        return (g.back().shape.inverse() * (b.centre - g.back().centre)).norm() < 0.4;
      });
      if (same == groups.end())
        groups.push_back({b});
      else
        same->push_back(b);
    }
  std::vector<Blob> merged;
  for (auto& g : groups) {
    if (g.size() < 2) continue;  // what only one threshold shows is noise
    std::sort(g.begin(), g.end(),
              [](const Blob& a, const Blob& b) { return a.shape.determinant() < b.shape.determinant(); });
    merged.push_back(g[g.size() / 2]);
    merged.back().levels = static_cast<int>(g.size());
  }
  return merged;
}

std::vector<Blob> FindBlobs(const FloatImage& image, bool dark) {
  std::vector<float> sorted = image.value;
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 100, sorted.end());
  const float low = sorted[sorted.size() / 100];
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() * 99 / 100, sorted.end());
  const float high = sorted[sorted.size() * 99 / 100];
  std::vector<std::vector<Blob>> by_level(kThresholds);
  std::vector<int> label, stack;
  for (int i = 0; i < kThresholds; ++i)
    BlobsAt(image, low + (high - low) * (i + 0.5f) / kThresholds, dark, label, stack, by_level[i]);
  return Merge(by_level);
}

// Step of the lattice in the metric of a blob's own ellipse, seen from p: the pitch over the radius.
double StepInRadii(const Blob& p, const Blob& q) {
  return (p.shape.inverse() * (q.centre - p.centre)).norm();
}

std::vector<std::vector<int>> Neighbours(const std::vector<Blob>& blobs, double step, bool sizes_differ) {
  constexpr double kLow = 0.72, kHigh = 1.26;  // a diagonal neighbour lies at 1.41
  std::vector<std::vector<int>> near(blobs.size());
  for (std::size_t i = 0; i < blobs.size(); ++i)
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      if (i == j) continue;
      const double a = StepInRadii(blobs[i], blobs[j]) / step, b = StepInRadii(blobs[j], blobs[i]) / step;
      const auto ok = [](double x) { return x > kLow && x < kHigh; };
      if (sizes_differ ? ok(a) || ok(b) : ok(std::sqrt(a * b))) near[i].push_back(static_cast<int>(j));
    }
  return near;
}

double MedianNearestStep(const std::vector<Blob>& blobs) {
  std::vector<double> nearest;
  for (const Blob& p : blobs) {
    double best = 1e9;
    for (const Blob& q : blobs)
      if (&p != &q) best = std::min(best, std::sqrt(StepInRadii(p, q) * StepInRadii(q, p)));
    nearest.push_back(best);
  }
  std::nth_element(nearest.begin(), nearest.begin() + nearest.size() / 2, nearest.end());
  return nearest[nearest.size() / 2];
}

BoardMarks Measure(const GreyView& image, const std::vector<Blob>& blobs,
                   const std::vector<LatticeLabel>& labels, double step) {
  constexpr double kGapShare = 0.45, kMinMargin = 1.2,
                   kMaxMargin = 4.0;  // px beyond the contour that the model may look
  BoardMarks board;
  for (const LatticeLabel& label : labels) {
    const Blob& blob = blobs[label.point];
    const double minor = Eigen::SelfAdjointEigenSolver<Matrix2d>(blob.shape).eigenvalues()[0];
    const double margin = std::clamp(kGapShare * (step - 2) * minor, kMinMargin, kMaxMargin);
    const auto fit = FitDisc(image, blob.centre, blob.shape, margin);
    if (!fit) {
      ++board.num_rejected;
      continue;
    }
    Mark mark{fit->centre,
              label.column,
              label.row,
              fit->sigma_px,
              fit->blur_px,
              fit->contrast,
              std::sqrt(fit->shape.determinant()),
              0};
    board.marks.push_back(mark);
  }
  const auto steps = StepsOf(board.marks);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (!steps[i].has_column || !steps[i].has_row) continue;
    Matrix2d cell;
    cell << steps[i].column, steps[i].row;
    board.marks[i].diameter_share = 2 * board.marks[i].size_px / std::sqrt(std::abs(cell.determinant()));
  }
  return board;
}

std::vector<LatticeLabel> Label(const std::vector<Blob>& blobs, const TargetSpec& target, double& step) {
  if (blobs.size() < 4) return {};
  std::vector<Vector2d> points;
  for (const Blob& b : blobs) points.push_back(b.centre);
  std::vector<LatticeLabel> best;
  const double expected = target.diameter_mm > 0 ? 2 * target.pitch_mm / target.diameter_mm : 0,
               seen = MedianNearestStep(blobs);
  // What is seen first: a wrong diameter in the target may let a diagonal pass for a row.
  for (double s : {seen, expected}) {
    if (!(s > 2)) continue;  // discs that touch
    auto labels = LabelLattice(points, Neighbours(blobs, s, !target.distinguished.empty()));
    if (labels.size() > best.size()) best = std::move(labels), step = s;
  }
  return best;
}

// Three discs of another size say which mark is which, and whether the board is seen in a mirror.
void AnchorByDistinguished(const TargetSpec& target, BoardMarks& board) {
  std::vector<double> shares;
  for (const Mark& m : board.marks)
    if (m.diameter_share > 0) shares.push_back(m.diameter_share);
  if (shares.size() < 4) return;
  std::nth_element(shares.begin(), shares.begin() + shares.size() / 2, shares.end());
  const double usual = shares[shares.size() / 2],
               ratio = target.distinguished_diameter_mm / target.diameter_mm;
  const auto other = [&](const Mark& m) {
    return std::abs(m.diameter_share / usual - ratio) < std::abs(m.diameter_share / usual - 1);
  };
  int num_other = 0;
  for (const Mark& m : board.marks) num_other += other(m);
  if (num_other != static_cast<int>(target.distinguished.size())) return;  // not all in view
  const auto matches = [&](bool mirror) -> std::optional<Placement> {
    for (int k = 0; k < 4; ++k)
      for (const Mark& first : board.marks) {
        if (!other(first)) continue;
        Placement p{k, 0, 0};
        const auto at = p(mirror ? -first.column : first.column, first.row);
        p.column = target.distinguished[0][0] - at[0], p.row = target.distinguished[0][1] - at[1];
        bool all = true;
        for (const Mark& m : board.marks) {
          const auto label = p(mirror ? -m.column : m.column, m.row);
          const bool expected = std::find(target.distinguished.begin(), target.distinguished.end(), label) !=
                                target.distinguished.end();
          all &= expected == other(m) && label[0] >= 0 && label[1] >= 0 && label[0] < target.columns &&
                 label[1] < target.rows;
        }
        if (all) return p;
      }
    return std::nullopt;
  };
  if (const auto p = matches(false)) {
    for (Mark& m : board.marks) {
      const auto label = (*p)(m.column, m.row);
      m.column = label[0], m.row = label[1];
    }
    board.anchored = true;
  } else if (matches(true)) {
    board.mirrored = true;
  }
}

}  // namespace

BoardMarks FindDiscs(const GreyView& image, const TargetSpec& target) {
  constexpr int kLargeSide = 1600;  // px: beyond, discs are looked for at half the resolution
  FloatImage work = ToFloat(image);
  int halvings = 0;
  while (std::max(work.width, work.height) > kLargeSide) work = Halved(work), ++halvings;
  BoardMarks best;
  for (bool dark : {true, false}) {
    auto blobs = FindBlobs(work, dark);
    for (Blob& b : blobs)
      for (int i = 0; i < halvings; ++i) b.centre = 2 * b.centre + Vector2d(0.5, 0.5), b.shape *= 2;
    double step = 0;
    const auto labels = Label(blobs, target, step);
    if (labels.size() <= best.marks.size()) continue;
    best = Measure(image, blobs, labels, step);
    best.polarity = dark ? 1 : -1;
  }
  AnchorByEnds(image.width, image.height, target, best);
  if (target.distinguished.size() >= 3) AnchorByDistinguished(target, best);
  return best;
}

}  // namespace vss::marks
