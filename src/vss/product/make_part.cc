#include "vss/product/make_part.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "vss/product/designation.h"

namespace vss {
namespace {

// Mean residual of the contours, root mean square.
double ResidualOf(const std::vector<ContourMatch>& matches) {
  double sum = 0;
  for (const auto& m : matches) sum += m.residual_px * m.residual_px;
  return matches.empty() ? 0 : std::sqrt(sum / static_cast<double>(matches.size()));
}

// The dimensions of `part` in the order of `model`; empty where one is missing.
std::vector<double> DimensionsOf(const Part& part, const ObjectModel& model) {
  std::vector<double> values;
  for (const auto& definition : model.dimensions()) {
    const auto found = std::find_if(part.dimensions.begin(), part.dimensions.end(),
                                    [&](const auto& d) { return d.name == definition.name; });
    if (found == part.dimensions.end()) return {};
    values.push_back(found->value_mm);
  }
  return values;
}

// From the covariance of the state (x, y, z, yaw, tilt_x, tilt_y, dimensions) to that of the part frame's
// origin, its rotation vector in world and the dimensions. The derivative is taken numerically: exact to 1e-7
// of itself.
Eigen::MatrixXd PoseCovariance(const PlacedObject& object, const Eigen::MatrixXd& of_state) {
  const int n = object.StateSize();
  if (of_state.rows() != n || of_state.cols() != n) return {};
  constexpr double kStep_mm = 1e-3, kStep_rad = 1e-6;
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Identity(n, n);
  for (int k = 0; k < n; ++k) {
    const double step = k >= 3 && k < kPlacementSize ? kStep_rad : kStep_mm;
    const auto pose_at = [&](double change) {
      PlacedObject moved = object;
      Eigen::VectorXd state = object.State();
      state[k] += change;
      moved.SetState(state);
      return PlaceSolid(moved, false).world_from_part;
    };
    const RigidTransform ahead = pose_at(step), behind = pose_at(-step);
    jacobian.col(k).head<3>() = (ahead.translation - behind.translation) / (2 * step);
    jacobian.col(k).segment<3>(3) =
        VectorFromRotation(ahead.rotation * behind.rotation.transpose()) / (2 * step);
  }
  return jacobian * of_state * jacobian.transpose();
}

// Picture by picture, in the survey's order: the root mean square of the means of the edges measured there.
std::vector<PictureResidual> PictureResiduals(const ReconstructedPart& reconstructed,
                                              std::span<const View> views) {
  std::map<int, PictureResidual> by_image;
  for (const auto& edge : reconstructed.edges) {
    if (!edge.used) continue;
    PictureResidual& r = by_image[views[static_cast<std::size_t>(edge.view)].image];
    r.rms_px += edge.mean_px * edge.mean_px;
    ++r.num_edges;
  }
  std::vector<PictureResidual> out;
  for (auto& [image, r] : by_image) out.push_back({image, std::sqrt(r.rms_px / r.num_edges), r.num_edges});
  return out;
}

std::vector<ContourResidual> ContourResiduals(const ReconstructedPart& reconstructed,
                                              std::span<const View> views) {
  static const char* const contours[] = {"edge", "circle", "limb"};
  std::vector<ContourResidual> out;
  for (const auto& e : reconstructed.edges) {
    // How it lies is the contour's own; a shadow behind it, the picture's.
    const bool shadowed = e.edge_class == ContourClass::kShadowed;
    const ContourClass own =
        e.source == ContourSample::Source::kCircle ? ContourClass::kRound : ContourClass::kFree;
    out.push_back({contours[static_cast<std::size_t>(e.source)], e.index, e.limb_side,
                   NameOf(shadowed ? own : e.edge_class), views[static_cast<std::size_t>(e.view)].image,
                   e.mean_px, e.rms_px, e.num_points, e.used, shadowed});
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
    return std::tie(a.contour, a.index, a.side, a.image) < std::tie(b.contour, b.index, b.side, b.image);
  });
  return out;
}

SurveyChecks MakeChecks(const Reconstruction& reconstruction, std::span<const View> views) {
  static const char* const scales[] = {"known length", "gantry", "places of the pictures"};
  SurveyChecks out;
  for (const auto& i : reconstruction.influences)
    out.pictures.push_back({views[static_cast<std::size_t>(i.view)].image, i.num_edges, i.rms_px,
                            PartId(i.part), i.unknown, i.change_mm, i.sigma_mm, i.outlying});
  for (const auto& c : reconstruction.cameras) {
    const View& first = views[static_cast<std::size_t>(c.views[0])];
    out.cameras.push_back({c.camera, first.stop < 0 ? first.image : -1, 1e3 * c.rotation_rad,
                           1e3 * c.rotation_sigma_rad, c.shift_mm, c.shift_sigma_mm, c.significance,
                           c.moved});
  }
  const auto& scale = reconstruction.scale;
  out.scale = {scales[static_cast<std::size_t>(scale.from)], 1e6 * scale.correction, 1e6 * scale.sigma};
  out.systematic_px = reconstruction.systematic_px;
  if (const auto& g = reconstruction.ground)
    out.ground = {g->at, g->height_mm, g->sigma_mm, 1e3 * g->slope, 1e3 * g->slope_sigma};
  return out;
}

}  // namespace

std::string PartId(int index) { return fmt::format("part-{}", index + 1); }

