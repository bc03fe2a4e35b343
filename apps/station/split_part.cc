#include "split_part.h"

#include <algorithm>
#include <cmath>

#include "cut.h"
#include "edit.h"
#include "part_of_fit.h"

namespace vss::station {
namespace {

using Eigen::Vector3d;

constexpr double kLeastShare = 0.02;  // of its length that a piece has
constexpr double kFacingSine = 1e-9;  // a ray along a triangle does not meet it
constexpr double kUpright = 0.9;      // cosine to the vertical from which on one piece stands on the other

// A part that is about to be cut.
struct Whole {
  PlacedObject object;
  CutAxis cut;
  std::string along;       // the name of that dimension
  double whole_mm = 0;     // its value
  double least_share = 0;  // of it that a piece has
  double low_mm = 0;       // where it begins, along the axis of `part`
  RigidTransform world_from_part;
};

// `along`: the dimension that is divided; empty: the first that can be.
Result<Whole> WholeOf(const Part& part, const std::string& along, const KnowledgeBase& knowledge) {
  Whole w;
  w.object = PlacedObjectOf(part, knowledge);
  if (!w.object.model)
    return UsageError("the knowledge base has no kind \"{}\"; it cannot be split", part.kind);
  const auto defs = w.object.model->dimensions();
  const auto axes = CutAxesOf(*w.object.model, w.object.dimensions_mm);
  const auto cut = std::find_if(axes.begin(), axes.end(), [&](const CutAxis& a) {
    return along.empty() || defs[a.dimension].name == along;
  });
  if (cut == axes.end())
    return UsageError(
        "a {} cannot be cut along its {}: the pieces would be no kind of the knowledge base; build them by "
        "hand",
        part.kind, along.empty() ? "dimensions" : along.substr(0, 40));
  w.cut = *cut;
  const DimensionDef& def = defs[cut->dimension];
  w.along = def.name;
  w.whole_mm = w.object.dimensions_mm[cut->dimension];
  w.least_share = std::max(kLeastShare, def.min_mm / w.whole_mm);
  if (w.least_share > 0.5)
    return UsageError("the {} of a {} is at least {:g} mm, and here {:.0f} mm: it cannot be split", w.along,
                      part.kind, def.min_mm, w.whole_mm);
  w.low_mm = ExtentAlong(w.object.model->InstantiateUnchecked(w.object.dimensions_mm), cut->axis).low_mm;
  w.world_from_part = PlaceSolid(w.object, false).world_from_part;
  return w;
}

// Where the ray from `eye` along `d` meets the triangle, as a multiple of d (Moeller and Trumbore 1997).
std::optional<double> Meet(const Vector3d& eye, const Vector3d& d, const std::array<Vector3d, 3>& t) {
  const Vector3d e1 = t[1] - t[0], e2 = t[2] - t[0], p = d.cross(e2), s = eye - t[0], q = s.cross(e1);
  const double det = e1.dot(p);
  if (std::abs(det) < kFacingSine * e1.norm() * e2.norm()) return std::nullopt;
  const double u = s.dot(p) / det, v = d.dot(q) / det, along = e2.dot(q) / det;
  if (u < 0 || v < 0 || u + v > 1 || along <= 0) return std::nullopt;
  return along;
}

// The point of the part under `img`; beside it the point of the line through its middle along `axis` nearest
// to the ray.
Vector3d PointedAt(const WorldSolid& solid, const Vector3d& axis, const View& view,
                   const Eigen::Vector2d& img) {
  const auto n = view.camera->intrinsics.NormalizedFromImg(img);
  const Vector3d ray = view.RayOfIdeal(n ? view.camera->intrinsics.IdealFromNormalized(*n) : img);
  std::optional<double> nearest;
  for (const auto& face : solid.faces)
    for (const auto& t : face.triangles)
      if (const auto along = Meet(view.center_in_world, ray, t); along && (!nearest || *along < *nearest))
        nearest = along;
  if (nearest) return view.center_in_world + *nearest * ray;
  Vector3d middle = Vector3d::Zero();
  for (const auto& v : solid.vertices) middle += v.point / double(solid.vertices.size());
  if (solid.vertices.empty())  // a pipe
    for (const auto& c : solid.circles) middle += c.center.point / double(solid.circles.size());
  const Vector3d between = view.center_in_world - middle;
  const double cosine = axis.dot(ray), sine2 = 1 - cosine * cosine;
  const double along = sine2 < kFacingSine ? 0 : (axis.dot(between) - cosine * ray.dot(between)) / sine2;
  return middle + along * axis;
}

// A piece as a part: what is known of the whole is kept, but for the dimension that was cut.
Part PartOfPiece(const PlacedObject& piece, const Part& whole, const std::string& along) {
  FitAnswer answer;
  answer.object = piece;
  answer.covariance = Eigen::MatrixXd::Zero(piece.StateSize(), piece.StateSize());
  answer.sigma_mm.assign(piece.dimensions_mm.size(), 0.0);
  answer.observable.assign(piece.dimensions_mm.size(), true);
  FitQuestion question;
  question.model = piece.model;
  Part part = PartOfFit(answer, question);
  part.covariance.resize(0, 0);
  part.vertex_sigma.clear();
  const auto value = [&](const std::string& name) {
    const auto at = std::find_if(whole.dimensions.begin(), whole.dimensions.end(),
                                 [&](const auto& d) { return d.name == name; });
    return at == whole.dimensions.end() ? nullptr : &*at;
  };
  // Which of the whole's dimensions each is: by its name, unless length and width were exchanged.
  const DimensionValue *length = value("length"), *width = value("width");
  bool turned = false;
  for (const auto& d : part.dimensions)
    turned |= length && width &&
              ((along == "length" && d.name == "length" && std::abs(d.value_mm - width->value_mm) < 1e-6) ||
               (along == "width" && d.name == "width" && std::abs(d.value_mm - length->value_mm) < 1e-6));
  for (auto& d : part.dimensions) {
    const std::string name = !turned              ? d.name
                             : d.name == "length" ? "width"
                             : d.name == "width"  ? "length"
                                                  : d.name;
    if (const DimensionValue* old = value(name))
      d.sigma_mm = old->sigma_mm, d.observable = old->observable, d.origin = old->origin,
      d.nominal_mm = old->nominal_mm;
    if (name == along)
      d.observable = false, d.origin = "where the operator split the part; measure it", d.nominal_mm.reset();
  }
  if (part.kind == whole.kind && along == "length") {  // a section's size does not change with its length
    part.designation = whole.designation;
    part.standard = whole.standard;
    part.designation_candidates = whole.designation_candidates;
  }
  part.source = "corrected";
  part.stands_on = whole.stands_on;
  part.images = whole.images;
  return part;
}

}  // namespace

Result<Json> CutPreview(Workspace& w, const Json& body) {
  VSS_ASSIGN(const auto old, w.FindPart(PartId(body)));
  VSS_ASSIGN(const Whole whole, WholeOf(old.first.part, body.value("along", ""), w.knowledge()));
  VSS_ASSIGN(const int image, IntOf(body, "image"));
  const std::vector<View> views = w.Views();
  if (image < 0 || std::size_t(image) >= views.size())
    return UsageError("there is no picture number {}", image);
  const Eigen::Vector2d img = PointOf(body.at("at"));
  if (!w.Inside(image, img)) return UsageError("point at the part inside the picture");
  const View& view = views[std::size_t(image)];
  const WorldSolid solid = PlaceSolid(whole.object, false);
  const Vector3d axis = whole.world_from_part.rotation.col(whole.cut.axis);
  const auto along = [&](const Vector3d& point) {
    return axis.dot(point - whole.world_from_part.translation) - whole.low_mm;
  };
  const double share = std::clamp(along(PointedAt(solid, axis, view, img)) / whole.whole_mm,
                                  whole.least_share, 1 - whole.least_share);
  Occluders occluders;
  int owner = 0;
  for (const auto& p : w.Parts())
    if (const PlacedObject object = PlacedObjectOf(p.part, w.knowledge()); object.model)
      occluders.Add(PlaceSolid(object, false), owner++);
  const Vector3d at = whole.world_from_part.translation + (whole.low_mm + share * whole.whole_mm) * axis;
  const auto pieces = ProjectCut(solid, at, axis, view, occluders);
  Json out = {{"share", share},
              {"along", whole.along},
              {"lengths", {share * whole.whole_mm, (1 - share) * whole.whole_mm}},
              {"pieces", PiecesToJson(pieces)}};
  for (const auto& [from, to] : {std::pair(0.0, share), std::pair(share, 1.0)})
    if (const auto piece = PieceOf(whole.object, whole.cut, from, to, w.knowledge()); !piece)
      out["refused"] = piece.error().message;
  return out;
}

// Into two at `share` of the dimension `along`: a cut that the operator sees in the pictures.
Result<Edit> SplitPart(const Context& c) {
  Workspace& w = c.workspace;
  VSS_ASSIGN(const auto old, w.FindPart(PartId(c.body)));
  VSS_ASSIGN(const Whole whole, WholeOf(old.first.part, c.body.value("along", ""), w.knowledge()));
  const double share = c.body.at("share").get<double>();
  if (!(share >= whole.least_share && share <= 1 - whole.least_share))
    return UsageError("this part is split between {:.1f} % and {:.1f} % of its {}", 100 * whole.least_share,
                      100 * (1 - whole.least_share), whole.along);
  // Of two pieces one above the other the lower keeps the id, and the upper stands on it.
  const double up = whole.world_from_part.rotation(2, whole.cut.axis);
  const std::string id = old.first.part.id, other = FreeId(w);
  std::array<std::string, 2> ids = {id, other};
  if (up < -kUpright) std::swap(ids[0], ids[1]);
  Edit edit{fmt::format("split {}", id), {}};
  for (std::size_t half : {std::size_t(0), std::size_t(1)}) {
    VSS_ASSIGN(const PlacedObject piece,
               PieceOf(whole.object, whole.cut, half == 0 ? 0 : share, half == 0 ? share : 1, w.knowledge()));
    StationPart part = old.first;
    part.part = PartOfPiece(piece, old.first.part, whole.along);
    part.part.id = ids[half];
    if (std::abs(up) > kUpright && ids[half] == other) part.part.stands_on = id;
    part.confirmed = false;
    part.doubt = "It was split: measure it, or pick the lines at the cut.";
    edit.answer["parts"].push_back(part.part.id);
    edit.changes.push_back(ChangeOf(w, part, ids[half] == id ? c.version : std::optional<std::int64_t>(0)));
  }
  if (std::abs(up) > kUpright)
    for (auto& p : w.Parts())
      if (p.part.stands_on == id) p.part.stands_on = other, edit.changes.push_back(ChangeOf(w, p, {}));
  return edit;
}

}  // namespace vss::station
