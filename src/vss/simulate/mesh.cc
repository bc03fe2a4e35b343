#include "vss/simulate/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "vss/simulate/random.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Corners = std::array<Vector3d, 3>;

constexpr double kMaxSagittaMm = 0.03;  // of a chord: some 0.005 px at 3 m and 520 px
constexpr double kOnCylinderMm = 1e-6;  // rounding of points that lie on a cylinder by construction

Vector3d NormalOf(const Corners& t) { return (t[1] - t[0]).cross(t[2] - t[0]); }

Vector3d AwayFromAxis(const SolidFace& cylinder, const Vector3d& p) {
  const Vector3d d = p - cylinder.axis_point;
  return d - cylinder.axis_direction * cylinder.axis_direction.dot(d);
}

class MeshMaker {
 public:
  explicit MeshMaker(const SimulatedScene& scene) : scene_(scene) {
    SceneMesh::Surface ground;
    ground.material = scene.ground;
    Random random(scene.seed);
    ground.texture_shift = Shift(random);
    mesh_.surfaces.push_back(ground);
    AddPlane(Vector3d::UnitZ(), Vector3d::Zero(), 0);
  }

  SceneMesh Run() {
    for (const auto& line : scene_.lines) AddLine(line);
    for (std::size_t i = 0; i < scene_.parts.size(); ++i) AddPart(static_cast<int>(i));
    for (const auto& offcut : scene_.offcuts) AddOffcut(offcut);
    for (std::size_t i = 0; i < scene_.stones.size(); ++i) AddStone(scene_.stones[i], i);
    for (const auto& cable : scene_.cables) AddCable(cable);
    FindBalls();
    return std::move(mesh_);
  }

 private:
  static Vector2d Shift(Random& random) {
    constexpr double kFarMm = 1e4;  // beyond any repetition of the texture
    return {random.Uniform(0, kFarMm), random.Uniform(0, kFarMm)};
  }

  int AddSurface(const SceneMesh::Surface& surface) {
    mesh_.surfaces.push_back(surface);
    return static_cast<int>(mesh_.surfaces.size()) - 1;
  }
  int AddPlane(const Vector3d& normal, const Vector3d& point, int surface) {
    SceneMesh::Plane plane;
    plane.normal = normal;
    plane.offset = normal.dot(point);
    plane.surface = surface;
    plane.shadow_plane = static_cast<int>(mesh_.planes.size());
    mesh_.planes.push_back(plane);
    return plane.shadow_plane;
  }

