#include "vss/export/glb.h"

#include <Eigen/Geometry>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <numbers>

namespace vss {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

constexpr int kFloat = 5126, kArrayBuffer = 34962, kLines = 1, kTriangles = 4;  // names of the standard
constexpr int kStepsPerTurn = 48;  // of a rim, as the facets of a cylinder

struct Mesh {
  std::vector<Vector3d> corners, normals;  // three a triangle
  std::vector<Vector3d> line_ends;         // two a line
};

Vector3d NormalAt(const SolidFace& face, const Vector3d& point) {
  if (!face.is_cylinder) return face.normal_in_part;
  Vector3d out = point - face.axis_point;
  out -= face.axis_direction * face.axis_direction.dot(out);
  return (face.is_hole ? -1 : 1) * out.normalized();
}

void AddTurn(const Vector3d& center, const Vector3d& from_center, const Vector3d& axis, double angle_rad,
             std::vector<Vector3d>& line_ends) {
  const int steps = std::max(
      1, static_cast<int>(std::ceil(std::abs(angle_rad) * kStepsPerTurn / (2 * std::numbers::pi) - 1e-9)));
  const auto at = [&](int step) {
    return Vector3d(center + Eigen::AngleAxisd(angle_rad * step / steps, axis) * from_center);
  };
  for (int i = 0; i < steps; ++i) {
    line_ends.push_back(at(i));
    line_ends.push_back(at(i + 1));
  }
}

void AddArc(const Solid& solid, const SolidArc& arc, std::vector<Vector3d>& line_ends) {
  const Vector3d& center = arc.center.point_in_part;
  const Vector3d from = solid.vertices[static_cast<std::size_t>(arc.start)].point_in_part - center;
  const Vector3d to = solid.vertices[static_cast<std::size_t>(arc.end)].point_in_part - center;
  const double angle_rad = std::atan2(arc.normal_in_part.dot(from.cross(to)), from.dot(to));  // the short way
  AddTurn(center, from, arc.normal_in_part, angle_rad, line_ends);
}

Mesh MeshOf(const Solid& solid) {
  Mesh mesh;
  for (const auto& face : solid.faces)
    for (const auto& triangle : face.triangles)
      for (const auto& corner : triangle) {
        mesh.corners.push_back(corner);
        mesh.normals.push_back(NormalAt(face, corner));
      }
  for (const auto& e : solid.edges)
    for (const int v : {e.start, e.end})
      mesh.line_ends.push_back(solid.vertices[static_cast<std::size_t>(v)].point_in_part);
  for (const auto& c : solid.circles)
    AddTurn(c.center.point_in_part, c.radius_mm * c.normal_in_part.unitOrthogonal(), c.normal_in_part,
            2 * std::numbers::pi, mesh.line_ends);
  for (const auto& arc : solid.arcs) AddArc(solid, arc, mesh.line_ends);
  return mesh;
}

class Writer {
 public:
  Writer() {
    json_["asset"] = {
        {"version", "2.0"},
        {"generator", "VSS " VSS_VERSION},
        {"extras",
         {{"frames", "node `world` holds mm, z up; its children are parts, placed by world_from_part"}}}};
    json_["scene"] = 0;
    json_["scenes"] = Json::array({Json{{"name", "workpiece"}, {"nodes", Json::array({0})}}});
    json_["nodes"] = Json::array();
    json_["meshes"] = json_["accessors"] = json_["bufferViews"] = Json::array();
    json_["materials"] =
        Json::array({Material("steel", {0.62, 0.65, 0.68}, 0.6), Material("edge", {0.05, 0.06, 0.07}, 0),
                     Material("seam", {0.9, 0.1, 0.1}, 0)});
  }

  int AddNode(Json node) {
    json_["nodes"].push_back(std::move(node));
    return static_cast<int>(json_["nodes"].size()) - 1;
  }
  Json& Node(int node) { return json_["nodes"][static_cast<std::size_t>(node)]; }

  int AddMesh(const std::string& name, Json primitives) {
    json_["meshes"].push_back({{"name", name}, {"primitives", std::move(primitives)}});
    return static_cast<int>(json_["meshes"].size()) - 1;
  }
  Json Triangles(const Mesh& mesh) {
    return {{"attributes", {{"POSITION", AddPoints(mesh.corners)}, {"NORMAL", AddPoints(mesh.normals)}}},
            {"material", 0},
            {"mode", kTriangles}};
  }
  Json Lines(const std::vector<Vector3d>& ends, int material) {
    return {{"attributes", {{"POSITION", AddPoints(ends)}}}, {"material", material}, {"mode", kLines}};
  }

