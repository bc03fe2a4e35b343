// What is asked of the adjustment once it is solved: covariances, what the pictures alone know of a part,
// what would change without a picture or with more unknowns.
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "vss/reconstruct/adjustment.h"

namespace vss {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The decrease of the weighted sum of squares by a step to the linearised solution, and the step.
std::pair<double, VectorXd> Adjustment::LinearisedStep() {
  Build(options.adjust_cameras);
  VectorXd step = h_.selfadjointView<Eigen::Lower>().ldlt().solve(g_);
  return {step.dot(g_), std::move(step)};
}

VectorXd Adjustment::StepOf(int part) {
  UpdateResiduals();
  UpdateWeights();
  const VectorXd step = LinearisedStep().second;
  const auto p = static_cast<std::size_t>(part);
  return step.segment(layout_.part[p], parts[p].object.StateSize());
}

Adjustment::Gain Adjustment::GainOfLeaning(int part, double tilt_sigma_rad) {
  auto& p = parts[static_cast<std::size_t>(part)];
  UpdateResiduals();
  UpdateWeights();
  const double before = LinearisedStep().first;
  const AdjustedPart saved = p;
  Lean(part, tilt_sigma_rad);
  const auto [after, step] = LinearisedStep();
  Gain out{after - before, step.segment(layout_.part[static_cast<std::size_t>(part)], p.object.StateSize())};
  p = saved;
  return out;
}

Adjustment::Gain Adjustment::GainOfFreeingGround() {
  UpdateResiduals();
  UpdateWeights();
  const auto saved_parts = parts;
  const auto saved_ground = ground;
  ground.pull_free = true;
  const double before = LinearisedStep().first;
  FreeGround();
  const auto [after, step] = LinearisedStep();
  Gain out{after - before, step.segment<kGroundSize>(layout_.ground)};
  parts = saved_parts;
  ground = saved_ground;
  return out;
}

MatrixXd Adjustment::CovarianceOfFree(int part) const {
  const auto p = static_cast<std::size_t>(part);
  const int n = parts[p].object.StateSize();
  MatrixXd c = covariance_.block(layout_.part[p], layout_.part[p], n, n);
  for (int i = 0; i < n; ++i)
    if (!parts[p].free[static_cast<std::size_t>(i)]) c.row(i).setZero(), c.col(i).setZero();
  return c;
}

MatrixXd Adjustment::PartCovariance(int part) const {
  const auto p = static_cast<std::size_t>(part);
  const auto by_held = by_held_.middleRows(layout_.part[p], parts[p].object.StateSize());
  return CovarianceOfFree(part) + by_held * by_held.transpose();
}

MatrixXd Adjustment::CameraCovariance(int camera) const {
  const auto c = static_cast<std::size_t>(camera);
  const auto n = cameras[c].value.size();
  return covariance_.block(layout_.camera[c], layout_.camera[c], n, n);
}

Matrix3d Adjustment::StopCovariance(int stop) const {
  const int at = layout_.stop[static_cast<std::size_t>(stop)];
  return covariance_.block<3, 3>(at, at);
}

Matrix3d Adjustment::GroundCovariance() const {
  if (!ground.free) return Matrix3d::Zero();
  return covariance_.block<3, 3>(layout_.ground, layout_.ground);
}

double Adjustment::ScaleSigma() const {
  return layout_.scale < 0 ? 0 : std::sqrt(std::max(0.0, covariance_(layout_.scale, layout_.scale)));
}

// With U the view's part of the normal matrix H, u of the right side (which is zero at the solution), and C =
// H^-1: (H - U)^-1 = C + C U (I - C U)^-1 C, and the step without the view is -(H - U)^-1 u (Sherman,
// Morrison, Woodbury). U is small: only the unknowns that the view knows of.
std::vector<Adjustment::Change> Adjustment::ChangesWithout(int view) const {
  const auto views = AdjustedViews();
  const auto pinned = Pinned(options.adjust_cameras);
  std::map<int, int> index;  // unknown -> row of U
  std::vector<Term> terms;
  for (const auto& group : groups) {
    if (group.view != view || group.weight <= 0) continue;
    const auto& object = parts[static_cast<std::size_t>(group.part)].object;
    terms.push_back(TermOf(group, PlaceSolid(object), views));
    for (int at : terms.back().at)
      if (!pinned[static_cast<std::size_t>(at)]) index.insert({at, 0});
  }
  std::vector<int> unknowns;
  for (auto& [at, row] : index) {
    row = static_cast<int>(unknowns.size());
    unknowns.push_back(at);
  }
  const auto n = static_cast<Eigen::Index>(unknowns.size());
  MatrixXd u = MatrixXd::Zero(n, n);
  VectorXd right = VectorXd::Zero(n);
  for (const auto& term : terms)
    for (std::size_t x = 0; x < term.at.size(); ++x) {
      const auto row = index.find(term.at[x]);
      if (row == index.end()) continue;
      right[row->second] += term.g[static_cast<Eigen::Index>(x)];
      for (std::size_t y = 0; y < term.at.size(); ++y) {
        const auto column = index.find(term.at[y]);
        if (column == index.end()) continue;
        u(row->second, column->second) +=
            term.h(static_cast<Eigen::Index>(std::max(x, y)), static_cast<Eigen::Index>(std::min(x, y)));
      }
    }
  const MatrixXd own = covariance_(unknowns, unknowns);
  const MatrixXd more =
      u * (MatrixXd::Identity(n, n) - own * u).partialPivLu().solve(MatrixXd::Identity(n, n));
  std::vector<Change> out;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto size = parts[p].object.StateSize();
    std::vector<int> rows;
    for (int i = 0; i < size; ++i) rows.push_back(layout_.part[p] + i);
    const MatrixXd c = covariance_(rows, unknowns);
    const MatrixXd grown = c * more;
    Change change{-(c * right + grown * (own * right)), VectorXd(size)};
    for (int i = 0; i < size; ++i) change.sigma[i] = std::sqrt(std::max(0.0, grown.row(i).dot(c.row(i))));
    for (int i = 0; i < size; ++i)
      if (pinned[static_cast<std::size_t>(rows[static_cast<std::size_t>(i)])])
        change.step[i] = change.sigma[i] = 0;
    out.push_back(std::move(change));
  }
  return out;
}

MatrixXd Adjustment::DataInformation(int part) const {
  const auto& p = parts[static_cast<std::size_t>(part)];
  const MatrixXd c = CovarianceOfFree(part);
  std::vector<int> free;
  for (int i = 0; i < c.rows(); ++i)
    if (p.free[static_cast<std::size_t>(i)]) free.push_back(i);
  MatrixXd out = MatrixXd::Zero(c.rows(), c.rows());
  if (free.empty()) return out;
  const MatrixXd info = MatrixXd(c(free, free))
                            .ldlt()
                            .solve(MatrixXd::Identity(static_cast<Eigen::Index>(free.size()),
                                                      static_cast<Eigen::Index>(free.size())));
  for (std::size_t a = 0; a < free.size(); ++a)
    for (std::size_t b = 0; b < free.size(); ++b)
      out(free[a], free[b]) = info(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
  for (int i : free) out(i, i) -= 1 / (p.prior_sigma[i] * p.prior_sigma[i]);
  return out;
}

}  // namespace vss
