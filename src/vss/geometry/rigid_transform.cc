#include "vss/geometry/rigid_transform.h"

#include <Eigen/SVD>

namespace vss {

Result<Eigen::Matrix3d> NearestRotation(const Eigen::Matrix3d& m, double tolerance) {
  if (!m.allFinite()) return InputError("a rotation with an entry that is not a number");
  const double off = (m.transpose() * m - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > tolerance) return InputError("not a rotation: its columns are off orthonormal by {:.2g}, {:g} is allowed", off, tolerance);
  if (m.determinant() < 0) return InputError("not a rotation but a reflection: its determinant is -1");
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose());
}

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + CrossMatrix(w);
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd a(rotation);
  return a.axis() * a.angle();
}

}  // namespace vss
