#include "vss/calibrate/board_solver.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "vss/solve/schur_lm.h"

namespace vss {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxTerms = 12;
constexpr int kMaxShared = 4 + kMaxTerms + 2;
using SharedRow = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, kMaxShared>;
using TermRow = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, kMaxTerms>;
using CoefficientRow = Eigen::Matrix<double, 2, 12, Eigen::RowMajor>;

// What is estimated.
struct State {
  Intrinsics lens;
  Eigen::VectorXd terms;
  Vector2d bow = Vector2d::Zero();
  std::vector<RigidTransform> poses;
};

// Observed normalised coordinates of n, with derivatives by n and by the distortion coefficients.
struct Distorted {
  Vector2d observed;
  Matrix2d by_n;
  CoefficientRow by_d;
};

void DistortOpenCvWithDerivatives(const std::array<double, 12>& d, const Vector2d& n, Distorted& out) {
  const double x = n.x(), y = n.y(), r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double num = 1 + d[0] * r2 + d[1] * r4 + d[4] * r6, den = 1 + d[5] * r2 + d[6] * r4 + d[7] * r6,
               radial = num / den;
  const double slope =
      ((d[0] + 2 * d[1] * r2 + 3 * d[4] * r4) - radial * (d[5] + 2 * d[6] * r2 + 3 * d[7] * r4)) / den;
  DistortOpenCv(d.data(), x, y, &out.observed.x(), &out.observed.y());
  const double prism_x = d[8] + 2 * d[9] * r2, prism_y = d[10] + 2 * d[11] * r2;
  out.by_n << radial + 2 * x * x * slope + 2 * d[2] * y + 6 * d[3] * x + 2 * x * prism_x,
      2 * x * y * slope + 2 * d[2] * x + 2 * d[3] * y + 2 * y * prism_x,
      2 * x * y * slope + 2 * d[2] * x + 2 * d[3] * y + 2 * x * prism_y,
      radial + 2 * y * y * slope + 6 * d[2] * y + 2 * d[3] * x + 2 * y * prism_y;
  const double a = 1 / den, b = -radial / den;
  out.by_d << x * r2 * a, x * r4 * a, 2 * x * y, r2 + 2 * x * x, x * r6 * a, x * r2 * b, x * r4 * b,
      x * r6 * b, r2, r4, 0, 0,  //
      y * r2 * a, y * r4 * a, r2 + 2 * y * y, 2 * x * y, y * r6 * a, y * r2 * b, y * r4 * b, y * r6 * b, 0, 0,
      r2, r4;
}

// Newton from `guess` (the mark as seen lies there), then the implicit function theorem.
bool DistortWengWithDerivatives(const std::array<double, 12>& d, const Vector2d& n, const Vector2d& guess,
                                Distorted& out) {
  constexpr int kMaxIterations = 20;
  Vector2d x = guess;
  Matrix2d j;
  for (int i = 0;; ++i) {
    const double u = x.x(), v = x.y(), q = u * u + v * v, radial = d[0] * q + d[5] * q * q,
                 slope = 2 * (d[0] + 2 * d[5] * q);
    j << 1 + 2 * (d[1] + d[3]) * u + d[4] * v + radial + u * u * slope,
        d[4] * u + 2 * d[1] * v + u * v * slope,  //
        2 * d[2] * u + d[3] * v + u * v * slope,
        1 + d[3] * u + 2 * (d[2] + d[4]) * v + radial + v * v * slope;
    const double det = j.determinant();
    if (!(det > 0) || i == kMaxIterations) return false;
    Vector2d ideal;
    UndistortWeng(d.data(), u, v, &ideal.x(), &ideal.y());
    const Vector2d r = n - ideal;
    Matrix2d inverse;
    inverse << j(1, 1), -j(0, 1), -j(1, 0), j(0, 0);
    inverse /= det;
    const Vector2d step = inverse * r;
    x += step;
    // Newton is quadratic: a step of 1e-8 leaves an error of some 1e-16.
    if (step.squaredNorm() < 1e-16) {
      out.observed = x;
      out.by_n = inverse;
      const double uu = x.x(), vv = x.y(), qq = uu * uu + vv * vv;
      CoefficientRow by_d = CoefficientRow::Zero();
      by_d.leftCols<6>() << uu * qq, qq, 0, uu * uu, uu * vv, uu * qq * qq,  //
          vv * qq, 0, qq, uu * vv, vv * vv, vv * qq * qq;
      out.by_d = -inverse * by_d;
      return true;
    }
  }
}

struct BoardProblem {
  const std::vector<BoardView>& views;
  const BoardProblemOptions& options;
  const std::vector<std::vector<double>>* weights;
  Eigen::Matrix<double, 12, Eigen::Dynamic> basis;  // distortion = basis * terms
  bool poses_only = false;