  // Around each plane's polygons, those of the planes that share its shadows included, and around each
  // caster.
  void FindBalls() {
    std::vector<Eigen::AlignedBox3d> boxes(mesh_.planes.size());
    for (const auto& t : mesh_.polygons)
      for (const Vector3d& c : t.Corners()) {
        boxes[std::size_t(t.plane)].extend(c);
        boxes[std::size_t(mesh_.planes[std::size_t(t.plane)].shadow_plane)].extend(c);
      }
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      if (boxes[i].isEmpty()) continue;
      mesh_.planes[i].middle = boxes[i].center();
      mesh_.planes[i].radius_mm = boxes[i].diagonal().norm() / 2;
    }
    mesh_.planes[0].radius_mm = std::numeric_limits<double>::infinity();
    for (auto& caster : mesh_.casters) {
      Eigen::AlignedBox3d box;
      for (const auto& t : caster.triangles)
        for (const Vector3d& c : t) box.extend(c);
      caster.middle = box.center();
      caster.radius_mm = box.diagonal().norm() / 2;
    }
  }
  void AddTriangle(int plane, const Corners& t) {
    mesh_.polygons.push_back({plane, 3, {t[0], t[1], t[2], t[2]}});
  }
  void AddCaster(std::span<const Corners> triangles) {
    SceneMesh::Caster caster;
    for (const Corners& t : triangles) {
      caster.triangles.push_back(t);
      caster.normals.push_back(NormalOf(t).normalized());
    }
    mesh_.casters.push_back(std::move(caster));
  }

  void AddLine(const PaintedLine& line) {
    SceneMesh::Surface surface = mesh_.surfaces[0];
    surface.material.albedo = line.albedo;
    const int s = AddSurface(surface);
    const int plane = AddPlane(Vector3d::UnitZ(), Vector3d::Zero(), s);
    mesh_.planes[std::size_t(plane)].shadow_plane = 0;
    const Vector2d along = (line.to - line.from).normalized(), across(-along.y(), along.x());
    const auto corner = [&](const Vector2d& end, double side) {
      const Vector2d p = end + side * line.width_mm / 2 * across;
      return Vector3d(p.x(), p.y(), 0);
    };
    const Vector3d a = corner(line.from, -1), b = corner(line.to, -1), c = corner(line.to, 1),
                   d = corner(line.from, 1);
    mesh_.polygons.push_back({plane, 4, {a, b, c, d}});
  }

  void AddPart(int index) {
    const ScenePart& part = scene_.parts[static_cast<std::size_t>(index)];
    const WorldSolid solid = PlaceSolid(part.object, false);
    Random random(scene_.seed * 1000003 + static_cast<std::uint64_t>(index) + 1);
    std::vector<Corners> coarse;
    for (const SolidFace& face : solid.faces) {
      SceneMesh::Surface surface;
      surface.part = index;
      surface.material = part.material;
      surface.texture_shift = Shift(random);
      if (face.is_cylinder)
        AddCylinder(face, surface);
      else
        AddPlaneFace(face, solid.faces, solid.world_from_part.rotation, surface);
      coarse.insert(coarse.end(), face.triangles.begin(), face.triangles.end());
    }
    AddCaster(coarse);
  }

  void AddPlaneFace(const SolidFace& face, std::span<const SolidFace> all, const Eigen::Matrix3d& axes,
                    SceneMesh::Surface surface) {
    const Vector3d& n = face.normal_in_part;  // in world, see WorldSolid
    const Vector3d seed = std::abs(n.dot(axes.col(0))) < 0.9 ? axes.col(0) : axes.col(1);
    surface.texture_u = (seed - n * n.dot(seed)).normalized();
    surface.texture_v = n.cross(surface.texture_u);
    const int plane = AddPlane(n, face.triangles[0][0], AddSurface(surface));
    for (const Corners& t : face.triangles) AddRounded(t, plane, n, all);
  }

  // The triangle, with a side that is a chord of one of the solid's cylinders bent to the arc.
  void AddRounded(const Corners& t, int plane, const Vector3d& normal, std::span<const SolidFace> all) {
    for (int side = 0; side < 3; ++side) {
      const Vector3d &a = t[side], &b = t[(side + 1) % 3], &c = t[(side + 2) % 3];
      const SolidFace* cylinder = nullptr;
      for (const SolidFace& f : all)
        if (f.is_cylinder && std::abs(std::abs(f.axis_direction.dot(normal)) - 1) < 1e-9 &&
            OnCylinder(f, a) && OnCylinder(f, b) &&
            (AwayFromAxis(f, a) - AwayFromAxis(f, b)).norm() < f.radius_mm)
          cylinder = &f;
      if (!cylinder) continue;
      const std::vector<Vector3d> arc = Arc(*cylinder, a, b);
      for (std::size_t i = 0; i + 1 < arc.size(); ++i) {
        const Corners piece{arc[i], arc[i + 1], c};
        if (NormalOf(piece).dot(normal) > 0) AddTriangle(plane, piece);
      }
      return;
    }
    AddTriangle(plane, t);
  }

  static bool OnCylinder(const SolidFace& f, const Vector3d& p) {
    return std::abs(AwayFromAxis(f, p).norm() - f.radius_mm) < kOnCylinderMm;
  }

  // Points on the cylinder from a to b, both included, as close as kMaxSagittaMm asks.
  static std::vector<Vector3d> Arc(const SolidFace& f, const Vector3d& a, const Vector3d& b) {
    const Vector3d from = AwayFromAxis(f, a), to = AwayFromAxis(f, b);
    const double angle = std::atan2(f.axis_direction.dot(from.cross(to)), from.dot(to));
    const double step = 2 * std::sqrt(2 * kMaxSagittaMm / f.radius_mm);  // sagitta = r step^2 / 8
    const int n = std::max(1, static_cast<int>(std::ceil(std::abs(angle) / step)));
    std::vector<Vector3d> points{a};
    for (int i = 1; i < n; ++i)
      points.push_back(a - from + Eigen::AngleAxisd(angle * i / n, f.axis_direction) * from);
    points.push_back(b);
    return points;
  }

  void AddCylinder(const SolidFace& face, SceneMesh::Surface surface) {
    surface.is_cylinder = true;
    surface.axis_point = face.axis_point;
    surface.axis_direction = face.axis_direction;
    surface.outward = face.is_hole ? -1 : 1;
    const int s = AddSurface(surface);
    // Facets come as pairs of triangles (a0, b0, b1), (a0, b1, a1).
    for (std::size_t i = 0; i + 1 < face.triangles.size(); i += 2) {
      const Corners &t = face.triangles[i], &next = face.triangles[i + 1];
      const std::vector<Vector3d> low = Arc(face, t[0], t[1]), high = Arc(face, next[2], t[2]);
      const auto first = mesh_.planes.size();
      for (std::size_t k = 0; k + 1 < low.size(); ++k) AddQuad(low[k], low[k + 1], high[k + 1], high[k], s);
      // What throws the shadows is coarser and may stand out a little from the finer surface.
      const double chord = (t[1] - t[0]).norm(), standing_out_mm = chord * chord / (2 * face.radius_mm);
      for (std::size_t k = first; k < mesh_.planes.size(); ++k) {
        mesh_.planes[k].shadow_plane = static_cast<int>((first + mesh_.planes.size()) / 2);
        mesh_.planes[k].shadow_from_mm += standing_out_mm;
      }
    }
  }

  void AddQuad(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d, int surface) {
    const Vector3d normal = (c - a).cross(d - b);
    if (!(normal.norm() > 0)) return;
    const int plane = AddPlane(normal.normalized(), (a + b + c + d) / 4, surface);
    mesh_.polygons.push_back({plane, 4, {a, b, c, d}});
  }

  // A closed body of triangles, each in a plane of its own.
  void AddBody(std::span<const Corners> triangles, const Material& material) {
    for (const Corners& t : triangles) {
      SceneMesh::Surface surface;
      surface.material = material;
      const Vector3d n = NormalOf(t).normalized();
      surface.texture_u = (t[1] - t[0]).normalized();
      surface.texture_v = n.cross(surface.texture_u);
      AddTriangle(AddPlane(n, t[0], AddSurface(surface)), t);
    }
    AddCaster(triangles);
  }

  void AddOffcut(const Offcut& offcut) {
    const std::size_t n = offcut.outline.size();
    const auto at = [&](std::size_t i, double z) {
      return Vector3d(offcut.outline[i % n].x(), offcut.outline[i % n].y(), offcut.base_mm + z);
    };
    std::vector<Corners> body;
    for (std::size_t i = 0; i < n; ++i) {
      body.push_back({at(i, 0), at(i + 1, 0), at(i + 1, offcut.height_mm)});
      body.push_back({at(i, 0), at(i + 1, offcut.height_mm), at(i, offcut.height_mm)});
    }
    for (std::size_t i = 1; i + 1 < n; ++i) {
      body.push_back({at(0, offcut.height_mm), at(i, offcut.height_mm), at(i + 1, offcut.height_mm)});
      body.push_back({at(0, 0), at(i + 1, 0), at(i, 0)});
    }
    AddBody(body, offcut.material);
  }

  // An octahedron knocked about.
  void AddStone(const Stone& stone, std::size_t index) {
    Random random(scene_.seed * 7919 + index);
    std::array<Vector3d, 6> p;
    const double r = stone.size_mm / 2, turn = random.Uniform(0, 2 * kPi);
    for (std::size_t i = 0; i < 4; ++i) {
      const double angle = turn + kPi / 2 * static_cast<double>(i) + random.Uniform(-0.4, 0.4);
      p[i] = {stone.place.x() + r * std::cos(angle), stone.place.y() + r * std::sin(angle),
              r * random.Uniform(0.1, 0.4)};
    }
    p[4] = {stone.place.x() + random.Uniform(-0.4, 0.4) * r, stone.place.y() + random.Uniform(-0.4, 0.4) * r,
            r * random.Uniform(0.7, 1.2)};
    p[5] = {stone.place.x(), stone.place.y(), 0};
    std::vector<Corners> body;
    for (std::size_t i = 0; i < 4; ++i) {
      body.push_back({p[i], p[(i + 1) % 4], p[4]});
      body.push_back({p[(i + 1) % 4], p[i], p[5]});
    }
    AddBody(body, {stone.albedo, 0, 0.05, 0});
  }

  void AddCable(const Cable& cable) {
    constexpr int kSides = 8, kRingsACaster = 8;
    const std::vector<Vector2d> path = SmoothPath(cable.points);
    const double r = cable.diameter_mm / 2;
    std::vector<std::array<Vector3d, kSides>> rings;
    for (std::size_t i = 0; i < path.size(); ++i) {
      const Vector2d along = (path[std::min(i + 1, path.size() - 1)] - path[i > 0 ? i - 1 : 0]).normalized();
      auto& ring = rings.emplace_back();
      for (int k = 0; k < kSides; ++k) {
        const double angle = 2 * kPi * (k + 0.5) / kSides;
        ring[std::size_t(k)] = {path[i].x() - along.y() * r * std::cos(angle),
                                path[i].y() + along.x() * r * std::cos(angle),
                                r * std::cos(kPi / kSides) + r * std::sin(angle)};
      }
    }
    SceneMesh::Surface surface;
    surface.material = {cable.albedo, 0.05, 0, 0};
    const int s = AddSurface(surface);
    const auto first_plane = mesh_.planes.size();
    std::vector<Corners> body;
    for (std::size_t i = 0; i + 1 < rings.size(); ++i) {
      for (std::size_t k = 0; k < kSides; ++k) {
        const std::size_t next = (k + 1) % kSides;
        const Vector3d &a = rings[i][k], &b = rings[i + 1][k], &c = rings[i + 1][next], &d = rings[i][next];
        AddQuad(d, c, b, a, s);
        body.push_back({d, c, b});
        body.push_back({d, b, a});
      }
      if (i % kRingsACaster == kRingsACaster - 1 || i + 2 == rings.size()) {
        AddCaster(body);  // open at its ends, where the next piece goes on
        body.clear();
      }
    }
    // A cable is too thin to show shadows; it takes those of the ground above its own height.
    const int shadow_plane = AddPlane(Vector3d::UnitZ(), Vector3d::Zero(), s);
    for (std::size_t k = first_plane; k < mesh_.planes.size(); ++k) {
      mesh_.planes[k].shadow_plane = shadow_plane;
      mesh_.planes[k].shadow_from_mm = cable.diameter_mm + 1;
    }
  }

  // Catmull and Rom's spline through the points (1974), in steps short against its bends.
  static std::vector<Vector2d> SmoothPath(const std::vector<Vector2d>& p) {
    constexpr int kSteps = 12;
    std::vector<Vector2d> path;
    const auto at = [&](std::ptrdiff_t i) {
      return p[std::size_t(std::clamp<std::ptrdiff_t>(i, 0, std::ptrdiff_t(p.size()) - 1))];
    };
    for (std::ptrdiff_t i = 0; i + 1 < std::ptrdiff_t(p.size()); ++i)
      for (int k = 0; k < kSteps; ++k) {
        const double t = double(k) / kSteps, t2 = t * t, t3 = t2 * t;
        path.push_back(0.5 * (2 * at(i) + (at(i + 1) - at(i - 1)) * t +
                              (2 * at(i - 1) - 5 * at(i) + 4 * at(i + 1) - at(i + 2)) * t2 +
                              (3 * at(i) - at(i - 1) - 3 * at(i + 1) + at(i + 2)) * t3));
      }
    path.push_back(p.back());
    return path;
  }

  const SimulatedScene& scene_;
  SceneMesh mesh_;
};

}  // namespace

SceneMesh MakeMesh(const SimulatedScene& scene) { return MeshMaker(scene).Run(); }

}  // namespace vss
