#include "cut.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "part_json.h"

namespace vss::station {
namespace {

using Eigen::Vector3d;

constexpr double kOnEndMm = 1e-6;   // a point so near to an end of the solid lies on it
constexpr double kParallel = 0.99;  // cosine of a rim's normal and an axis that are parallel
constexpr double kStepMm = 1.0;     // a dimension is made so much larger to see what it moves

Solid SolidAt(const ObjectModel& model, const std::vector<double>& dimensions_mm) {
  return model.InstantiateUnchecked(dimensions_mm);
}

bool RunsAcross(const SolidCircle& circle, int axis) {
  return std::abs(circle.normal_in_part[axis]) > kParallel;
}

// The points that bound the solid along an axis: vertices, and rims across it.
std::vector<double> PlacesAlong(const Solid& solid, int axis) {
  std::vector<double> places;
  for (const auto& v : solid.vertices) places.push_back(v.point_in_part[axis]);
  for (const auto& c : solid.circles)
    if (RunsAcross(c, axis)) places.push_back(c.center.point_in_part[axis]);
  return places;
}

std::size_t IndexOf(const ObjectModel& model, const char* name) {
  const auto defs = model.dimensions();
  return std::size_t(std::find_if(defs.begin(), defs.end(), [&](const auto& d) { return d.name == name; }) -
                     defs.begin());
}

// The axis along which the dimension is the solid's whole extent; -1 where there is none.
int AxisOf(const ObjectModel& model, const std::vector<double>& dimensions_mm, std::size_t dimension) {
  std::vector<double> longer = dimensions_mm;
  longer[dimension] += kStepMm;
  const Solid solid = SolidAt(model, dimensions_mm), larger = SolidAt(model, longer);
  for (int axis = 0; axis < 3; ++axis) {
    if (PlacesAlong(solid, axis).empty()) continue;
    const Extent now = ExtentAlong(solid, axis), then = ExtentAlong(larger, axis);
    const double extent = now.high_mm - now.low_mm;
    if (std::abs(extent - dimensions_mm[dimension]) < kOnEndMm &&
        std::abs(then.high_mm - then.low_mm - extent - kStepMm) < kOnEndMm)
      return axis;
  }
  return -1;
}

bool SameAllAlong(const Solid& solid, int axis) {
  const Extent extent = ExtentAlong(solid, axis);
  const auto places = PlacesAlong(solid, axis);
  return std::all_of(places.begin(), places.end(), [&](double x) {
    return std::min(std::abs(x - extent.low_mm), std::abs(x - extent.high_mm)) < kOnEndMm;
  });
}

// A kind that is a rectangular block and nothing else; null where the knowledge base has none.
const ObjectModel* BlockOf(const KnowledgeBase& knowledge) {
  for (const auto& model : knowledge.objects) {
    const std::vector<std::optional<double>> nothing(model->dimensions().size());
    const auto usual = model->UsualDimensions(nothing);
    const Solid solid = SolidAt(*model, usual);
    if (solid.vertices.size() == 8 && solid.circles.empty() && solid.arcs.empty() && usual.size() == 3 &&
        CutAxesOf(*model, usual).size() == 3)
      return model.get();
  }
  return nullptr;
}

// By how much (mm) the object breaks what its author requires; a part that was measured may break it by a
// little.
double BrokenBy(const ObjectModel* model, const std::vector<double>& dimensions_mm) {
  double sum = 0;
  for (double v : model->Violations(dimensions_mm)) sum += v;
  return sum;
}

// An object at a place of its `part` frame.
struct Placed {
  const ObjectModel* model = nullptr;
  std::vector<double> dimensions_mm;
  RigidTransform world_from_part;
};

// The holes of `whole` that a piece has, from `low_mm` to `high_mm` along `axis` of `part`: all of them, or
// none.
Result<bool> KeepsHoles(const Solid& whole, int axis, double low_mm, double high_mm) {
  int kept = 0, lost = 0;
  for (const auto& c : whole.circles) {
    if (RunsAcross(c, axis)) continue;  // it ends where the solid ends
    const double x = c.center.point_in_part[axis];
    if (x - c.radius_mm >= low_mm && x + c.radius_mm <= high_mm)
      ++kept;
    else if (x + c.radius_mm <= low_mm || x - c.radius_mm >= high_mm)
      ++lost;
    else
      return UsageError("the cut goes through a hole; cut beside it");
  }
  if (kept > 0 && lost > 0)
    return UsageError("each piece would have some of the holes; build the pieces by hand");
  return lost == 0;
}

// Changes the dimensions that move holes only, so that the holes lie where `centers_in_part` says.
void PutHoles(const std::vector<Vector3d>& centers_in_part, Placed& piece) {
  const Solid solid = SolidAt(*piece.model, piece.dimensions_mm);
  if (solid.circles.empty() || centers_in_part.size() != solid.circles.size()) return;
  const auto n = Eigen::Index(piece.dimensions_mm.size());
  std::vector<Eigen::Index> free;
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto moves = [&](const SolidPoint& p) { return p.by_dimension.col(k).norm() > kOnEndMm; };
    const bool holes_only = std::none_of(solid.vertices.begin(), solid.vertices.end(), moves) &&
                            std::any_of(solid.circles.begin(), solid.circles.end(),
                                        [&](const auto& c) { return moves(c.center); });
    if (holes_only) free.push_back(k);
  }
  if (free.empty()) return;
  Eigen::MatrixXd j =
      Eigen::MatrixXd::Zero(3 * Eigen::Index(solid.circles.size()), Eigen::Index(free.size()));
  Eigen::VectorXd wanted(j.rows());
  for (Eigen::Index i = 0; i < Eigen::Index(solid.circles.size()); ++i) {
    const SolidPoint& center = solid.circles[std::size_t(i)].center;
    for (Eigen::Index k = 0; k < j.cols(); ++k)
      j.block<3, 1>(3 * i, k) = center.by_dimension.col(free[std::size_t(k)]);
    wanted.segment<3>(3 * i) = centers_in_part[std::size_t(i)] - center.point_in_part;
  }
  const Eigen::VectorXd step = j.colPivHouseholderQr().solve(wanted);
  for (std::size_t k = 0; k < free.size(); ++k)
    piece.dimensions_mm[std::size_t(free[k])] += step[Eigen::Index(k)];
}

bool SameVertices(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b) {
  return a.size() == b.size() && std::all_of(a.begin(), a.end(), [&](const Vector3d& p) {
           return std::any_of(b.begin(), b.end(),
                              [&](const Vector3d& q) { return (p - q).norm() < kOnEndMm; });
         });
}

std::vector<Vector3d> VerticesInWorld(const Placed& p) {
  std::vector<Vector3d> out;
  for (const auto& v : SolidAt(*p.model, p.dimensions_mm).vertices)
    out.push_back(p.world_from_part * v.point_in_part);
  return out;
}

// The contract calls the longer of two horizontal sides the length, where the object is the same when both
// are exchanged.
Placed WithLongerSideFirst(const Placed& p) {
  const std::size_t length = IndexOf(*p.model, "length"), width = IndexOf(*p.model, "width");
  if (std::max(length, width) >= p.dimensions_mm.size() || p.dimensions_mm[length] >= p.dimensions_mm[width])
    return p;
  Placed turned = p;
  std::swap(turned.dimensions_mm[length], turned.dimensions_mm[width]);
  turned.world_from_part.rotation =
      p.world_from_part.rotation * Eigen::AngleAxisd(kPi / 2, Vector3d::UnitZ()).toRotationMatrix();
  return SameVertices(VerticesInWorld(turned), VerticesInWorld(p)) ? turned : p;
}

PlacedObject ObjectAt(const Placed& p, const PlacedObject& whole, const KnowledgeBase& knowledge) {
  Part part;
  part.kind = p.model->kind();
  part.features = FeaturesOf(*p.model);
  part.world_from_part = p.world_from_part;
  if (p.model == whole.model)
    part.resting_pose = p.model->resting_poses()[std::size_t(whole.resting_pose)].name;
  const auto defs = p.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i)
    part.dimensions.push_back({defs[i].name, p.dimensions_mm[i], 0, true, ""});
  return PlacedObjectOf(part, knowledge);
}

