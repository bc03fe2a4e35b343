#include "part_of_fit.h"

#include <algorithm>

#include "vss/product/designation.h"

namespace vss::station {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// The standard size that the dimensions tell; those that the operator gave count as measured.
void SetDesignation(const FitAnswer& answer, const FitQuestion& q, Part& part) {
  ReconstructedPart measured;
  measured.object = answer.object;
  measured.covariance = answer.covariance;
  for (const auto& d : part.dimensions)
    measured.dimensions.push_back(
        {d.name, d.value_mm, d.sigma_mm, d.observable || q.fixed_mm.contains(d.name), d.origin});
  const Designation size = Designate(measured);
  part.designation = size.name;
  part.standard = size.standard;
  part.designation_candidates = size.candidates;
  for (std::size_t i = 0; i < size.nominal_mm.size(); ++i) part.dimensions[i].nominal_mm = size.nominal_mm[i];
}

// (x, y, z, rotation vector in world, dimensions) of a part by the object's state, by difference.
MatrixXd PoseAndDimensionsByState(const PlacedObject& object, const RigidTransform& world_from_part) {
  const int n = int(object.dimensions_mm.size());
  MatrixXd by_state = MatrixXd::Zero(6 + n, object.StateSize());
  constexpr double kStep = 1e-4;
  for (int i = 0; i < object.StateSize(); ++i) {
    PlacedObject moved = object;
    VectorXd state = object.State();
    state[i] += kStep;
    moved.SetState(state);
    const RigidTransform after = PlaceSolid(moved, false).world_from_part;
    by_state.block<3, 1>(0, i) = (after.translation - world_from_part.translation) / kStep;
    by_state.block<3, 1>(3, i) =
        VectorFromRotation(after.rotation * world_from_part.rotation.transpose()) / kStep;
    if (i >= kPlacementSize) by_state(i, i) = 1;
  }
  return by_state;
}

std::vector<DimensionValue> DimensionsOfFit(const FitAnswer& answer, const FitQuestion& q) {
  std::vector<DimensionValue> out;
  const auto defs = q.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    DimensionValue d{defs[i].name, answer.object.dimensions_mm[i], answer.sigma_mm[i], answer.observable[i],
                     ""};
    if (q.fixed_mm.contains(d.name))
      d.origin = "given by the operator", d.observable = false, d.sigma_mm = 0;
    else if (!d.observable)
      d.origin = "not determined by the picked lines: what is usual for this kind";
    out.push_back(std::move(d));
  }
  return out;
}

}  // namespace

Part PartOfFit(const FitAnswer& answer, const FitQuestion& q) {
  Part part;
  const PlacedObject& object = answer.object;
  const WorldSolid solid = PlaceSolid(object);
  part.kind = q.model->kind();
  part.features = FeaturesOf(*q.model);
  part.has_features = !q.model->features().empty();
  part.resting_pose = q.model->resting_poses()[std::size_t(object.resting_pose)].name;
  part.world_from_part = solid.world_from_part;
  part.yaw_rad = object.placement[3];
  part.dimensions = DimensionsOfFit(answer, q);
  for (const auto& v : solid.vertices) {
    part.vertices.push_back(v.point);
    part.vertex_sigma.push_back(
        (v.by_state * answer.covariance * v.by_state.transpose()).diagonal().cwiseMax(0).cwiseSqrt());
  }
  for (const auto& e : solid.edges) part.edges.push_back({e.start, e.end});
  for (const auto& c : solid.circles) part.circles.push_back({c.center.point, c.normal, c.radius_mm});
  const MatrixXd by_state = PoseAndDimensionsByState(object, solid.world_from_part);
  part.covariance = by_state * answer.covariance * by_state.transpose();
  for (std::size_t i = 0; i < q.picks.size(); ++i) {
    const Pick& p = q.picks[i];
    part.matches.push_back({p.image, p.line, p.contour, p.is_circle, answer.residual_px[i]});
    if (std::find(part.images.begin(), part.images.end(), p.image) == part.images.end())
      part.images.push_back(p.image);
  }
  std::sort(part.images.begin(), part.images.end());
  part.residual_px = answer.rms_px;
  SetDesignation(answer, q, part);
  return part;
}

}  // namespace vss::station