  int NumShared() const {
    return poses_only ? 0 : 4 + static_cast<int>(options.terms.size()) + (options.estimate_bow ? 2 : 0);
  }

  Vector3d PointInBoard(const State& s, const BoardView& view, std::size_t i,
                        Vector2d* bow_shape = nullptr) const {
    const Vector2d& p = view.point_in_board[i];
    Vector2d shape = Vector2d::Zero();
    if (view.anchored && (options.estimate_bow || !s.bow.isZero(0))) {
      const Vector2d x = 2 * p.cwiseQuotient(options.board_size_mm) - Vector2d::Ones();
      shape = Vector2d::Ones() - x.cwiseProduct(x);
    }
    if (bow_shape) *bow_shape = shape;
    return {p.x(), p.y(), shape.dot(s.bow)};
  }

  bool Predict(const State& s, const RigidTransform& pose, const Vector3d& p, const Vector2d& seen,
               Vector3d& rotated, Vector3d& point, Distorted& out) const {
    rotated = pose.rotation * p;
    point = rotated + pose.translation;
    if (!(point.z() > 1e-3)) return false;
    const Vector2d n(point.x() / point.z(), point.y() / point.z());
    if (options.model == LensModel::kOpenCv)
      DistortOpenCvWithDerivatives(s.lens.distortion, n, out);
    else if (!DistortWengWithDerivatives(s.lens.distortion, n, s.lens.NormalizedFromIdeal(seen), out) &&
             !DistortWengWithDerivatives(s.lens.distortion, n, n, out))
      return false;
    return true;
  }

