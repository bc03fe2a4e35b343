#include "vss/product/temperature.h"

namespace vss {
namespace {

constexpr double kReferenceC = 20;

// Middle of all vertices and circles, on the ground.
Eigen::Vector3d MiddleOf(const Product& product) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0;
  for (const auto& part : product.parts) {
    for (const auto& v : part.vertices) sum += v, ++n;
    for (const auto& c : part.circles) sum += c.center, ++n;
  }
  if (n > 0) sum /= n;
  sum.z() = 0;
  return sum;
}

void Scale(double factor, const Eigen::Vector3d& middle, Part& part) {
  const auto moved = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return middle + factor * (p - middle);
  };
  part.world_from_part.translation = moved(part.world_from_part.translation);
  for (auto& d : part.dimensions) d.value_mm *= factor, d.sigma_mm *= factor;
  for (auto& v : part.vertices) v = moved(v);
  for (auto& s : part.vertex_sigma) s *= factor;
  for (auto& c : part.vertex_covariance) c *= factor * factor;
  for (auto& c : part.circles) c.center = moved(c.center), c.radius_mm *= factor;
  const auto is_angle = [](Eigen::Index i) { return i >= 3 && i < 6; };
  for (Eigen::Index i = 0; i < part.covariance.rows(); ++i)
    for (Eigen::Index k = 0; k < part.covariance.cols(); ++k)
      part.covariance(i, k) *= (is_angle(i) ? 1 : factor) * (is_angle(k) ? 1 : factor);
}

}  // namespace

std::span<const ParameterOf<TemperatureOptions>> TemperatureParameters() {
  using O = TemperatureOptions;
  static const ParameterOf<O> rows[] = {
      {"temperature.workpiece_c", &O::workpiece_c, -50, 500, "C",
       "Temperature of the workpiece when the pictures were taken; all lengths are given as at 20."},
      {"temperature.expansion_ppm_per_k", &O::expansion_ppm_per_k, 0, 100, "1e-6/K",
       "How much the workpiece's material grows with each degree."},
  };
  return rows;
}

void ReduceToReferenceTemperature(const TemperatureOptions& o, Product& product) {
  if (o.workpiece_c == kReferenceC) return;
  const double factor = 1 / (1 + o.expansion_ppm_per_k * 1e-6 * (o.workpiece_c - kReferenceC));
  const Eigen::Vector3d middle = MiddleOf(product);
  for (auto& part : product.parts) Scale(factor, middle, part);
  for (auto& seam : product.seams) {
    seam.start = middle + factor * (seam.start - middle);
    seam.end = middle + factor * (seam.end - middle);
  }
  product.temperature = ReducedTemperature{o.workpiece_c, o.expansion_ppm_per_k, factor};
}

}  // namespace vss