void SetGeometry(const PlacedObject& object, Part& part) {
  const WorldSolid solid = PlaceSolid(object, false);
  part.kind = object.model->kind();
  part.features = FeaturesOf(*object.model);
  part.has_features = !object.model->features().empty();
  part.resting_pose = object.model->resting_poses()[static_cast<std::size_t>(object.resting_pose)].name;
  part.world_from_part = solid.world_from_part;
  part.yaw_rad = object.placement[3];
  part.dimensions.resize(object.dimensions_mm.size());
  for (std::size_t i = 0; i < object.dimensions_mm.size(); ++i) {
    part.dimensions[i].name = object.model->dimensions()[i].name;
    part.dimensions[i].value_mm = object.dimensions_mm[i];
    part.dimensions[i].nominal_mm.reset();
  }
  // Of the size that other dimensions told.
  part.designation.clear();
  part.standard.clear();
  part.designation_candidates.clear();
  part.vertices.clear();
  for (const auto& v : solid.vertices) part.vertices.push_back(v.point);
  part.edges.clear();
  for (const auto& e : solid.edges) part.edges.push_back({e.start, e.end});
  part.circles.clear();
  for (const auto& c : solid.circles) part.circles.push_back({c.center.point, c.normal, c.radius_mm});
}

Part MakePart(const IdentifiedPart& found, const std::string& id, std::span<const View> views) {
  Part part;
  part.id = id;
  SetGeometry(found.object, part);
  for (auto& d : part.dimensions) d.sigma_mm = std::numeric_limits<double>::quiet_NaN();
  for (int view : found.views) part.images.push_back(views[static_cast<std::size_t>(view)].image);
  part.matches = found.matches;
  for (auto& match : part.matches) match.image = views[static_cast<std::size_t>(match.image)].image;
  part.residual_px = ResidualOf(part.matches);
  part.doubtful = found.doubtful;
  part.log_odds = found.log_odds;
  part.runner_up = found.runner_up;
  return part;
}

void SetReconstruction(const ReconstructedPart& measured, std::span<const View> views, Part& part) {
  ReconstructedPart reconstructed = measured;
  const Designation size = Designate(reconstructed);
  SetGeometry(reconstructed.object, part);
  part.designation = size.name;
  part.standard = size.standard;
  part.designation_candidates = size.candidates;
  for (std::size_t i = 0; i < part.dimensions.size() && i < reconstructed.dimensions.size(); ++i) {
    const ReconstructedDimension& d = reconstructed.dimensions[i];
    part.dimensions[i] = {d.name, d.value_mm, d.sigma_mm, d.observable, d.origin, {}};
    if (i < size.nominal_mm.size()) part.dimensions[i].nominal_mm = size.nominal_mm[i];
  }
  part.vertex_sigma = reconstructed.vertex_sigma;
  part.vertex_covariance = reconstructed.vertex_covariance;
  part.covariance = PoseCovariance(reconstructed.object, reconstructed.covariance);
  part.residual_px = reconstructed.residual_px;
  part.picture_residuals = PictureResiduals(reconstructed, views);
  part.contour_residuals = ContourResiduals(reconstructed, views);
  part.straightness.clear();
  for (const auto& s : reconstructed.straightness)
    part.straightness.push_back({s.edge, s.bow_mm, s.sigma_mm, s.num_views});
  part.observable = reconstructed.observable;
  part.singular_values = reconstructed.singular_values;
  part.remarks = reconstructed.remarks;
  part.images.clear();
  for (int view : reconstructed.views) part.images.push_back(views[static_cast<std::size_t>(view)].image);
}

Product MakeProduct(const SceneResult& scene, const Reconstruction& reconstruction,
                    std::span<const View> views) {
  Product product;
  for (std::size_t i = 0; i < scene.parts.size(); ++i) {
    const IdentifiedPart& found = scene.parts[i];
    Part part = MakePart(found, PartId(static_cast<int>(i)), views);
    if (found.stands_on >= 0) part.stands_on = PartId(found.stands_on);
    if (i < reconstruction.parts.size()) SetReconstruction(reconstruction.parts[i], views, part);
    product.parts.push_back(std::move(part));
  }
  product.unknown = scene.unknown;
  product.warnings = reconstruction.warnings;
  for (const auto& part : product.parts)
    for (const auto& remark : part.remarks)
      product.warnings.push_back(fmt::format("{} ({}): {}", part.id, part.kind, remark));
  product.checks = MakeChecks(reconstruction, views);
  return product;
}

std::optional<WorldSolid> SolidOfPart(const Part& part, const KnowledgeBase& knowledge) {
  const ObjectModel* model = knowledge.Find(part.kind, part.features);
  if (model == nullptr) model = knowledge.Find(part.kind);
  if (model == nullptr) return std::nullopt;
  const std::vector<double> dimensions_mm = DimensionsOf(part, *model);
  if (dimensions_mm.size() != model->dimensions().size()) return std::nullopt;
  const RigidTransform& pose = part.world_from_part;
  Solid solid = model->InstantiateUnchecked(dimensions_mm);
  WorldSolid out;
  out.world_from_part = pose;
  for (const auto& v : solid.vertices) out.vertices.push_back({pose * v.point_in_part, {}});
  out.edges = std::move(solid.edges);
  for (const auto& c : solid.circles) {
    const Eigen::Vector3d normal = pose.rotation * c.normal_in_part;
    const Eigen::Vector3d axis_u = normal.unitOrthogonal();
    out.circles.push_back({{pose * c.center.point_in_part, {}},
                           normal,
                           axis_u,
                           normal.cross(axis_u),
                           c.radius_mm,
                           {},
                           c.plane_face,
                           c.cylinder_face,
                           c.weight});
  }
  out.faces = std::move(solid.faces);
  for (auto& face : out.faces) {
    face.normal_in_part = pose.rotation * face.normal_in_part;
    face.axis_point = pose * face.axis_point;
    face.axis_direction = pose.rotation * face.axis_direction;
    for (auto& triangle : face.triangles)
      for (auto& corner : triangle) corner = pose * corner;
  }
  return out;
}

}  // namespace vss
