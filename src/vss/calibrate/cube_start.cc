#include "vss/calibrate/cube_start.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "vss/calibrate/board_solver.h"
#include "vss/feature/line_image.h"

namespace vss::cube {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxLines = 14;              // the longest lines of a picture: a cube shows nine edges
constexpr double kMaxScorePx = 8;          // a start is a few pixels off in the other pictures
constexpr double kMaxScoreAngle = 0.14;    // rad
constexpr double kSquareTolerance = 0.15;  // sides' ratio and cosine of a face from lines

struct Line {
  Vector2d start, end;  // normalised coordinates
};

using Quad = std::array<Vector2d, 4>;  // clockwise on the screen

std::optional<Vector2d> Crossing(const Line& a, const Line& b) {
  const Vector3d p = a.start.homogeneous()
                         .cross(a.end.homogeneous())
                         .cross(b.start.homogeneous().cross(b.end.homogeneous()));
  const Vector2d da = (a.end - a.start).normalized(), db = (b.end - b.start).normalized();
  if (std::abs(da.x() * db.y() - da.y() * db.x()) < 0.15) return std::nullopt;  // less than 9 degrees apart
  return Vector2d(p.x() / p.z(), p.y() / p.z());
}

// Does `line` lie along the side from a to b: most of it between them, and most of the side covered?
bool Covers(const Line& line, const Vector2d& a, const Vector2d& b) {
  const double length = (b - a).norm();
  if (!(length > 0)) return false;
  const Vector2d d = (b - a) / length;
  double s = d.dot(line.start - a) / length, e = d.dot(line.end - a) / length;
  if (s > e) std::swap(s, e);
  const double inside = std::max(0.0, std::min(e, 1.0) - std::max(s, 0.0));
  return inside > 0.55 && e - s < inside + 0.25;
}

std::vector<Quad> FindQuads(const std::vector<Line>& lines) {
  const int n = static_cast<int>(lines.size());
  std::vector<Quad> quads;
  for (int a = 0; a < n; ++a)
    for (int b = a + 1; b < n; ++b)
      for (int c = b + 1; c < n; ++c)
        for (int d = c + 1; d < n; ++d)
          for (const auto& order : {std::array{a, b, c, d}, std::array{a, c, b, d}, std::array{a, b, d, c}}) {
            Quad q;
            bool ok = true;
            for (int i = 0; i < 4 && ok; ++i) {
              const auto p = Crossing(lines[order[i]], lines[order[(i + 1) % 4]]);
              ok = p.has_value() && p->norm() < 10;
              if (ok) q[i] = *p;
            }
            // Corner i closes line i: line i runs from corner i-1 to corner i.
            for (int i = 0; i < 4 && ok; ++i) ok = Covers(lines[order[i]], q[(i + 3) % 4], q[i]);
            if (!ok) continue;
            double turns[4];
            for (int i = 0; i < 4; ++i) {
              const Vector2d u = q[(i + 1) % 4] - q[i], v = q[(i + 2) % 4] - q[(i + 1) % 4];
              turns[i] = u.x() * v.y() - u.y() * v.x();
            }
            const bool clockwise = turns[0] > 0;
            if (!std::all_of(turns, turns + 4, [&](double t) { return (t > 0) == clockwise; })) continue;
            if (!clockwise) std::reverse(q.begin(), q.end());
            quads.push_back(q);
          }
  return quads;
}

// The pose of a unit square whose corners are seen at q; empty where q is no picture of a square.
std::optional<RigidTransform> PoseOfSquare(const Quad& q, double size) {
  const auto h = HomographyFromMarks({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {q.begin(), q.end()});
  if (!h) return std::nullopt;
  Matrix3d m = *h;
  if (m(2, 2) < 0) m = -m;
  const double a = m.col(0).norm(), b = m.col(1).norm();
  if (std::abs(a / b - 1) > kSquareTolerance || std::abs(m.col(0).dot(m.col(1)) / (a * b)) > kSquareTolerance)
    return std::nullopt;
  Matrix3d r;
  r << m.col(0) / a, m.col(1) / b, (m.col(0) / a).cross(m.col(1) / b);
  const Eigen::JacobiSVD<Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) return std::nullopt;
  return RigidTransform{rotation, m.col(2) * (2 * size / (a + b))};
}

// face_from_world, with the face's corner `first` as origin, x to the next corner, z into the cube.
RigidTransform FaceFromWorld(const Geometry& g, int face, int first) {
  const auto& c = g.face[face].corner;
  const Vector3d o = g.corner[c[first]], x = (g.corner[c[(first + 1) % 4]] - o).normalized(),
                 y = (g.corner[c[(first + 3) % 4]] - o).normalized();
  Matrix3d world_from_face;
  world_from_face << x, y, x.cross(y);
  return RigidTransform{world_from_face, o}.Inverse();
}

double LineScore(const Intrinsics& lens, const Geometry& g, const RigidTransform& pose,
                 const std::vector<Line>& lines) {
  constexpr int kSamples = 8;
  double credit = 0;
  int samples = 0;
  const double max_distance = kMaxScorePx / lens.fx_px;
  for (const VisibleEdge& visible : VisibleEdges(g, pose.Inverse().translation)) {
    const Edge& e = g.edge[visible.edge];
    const Vector3d a = pose * g.corner[e.from], b = pose * g.corner[e.to];
    if (!(a.z() > 1 && b.z() > 1)) return 0;
    const Vector2d na(a.x() / a.z(), a.y() / a.z()), nb(b.x() / b.z(), b.y() / b.z()),
        direction = (nb - na).normalized();
    const double weight =
        visible.edge_class == CubeEdgeClass::kTopInner || visible.edge_class == CubeEdgeClass::kTopOuter ? 2
                                                                                                         : 1;
    for (int i = 0; i < kSamples; ++i) {
      const Vector2d p = na + (i + 0.5) / kSamples * (nb - na);
      samples += static_cast<int>(weight);
      double best = max_distance;
      for (const Line& line : lines) {
        const Vector2d d = (line.end - line.start), u = d.normalized();
        if (std::abs(u.x() * direction.y() - u.y() * direction.x()) > kMaxScoreAngle) continue;
        const double along = u.dot(p - line.start);
        if (along < -max_distance || along > d.norm() + max_distance) continue;
        best = std::min(best, std::abs(u.x() * (p.y() - line.start.y()) - u.y() * (p.x() - line.start.x())));
      }
      credit += weight * (1 - best / max_distance);
    }
  }
  return samples > 0 ? credit / samples : 0;
}

std::vector<Line> LinesOf(const Intrinsics& lens, const GreyImage& image) {
  LineOptions options;
  options.arcs = false;
  const LineImage found = DetectLines(image.view(), &lens, options);
  std::vector<Line> lines;
  for (const auto& s : found.segments)
    lines.push_back({lens.NormalizedFromIdeal(s.ideal_start), lens.NormalizedFromIdeal(s.ideal_end)});
  std::sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) {
    return (a.end - a.start).squaredNorm() > (b.end - b.start).squaredNorm();
  });
  return lines;
}

}  // namespace

