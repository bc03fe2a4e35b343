// What the page draws: lines, parts in pictures and in 3D, objects of the knowledge base; and what it
// measures.
#include <algorithm>
#include <cmath>

#include "cut.h"
#include "routes.h"

namespace vss::station {
namespace {

constexpr double kBentPx = 0.15;  // a line that the lens bends by more is drawn as a polyline

double Round(double v, double unit) { return std::round(v / unit) * unit; }
double Round2(double v) { return Round(v, 0.01); }

// [number, u0, v0, u1, v1, contrast, sigma_px, (points between where the lens bends the line)]
Json LineRow(int number, const LineSegment& s, const Intrinsics& lens) {
  Json row = {number,
              Round2(s.start.x()),
              Round2(s.start.y()),
              Round2(s.end.x()),
              Round2(s.end.y()),
              Round(s.contrast, 0.1),
              Round(s.sigma_offset_px, 0.001)};
  auto at = [&](double t) {
    const Eigen::Vector2d ideal = (1 - t) * s.ideal_start + t * s.ideal_end;
    return lens.ImgFromNormalized(lens.NormalizedFromIdeal(ideal)).value_or(ideal);
  };
  if ((at(0.5) - (s.start + s.end) / 2).norm() > kBentPx)
    for (double t : {0.2, 0.4, 0.6, 0.8}) {
      row.push_back(Round2(at(t).x()));
      row.push_back(Round2(at(t).y()));
    }
  return row;
}

Json ArcRow(int number, const EllipticalArc& a) {
  return {number,
          Round2(a.center.x()),
          Round2(a.center.y()),
          Round2(a.axes.x()),
          Round2(a.axes.y()),
          Round(a.angle_rad, 1e-4),
          Round(a.from_rad, 1e-4),
          Round(a.to_rad, 1e-4),
          Round(a.contrast, 0.1)};
}

// Distance between two vertices of parts and its sigma; the parts' errors are independent of each other.
struct VertexAt {
  Eigen::Vector3d point;
  Eigen::MatrixXd by_part;  // 3 x (6 + dimensions)
  Eigen::MatrixXd covariance;
  std::string part;
};

Result<VertexAt> FindVertex(const Workspace& workspace, const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const auto index = colon == text.npos ? std::nullopt : NumberIn(std::string_view(text).substr(colon + 1));
  if (!index || *index < 0) return UsageError("a vertex is named PART:NUMBER, not \"{}\"", text);
  VSS_ASSIGN(const auto found, workspace.FindPart(text.substr(0, colon)));
  const Part& part = found.first.part;
  if (std::size_t(*index) >= part.vertices.size())
    return UsageError("{} has {} vertices", part.id, part.vertices.size());
  VertexAt v{part.vertices[std::size_t(*index)], {}, part.covariance, part.id};
  const PlacedObject object = PlacedObjectOf(part, workspace.knowledge());
  const Eigen::Index n = part.covariance.rows();
  v.by_part = Eigen::MatrixXd::Zero(3, n);
  if (n == 0) return v;
  v.by_part.leftCols(3).setIdentity();
  v.by_part.middleCols(3, 3) = -CrossMatrix(v.point - part.world_from_part.translation);
  if (object.model && n == 6 + Eigen::Index(object.dimensions_mm.size())) {
    const Solid solid = object.model->InstantiateUnchecked(object.dimensions_mm);
    if (std::size_t(*index) < solid.vertices.size())
      v.by_part.rightCols(n - 6) =
          part.world_from_part.rotation * solid.vertices[std::size_t(*index)].by_dimension;
  }
  return v;
}

using NamedSolids = std::vector<std::pair<std::string, WorldSolid>>;  // by the part's id

NamedSolids SolidsOf(const Workspace& workspace) {
  NamedSolids solids;
  for (const auto& p : workspace.Parts())
    if (const PlacedObject object = PlacedObjectOf(p.part, workspace.knowledge()); object.model)
      solids.emplace_back(p.part.id, PlaceSolid(object, false));
  return solids;
}

Occluders OccludersOf(const NamedSolids& solids) {
  Occluders occluders;
  int owner = 0;
  for (const auto& s : solids) occluders.Add(s.second, owner++);
  return occluders;
}

}  // namespace

Result<Json> Routes::LinesOf(int image) {
  VSS_ASSIGN(const auto lines, workspace_.Lines(image));
  const Intrinsics& lens = workspace_.survey()
                               .cameras[std::size_t(workspace_.survey().images[std::size_t(image)].camera)]
                               .intrinsics;
  Json segments = Json::array(), removed = Json::array(), arcs = Json::array();
  for (std::size_t i = 0; i < lines->found.segments.size(); ++i)
    (lines->removed[i] ? removed : segments).push_back(LineRow(int(i), lines->found.segments[i], lens));
  for (const auto& [number, segment] : lines->drawn) segments.push_back(LineRow(number, segment, lens));
  for (std::size_t i = 0; i < lines->found.arcs.size(); ++i)
    if (!lines->removed_arcs[i]) arcs.push_back(ArcRow(int(i), lines->found.arcs[i]));
  for (const auto& [number, arc] : lines->drawn_arcs) arcs.push_back(ArcRow(number, arc));
  return Json{{"segments", segments},
              {"removed", removed},
              {"arcs", arcs},
              {"version", lines->version},
              {"noise", Round2(lines->found.noise_sigma)}};
}

Result<Json> Routes::ProjectionOf(int image) {
  const std::vector<View> views = workspace_.Views();
  const View& view = views[std::size_t(image)];
  const auto solids = SolidsOf(workspace_);
  const Occluders occluders = OccludersOf(solids);
  Json parts = Json::object();
  for (const auto& [id, solid] : solids) {
    const auto pieces = ProjectContour(solid, view, occluders);
    if (pieces.empty()) continue;
    Json vertices = Json::array();
    for (const auto& v : solid.vertices) {
      const auto img = view.ProjectInside(v.point);
      const bool seen = img && occluders.Free(view.center_in_world, v.point, 1.0);
      vertices.push_back(img ? Json{Round2(img->x()), Round2(img->y()), seen ? 1 : 0} : Json());
    }
    parts[id] = {{"pieces", PiecesToJson(pieces)}, {"vertices", vertices}};
  }
  return Json{{"parts", parts}};
}

// One part, drawn in every picture that shows it.
std::optional<Json> Routes::OutlinesOf(const std::string& part) const {
  const auto solids = SolidsOf(workspace_);
  const auto at = std::find_if(solids.begin(), solids.end(), [&](const auto& s) { return s.first == part; });
  if (at == solids.end()) return std::nullopt;
  const Occluders occluders = OccludersOf(solids);
  Json pictures = Json::object();
  for (const auto& view : workspace_.Views())
    if (const auto pieces = ProjectContour(at->second, view, occluders); !pieces.empty())
      pictures[std::to_string(view.image)] = PiecesToJson(pieces);
  return Json{{"pictures", pictures}};
}

// The parts that an edit changed or removed, drawn as they were before it.
Result<Json> Routes::BeforeOf(int image, std::int64_t edit) const {
  const std::vector<View> views = workspace_.Views();
  Json parts = Json::object();
  for (const auto& d : workspace_.store().DifferencesOf(edit)) {
    if (d.kind != "part" || !d.before) continue;
    const auto before = PartFromJson(*d.before, workspace_.image_files());
    if (!before) continue;
    const PlacedObject object = PlacedObjectOf(before->part, workspace_.knowledge());
    if (!object.model) continue;
    const WorldSolid solid = PlaceSolid(object, false);
    Occluders itself;
    itself.Add(solid, 0);
    if (const auto pieces = ProjectContour(solid, views[std::size_t(image)], itself); !pieces.empty())
      parts[d.id] = PiecesToJson(pieces);
  }
  return Json{{"parts", parts}};
}

Result<Json> Routes::Scene() {
  Json parts = Json::array();
  for (const auto& p : workspace_.Parts()) {
    const PlacedObject object = PlacedObjectOf(p.part, workspace_.knowledge());
    Json triangles = Json::array(), edges = Json::array(), vertices = Json::array(), circles = Json::array();
    if (object.model) {
      const WorldSolid solid = PlaceSolid(object, false);
      for (const auto& f : solid.faces)
        for (const auto& t : f.triangles)
          for (const auto& v : t)
            for (int k = 0; k < 3; ++k) triangles.push_back(Round2(v[k]));
    }
    for (const auto& v : p.part.vertices) vertices.push_back(JsonOf(v));
    for (const auto& e : p.part.edges) edges.push_back(e);
    for (const auto& c : p.part.circles)
      circles.push_back(
          {{"center", JsonOf(c.center)}, {"normal", JsonOf(c.normal)}, {"radius", c.radius_mm}});
    parts.push_back({{"id", p.part.id},
                     {"triangles", triangles},
                     {"vertices", vertices},
                     {"edges", edges},
                     {"circles", circles}});
  }
  Json seams = Json::array();
  for (const auto& s : workspace_.ProductNow().seams)
    seams.push_back({{"parts", {s.part_a, s.part_b}}, {"start", JsonOf(s.start)}, {"end", JsonOf(s.end)}});
  return Json{{"parts", parts}, {"seams", seams}};
}

Json Routes::Knowledge() const {
  Json list = Json::array();
  for (const auto& o : workspace_.knowledge().objects) {
    if (workspace_.knowledge().Find(o->kind()) != o.get()) continue;  // another variant of one that is listed
    Json dimensions = Json::array(), poses = Json::array();
    const std::vector<std::optional<double>> nothing(o->dimensions().size());
    const auto usual = o->UsualDimensions(nothing);
    for (std::size_t i = 0; i < usual.size(); ++i) {
      const auto& d = o->dimensions()[i];
      dimensions.push_back(
          {{"name", d.name}, {"min", d.min_mm}, {"max", d.max_mm}, {"usual", usual[i]}, {"help", d.help}});
    }
    for (const auto& p : o->resting_poses()) poses.push_back(p.name);
    Json variants = Json::array();  // the features of each
    for (const auto& v : workspace_.knowledge().objects)
      if (v->kind() == o->kind()) variants.push_back(FeaturesOf(*v));
    list.push_back({{"kind", o->kind()},
                    {"title", o->title()},
                    {"dimensions", dimensions},
                    {"resting_poses", poses},
                    {"variants", variants},
                    {"cuts", CutDimensionsOf(*o)}});
  }
  return {{"objects", list}};
}

Result<Json> Routes::Drawing(const Json& body) const {
  const std::string kind = body.value("kind", "");
  const ObjectModel* model =
      body.contains("features")
          ? workspace_.knowledge().Find(kind, body.at("features").get<std::vector<std::string>>())
          : workspace_.knowledge().Find(kind);
  if (!model)
    return UsageError("the knowledge base has no kind \"{}\" with these features", kind.substr(0, 40));
  std::vector<std::optional<double>> known;
  const Json given = body.value("dimensions", Json::object());
  for (const auto& d : model->dimensions()) {
    const auto at = given.find(d.name);
    known.push_back(at != given.end() && at->is_number()
                        ? std::optional(std::clamp(at->get<double>(), d.min_mm, d.max_mm))
                        : std::nullopt);
  }
  const auto dimensions = model->UsualDimensions(known);
  const int pose = std::clamp(body.value("resting_pose", 0), 0, int(model->resting_poses().size()) - 1);
  const ObjectDrawing drawing = DrawObject(*model, dimensions, pose, 240);
  return Json{{"pieces", PiecesToJson(drawing.pieces)}, {"size", 240}};
}

Result<Json> Routes::Measure(const Request& request) const {
  auto text = [&](const char* name) {
    const auto at = request.query.find(name);
    return at == request.query.end() ? std::string() : at->second;
  };
  VSS_ASSIGN(const auto a, FindVertex(workspace_, text("a")));
  VSS_ASSIGN(const auto b, FindVertex(workspace_, text("b")));
  const Eigen::Vector3d d = b.point - a.point;
  const double distance = d.norm();
  Json out = {{"distance", distance}, {"delta", JsonOf(d)}, {"sigma", Json()}};
  if (distance < 1e-9 || a.covariance.size() == 0 || b.covariance.size() == 0) return out;
  const Eigen::RowVectorXd ja = -(d / distance).transpose() * a.by_part,
                           jb = (d / distance).transpose() * b.by_part;
  const double variance =
      a.part == b.part ? ((ja + jb) * a.covariance * (ja + jb).transpose())(0)
                       : (ja * a.covariance * ja.transpose())(0) + (jb * b.covariance * jb.transpose())(0);
  out["sigma"] = std::sqrt(std::max(0.0, variance));
  return out;
}

}  // namespace vss::station
