#include "vss/identify/upright_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vss {

using Eigen::Vector3d;

namespace {

// Does a point in the face's plane lie on the face?
bool LiesOn(const SolidFace& face, const Vector3d& point) {
  return std::any_of(face.triangles.begin(), face.triangles.end(), [&](const auto& t) {
    for (std::size_t i = 0; i < 3; ++i)
      if (face.normal_in_part.dot((t[(i + 1) % 3] - t[i]).cross(point - t[i])) < 0) return false;
    return true;
  });
}

}  // namespace

Vector3d MiddleOf(const SolidFace& face) {
  Vector3d sum = Vector3d::Zero();
  for (const auto& t : face.triangles) sum += t[0] + t[1] + t[2];
  return sum / (3.0 * static_cast<double>(face.triangles.size()));
}

bool IsUpright(const SolidFace& face) {
  constexpr double kUpright = 0.02;  // of the normal
  return !face.is_cylinder && !face.triangles.empty() && std::abs(face.normal_in_part.z()) < kUpright;
}

std::optional<double> WayToWall(const SolidFace& face, const SolidFace& wall) {
  constexpr double kAgainst = -0.9986;  // 3 degrees
  if (!IsUpright(face) || !IsUpright(wall) || face.normal_in_part.dot(wall.normal_in_part) > kAgainst)
    return std::nullopt;
  const Vector3d middle = MiddleOf(face);
  const double way = face.normal_in_part.dot(wall.triangles.front()[0] - middle);
  return LiesOn(wall, middle + way * face.normal_in_part) ? std::optional(way) : std::nullopt;
}

}  // namespace vss