// Shifted so that its solid begins at `low_mm` along that axis of its `part` frame as it was.
Placed BegunAt(Placed p, int axis, double low_mm) {
  Vector3d shift_in_part = Vector3d::Zero();
  shift_in_part[axis] = low_mm - ExtentAlong(SolidAt(*p.model, p.dimensions_mm), axis).low_mm;
  p.world_from_part.translation += p.world_from_part.rotation * shift_in_part;
  return p;
}

// `whole` with one dimension as long as the piece, or the block that the piece is without its holes. Its
// place comes later.
Result<Placed> ShapeOf(const PlacedObject& whole, const Solid& solid, const CutAxis& cut, double length_mm,
                       bool holes, const RigidTransform& world_from_part, const KnowledgeBase& knowledge) {
  Placed piece{whole.model, whole.dimensions_mm, world_from_part};
  piece.dimensions_mm[cut.dimension] = length_mm;
  if (holes) return piece;
  piece.model = BlockOf(knowledge);
  if (!piece.model)
    return UsageError(
        "a piece without its holes is no object of the knowledge base; build the pieces by hand");
  const std::vector<std::optional<double>> nothing(piece.model->dimensions().size());
  piece.dimensions_mm = piece.model->UsualDimensions(nothing);
  for (const auto& side : CutAxesOf(*piece.model, piece.dimensions_mm)) {
    const Extent extent = ExtentAlong(solid, side.axis);
    piece.dimensions_mm[side.dimension] = side.axis == cut.axis ? length_mm : extent.high_mm - extent.low_mm;
  }
  return piece;
}

}  // namespace

