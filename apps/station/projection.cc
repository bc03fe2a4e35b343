#include "projection.h"

#include <algorithm>
#include <cmath>

namespace vss::station {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHideMarginMm = 0.5;  // a point lies on its own faces: rays stop this far before it
constexpr int kSamplesAnEdge = 24;
constexpr int kSamplesACircle = 48;
constexpr int kSamplesACut = 8;   // of the piece of a cut's outline that lies in one triangle
constexpr double kBorder = 0.25;  // of the picture's width: so far beyond the border a contour is followed
constexpr double kDrawnPx =
    0.05;  // a point that lies no farther beside the line through its neighbours is not drawn

// `points` without those that a straight line between others replaces (Douglas and Peucker 1973).
std::vector<Vector2d> Simplified(const std::vector<Vector2d>& points) {
  std::vector<bool> kept(points.size(), false);
  kept.front() = kept.back() = true;
  std::vector<std::pair<std::size_t, std::size_t>> spans = {{0, points.size() - 1}};
  while (!spans.empty()) {
    const auto [from, to] = spans.back();
    spans.pop_back();
    const Vector2d d = points[to] - points[from];
    const double length = d.norm();
    double most = kDrawnPx;
    std::size_t farthest = 0;
    for (std::size_t i = from + 1; i < to; ++i) {
      const Vector2d e = points[i] - points[from];
      const double aside = length > kDrawnPx ? std::abs(d.x() * e.y() - d.y() * e.x()) / length : e.norm();
      if (aside > most) most = aside, farthest = i;
    }
    if (farthest == 0) continue;
    kept[farthest] = true;
    spans.push_back({from, farthest});
    spans.push_back({farthest, to});
  }
  std::vector<Vector2d> out;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (kept[i]) out.push_back(points[i]);
  return out;
}

struct Drawer {
  const View& view;
  const Occluders& occluders;
  std::vector<ContourPiece> pieces;

  std::optional<Vector2d> Img(const Vector3d& p) const {
    const auto img = view.camera->intrinsics.Project(view.cam_from_world * p);
    if (!img) return std::nullopt;
    const double w = view.camera->width_px, h = view.camera->height_px, b = kBorder * w;
    if (img->x() < -b || img->y() < -b || img->x() > w + b || img->y() > h + b) return std::nullopt;
    return img;
  }

  // A polyline through `points`, cut where it leaves the picture or goes into hiding.
  void Trace(ContourSample::Source source, int index, const std::vector<Vector3d>& points) {
    ContourPiece piece;
    auto finish = [&] {
      if (piece.points.size() > 1) {
        piece.points = Simplified(piece.points);
        pieces.push_back(piece);
      }
      piece.points.clear();
    };
    auto b = Img(points.front());
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const auto a = b;
      b = Img(points[i + 1]);
      if (!a || !b) {
        finish();
        continue;
      }
      const bool hidden =
          !occluders.Free(view.center_in_world, (points[i] + points[i + 1]) / 2, kHideMarginMm);
      if (!piece.points.empty() && piece.hidden != hidden) finish();
      if (piece.points.empty()) {
        piece.source = source;
        piece.index = index;
        piece.hidden = hidden;
        piece.points.push_back(*a);
      }
      piece.points.push_back(*b);
    }
    finish();
  }

  void Edges(const WorldSolid& solid) {
    for (std::size_t i = 0; i < solid.edges.size(); ++i) {
      const Vector3d a = solid.vertices[std::size_t(solid.edges[i].start)].point,
                     b = solid.vertices[std::size_t(solid.edges[i].end)].point;
      std::vector<Vector3d> points;
      for (int k = 0; k <= kSamplesAnEdge; ++k) points.push_back(a + (b - a) * (double(k) / kSamplesAnEdge));
      Trace(ContourSample::Source::kEdge, int(i), points);
    }
  }

  void Circles(const WorldSolid& solid) {
    for (std::size_t i = 0; i < solid.circles.size(); ++i) {
      const auto& c = solid.circles[i];
      std::vector<Vector3d> points;
      for (int k = 0; k <= kSamplesACircle; ++k) {
        const double t = 2 * kPi * k / kSamplesACircle;
        points.push_back(c.center.point + c.radius_mm * (c.axis_u * std::cos(t) + c.axis_v * std::sin(t)));
      }
      Trace(ContourSample::Source::kCircle, int(i), points);
    }
  }

