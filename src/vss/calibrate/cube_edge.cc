// One edge, measured across: a blurred step with a slope on both sides, fitted to the pixels of a small
// window.
#include <Eigen/Cholesky>
#include <cmath>

#include "vss/calibrate/cube.h"

namespace vss {
namespace {

using Eigen::Vector2d;

struct Sample {
  double across, grey;
};

std::vector<Sample> SamplesAround(const GreyView& image, const Vector2d& p, const Vector2d& n, double reach,
                                  double half_length) {
  std::vector<Sample> samples;
  const double r = std::hypot(reach, half_length);
  const int u0 = static_cast<int>(std::ceil(p.x() - r)), u1 = static_cast<int>(std::floor(p.x() + r));
  const int v0 = static_cast<int>(std::ceil(p.y() - r)), v1 = static_cast<int>(std::floor(p.y() + r));
  if (u0 < 0 || v0 < 0 || u1 >= image.width || v1 >= image.height) return samples;
  const double scale = 1 / image.MaxValue();
  for (int v = v0; v <= v1; ++v)
    for (int u = u0; u <= u1; ++u) {
      const Vector2d d(u - p.x(), v - p.y());
      const double s = n.dot(d), t = n.x() * d.y() - n.y() * d.x();
      if (std::abs(s) <= reach && std::abs(t) <= half_length) samples.push_back({s, scale * image.At(u, v)});
    }
  return samples;
}

// Where the smoothed gradient is strongest; places far from the middle must be the stronger for it.
double SteepestPlace(const std::vector<Sample>& samples, double reach) {
  constexpr double kBlur = 1.0, kStep = 0.25;
  double best = 0, place = 0;
  for (double s = -reach + 1.5; s <= reach - 1.5; s += kStep) {
    double response = 0, norm = 0;
    for (const Sample& x : samples) {
      const double z = (x.across - s) / kBlur;
      if (std::abs(z) > 3) continue;
      const double w = z * std::exp(-0.5 * z * z);
      response += w * x.grey, norm += std::abs(w);
    }
    const double strength = norm > 0 ? std::abs(response) / norm * (1 - 0.5 * std::abs(s) / reach) : 0;
    if (strength > best) best = strength, place = s;
  }
  return place;
}

}  // namespace

std::optional<EdgeOffset> MeasureEdge(const GreyView& image, const Vector2d& p, const Vector2d& normal,
                                      double reach_px, double half_length_px) {
  constexpr double kFitReach = 3.0;  // px: the tails of a blur of 1 px
  constexpr double kMinBlur = 0.3, kMaxBlur = 3.0, kMaxIterations = 20;
  constexpr double kMinSnr = 4;  // contrast over noise of a sample
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Matrix5 = Eigen::Matrix<double, 5, 5>;
  const Vector2d n = normal.normalized();
  double centre = 0;
  if (reach_px > kFitReach) {
    const auto wide = SamplesAround(image, p, n, reach_px, half_length_px);
    if (wide.size() < 12) return std::nullopt;
    centre = SteepestPlace(wide, reach_px);
  }
  const auto samples = SamplesAround(image, p + centre * n, n, kFitReach, half_length_px);
  if (samples.size() < 12) return std::nullopt;
  double low = 0, high = 0;
  int num_low = 0, num_high = 0;
  for (const Sample& s : samples)
    (s.across < 0 ? low : high) += s.grey, ++(s.across < 0 ? num_low : num_high);
  if (num_low == 0 || num_high == 0) return std::nullopt;
  low /= num_low, high /= num_high;
  Vector5 q(0, 0.7, 0.5 * (low + high), 0.5 * (high - low), 0);  // place, blur, level, half step, slope
  const auto evaluate = [&](const Vector5& x, Matrix5& a, Vector5& b) {
    a.setZero(), b.setZero();
    double cost = 0;
    for (const Sample& s : samples) {
      const double z = (s.across - x[0]) / (std::sqrt(2.0) * x[1]),
                   bell = std::exp(-z * z) * 2 / std::sqrt(kPi);
      const double step = std::erf(z), r = s.grey - (x[2] + x[3] * step + x[4] * s.across);
      const Vector5 g(-x[3] * bell / (std::sqrt(2.0) * x[1]), -x[3] * bell * z / x[1], 1, step, s.across);
      a += g * g.transpose(), b += r * g, cost += r * r;
    }
    return cost;
  };
  Matrix5 a, trial_a;
  Vector5 b, trial_b;
  double cost = evaluate(q, a, b), damping = 1e-3;
  for (int i = 0; i < kMaxIterations && damping < 1e6; ++i) {
    Matrix5 m = a;
    m.diagonal() *= 1 + damping;
    m.diagonal().array() += 1e-12;
    const Vector5 step = m.ldlt().solve(b), x = q + step;
    const double trial = x.allFinite() && x[1] > kMinBlur && x[1] < kMaxBlur && std::abs(x[0]) < kFitReach
                             ? evaluate(x, trial_a, trial_b)
                             : cost + 1;
    if (trial <= cost) {
      q = x, a = trial_a, b = trial_b, cost = trial, damping = std::max(1e-9, 0.1 * damping);
      if (std::abs(step[0]) < 1e-4) break;
    } else {
      damping *= 10;
    }
  }
  const double noise = std::sqrt(cost / std::max(1.0, samples.size() - 5.0));
  const double variance = a.ldlt().solve(Vector5::Unit(0))[0];
  if (!(variance > 0) || std::abs(q[0]) > kFitReach - 1 || 2 * std::abs(q[3]) < kMinSnr * noise)
    return std::nullopt;
  return EdgeOffset{centre + q[0], noise * std::sqrt(variance), 2 * std::abs(q[3])};
}

}  // namespace vss