std::vector<Start> FindStarts(const Intrinsics& lens, const Geometry& g,
                              const std::vector<CubePicture>& pictures, const Matrix3d& axes) {
  std::vector<std::vector<Line>> lines;
  for (const CubePicture& p : pictures) lines.push_back(LinesOf(lens, p.image));
  const double size = (g.corner[1] - g.corner[0]).norm();
  std::vector<Start> starts;
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    const std::vector<Line> longest(lines[k].begin(),
                                    lines[k].begin() + std::min<std::size_t>(kMaxLines, lines[k].size()));
    for (const Quad& quad : FindQuads(longest)) {
      const auto cam_from_face = PoseOfSquare(quad, size);
      if (!cam_from_face) continue;
      for (int face = 0; face < 5; ++face)
        for (int first = 0; first < 4; ++first) {
          RigidTransform pose = *cam_from_face * FaceFromWorld(g, face, first);
          pose.translation += pose.rotation * (axes * pictures[k].gantry_mm);  // to displacement zero
          Start start{pose, 0};
          bool above = true;
          for (std::size_t j = 0; j < pictures.size() && above; ++j) {
            RigidTransform at = pose;
            at.translation -= at.rotation * (axes * pictures[j].gantry_mm);
            above = at.Inverse().translation.z() > 0;
            if (above) start.score += LineScore(lens, g, at, lines[j]) / pictures.size();
          }
          if (above) starts.push_back(start);
        }
    }
  }
  std::sort(starts.begin(), starts.end(), [](const Start& a, const Start& b) { return a.score > b.score; });
  std::vector<Start> distinct;
  for (const Start& s : starts) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Start& d) {
      return VectorFromRotation(d.cam_from_world.rotation * s.cam_from_world.rotation.transpose()).norm() <
                 0.1 &&
             (d.cam_from_world.Inverse().translation - s.cam_from_world.Inverse().translation).norm() <
                 0.5 * size;
    });
    if (!known) distinct.push_back(s);
    if (distinct.size() >= 24) break;
  }
  return distinct;
}

}  // namespace vss::cube