Extent ExtentAlong(const Solid& solid, int axis) {
  const auto places = PlacesAlong(solid, axis);
  if (places.empty()) return {};
  const auto [low, high] = std::minmax_element(places.begin(), places.end());
  return {*low, *high};
}

std::vector<CutAxis> CutAxesOf(const ObjectModel& model, const std::vector<double>& dimensions_mm) {
  std::vector<CutAxis> out;
  const Solid solid = SolidAt(model, dimensions_mm);
  const auto defs = model.dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    const int axis = AxisOf(model, dimensions_mm, i);
    if (axis >= 0 && (defs[i].name == "length" || SameAllAlong(solid, axis))) out.push_back({i, axis});
  }
  return out;
}

std::vector<std::string> CutDimensionsOf(const ObjectModel& model) {
  const std::vector<std::optional<double>> nothing(model.dimensions().size());
  std::vector<std::string> names;
  for (const auto& axis : CutAxesOf(model, model.UsualDimensions(nothing)))
    names.push_back(model.dimensions()[axis.dimension].name);
  return names;
}

Result<PlacedObject> PieceOf(const PlacedObject& whole, const CutAxis& cut, double from, double to,
                             const KnowledgeBase& knowledge) {
  const Solid solid = SolidAt(*whole.model, whole.dimensions_mm);
  const RigidTransform world_from_part = PlaceSolid(whole, false).world_from_part;
  const Extent extent = ExtentAlong(solid, cut.axis);
  const double whole_mm = extent.high_mm - extent.low_mm, low = extent.low_mm + from * whole_mm,
               high = extent.low_mm + to * whole_mm;
  VSS_ASSIGN(const bool holes, KeepsHoles(solid, cut.axis, low, high));
  VSS_ASSIGN(Placed piece, ShapeOf(whole, solid, cut, high - low, holes, world_from_part, knowledge));
  piece = WithLongerSideFirst(BegunAt(piece, cut.axis, low));
  std::vector<Vector3d> centers;
  if (holes)
    for (const auto& c : solid.circles)
      centers.push_back(piece.world_from_part.Inverse() * (world_from_part * c.center.point_in_part));
  PutHoles(centers, piece);
  if (BrokenBy(piece.model, piece.dimensions_mm) > BrokenBy(whole.model, whole.dimensions_mm) + kOnEndMm)
    return UsageError("a piece of {:.0f} mm is no {} any more; cut elsewhere", high - low,
                      piece.model->kind());
  return ObjectAt(piece, whole, knowledge);
}

PlacedObject Stretched(const PlacedObject& object, const CutAxis& cut, const Extent& extent,
                       const KnowledgeBase& knowledge) {
  Placed p{object.model, object.dimensions_mm, PlaceSolid(object, false).world_from_part};
  const DimensionDef& def = object.model->dimensions()[cut.dimension];
  p.dimensions_mm[cut.dimension] = std::clamp(extent.high_mm - extent.low_mm, def.min_mm, def.max_mm);
  return ObjectAt(WithLongerSideFirst(BegunAt(p, cut.axis, extent.low_mm)), object, knowledge);
}

}  // namespace vss::station
