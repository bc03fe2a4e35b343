#include "split_part.h"

#include <algorithm>
#include <cmath>

#include "edit.h"

namespace vss::station {
namespace {

using Eigen::Vector3d;

constexpr double kLeastShare = 0.02;  // of its length that a piece has
constexpr double kOnEndMm = 1e-6;     // a vertex so near to an end of the part lies on it
constexpr double kFacingSine = 1e-9;  // a ray along a triangle does not meet it

// A part that is the same all along its x axis.
struct Bar {
  PlacedObject object;
  std::size_t length = 0;  // index of that dimension
  double whole_mm = 0;
  double least_share = 0;  // of its length that a piece has
};

Result<Bar> BarOf(const Part& part, const KnowledgeBase& knowledge) {
  Bar bar{PlacedObjectOf(part, knowledge)};
  if (!bar.object.model)
    return UsageError("the knowledge base has no kind \"{}\"; it cannot be split", part.kind);
  const auto defs = bar.object.model->dimensions();
  bar.length =
      std::size_t(std::find_if(defs.begin(), defs.end(), [](const auto& d) { return d.name == "length"; }) -
                  defs.begin());
  if (bar.length >= defs.size())
    return UsageError("a {} has no length along which it could be split", part.kind);
  bar.whole_mm = bar.object.dimensions_mm[bar.length];
  const Solid solid = bar.object.model->InstantiateUnchecked(bar.object.dimensions_mm);
  const bool same = solid.circles.empty() &&
                    std::all_of(solid.vertices.begin(), solid.vertices.end(), [&](const SolidPoint& v) {
                      return std::abs(std::abs(v.point_in_part.x()) - bar.whole_mm / 2) < kOnEndMm;
                    });
  if (!same)
    return UsageError("a {} is not the same all along its length; build its pieces by hand", part.kind);
  bar.least_share = std::max(kLeastShare, defs[bar.length].min_mm / bar.whole_mm);
  if (bar.least_share > 0.5)
    return UsageError("a {} is at least {:g} mm long, and this one {:.0f} mm: it cannot be split", part.kind,
                      defs[bar.length].min_mm, bar.whole_mm);
  return bar;
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

// The point of the part under `img`; beside it the point of its middle line nearest to the ray.
Vector3d PointedAt(const WorldSolid& solid, const View& view, const Eigen::Vector2d& img) {
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
  const Vector3d axis = solid.world_from_part.rotation.col(0), between = view.center_in_world - middle;
  const double cosine = axis.dot(ray), sine2 = 1 - cosine * cosine;
  const double along = sine2 < kFacingSine ? 0 : (axis.dot(between) - cosine * ray.dot(between)) / sine2;
  return middle + along * axis;
}

// Box: the contract calls its longer horizontal side its length.
void PutLongerSideFirst(PlacedObject& box) {
  const auto defs = box.model->dimensions();
  const auto at = [&](const char* name) {
    return std::size_t(std::find_if(defs.begin(), defs.end(), [&](const auto& d) { return d.name == name; }) -
                       defs.begin());
  };
  const std::size_t length = at("length"), width = at("width");
  if (box.model->kind() != "box" || length >= defs.size() || width >= defs.size() ||
      box.dimensions_mm[length] >= box.dimensions_mm[width])
    return;
  std::swap(box.dimensions_mm[length], box.dimensions_mm[width]);
  box.placement[3] = std::remainder(box.placement[3] + kPi / 2, 2 * kPi);
}

}  // namespace

Result<Json> CutPreview(Workspace& w, const Json& body) {
  VSS_ASSIGN(const auto old, w.FindPart(PartId(body)));
  VSS_ASSIGN(const Bar bar, BarOf(old.first.part, w.knowledge()));
  VSS_ASSIGN(const int image, IntOf(body, "image"));
  const std::vector<View> views = w.Views();
  if (image < 0 || std::size_t(image) >= views.size())
    return UsageError("there is no picture number {}", image);
  const Eigen::Vector2d img = PointOf(body.at("at"));
  if (!w.Inside(image, img)) return UsageError("point at the part inside the picture");
  const View& view = views[std::size_t(image)];
  const WorldSolid solid = PlaceSolid(bar.object, false);
  const RigidTransform& world_from_part = solid.world_from_part;
  const Vector3d axis = world_from_part.rotation.col(0);
  const double x = axis.dot(PointedAt(solid, view, img) - world_from_part.translation);
  const double share = std::clamp(x / bar.whole_mm + 0.5, bar.least_share, 1 - bar.least_share);
  Occluders occluders;
  int owner = 0;
  for (const auto& p : w.Parts())
    if (const PlacedObject object = PlacedObjectOf(p.part, w.knowledge()); object.model)
      occluders.Add(PlaceSolid(object, false), owner++);
  const auto pieces = ProjectCut(solid, world_from_part.translation + (share - 0.5) * bar.whole_mm * axis,
                                 axis, view, occluders);
  return Json{{"share", share},
              {"lengths", {share * bar.whole_mm, (1 - share) * bar.whole_mm}},
              {"pieces", PiecesToJson(pieces)}};
}

// Into two of the same section, at `share` of its length: a cut that the operator sees in the pictures.
Result<Edit> SplitPart(const Context& c) {
  Workspace& w = c.workspace;
  VSS_ASSIGN(const auto old, w.FindPart(PartId(c.body)));
  VSS_ASSIGN(const Bar bar, BarOf(old.first.part, w.knowledge()));
  const double share = c.body.at("share").get<double>();
  if (!(share >= bar.least_share && share <= 1 - bar.least_share))
    return UsageError("this part is split between {:.1f} % and {:.1f} % of its length", 100 * bar.least_share,
                      100 * (1 - bar.least_share));
  Edit edit{fmt::format("split {}", old.first.part.id), {}};
  for (int half = 0; half < 2; ++half) {
    PlacedObject piece = bar.object;
    piece.dimensions_mm[bar.length] = bar.whole_mm * (half == 0 ? share : 1 - share);
    const double shift = half == 0 ? (share - 1) * bar.whole_mm / 2 : share * bar.whole_mm / 2;
    piece.placement.head<3>() += Vector3d(old.first.part.world_from_part.rotation.col(0)) * shift;
    PutLongerSideFirst(piece);
    const bool turned = piece.dimensions_mm[bar.length] != bar.whole_mm * (half == 0 ? share : 1 - share);
    FitAnswer answer;
    answer.object = piece;
    answer.covariance = Eigen::MatrixXd::Zero(piece.StateSize(), piece.StateSize());
    answer.sigma_mm.assign(piece.dimensions_mm.size(), 0.0);
    answer.observable.assign(piece.dimensions_mm.size(), true);
    FitQuestion question;
    question.model = piece.model;
    StationPart part = old.first;
    part.part = PartOfFit(answer, question);
    part.part.covariance.resize(0, 0);
    part.part.vertex_sigma.clear();
    for (auto& d : part.part.dimensions) {
      const std::string name = !turned              ? d.name
                               : d.name == "length" ? "width"
                               : d.name == "width"  ? "length"
                                                    : d.name;
      const auto at = std::find_if(old.first.part.dimensions.begin(), old.first.part.dimensions.end(),
                                   [&](const auto& o) { return o.name == name; });
      if (at != old.first.part.dimensions.end())
        d.sigma_mm = at->sigma_mm, d.observable = at->observable, d.origin = at->origin,
        d.nominal_mm = at->nominal_mm;
      if (name == "length")
        d.observable = false, d.origin = "where the operator split the part; measure it",
        d.nominal_mm.reset();
    }
    part.part.designation = old.first.part.designation;
    part.part.standard = old.first.part.standard;
    part.part.designation_candidates = old.first.part.designation_candidates;
    part.part.source = "corrected";
    part.part.stands_on = old.first.part.stands_on;
    part.part.images = old.first.part.images;
    part.part.id = half == 0 ? old.first.part.id : FreeId(w);
    part.confirmed = false;
    part.doubt = "It was split: measure it, or pick the lines at the cut.";
    edit.answer["parts"].push_back(part.part.id);
    edit.changes.push_back(ChangeOf(w, part, half == 0 ? c.version : std::optional<std::int64_t>(0)));
  }
  return edit;
}

}  // namespace vss::station
