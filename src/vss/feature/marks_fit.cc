// Grey-value models of a disc and of a checkerboard corner, fitted to the pixels around them by
// Levenberg-Marquardt.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "vss/feature/marks.h"

namespace vss {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double kSqrt2 = 1.4142135623730951;
constexpr double kSqrtPi = 1.7724538509055161;
constexpr double kStartBlurPx = 0.7;  // of a lens in focus with pixels of full fill factor
constexpr double kMinBlurPx = 0.25, kMaxBlurPx = 8.0;

struct Pixel {
  double u, v, grey;  // u, v against the start of the fit (px); grey as a share of full scale
};

// Model: double operator()(const Pixel&, const Vector<N>& parameters, Vector<N>& gradient); bool
// Valid(parameters).
template <int N>
struct GreyFit {
  Eigen::Matrix<double, N, 1> parameters;
  double sigma_grey = 0;
  double sigma_px = 0;  // of the first two parameters, per coordinate
};

template <int N, class Model>
double NormalEquations(const std::vector<Pixel>& pixels, const Model& model,
                       const Eigen::Matrix<double, N, 1>& p, Eigen::Matrix<double, N, N>& a,
                       Eigen::Matrix<double, N, 1>& b) {
  a.setZero();
  b.setZero();
  double cost = 0;
  Eigen::Matrix<double, N, 1> g;
  for (const Pixel& pixel : pixels) {
    const double r = pixel.grey - model(pixel, p, g);
    cost += r * r;
    a.template selfadjointView<Eigen::Lower>().rankUpdate(g);
    b += r * g;
  }
  a.template triangularView<Eigen::StrictlyUpper>() = a.transpose();
  return cost;
}

template <int N, class Model>
std::optional<GreyFit<N>> FitGrey(const std::vector<Pixel>& pixels, const Model& model,
                                  Eigen::Matrix<double, N, 1> p) {
  constexpr int kMaxIterations = 25;
  constexpr double kDoneStepPx = 1e-4;  // a hundredth of the accuracy that is sought
  if (static_cast<int>(pixels.size()) < 2 * N) return std::nullopt;
  Eigen::Matrix<double, N, N> a, trial_a;
  Eigen::Matrix<double, N, 1> b, trial_b;
  double cost = NormalEquations<N>(pixels, model, p, a, b), damping = 1e-3;
  for (int i = 0; i < kMaxIterations; ++i) {
    Eigen::Matrix<double, N, N> damped = a;
    damped.diagonal() += damping * a.diagonal();
    const Eigen::Matrix<double, N, 1> step = damped.ldlt().solve(b);
    if (!step.allFinite()) return std::nullopt;
    const Eigen::Matrix<double, N, 1> trial = p + step;
    const double trial_cost =
        model.Valid(trial) ? NormalEquations<N>(pixels, model, trial, trial_a, trial_b) : cost + 1;
    if (trial_cost <= cost) {
      const bool done = step.template head<2>().norm() < kDoneStepPx && cost - trial_cost < 1e-4 * cost;
      p = trial, a = trial_a, b = trial_b, cost = trial_cost;
      damping = std::max(1e-9, damping * 0.1);
      if (done) break;
    } else {
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  GreyFit<N> fit{p, std::sqrt(cost / (pixels.size() - N)), 0};
  const Eigen::Matrix<double, N, N> inverse = a.ldlt().solve(Eigen::Matrix<double, N, N>::Identity());
  const double variance = 0.5 * (inverse(0, 0) + inverse(1, 1));
  if (!(variance > 0)) return std::nullopt;
  fit.sigma_px = fit.sigma_grey * std::sqrt(variance);
  return fit;
}

// 0: centre u, v; 2: inverse shape b11, b12, b22; 5: blur; 6: illumination level, slope u, slope v; 9: inside
// over outside.
struct DiscModel {
  using Vector = Eigen::Matrix<double, 10, 1>;
  bool Valid(const Vector& p) const {
    return p[5] > kMinBlurPx && p[5] < kMaxBlurPx && p[2] > 0 && p[4] > 0 && p[2] * p[4] > p[3] * p[3];
  }
  double operator()(const Pixel& px, const Vector& p, Vector& g) const {
    const double du = px.u - p[0], dv = px.v - p[1];
    const double xu = p[2] * du + p[3] * dv, xv = p[3] * du + p[4] * dv;
    const double s = std::max(1e-9, std::sqrt(xu * xu + xv * xv));
    const double nu = (p[2] * xu + p[3] * xv) / s, nv = (p[3] * xu + p[4] * xv) / s;  // gradient of s
    const double norm = std::max(1e-12, std::sqrt(nu * nu + nv * nv));
    const double d = (s - 1) / norm, z = d / (kSqrt2 * p[5]);
    const double outside = 0.5 * (1 + std::erf(z)), bell = std::exp(-z * z) / (kSqrtPi * kSqrt2 * p[5]);
    const double light = p[6] + p[7] * px.u + p[8] * px.v, share = p[9] + (1 - p[9]) * outside;
    const double slope = light * (1 - p[9]) * bell;  // d grey / d distance
    g[0] = -slope * nu / norm;
    g[1] = -slope * nv / norm;
    g[2] = slope * xu * du / (s * norm);
    g[3] = slope * (xu * dv + xv * du) / (s * norm);
    g[4] = slope * xv * dv / (s * norm);
    g[5] = -slope * d / p[5];
    g[6] = share;
    g[7] = share * px.u;
    g[8] = share * px.v;
    g[9] = light * (1 - outside);
    return light * share;
  }
};

// 0: corner u, v; 2: angles of the two edges' normals; 4: blur; 5: illumination level, slope u, slope v; 8:
// half contrast.
struct CornerModel {
  using Vector = Eigen::Matrix<double, 9, 1>;
  double radius;
  bool Valid(const Vector& p) const {
    return p[4] > kMinBlurPx && p[4] < kMaxBlurPx && p.head<2>().norm() < radius;
  }
  double operator()(const Pixel& px, const Vector& p, Vector& g) const {
    const double du = px.u - p[0], dv = px.v - p[1];
    const double c1 = std::cos(p[2]), s1 = std::sin(p[2]), c2 = std::cos(p[3]), s2 = std::sin(p[3]);
    const double k = 1 / (kSqrt2 * p[4]);
    const double z1 = k * (c1 * du + s1 * dv), z2 = k * (c2 * du + s2 * dv);
    const double e1 = std::erf(z1), e2 = std::erf(z2);
    const double bell1 = 2 / kSqrtPi * std::exp(-z1 * z1), bell2 = 2 / kSqrtPi * std::exp(-z2 * z2);
    const double light = p[5] + p[6] * px.u + p[7] * px.v, share = 1 + p[8] * e1 * e2, a = light * p[8];
    g[0] = -a * k * (bell1 * c1 * e2 + e1 * bell2 * c2);
    g[1] = -a * k * (bell1 * s1 * e2 + e1 * bell2 * s2);
    g[2] = a * k * bell1 * e2 * (-s1 * du + c1 * dv);
    g[3] = a * k * e1 * bell2 * (-s2 * du + c2 * dv);
    g[4] = -a * (bell1 * z1 * e2 + e1 * bell2 * z2) / p[4];
    g[5] = share;
    g[6] = share * px.u;
    g[7] = share * px.v;
    g[8] = light * e1 * e2;
    return light * share;
  }
};

template <class Keep>
std::vector<Pixel> PixelsAround(const GreyView& image, const Vector2d& centre, double reach,
                                const Keep& keep) {
  std::vector<Pixel> pixels;
  const int u0 = std::max(0, static_cast<int>(std::ceil(centre.x() - reach))),
            u1 = std::min(image.width - 1, static_cast<int>(centre.x() + reach));
  const int v0 = std::max(0, static_cast<int>(std::ceil(centre.y() - reach))),
            v1 = std::min(image.height - 1, static_cast<int>(centre.y() + reach));
  const double scale = 1 / image.MaxValue();
  for (int v = v0; v <= v1; ++v)
    for (int u = u0; u <= u1; ++u) {
      const Vector2d d(u - centre.x(), v - centre.y());
      if (keep(d)) pixels.push_back({d.x(), d.y(), image.At(u, v) * scale});
    }
  return pixels;
}

}  // namespace

std::optional<DiscFit> FitDisc(const GreyView& image, const Vector2d& centre, const Matrix2d& shape,
                               double margin_px) {
  constexpr double kCore = 5.0;  // px inside the contour: deeper pixels say nothing of it
  const Matrix2d inverse = shape.inverse();
  const double reach = shape.norm() + margin_px;
  double outside = 0, inside = 0;
  int num_outside = 0, num_inside = 0;
  const auto pixels = PixelsAround(image, centre, reach, [&](const Vector2d& d) {
    const Vector2d x = inverse * d;
    const double s = std::max(1e-9, x.norm()), distance = (s - 1) * s / (inverse.transpose() * x).norm();
    return distance < margin_px && distance > -kCore;
  });
  for (const Pixel& p : pixels) {
    const bool in = (inverse * Vector2d(p.u, p.v)).squaredNorm() < 1;
    (in ? inside : outside) += p.grey;
    ++(in ? num_inside : num_outside);
  }
  if (num_inside < 5 || num_outside < 5 || !(outside > 0)) return std::nullopt;
  inside /= num_inside, outside /= num_outside;
  DiscModel::Vector p;
  p << 0, 0, inverse(0, 0), 0.5 * (inverse(0, 1) + inverse(1, 0)), inverse(1, 1), kStartBlurPx, outside, 0, 0,
      inside / outside;
  const auto fit = FitGrey<10>(pixels, DiscModel{}, p);
  if (!fit || !DiscModel{}.Valid(fit->parameters)) return std::nullopt;
  DiscFit disc;
  const auto& q = fit->parameters;
  disc.centre = centre + q.head<2>();
  Matrix2d b;
  b << q[2], q[3], q[3], q[4];
  disc.shape = b.inverse();
  disc.sigma_px = fit->sigma_px;
  disc.blur_px = q[5];
  disc.contrast = std::abs(q[6] * (1 - q[9]));
  // Noise of half the contrast, a centre outside the contour or a doubled size: not this disc.
  if (fit->sigma_grey > 0.25 * disc.contrast || (inverse * q.head<2>()).norm() > 0.5) return std::nullopt;
  if (const double growth = disc.shape.determinant() / shape.determinant(); growth > 3 || growth < 0.33)
    return std::nullopt;
  return disc;
}

std::optional<CornerFit> FitCorner(const GreyView& image, const Vector2d& corner, const Vector2d& arm1,
                                   const Vector2d& arm2, double radius_px) {
  const auto pixels =
      PixelsAround(image, corner, radius_px, [&](const Vector2d& d) { return d.norm() <= radius_px; });
  const Vector2d n1(-arm1.y(), arm1.x()), n2(-arm2.y(), arm2.x());
  double sum = 0, same = 0, other = 0;
  int num_same = 0, num_other = 0;
  for (const Pixel& p : pixels) {
    const Vector2d d(p.u, p.v);
    const bool in = (n1.dot(d) > 0) == (n2.dot(d) > 0);
    sum += p.grey;
    (in ? same : other) += p.grey;
    ++(in ? num_same : num_other);
  }
  if (num_same < 5 || num_other < 5 || !(sum > 0)) return std::nullopt;
  same /= num_same, other /= num_other;
  CornerModel::Vector p;
  p << 0, 0, std::atan2(n1.y(), n1.x()), std::atan2(n2.y(), n2.x()), kStartBlurPx, 0.5 * (same + other), 0, 0,
      (same - other) / (same + other);
  const CornerModel model{0.5 * radius_px};
  const auto fit = FitGrey<9>(pixels, model, p);
  if (!fit || !model.Valid(fit->parameters)) return std::nullopt;
  const auto& q = fit->parameters;
  CornerFit result;
  result.corner = corner + q.head<2>();
  result.sigma_px = fit->sigma_px;
  result.blur_px = q[4];
  result.contrast = 2 * std::abs(q[5] * q[8]);
  const double cross = std::abs(std::sin(q[2] - q[3]));
  if (fit->sigma_grey > 0.25 * result.contrast || cross < 0.17)
    return std::nullopt;  // edges less than 10 degrees apart cross nowhere
  return result;
}

}  // namespace vss