  double Evaluate(const State& s, SchurSystem* system) const {
    const int num_shared = NumShared(), num_terms = static_cast<int>(options.terms.size());
    if (!(s.lens.fx_px > 1 && s.lens.fy_px > 1)) return std::numeric_limits<double>::infinity();
    system->Reset(num_shared, static_cast<int>(views.size()));
    double cost = 0;
    SharedRow by_shared(2, num_shared);
    Distorted distorted;
    for (std::size_t v = 0; v < views.size(); ++v) {
      auto& block = system->blocks[v];
      for (std::size_t i = 0; i < views[v].img.size(); ++i) {
        const double weight = weights ? (*weights)[v][i] : 1;
        if (weight == 0) continue;
        Vector2d bow_shape;
        Vector3d rotated, point;
        if (!Predict(s, s.poses[v], PointInBoard(s, views[v], i, &bow_shape), views[v].img[i], rotated, point,
                     distorted))
          return std::numeric_limits<double>::infinity();
        const Vector2d r = views[v].img[i] - s.lens.IdealFromNormalized(distorted.observed);
        cost += weight * r.squaredNorm();
        const double iz = 1 / point.z(), x = point.x() * iz, y = point.y() * iz;
        Matrix2d by_n = distorted.by_n;
        by_n.row(0) *= s.lens.fx_px, by_n.row(1) *= s.lens.fy_px;
        Eigen::Matrix<double, 2, 3> by_point;
        by_point.col(0) = iz * by_n.col(0);
        by_point.col(1) = iz * by_n.col(1);
        by_point.col(2) = -iz * (x * by_n.col(0) + y * by_n.col(1));
        Eigen::Matrix<double, 2, 6> by_pose;
        // d point = w x rotated + dt
        by_pose.col(0) = by_point.col(2) * rotated.y() - by_point.col(1) * rotated.z();
        by_pose.col(1) = by_point.col(0) * rotated.z() - by_point.col(2) * rotated.x();
        by_pose.col(2) = by_point.col(1) * rotated.x() - by_point.col(0) * rotated.y();
        by_pose.rightCols<3>() = by_point;
        block.hessian.noalias() += weight * by_pose.transpose() * by_pose;
        block.gradient.noalias() += weight * by_pose.transpose() * r;
        if (num_shared == 0) continue;
        by_shared(0, 0) = distorted.observed.x(), by_shared(1, 0) = 0;
        by_shared(0, 1) = 0, by_shared(1, 1) = distorted.observed.y();
        if (options.fix_focal) by_shared(0, 0) = by_shared(1, 1) = 0;
        by_shared(0, 2) = 1, by_shared(1, 2) = 0, by_shared(0, 3) = 0, by_shared(1, 3) = 1;
        for (int t = 0; t < num_terms; ++t) {
          double a = 0, b = 0;
          for (int d = 0; d < 12; ++d) {
            const double w = basis(d, t);
            if (w == 0) continue;
            a += distorted.by_d(0, d) * w, b += distorted.by_d(1, d) * w;
          }
          by_shared(0, 4 + t) = s.lens.fx_px * a, by_shared(1, 4 + t) = s.lens.fy_px * b;
        }
        if (options.estimate_bow) {
          const Vector2d by_height = by_point * s.poses[v].rotation.col(2);
          by_shared.rightCols<2>() = by_height * bow_shape.transpose();
        }
        for (int a = 0; a < num_shared; ++a) {
          const double wx = weight * by_shared(0, a), wy = weight * by_shared(1, a);
          for (int b = a; b < num_shared; ++b)
            system->shared(b, a) += wx * by_shared(0, b) + wy * by_shared(1, b);
          for (int b = 0; b < 6; ++b) block.shared_hessian(a, b) += wx * by_pose(0, b) + wy * by_pose(1, b);
          system->shared_gradient[a] += wx * r.x() + wy * r.y();
        }
      }
    }
    if (options.fix_focal && num_shared > 0) system->shared(0, 0) = system->shared(1, 1) = 1;
    system->shared.triangularView<Eigen::StrictlyUpper>() = system->shared.transpose();
    return cost;
  }

  State Plus(const State& s, const SchurStep& step) const {
    State next = s;
    for (std::size_t v = 0; v < s.poses.size(); ++v) {
      next.poses[v].rotation = RotationFromVector(step.blocks[v].head<3>()) * s.poses[v].rotation;
      next.poses[v].translation += step.blocks[v].tail<3>();
    }
    if (poses_only) return next;
    const int num_terms = static_cast<int>(options.terms.size());
    next.lens.fx_px += step.shared[0], next.lens.fy_px += step.shared[1];
    next.lens.cx_px += step.shared[2], next.lens.cy_px += step.shared[3];
    next.terms += step.shared.segment(4, num_terms);
    SetDistortion(next);
    if (options.estimate_bow) next.bow += step.shared.tail<2>();
    return next;
  }

