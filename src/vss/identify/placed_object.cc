#include "vss/identify/placed_object.h"

#include <cassert>
#include <cmath>

namespace vss {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Height of the lowest point of the rested solid and its derivative by the dimensions.
struct Lowest {
  double z = INFINITY;
  Eigen::RowVectorXd by_dimension;
};

Lowest FindLowest(const Solid& solid, const Matrix3d& rest, int num_dimensions) {
  Lowest lowest;
  lowest.by_dimension = Eigen::RowVectorXd::Zero(num_dimensions);
  for (const auto& v : solid.vertices) {
    const double z = rest.row(2).dot(v.point_in_part);
    if (z < lowest.z) lowest = {z, rest.row(2) * v.by_dimension};
  }
  for (const auto& c : solid.circles) {
    const double reach = std::sqrt(std::max(0.0, 1 - std::pow(rest.row(2).dot(c.normal_in_part), 2)));
    const double z = rest.row(2).dot(c.center.point_in_part) - reach * c.radius_mm;
    if (z < lowest.z) lowest = {z, rest.row(2) * c.center.by_dimension - reach * c.radius_by_dimension};
  }
  return lowest;
}

Matrix3d RotX(double a) { return Eigen::AngleAxisd(a, Vector3d::UnitX()).toRotationMatrix(); }
Matrix3d RotY(double a) { return Eigen::AngleAxisd(a, Vector3d::UnitY()).toRotationMatrix(); }
Matrix3d RotZ(double a) { return Eigen::AngleAxisd(a, Vector3d::UnitZ()).toRotationMatrix(); }

}  // namespace

Eigen::VectorXd PlacedObject::State() const {
  Eigen::VectorXd state(StateSize());
  state.head<kPlacementSize>() = placement;
  for (std::size_t i = 0; i < dimensions_mm.size(); ++i)
    state[kPlacementSize + static_cast<int>(i)] = dimensions_mm[i];
  return state;
}

void PlacedObject::SetState(const Eigen::VectorXd& state) {
  placement = state.head<kPlacementSize>();
  for (std::size_t i = 0; i < dimensions_mm.size(); ++i)
    dimensions_mm[i] = state[kPlacementSize + static_cast<int>(i)];
}

WorldSolid PlaceSolid(const PlacedObject& object, bool derivatives) {
  assert(object.model != nullptr);
  Solid solid = object.model->InstantiateUnchecked(object.dimensions_mm);
  const int n = static_cast<int>(object.dimensions_mm.size());
  const auto& p = object.placement;
  const Matrix3d& rest =
      object.model->resting_poses()[static_cast<std::size_t>(object.resting_pose)].rested_from_part;
  const Matrix3d z = RotZ(p[3]), x = RotX(p[4]), y = RotY(p[5]);
  const Matrix3d turn = z * x * y;
  const Matrix3d turn_yaw = CrossMatrix(Vector3d::UnitZ()) * turn;
  const Matrix3d turn_tilt_x = z * CrossMatrix(Vector3d::UnitX()) * x * y;
  const Matrix3d turn_tilt_y = z * x * CrossMatrix(Vector3d::UnitY()) * y;
  const Lowest lowest = FindLowest(solid, rest, n);
  const Vector3d lift(0, 0, -lowest.z);

  WorldSolid out;
  out.world_from_part = {turn * rest, turn * lift + p.head<3>()};
  auto place = [&](const SolidPoint& v) {
    const Vector3d rested = rest * v.point_in_part + lift;
    WorldPoint w;
    w.point = turn * rested + p.head<3>();
    if (!derivatives) return w;
    w.by_state.resize(3, kPlacementSize + n);
    w.by_state.leftCols<3>().setIdentity();
    w.by_state.col(3) = turn_yaw * rested;
    w.by_state.col(4) = turn_tilt_x * rested;
    w.by_state.col(5) = turn_tilt_y * rested;
    DimensionColumns by_dimension = rest * v.by_dimension;
    by_dimension.row(2) -= lowest.by_dimension;
    w.by_state.rightCols(n) = turn * by_dimension;
    return w;
  };
  out.vertices.reserve(solid.vertices.size());
  for (const auto& v : solid.vertices) out.vertices.push_back(place(v));
  out.edges = std::move(solid.edges);
  const Matrix3d& r = out.world_from_part.rotation;
  for (const auto& c : solid.circles) {
    WorldSolid::Circle circle;
    circle.center = place(c.center);
    circle.normal = r * c.normal_in_part;
    const Vector3d seed = std::abs(c.normal_in_part.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
    const Vector3d u = (seed - c.normal_in_part * c.normal_in_part.dot(seed)).normalized();
    circle.axis_u = r * u;
    circle.axis_v = r * c.normal_in_part.cross(u);
    circle.radius_mm = c.radius_mm;
    circle.plane_face = c.plane_face;
    circle.cylinder_face = c.cylinder_face;
    circle.weight = c.weight;
    if (derivatives) {
      circle.radius_by_state = Eigen::RowVectorXd::Zero(kPlacementSize + n);
      circle.radius_by_state.tail(n) = c.radius_by_dimension;
    }
    out.circles.push_back(std::move(circle));
  }
  out.faces = std::move(solid.faces);
  for (auto& f : out.faces) {
    f.normal_in_part = r * f.normal_in_part;
    f.axis_point = out.world_from_part * f.axis_point;
    f.axis_direction = r * f.axis_direction;
    for (auto& t : f.triangles)
      for (auto& v : t) v = out.world_from_part * v;
  }
  return out;
}

RelatedSolid RelatedOf(const PlacedObject& object) {
  const WorldSolid solid = PlaceSolid(object, false);
  RelatedSolid related;
  related.kind = object.model->kind();
  related.along = solid.world_from_part.rotation.col(0);
  for (const auto& f : solid.faces)
    related.triangles.insert(related.triangles.end(), f.triangles.begin(), f.triangles.end());
  return related;
}

}  // namespace vss