  // Header, JSON chunk filled up with spaces, binary chunk; each of a length that four divides.
  std::string Glb() {
    for (const char* list : {"meshes", "accessors", "bufferViews"})
      if (json_[list].empty()) json_.erase(list);  // the standard has no empty lists
    if (!bytes_.empty()) json_["buffers"] = Json::array({Json{{"byteLength", bytes_.size()}}});
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string out = "glTF";
    const std::size_t binary = bytes_.empty() ? 0 : 8 + bytes_.size();
    Append(out, 2);
    Append(out, 12 + 8 + text.size() + binary);
    Append(out, text.size());
    out += "JSON" + text;
    if (bytes_.empty()) return out;
    Append(out, bytes_.size());
    return out + std::string("BIN\0", 4) + bytes_;
  }

 private:
  static Json Material(const char* name, std::array<double, 3> colour, double metallic) {
    return {{"name", name},
            {"pbrMetallicRoughness",
             {{"baseColorFactor", {colour[0], colour[1], colour[2], 1.0}},
              {"metallicFactor", metallic},
              {"roughnessFactor", 0.7}}}};
  }
  static void Append(std::string& out, std::size_t value) {  // little endian on every machine
    for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(value >> shift & 0xff);
  }
  int AddPoints(const std::vector<Vector3d>& points) {
    Eigen::Array3f low = Eigen::Array3f::Constant(INFINITY), high = -low;
    const std::size_t offset = bytes_.size();
    for (const auto& p : points) {
      const Eigen::Array3f f = p.cast<float>().array() + 0.0f;  // no -0
      low = low.min(f);
      high = high.max(f);
      for (int i = 0; i < 3; ++i) Append(bytes_, std::bit_cast<std::uint32_t>(f[i]));
    }
    json_["bufferViews"].push_back({{"buffer", 0},
                                    {"byteOffset", offset},
                                    {"byteLength", bytes_.size() - offset},
                                    {"target", kArrayBuffer}});
    json_["accessors"].push_back({{"bufferView", json_["bufferViews"].size() - 1},
                                  {"componentType", kFloat},
                                  {"count", points.size()},
                                  {"type", "VEC3"},
                                  {"min", {low[0], low[1], low[2]}},
                                  {"max", {high[0], high[1], high[2]}}});
    return static_cast<int>(json_["accessors"].size()) - 1;
  }

  Json json_;
  std::string bytes_;
};

Json List(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Json Known(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json ExtrasOf(const Part& part) {
  Json dimensions = Json::object();
  for (const auto& d : part.dimensions)
    dimensions[d.name] = {
        {"value_mm", d.value_mm}, {"sigma_mm", Known(d.sigma_mm)}, {"observable", d.observable}};
  return {{"id", part.id},
          {"kind", part.kind},
          {"source", part.source},
          {"doubtful", part.doubtful},
          {"dimensions", dimensions}};
}

Json ExtrasOf(const Seam& seam) {
  return {{"parts", {seam.part_a, seam.part_b}},
          {"normals", {List(seam.normal_a), List(seam.normal_b)}},
          {"approach", List(ApproachOf(seam))},
          {"gap_mm", Known(seam.gap_mm)}};
}

int AddPart(const PartSolid& solid, Writer& writer) {
  const Mesh mesh = MeshOf(solid.solid);
  const std::string name = NameOf(*solid.part);
  Json primitives = Json::array({writer.Triangles(mesh)});
  if (!mesh.line_ends.empty()) primitives.push_back(writer.Lines(mesh.line_ends, 1));
  const RigidTransform& pose = solid.part->world_from_part;
  const Eigen::Quaterniond q(pose.rotation);
  return writer.AddNode({{"name", name},
                         {"mesh", writer.AddMesh(name, std::move(primitives))},
                         {"translation", List(pose.translation)},
                         {"rotation", {q.x(), q.y(), q.z(), q.w()}},
                         {"extras", ExtrasOf(*solid.part)}});
}

int AddSeams(const std::vector<Seam>& seams, Writer& writer) {
  Json children = Json::array();
  for (std::size_t i = 0; i < seams.size(); ++i) {
    const std::string name = NameOf(seams[i], i);
    const int mesh = writer.AddMesh(name, Json::array({writer.Lines({seams[i].start, seams[i].end}, 2)}));
    children.push_back(writer.AddNode({{"name", name}, {"mesh", mesh}, {"extras", ExtrasOf(seams[i])}}));
  }
  return writer.AddNode({{"name", "seams"}, {"children", children}});
}

}  // namespace

std::string WriteGlb(const Product& product, std::span<const PartSolid> solids) {
  Writer writer;
  constexpr double kMetre = 1e-3, kHalf = std::numbers::sqrt2 / 2;
  const int world =
      writer.AddNode({{"name", "world"},
                      {"rotation", {-kHalf, 0.0, 0.0, kHalf}},  // z up to y up: -90 degrees about x
                      {"scale", {kMetre, kMetre, kMetre}},
                      {"extras", {{"survey", product.survey}}}});
  Json children = Json::array();
  for (const auto& solid : solids) children.push_back(AddPart(solid, writer));
  if (!product.seams.empty()) children.push_back(AddSeams(product.seams, writer));
  if (!children.empty()) writer.Node(world)["children"] = children;
  return writer.Glb();
}

}  // namespace vss