  void SetDistortion(State& s) const {
    const Eigen::Matrix<double, 12, 1> d = basis * s.terms;
    for (int i = 0; i < 12; ++i) s.lens.distortion[i] = d[i];
  }
};

Eigen::Matrix<double, 12, Eigen::Dynamic> Basis(const BoardProblemOptions& options) {
  Eigen::Matrix<double, 12, Eigen::Dynamic> basis(12, options.terms.size());
  for (std::size_t t = 0; t < options.terms.size(); ++t)
    for (int d = 0; d < 12; ++d) basis(d, t) = options.terms[t].direction[d];
  return basis;
}

int NumDistortion(const BoardProblemOptions& options) {
  int last = options.model == LensModel::kWeng ? 5 : 4;
  for (const auto& term : options.terms)
    for (int d = 0; d < 12; ++d)
      if (term.direction[d] != 0) last = std::max(last, d + 1);
  if (options.model == LensModel::kWeng) return last;
  return last <= 4 ? 4 : last <= 5 ? 5 : last <= 8 ? 8 : 12;
}

// Pose of the plane from its homography with a pinhole: the columns of K^-1 H.
std::optional<RigidTransform> PoseFromHomography(const Intrinsics& lens, const Matrix3d& h) {
  Matrix3d m;
  for (int c = 0; c < 3; ++c)
    m.col(c) << (h(0, c) - lens.cx_px * h(2, c)) / lens.fx_px, (h(1, c) - lens.cy_px * h(2, c)) / lens.fy_px,
        h(2, c);
  const double scale = 2 / (m.col(0).norm() + m.col(1).norm());
  m *= m(2, 2) < 0 ? -scale : scale;
  Matrix3d r;
  r << m.col(0), m.col(1), m.col(0).cross(m.col(1));
  const Eigen::JacobiSVD<Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  RigidTransform pose{svd.matrixU() * svd.matrixV().transpose(), m.col(2)};
  if (!(pose.translation.z() > 0) || pose.rotation.determinant() < 0) return std::nullopt;
  return pose;
}

// fx, fy with the principal point in the middle: h1^T w h2 = 0 and h1^T w h1 = h2^T w h2 with w =
// diag(1/fx^2, 1/fy^2, 1).
std::optional<Vector2d> FocalFromHomographies(const std::vector<Matrix3d>& homographies,
                                              const Vector2d& middle) {
  Eigen::Matrix2d a = Eigen::Matrix2d::Zero();
  Vector2d b = Vector2d::Zero();
  for (const Matrix3d& h0 : homographies) {
    Matrix3d shift = Matrix3d::Identity();
    shift(0, 2) = -middle.x(), shift(1, 2) = -middle.y();
    Matrix3d h = shift * h0;
    const double size = middle.norm();
    h.row(2) *= size;  // one scale for the three rows
    Vector3d h1 = h.col(0), h2 = h.col(1);
    const double scale = 2 / (h1.norm() + h2.norm());
    h1 *= scale, h2 *= scale;
    const Vector3d d1 = (h1 + h2) / std::sqrt(2), d2 = (h1 - h2) / std::sqrt(2);
    for (const auto& [p, q] : {std::pair{h1, h2}, {d1, d2}}) {
      const Vector2d row(p.x() * q.x(), p.y() * q.y());
      const double right = -p.z() * q.z();
      a += row * row.transpose();
      b += row * right;
    }
  }
  const double size = middle.norm();
  const Vector2d w = a.ldlt().solve(b);
  if (w.x() > 0 && w.y() > 0) {
    const Vector2d f(size / std::sqrt(w.x()), size / std::sqrt(w.y()));
    if (f.x() / f.y() > 0.5 && f.x() / f.y() < 2) return f;
  }
  const double one = (b.x() + b.y()) / a.sum();  // square pixels
  if (one > 0) return Vector2d::Constant(size / std::sqrt(one));
  return std::nullopt;
}

void Summarise(const BoardProblem& problem, const State& state, const SchurSystem& system,
               const LevenbergSummary& lm, BoardSolution& solution) {
  solution.intrinsics = state.lens;
  solution.intrinsics.num_distortion = NumDistortion(problem.options);
  solution.term_values.assign(state.terms.data(), state.terms.data() + state.terms.size());
  solution.cam_from_board = state.poses;
  solution.bow_mm = state.bow;
  solution.iterations = lm.iterations;
  solution.residual_px.assign(problem.views.size(), {});
  double sum = 0, weighted = 0, used = 0;
  Distorted d;
  for (std::size_t v = 0; v < problem.views.size(); ++v)
    for (std::size_t i = 0; i < problem.views[v].img.size(); ++i) {
      Vector3d rotated, point;
      const Vector2d& seen = problem.views[v].img[i];
      const bool ok = problem.Predict(state, state.poses[v], problem.PointInBoard(state, problem.views[v], i),
                                      seen, rotated, point, d);
      const Vector2d r =
          ok ? Vector2d(seen - state.lens.IdealFromNormalized(d.observed)) : Vector2d::Constant(1e6);
      solution.residual_px[v].push_back(r);
      const double w = problem.weights ? (*problem.weights)[v][i] : 1;
      if (w == 0) continue;
      sum += r.squaredNorm(), weighted += w * r.squaredNorm(), used += 1;
    }
  solution.rms_px = used > 0 ? std::sqrt(sum / used) : 0;
  const double freedom = 2 * used - problem.NumShared() - 6.0 * problem.views.size();
  solution.sigma_px = freedom > 0 ? std::sqrt(weighted / freedom) : 0;
  if (problem.NumShared() > 0) {
    solution.covariance = SharedCovariance(system);
    if (solution.covariance.size() > 0) solution.covariance *= solution.sigma_px * solution.sigma_px;
  }
}

Result<std::vector<Matrix3d>> Homographies(const std::vector<BoardView>& views) {
  std::vector<Matrix3d> homographies;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto h = HomographyFromMarks(views[v].point_in_board, views[v].img);
    if (!h) return InputError("view {}: {} marks do not span a plane", v + 1, views[v].img.size());
    homographies.push_back(*h);
  }
  return homographies;
}

}  // namespace

