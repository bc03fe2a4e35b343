#include "vss/identify/seed_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

namespace vss {
namespace {

double PriorSigma(const DimensionDef& d) { return std::max(10.0, (d.max_mm - d.min_mm) / 4); }

Eigen::MatrixXd Covariance(Eigen::MatrixXd information, std::span<const DimensionDef> defs) {
  for (std::size_t i = 0; i < defs.size(); ++i)
    information(kPlacementSize + int(i), kPlacementSize + int(i)) += 1 / std::pow(PriorSigma(defs[i]), 2);
  Eigen::VectorXd unused = Eigen::VectorXd::Zero(information.rows());
  HoldUpright(information, unused);
  return information.inverse();
}

Eigen::MatrixXd OpenDirections(const Eigen::MatrixXd& information, const std::vector<bool>& determined) {
  const int n = int(information.rows());
  std::vector<int> follow{0, 1};
  for (std::size_t d = 0; d < determined.size(); ++d)
    if (determined[d]) follow.push_back(kPlacementSize + int(d));
  const int m = int(follow.size());
  Eigen::MatrixXd a(m, m), out = Eigen::MatrixXd::Zero(n, int(determined.size()));
  for (int i = 0; i < m; ++i)
    for (int k = 0; k < m; ++k) a(i, k) = information(follow[std::size_t(i)], follow[std::size_t(k)]);
  a.diagonal().array() += 1e-9;
  const Eigen::LDLT<Eigen::MatrixXd> solver(a);
  for (std::size_t d = 0; d < determined.size(); ++d) {
    if (determined[d]) continue;
    const int column = kPlacementSize + int(d);
    Eigen::VectorXd b(m);
    for (int i = 0; i < m; ++i) b[i] = -information(follow[std::size_t(i)], column);
    const Eigen::VectorXd x = solver.solve(b);
    for (int i = 0; i < m; ++i) out(follow[std::size_t(i)], int(d)) = x[i];
    out(column, int(d)) = 1;
  }
  return out;
}

// A seed laid on its targets.
struct Laid {
  PlacedObject object;
  Eigen::MatrixXd covariance;  // of the state
  double worst_mm = 0;         // miss of a target
};

std::optional<Laid> LayOn(const PlacedObject& usual, PlacedObject start, const SeedTargets& targets) {
  Laid laid{std::move(start), {}, 0};
  PlacedObject& o = laid.object;
  const int n = o.StateSize();
  const auto defs = o.model->dimensions();
  for (int iteration = 0; iteration < 3; ++iteration) {
    NormalEquations normal(n);
    laid.worst_mm = AddTargets(o, targets.edges, targets.circles, normal);
    if (iteration == 2) break;
    Eigen::MatrixXd a = normal.ata;
    Eigen::VectorXd b = normal.atb;
    for (std::size_t i = 0; i < defs.size(); ++i) {
      const int at = kPlacementSize + int(i);
      const double w = 1 / std::pow(PriorSigma(defs[i]), 2);
      a(at, at) += w;
      b[at] -= w * (o.dimensions_mm[i] - usual.dimensions_mm[i]);
    }
    HoldUpright(a, b);
    const Eigen::LDLT<Eigen::MatrixXd> solver(a);
    const Eigen::VectorXd state = o.State() + Eigen::VectorXd(solver.solve(b));
    if (!state.allFinite()) return std::nullopt;
    o.SetState(state);
    if (iteration == 1) laid.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
  }
  return laid;
}

// Asks the usual dimensions again, now that some are known.
void AskUsual(Hypothesis& h) {
  std::vector<std::optional<double>> known(h.determined.size());
  for (std::size_t i = 0; i < known.size(); ++i)
    if (h.determined[i]) known[i] = h.object.dimensions_mm[i];
  const auto usual = h.object.model->UsualDimensions(known);
  for (std::size_t i = 0; i < known.size(); ++i)
    if (!h.determined[i]) MoveDimension(h.object, h.open_direction, i, usual[i]);
}

}  // namespace

void MoveDimension(PlacedObject& object, const Eigen::MatrixXd& open_direction, std::size_t dimension,
                   double value_mm) {
  object.SetState(object.State() +
                  (value_mm - object.dimensions_mm[dimension]) * open_direction.col(int(dimension)));
}

std::optional<Hypothesis> FitSeed(const PlacedObject& usual, double yaw_rad, const Eigen::Vector3d& near,
                                  const SeedTargets& targets, double mm_per_px) {
  constexpr double kDetermined = 0.2;    // of what a dimension's range says: it is told by the targets
  constexpr double kSlantedRise = 0.05;  // 3 degrees
  PlacedObject start = usual;
  start.placement[0] = near.x();
  start.placement[1] = near.y();
  start.placement[3] = yaw_rad;
  const auto laid = LayOn(usual, std::move(start), targets);
  if (!laid || laid->worst_mm > kSeedTolerancePx * mm_per_px || !InRange(laid->object, 2 * mm_per_px))
    return std::nullopt;
  const auto defs = usual.model->dimensions();
  NormalEquations fixed(usual.StateSize());
  AddTargets(laid->object, targets.edges, targets.circles, fixed, targets.trust_ends);
  const Eigen::MatrixXd covariance = targets.trust_ends ? laid->covariance : Covariance(fixed.ata, defs);
  Hypothesis h;
  h.object = laid->object;
  h.determined.resize(defs.size());
  for (std::size_t i = 0; i < defs.size(); ++i) {
    const int at = kPlacementSize + int(i);
    h.object.dimensions_mm[i] = std::clamp(h.object.dimensions_mm[i], defs[i].min_mm, defs[i].max_mm);
    h.determined[i] = std::sqrt(covariance(at, at)) < kDetermined * PriorSigma(defs[i]);
  }
  h.open_direction = OpenDirections(fixed.ata, h.determined);
  const bool slanted = !targets.edges.empty() && std::abs(targets.edges[0].unit.z()) >= kSlantedRise;
  if (!slanted) AskUsual(h);
  return h;
}

}  // namespace vss