  void Limbs(const WorldSolid& solid) {
    if (std::none_of(solid.faces.begin(), solid.faces.end(),
                     [](const SolidFace& f) { return f.is_cylinder; }))
      return;
    std::map<std::pair<int, int>, std::vector<Vector3d>> limbs;
    for (const auto& s : SampleContour(solid, view, 8, 2))
      if (s.source == ContourSample::Source::kLimb) limbs[{s.index, s.limb_side}].push_back(s.point_in_world);
    for (const auto& [key, points] : limbs) Trace(ContourSample::Source::kLimb, key.first, points);
  }
};

}  // namespace

std::vector<ContourPiece> ProjectContour(const WorldSolid& solid, const View& view,
                                         const Occluders& occluders) {
  Drawer drawer{view, occluders, {}};
  drawer.Edges(solid);
  drawer.Circles(solid);
  drawer.Limbs(solid);
  return std::move(drawer.pieces);
}

std::vector<ContourPiece> ProjectCut(const WorldSolid& solid, const Vector3d& point, const Vector3d& normal,
                                     const View& view, const Occluders& occluders) {
  Drawer drawer{view, occluders, {}};
  for (const auto& face : solid.faces)
    for (const auto& t : face.triangles) {
      std::vector<Vector3d> ends;
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3d &a = t[i], &b = t[(i + 1) % 3];
        const double da = normal.dot(a - point), db = normal.dot(b - point);
        if ((da < 0) != (db < 0)) ends.push_back(a + da / (da - db) * (b - a));
      }
      if (ends.size() != 2) continue;
      std::vector<Vector3d> points;
      for (int k = 0; k <= kSamplesACut; ++k)
        points.push_back(ends[0] + (ends[1] - ends[0]) * (double(k) / kSamplesACut));
      drawer.Trace(ContourSample::Source::kEdge, 0, points);
    }
  return std::move(drawer.pieces);
}

ObjectDrawing DrawObject(const ObjectModel& model, std::span<const double> dimensions, int resting_pose,
                         double size_px) {
  PlacedObject object;
  object.model = &model;
  object.resting_pose = resting_pose;
  object.dimensions_mm.assign(dimensions.begin(), dimensions.end());
  const WorldSolid solid = PlaceSolid(object, false);
  Eigen::AlignedBox3d box;
  for (const auto& v : solid.vertices) box.extend(v.point);
  for (const auto& c : solid.circles)
    for (int k = 0; k < 8; ++k)
      box.extend(Vector3d(c.center.point + c.radius_mm * (c.axis_u * std::cos(k * kPi / 4) +
                                                          c.axis_v * std::sin(k * kPi / 4))));
  const double reach = std::max(box.sizes().norm(), 1.0);
  const double distance = 6 * reach;
  const Vector3d eye = box.center() + distance * Vector3d(-0.52, -0.66, 0.54).normalized();
  Eigen::Matrix3d r;
  r.row(2) = (box.center() - eye).normalized().transpose();
  r.row(0) = r.row(2).transpose().cross(Vector3d::UnitZ()).normalized().transpose();
  r.row(1) = r.row(2).transpose().cross(Vector3d(r.row(0))).transpose();
  Camera camera;
  camera.width_px = camera.height_px = int(size_px);
  camera.intrinsics.fx_px = camera.intrinsics.fy_px = 0.92 * size_px * distance / reach;
  camera.intrinsics.cx_px = camera.intrinsics.cy_px = size_px / 2;
  const View view = MakeView(0, camera, {r, -(r * eye)}, -1, nullptr);
  Occluders self;
  self.Add(solid, 0);
  ObjectDrawing drawing{ProjectContour(solid, view, self), {}};
  for (const auto& v : solid.vertices)
    drawing.vertices.push_back(view.ProjectIdeal(v.point).value_or(Vector2d::Zero()));
  return drawing;
}

Json PiecesToJson(const std::vector<ContourPiece>& pieces) {
  auto round = [](double v) { return std::round(v * 100) / 100; };
  Json list = Json::array();
  for (const auto& p : pieces) {
    Json points = Json::array();
    for (const auto& q : p.points) {
      points.push_back(round(q.x()));
      points.push_back(round(q.y()));
    }
    const char* source = p.source == ContourSample::Source::kEdge     ? "edge"
                         : p.source == ContourSample::Source::kCircle ? "circle"
                                                                      : "limb";
    list.push_back(
        {{"source", source}, {"index", p.index}, {"hidden", p.hidden}, {"points", std::move(points)}});
  }
  return list;
}

}  // namespace vss::station
