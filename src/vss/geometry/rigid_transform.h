// Rigid motions between named frames. A variable is called target_from_source; inner names cancel:
//   world_from_cam = world_from_gantry * gantry_from_cam.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "vss/base/result.h"

namespace vss {

// point_in_target = rotation * point_in_source + translation (mm).
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_source) const { return rotation * point_in_source + translation; }
  RigidTransform operator*(const RigidTransform& b) const { return {rotation * b.rotation, rotation * b.translation + translation}; }
  RigidTransform Inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
};

// The rotation nearest to `m` (in the Frobenius norm), or an error where m^T m differs from I by more than `tolerance`
// in any entry or m is a reflection. A matrix rounded by hand to three digits passes at 1e-3.
Result<Eigen::Matrix3d> NearestRotation(const Eigen::Matrix3d& m, double tolerance);

// Rotation by |w| about w (rad): the exponential map.
Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_vector_rad);
Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation);
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v);

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double DegFromRad(double rad) { return rad * 180.0 / kPi; }
inline constexpr double RadFromDeg(double deg) { return deg * kPi / 180.0; }

}  // namespace vss
