#include <Eigen/Dense>
#include <cmath>

#include "vss/calibrate/intrinsic.h"
#include "vss/calibrate/maps.h"

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr int kGrid = 25;  // places a side at which the two are compared

struct Family {
  LensModel model;
  std::vector<LensTerm> terms;
  int num_distortion;
};

Family FamilyOf(LensModel model) {
  Family f{model, {}, 0};
  const std::vector<std::string> names =
      model == LensModel::kWeng     ? std::vector<std::string>{"k1", "k2", "p1", "p2", "s1", "s2"}
      : model == LensModel::kOpenCv ? std::vector<std::string>{"k1", "k2", "p1", "p2", "k3"}
                                    : std::vector<std::string>{};
  for (const auto& n : names) f.terms.push_back(NamedTerm(model, n));
  f.num_distortion = model == LensModel::kWeng ? 6 : model == LensModel::kOpenCv ? 5 : 0;
  return f;
}

Intrinsics LensOf(const Family& f, const VectorXd& x) {
  Intrinsics k;
  k.model = f.model;
  k.fx_px = x[0], k.fy_px = x[1], k.cx_px = x[2], k.cy_px = x[3];
  k.num_distortion = f.num_distortion;
  for (std::size_t t = 0; t < f.terms.size(); ++t)
    for (int d = 0; d < 12; ++d) k.distortion[d] += x[4 + t] * f.terms[t].direction[d];
  return k;
}

// Where the lens has the rays, against the pixels (px).
bool Residuals(const Intrinsics& lens, const std::vector<Vector2d>& img, const std::vector<Vector2d>& rays,
               VectorXd& r) {
  r.resize(2 * img.size());
  for (std::size_t i = 0; i < img.size(); ++i) {
    const auto p = lens.ImgFromNormalized(rays[i]);
    if (!p) return false;
    r.segment<2>(2 * i) = *p - img[i];
  }
  return true;
}

}  // namespace

Result<ConvertedLens> ConvertLens(const Intrinsics& from, LensModel model, int width_px, int height_px) {
  std::vector<Vector2d> img, rays;
  for (int j = 0; j < kGrid; ++j)
    for (int i = 0; i < kGrid; ++i) {
      const Vector2d p = CellPlace(i, j, kGrid, kGrid, width_px, height_px);
      const auto n = from.NormalizedFromImg(p);
      if (!n)
        return InputError(
            "the lens has no ray for the pixel ({:.0f}, {:.0f}), so it cannot be converted; calibrate it "
            "again",
            p.x(), p.y());
      img.push_back(p), rays.push_back(*n);
    }
  const Family family = FamilyOf(model);
  VectorXd x = VectorXd::Zero(4 + family.terms.size()), r, trial_r;
  x.head<4>() << from.fx_px, from.fy_px, from.cx_px, from.cy_px;
  if (!Residuals(LensOf(family, x), img, rays, r)) return InputError("the lens cannot be converted");
  double damping = 1e-3;
  for (int iteration = 0; iteration < 60 && damping < 1e8; ++iteration) {
    MatrixXd j(r.size(), x.size());
    for (int k = 0; k < x.size(); ++k) {
      const double h = k < 4 ? 1e-3 : 1e-6;
      VectorXd high = x, low = x, a, b;
      high[k] += h, low[k] -= h;
      if (!Residuals(LensOf(family, high), img, rays, a) || !Residuals(LensOf(family, low), img, rays, b))
        return InputError("the lens cannot be converted: its distortion is too strong for the other model");
      j.col(k) = (a - b) / (2 * h);
    }
    MatrixXd a = j.transpose() * j;
    a.diagonal() *= 1 + damping;
    const VectorXd step = a.ldlt().solve(-j.transpose() * r);
    if (step.allFinite() && Residuals(LensOf(family, x + step), img, rays, trial_r) &&
        trial_r.squaredNorm() <= r.squaredNorm()) {
      const bool done = r.squaredNorm() - trial_r.squaredNorm() <= 1e-10 * r.squaredNorm();
      x += step, r = trial_r, damping = std::max(1e-12, damping * 0.1);
      if (done) break;
    } else {
      damping *= 10;
    }
  }
  ConvertedLens converted{LensOf(family, x), std::sqrt(r.squaredNorm() / img.size()), 0, {}};
  converted.intrinsics.pixel_pitch_v_mm = from.pixel_pitch_v_mm;
  for (std::size_t i = 0; i < img.size(); ++i)
    converted.max_px = std::max(converted.max_px, r.segment<2>(2 * i).norm());
  // The rays of both move alike: J_to d_to = J_from d_from, in the least squares of the grid.
  const int n_from = 4 + from.num_distortion, n_to = static_cast<int>(x.size());
  MatrixXd terms = MatrixXd::Zero(4 + family.num_distortion, n_to);
  terms.topLeftCorner(4, 4).setIdentity();
  for (std::size_t t = 0; t < family.terms.size(); ++t)
    for (int d = 0; d < family.num_distortion; ++d)
      terms(4 + d, 4 + static_cast<int>(t)) = family.terms[t].direction[d];
  MatrixXd a = MatrixXd::Zero(n_to, n_to), b = MatrixXd::Zero(n_to, n_from);
  for (const Vector2d& p : img) {
    const MatrixXd to = RayJacobian(converted.intrinsics, p) * terms, source = RayJacobian(from, p);
    if (!to.allFinite() || !source.allFinite()) continue;
    a += to.transpose() * to, b += to.transpose() * source;
  }
  converted.by_source = terms * a.ldlt().solve(b);
  return converted;
}

Status CheckLens(const Intrinsics& lens, int width_px, int height_px) {
  constexpr double kMaxErrorPx = 1e-4;
  for (int j = 0; j < kGrid; ++j)
    for (int i = 0; i < kGrid; ++i) {
      const Vector2d p = CellPlace(i, j, kGrid, kGrid, width_px, height_px);
      const auto ray = lens.NormalizedFromImg(p);
      const auto back = ray ? lens.ImgFromNormalized(*ray) : std::nullopt;
      if (!back || (*back - p).norm() > kMaxErrorPx)
        return InputError(
            "the lens folds over at the pixel ({:.0f}, {:.0f}): no single ray belongs to it, so the "
            "distortion is not to be trusted there; calibrate with marks up to the picture's border",
            p.x(), p.y());
    }
  return {};
}

}  // namespace vss
