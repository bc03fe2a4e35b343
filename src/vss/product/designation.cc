#include "vss/product/designation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <set>

namespace vss {
namespace {

constexpr std::size_t kMaxCandidates = 4;  // more say nothing
constexpr double kStaysMm = 0.05;  // a measured edge that moves less has not moved: half the usual sigma

// The edges and rims that pictures measured.
struct Measured {
  std::set<int> edges, circles;
};
Measured MeasuredOf(const ReconstructedPart& part) {
  Measured m;
  for (const EdgeResidual& e : part.edges) {
    if (!e.used) continue;
    if (e.source == ContourSample::Source::kEdge) m.edges.insert(e.index);
    if (e.source == ContourSample::Source::kCircle) m.circles.insert(e.index);
  }
  return m;
}

// How the measured edges move (across themselves) and the measured rims with the state: a row each, mm by
// state.
Eigen::MatrixXd MotionOfMeasured(const PlacedObject& object, const Measured& measured) {
  const WorldSolid solid = PlaceSolid(object);
  std::vector<Eigen::RowVectorXd> rows;
  for (const int i : measured.edges) {
    const SolidEdge& e = solid.edges[static_cast<std::size_t>(i)];
    const WorldPoint &a = solid.vertices[static_cast<std::size_t>(e.start)],
                     &b = solid.vertices[static_cast<std::size_t>(e.end)];
    const Eigen::Vector3d along = (b.point - a.point).normalized(), one = along.unitOrthogonal(),
                          other = along.cross(one);
    for (const WorldPoint* p : {&a, &b})
      for (const Eigen::Vector3d& across : {one, other}) rows.emplace_back(across.transpose() * p->by_state);
  }
  for (const int i : measured.circles) {
    const auto& c = solid.circles[static_cast<std::size_t>(i)];
    for (int axis = 0; axis < 3; ++axis) rows.emplace_back(c.center.by_state.row(axis));
    rows.push_back(c.radius_by_state);
  }
  Eigen::MatrixXd out(static_cast<Eigen::Index>(rows.size()), object.StateSize());
  for (std::size_t r = 0; r < rows.size(); ++r) out.row(static_cast<Eigen::Index>(r)) = rows[r];
  return out;
}

// How the state goes with dimension `at` so that the measured edges move least: the place follows.
Eigen::VectorXd Follow(const Eigen::MatrixXd& motion, Eigen::Index at) {
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(motion.cols());
  direction[at] = 1;
  const Eigen::MatrixXd place = motion.leftCols<2>();
  Eigen::Matrix2d information = place.transpose() * place;
  information.diagonal().array() += 1e-9;
  direction.head<2>() = -information.ldlt().solve(place.transpose() * motion.col(at));
  return direction;
}

// False, and nothing is changed, where the value contradicts what was measured or the knowledge base.
bool TakeFromCatalogue(ReconstructedPart& part, std::size_t d, double nominal_mm, double sigma_mm) {
  const Eigen::Index at = kPlacementSize + static_cast<Eigen::Index>(d);
  const Eigen::MatrixXd motion = MotionOfMeasured(part.object, MeasuredOf(part));
  const Eigen::VectorXd follow = Follow(motion, at);
  const double change = nominal_mm - part.object.dimensions_mm[d];
  if (motion.rows() > 0 && (motion * follow * change).cwiseAbs().maxCoeff() > kStaysMm) return false;
  PlacedObject moved = part.object;
  moved.SetState(part.object.State() + change * follow);
  if (!moved.model->Violations(moved.dimensions_mm).empty()) return false;
  part.object = moved;
  part.covariance.row(at).setZero();
  part.covariance.col(at).setZero();
  part.covariance += sigma_mm * sigma_mm * follow * follow.transpose();
  return true;
}

void UpdateVertexSigma(ReconstructedPart& part) {
  const WorldSolid solid = PlaceSolid(part.object);
  part.vertex_sigma.clear();
  for (const WorldPoint& v : solid.vertices)
    part.vertex_sigma.push_back(
        (v.by_state * part.covariance * v.by_state.transpose()).diagonal().cwiseMax(0).cwiseSqrt());
}

}  // namespace

Designation Designate(ReconstructedPart& part) {
  Designation out;
  std::vector<MeasuredDimension> measured;
  for (const ReconstructedDimension& d : part.dimensions)
    measured.push_back({d.value_mm, std::isfinite(d.sigma_mm) ? d.sigma_mm : 0, d.observable});
  if (measured.size() != part.object.dimensions_mm.size()) return out;
  const std::vector<SizeMatch> matches = part.object.model->MatchSizes(measured);
  const SizeMatch* size = DeterminedSize(matches);
  if (!size) {
    if (matches.size() <= kMaxCandidates)
      for (const SizeMatch& m : matches) out.candidates.push_back(m.designation);
    return out;
  }
  out.name = size->designation;
  out.standard = size->standard;
  out.nominal_mm = size->nominal_mm;
  bool changed = false;
  for (std::size_t d = 0; d < measured.size(); ++d) {
    if (measured[d].observed || !size->nominal_mm[d]) continue;
    const double sigma_mm =
        size->tolerance_mm[d] / std::sqrt(3.0);  // of a value anywhere within its tolerance
    if (!TakeFromCatalogue(part, d, *size->nominal_mm[d], sigma_mm)) continue;
    part.dimensions[d].value_mm = *size->nominal_mm[d];
    part.dimensions[d].sigma_mm = sigma_mm;
    part.dimensions[d].origin = fmt::format("{} of {}, which the observed dimensions tell; within {:g} mm",
                                            size->designation, size->standard, size->tolerance_mm[d]);
    changed = true;
  }
  if (changed) UpdateVertexSigma(part);
  return out;
}

}  // namespace vss