std::optional<Matrix3d> HomographyFromMarks(const std::vector<Vector2d>& from,
                                            const std::vector<Vector2d>& to) {
  if (from.size() < 4) return std::nullopt;
  const auto normaliser = [](const std::vector<Vector2d>& points) {
    Vector2d mean = Vector2d::Zero();
    for (const auto& p : points) mean += p;
    mean /= points.size();
    double spread = 0;
    for (const auto& p : points) spread += (p - mean).norm();
    const double s = std::sqrt(2) * points.size() / std::max(spread, 1e-12);
    Matrix3d t;
    t << s, 0, -s * mean.x(), 0, s, -s * mean.y(), 0, 0, 1;
    return t;
  };
  const Matrix3d a = normaliser(from), b = normaliser(to);
  Eigen::Matrix<double, 9, 9> m = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vector3d p = a * from[i].homogeneous(), q = b * to[i].homogeneous();
    Eigen::Matrix<double, 2, 9> rows;
    rows << p.transpose(), 0, 0, 0, -q.x() * p.transpose(), 0, 0, 0, p.transpose(), -q.y() * p.transpose();
    m.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(m);
  // Marks on a line leave more than one solution.
  if (!(eigen.eigenvalues()[1] > 1e-7 * eigen.eigenvalues()[8])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> x = eigen.eigenvectors().col(0);
  Matrix3d h;
  h << x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8];
  h = b.inverse() * h * a;
  if ((h * from[0].homogeneous()).z() < 0) h = -h;
  return h;
}

LensTerm NamedTerm(LensModel model, const std::string& name) {
  LensTerm term{name, {}};
  auto& d = term.direction;
  if (model == LensModel::kWeng) {
    // k1 g1 g2 g3 g4 k2
    if (name == "k1")
      d[0] = 1;
    else if (name == "k2")
      d[5] = 1;
    else if (name == "p1")
      d[1] = 1, d[3] = 2;
    else if (name == "p2")
      d[2] = 1, d[4] = 2;
    else if (name == "s1")
      d[1] = 1;
    else if (name == "s2")
      d[2] = 1;
  } else {
    const std::vector<std::string> order{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "", "s2", ""};
    for (int i = 0; i < 12; ++i)
      if (order[i] == name) d[i] = 1;
  }
  return term;
}

std::vector<LensTerm> DefaultTerms(LensModel model) {
  std::vector<LensTerm> terms;
  for (const char* name : {"k1", "k2", "p1", "p2"}) terms.push_back(NamedTerm(model, name));
  return terms;
}

Eigen::MatrixXd DistortionFromTerms(const BoardProblemOptions& options) {
  return Basis(options).topRows(NumDistortion(options));
}

