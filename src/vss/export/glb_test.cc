#include "vss/export/glb.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>

#include "vss/export/sample_product.h"

namespace vss {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

std::uint32_t NumberAt(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes.at(at + i))) << (8 * i);
  return value;
}

// A GLB as the standard's chapter 4.4 describes it, read with no help of the writer.
struct Glb {
  nlohmann::json json;
  std::string binary;

  explicit Glb(const std::string& bytes) {
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(NumberAt(bytes, 4), 2u);
    EXPECT_EQ(NumberAt(bytes, 8), bytes.size());
    const std::size_t length = NumberAt(bytes, 12);
    EXPECT_EQ(length % 4, 0u);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    json = nlohmann::json::parse(bytes.substr(20, length));
    const std::size_t second = 20 + length;
    if (second == bytes.size()) return;
    EXPECT_EQ(NumberAt(bytes, second) % 4, 0u);
    EXPECT_EQ(bytes.substr(second + 4, 4), std::string("BIN\0", 4));
    binary = bytes.substr(second + 8);
    EXPECT_EQ(binary.size(), NumberAt(bytes, second));
    EXPECT_LE(json["buffers"][0]["byteLength"].get<std::size_t>(), binary.size());
  }

  std::vector<Vector3f> Points(int accessor) const {
    const auto& a = json["accessors"][std::size_t(accessor)];
    EXPECT_EQ(a["componentType"], 5126);
    EXPECT_EQ(a["type"], "VEC3");
    const auto& view = json["bufferViews"][a["bufferView"].get<std::size_t>()];
    const std::size_t offset = view["byteOffset"], count = a["count"];
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_EQ(view["byteLength"], 12 * count);
    EXPECT_LE(offset + 12 * count, binary.size());
    std::vector<Vector3f> points(count);
    for (std::size_t i = 0; i < 3 * count; ++i)
      points[i / 3][static_cast<int>(i % 3)] = std::bit_cast<float>(NumberAt(binary, offset + 4 * i));
    return points;
  }
};

void ExpectBounds(const Glb& glb, int accessor) {
  Eigen::AlignedBox3f box;
  for (const auto& p : glb.Points(accessor)) box.extend(p);
  const auto& a = glb.json["accessors"][std::size_t(accessor)];
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(a["min"][std::size_t(i)].get<float>(), box.min()[i]);
    EXPECT_EQ(a["max"][std::size_t(i)].get<float>(), box.max()[i]);
  }
}

std::string WriteAll(const Product& product, const KnowledgeBase& knowledge) {
  const auto solids = SolidsOfProduct(product, knowledge);
  EXPECT_TRUE(solids) << (solids ? "" : solids.error().message);
  return WriteGlb(product, *solids);
}

const nlohmann::json& NodeNamed(const Glb& glb, const std::string& name) {
  for (const auto& node : glb.json["nodes"])
    if (node["name"] == name) return node;
  throw std::runtime_error("no node " + name);
}

TEST(Glb, KeepsToTheStandard) {
  const KnowledgeBase knowledge = Shipped();
  const Glb glb(WriteAll(EveryKind(knowledge), knowledge));
  EXPECT_EQ(glb.json["asset"]["version"], "2.0");
  EXPECT_EQ(glb.json["scenes"][glb.json["scene"].get<std::size_t>()]["nodes"], nlohmann::json({0}));
  for (std::size_t i = 0; i < glb.json["accessors"].size(); ++i) ExpectBounds(glb, static_cast<int>(i));
  for (const auto& mesh : glb.json["meshes"])
    for (const auto& primitive : mesh["primitives"]) {
      EXPECT_LT(primitive["material"].get<std::size_t>(), glb.json["materials"].size());
      const auto& at = primitive["attributes"];
      const std::size_t count = glb.Points(at["POSITION"]).size();
      EXPECT_EQ(count % (primitive["mode"] == 4 ? 3 : 2), 0u);
      if (!at.contains("NORMAL")) continue;
      const auto normals = glb.Points(at["NORMAL"]);
      EXPECT_EQ(normals.size(), count);
      for (const auto& n : normals) ASSERT_NEAR(n.norm(), 1, 1e-5);
    }
  for (const auto& node : glb.json["nodes"])
    if (node.contains("rotation")) {
      double norm = 0;
      for (const double x : node["rotation"]) norm += x * x;
      EXPECT_NEAR(norm, 1, 1e-9);
    }
}

TEST(Glb, EnclosesTheVolumeOfEachPartWithNormalsOutside) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = EveryKind(knowledge);
  const auto solids = SolidsOfProduct(product, knowledge);
  const Glb glb(WriteGlb(product, *solids));
  for (const auto& solid : *solids) {
    const auto& node = NodeNamed(glb, NameOf(*solid.part));
    const auto& faces = glb.json["meshes"][node["mesh"].get<std::size_t>()]["primitives"][0]["attributes"];
    const auto points = glb.Points(faces["POSITION"]), normals = glb.Points(faces["NORMAL"]);
    double six_volumes = 0;
    for (std::size_t i = 0; i < points.size(); i += 3) {
      const Vector3f across = (points[i + 1] - points[i]).cross(points[i + 2] - points[i]);
      for (std::size_t k = 0; k < 3; ++k) EXPECT_GT(across.dot(normals[i + k]), 0);
      six_volumes +=
          points[i].cast<double>().dot(points[i + 1].cast<double>().cross(points[i + 2].cast<double>()));
    }
    const double volume = FacetedVolume(solid.solid);
    EXPECT_NEAR(six_volumes / 6, volume, 1e-5 * volume) << solid.part->kind;
  }
}

TEST(Glb, PutsEachVertexWhereTheProductHasItInMetresWithYUp) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = EveryKind(knowledge);
  const Glb glb(WriteAll(product, knowledge));
  const auto transform = [](const nlohmann::json& node) {
    Eigen::Affine3d t = Eigen::Affine3d::Identity();
    if (node.contains("translation"))
      t.translate(Vector3d(node["translation"][0], node["translation"][1], node["translation"][2]));
    if (node.contains("rotation")) {
      const auto& r = node["rotation"];
      t.rotate(
          Eigen::Quaterniond(r[3].get<double>(), r[0].get<double>(), r[1].get<double>(), r[2].get<double>()));
    }
    if (node.contains("scale")) t.scale(Vector3d(node["scale"][0], node["scale"][1], node["scale"][2]));
    return t;
  };
  for (const auto& part : product.parts) {
    const auto& node = NodeNamed(glb, NameOf(part));
    const Eigen::Affine3d placed = transform(glb.json["nodes"][0]) * transform(node);
    const auto& mesh = glb.json["meshes"][node["mesh"].get<std::size_t>()];
    Eigen::AlignedBox3d seen, wanted;
    for (const auto& p : glb.Points(mesh["primitives"][0]["attributes"]["POSITION"])) {
      const Vector3d m = placed * p.cast<double>();
      seen.extend(Vector3d(1000 * m.x(), -1000 * m.z(), 1000 * m.y()));  // y up, m to z up, mm
    }
    for (const auto& v : part.vertices) wanted.extend(v);
    if (part.vertices.empty()) continue;  // a pipe has none
    EXPECT_LT((seen.min() - wanted.min()).norm(), 0.01) << part.kind;
    EXPECT_LT((seen.max() - wanted.max()).norm(), 0.01) << part.kind;
  }
}

TEST(Glb, HasALineForEachSeamWithItsApproach) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = PlateWithUpright(knowledge);
  const Glb glb(WriteAll(product, knowledge));
  const auto& seams = NodeNamed(glb, "seams");
  ASSERT_EQ(seams["children"].size(), product.seams.size());
  for (std::size_t i = 0; i < product.seams.size(); ++i) {
    const auto& node = glb.json["nodes"][seams["children"][i].get<std::size_t>()];
    const auto& line = glb.json["meshes"][node["mesh"].get<std::size_t>()]["primitives"][0];
    EXPECT_EQ(line["mode"], 1);
    const auto ends = glb.Points(line["attributes"]["POSITION"]);
    ASSERT_EQ(ends.size(), 2u);
    EXPECT_LT((ends[0].cast<double>() - product.seams[i].start).norm(), 1e-3);
    EXPECT_LT((ends[1].cast<double>() - product.seams[i].end).norm(), 1e-3);
    EXPECT_NEAR(node["extras"]["approach"][2].get<double>(), ApproachOf(product.seams[i]).z(), 1e-9);
    EXPECT_NEAR(node["extras"]["gap_mm"].get<double>(), 0.5, 1e-9);
  }
}

TEST(Glb, OfNothingIsAnEmptyWorld) {
  const Glb glb(WriteGlb({}, {}));
  EXPECT_TRUE(glb.binary.empty());
  EXPECT_EQ(glb.json["nodes"].size(), 1u);
  EXPECT_FALSE(glb.json.contains("meshes"));
  EXPECT_FALSE(glb.json.contains("accessors"));
}

TEST(Glb, IsTheSameBytesEachTime) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = EveryKind(knowledge);
  EXPECT_EQ(WriteAll(product, knowledge), WriteAll(product, knowledge));
}

}  // namespace
}  // namespace vss