Result<BoardSolution> SolveBoards(const std::vector<BoardView>& views, const BoardProblemOptions& options,
                                  const std::vector<std::vector<double>>* weights,
                                  const BoardSolution* start) {
  BoardProblem problem{views, options, weights, Basis(options)};
  SchurSystem system;
  BoardSolution solution;
  if (start) {
    State state{start->intrinsics,
                Eigen::Map<const Eigen::VectorXd>(start->term_values.data(), start->term_values.size()),
                start->bow_mm, start->cam_from_board};
    state.terms.conservativeResizeLike(Eigen::VectorXd::Zero(options.terms.size()));
    state.lens.model = options.model;
    problem.SetDistortion(state);
    const auto lm = MinimizeSchur(problem, state, system);
    Summarise(problem, state, system, lm, solution);
    return solution;
  }
  VSS_ASSIGN(const auto homographies, Homographies(views));
  const Vector2d middle(0.5 * (options.width_px - 1), 0.5 * (options.height_px - 1));
  // The closed form; where perspective is too weak for it, or it leads nowhere, usual lenses in turn.
  std::vector<Vector2d> focal;
  if (const auto f = FocalFromHomographies(homographies, middle)) focal.push_back(*f);
  for (double widths : {1.0, 2.0, 0.6, 4.0, 8.0})
    focal.push_back(Vector2d::Constant(widths * std::max(options.width_px, options.height_px)));
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t trial = 0; trial < focal.size(); ++trial) {
    State state;
    state.lens.model = options.model;
    state.lens.fx_px = focal[trial].x(), state.lens.fy_px = focal[trial].y();
    state.lens.cx_px = middle.x(), state.lens.cy_px = middle.y();
    state.terms = Eigen::VectorXd::Zero(options.terms.size());
    for (const Matrix3d& h : homographies) {
      const auto pose = PoseFromHomography(state.lens, h);
      if (!pose) break;
      state.poses.push_back(*pose);
    }
    if (state.poses.size() != views.size()) continue;
    const auto lm = MinimizeSchur(problem, state, system);
    if (!(lm.cost < best)) continue;
    best = lm.cost;
    Summarise(problem, state, system, lm, solution);
    // A lens that explains its marks to a small share of the picture needs no other start.
    if (lm.converged && solution.rms_px < 2e-3 * options.width_px) break;
  }
  if (!std::isfinite(best))
    return InputError(
        "no lens explains the marks: is every view a picture of the same flat board, and the marks' numbers "
        "of columns and rows right?");
  return solution;
}

Result<BoardSolution> SolveBoardPoses(const std::vector<BoardView>& views, const BoardProblemOptions& options,
                                      const BoardSolution& lens) {
  BoardProblem problem{views, options, nullptr, Basis(options), true};
  State state{lens.intrinsics,
              Eigen::Map<const Eigen::VectorXd>(lens.term_values.data(), lens.term_values.size()),
              lens.bow_mm,
              {}};
  for (const BoardView& view : views) {
    BoardView ideal = view;
    for (Vector2d& p : ideal.img) {
      const auto n = lens.intrinsics.NormalizedFromImg(p);
      if (n) p = lens.intrinsics.IdealFromNormalized(*n);
    }
    const auto h = HomographyFromMarks(ideal.point_in_board, ideal.img);
    const auto pose = h ? PoseFromHomography(lens.intrinsics, *h) : std::nullopt;
    if (!pose) return InputError("a view of {} marks has no pose under the lens", view.img.size());
    state.poses.push_back(*pose);
  }
  SchurSystem system;
  const auto lm = MinimizeSchur(problem, state, system);
  BoardSolution solution;
  Summarise(problem, state, system, lm, solution);
  return solution;
}

Vector2d DiscEccentricity(const Intrinsics& lens, const RigidTransform& cam_from_board, const Vector2d& point,
                          double radius_mm) {
  constexpr int kCorners =
      24;  // of the polygon in the circle; inscribed evenly it has the ellipse's own centroid
  const auto centre = lens.Project(cam_from_board * Vector3d(point.x(), point.y(), 0));
  std::array<Vector2d, kCorners> img;
  for (int i = 0; i < kCorners; ++i) {
    const double a = 2 * kPi * i / kCorners;
    const auto p = lens.Project(cam_from_board * Vector3d(point.x() + radius_mm * std::cos(a),
                                                          point.y() + radius_mm * std::sin(a), 0));
    if (!p || !centre) return Vector2d::Zero();
    img[i] = *p - *centre;
  }
  double area = 0;
  Vector2d moment = Vector2d::Zero();
  for (int i = 0; i < kCorners; ++i) {
    const Vector2d &p = img[i], &q = img[(i + 1) % kCorners];
    const double cross = p.x() * q.y() - q.x() * p.y();
    area += cross;
    moment += cross * (p + q);
  }
  return moment / (3 * area);
}

}  // namespace vss
