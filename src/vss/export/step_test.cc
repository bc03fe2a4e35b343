#include "vss/export/step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <BRepBndLib.hxx>
#include <BRepGProp.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GProp_GProps.hxx>
#include <Geom_Curve.hxx>
#include <Geom_Surface.hxx>
#include <Message.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <XCAFApp_Application.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>

#include "vss/export/export.h"
#include "vss/export/sample_product.h"

namespace vss {
namespace {

using testing::HasSubstr;

std::string WriteAll(const Product& product, const KnowledgeBase& knowledge) {
  const auto solids = SolidsOfProduct(product, knowledge);
  EXPECT_TRUE(solids) << (solids ? "" : solids.error().message);
  const auto text = WriteStep(product, *solids);
  EXPECT_TRUE(text) << (text ? "" : text.error().message);
  return text ? *text : std::string();
}

// The shapes of a STEP file by their names, where the file places them, as another program reads it.
std::map<std::string, TopoDS_Shape> ReadBack(const std::string& text) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  const auto path = std::filesystem::temp_directory_path() / fmt::format("vss-step-{}.step", ::getpid());
  std::ofstream(path) << text;
  Handle(TDocStd_Document) document;
  XCAFApp_Application::GetApplication()->NewDocument("BinXCAF", document);
  STEPCAFControl_Reader reader;
  reader.SetNameMode(Standard_True);
  EXPECT_EQ(reader.ReadFile(path.c_str()), IFSelect_RetDone);
  EXPECT_TRUE(reader.Transfer(document));
  std::filesystem::remove(path);
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  TDF_LabelSequence roots, components;
  shapes->GetFreeShapes(roots);
  EXPECT_EQ(roots.Length(), 1);
  std::map<std::string, TopoDS_Shape> found;
  if (roots.Length() != 1) return found;
  shapes->GetComponents(roots.Value(1), components);
  for (int i = 1; i <= components.Length(); ++i) {
    Handle(TDataStd_Name) name;
    EXPECT_TRUE(components.Value(i).FindAttribute(TDataStd_Name::GetID(), name));
    char utf8[256] = {};
    Standard_PCharacter at = utf8;
    if (!name.IsNull() && name->Get().LengthOfCString() < 255) name->Get().ToUTF8CString(at);
    found[utf8] = shapes->GetShape(components.Value(i));
  }
  return found;
}

double VolumeOf(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::VolumeProperties(shape, properties);
  return properties.Mass();
}

int Count(const TopoDS_Shape& shape, TopAbs_ShapeEnum kind) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, kind, map);
  return map.Extent();
}

int CountCylinders(const TopoDS_Shape& shape) {
  int count = 0;
  for (TopExp_Explorer f(shape, TopAbs_FACE); f.More(); f.Next())
    count += BRep_Tool::Surface(TopoDS::Face(f.Current()))->DynamicType()->Name() ==
             std::string("Geom_CylindricalSurface");
  return count;
}

TEST(Step, IsAP242InMillimetres) {
  const KnowledgeBase knowledge = Shipped();
  const std::string text = WriteAll(PlateWithUpright(knowledge), knowledge);
  EXPECT_THAT(text, HasSubstr("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING"));
  EXPECT_THAT(text, HasSubstr("SI_UNIT(.MILLI.,.METRE.)"));
  EXPECT_THAT(text, HasSubstr("world frame right-handed, z up"));
}

TEST(Step, ReadsBackWithEverySolidsVolumeAndExtent) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = EveryKind(knowledge);
  const auto shapes = ReadBack(WriteAll(product, knowledge));
  ASSERT_EQ(shapes.size(), product.parts.size());
  const auto solids = SolidsOfProduct(product, knowledge);
  for (const auto& solid : *solids) {
    const auto found = shapes.find(NameOf(*solid.part));
    ASSERT_NE(found, shapes.end()) << NameOf(*solid.part);
    EXPECT_EQ(Count(found->second, TopAbs_SOLID), 1);
    EXPECT_EQ(Count(found->second, TopAbs_FACE), static_cast<int>(solid.solid.faces.size()));
    // A cylinder of 48 facets holds sin(2 pi / 48) / (2 pi / 48) of the true one.
    double volume = FacetedVolume(solid.solid);
    for (const auto& face : solid.solid.faces) {
      if (!face.is_cylinder) continue;
      const double facet = 2 * std::numbers::pi / 48,
                   height = std::abs(solid.solid.circles[1].center.point_in_part.z() -
                                     solid.solid.circles[0].center.point_in_part.z());
      const double missing =
          std::numbers::pi * face.radius_mm * face.radius_mm * height * (1 - std::sin(facet) / facet);
      volume += face.is_hole ? -missing : missing;
    }
    EXPECT_NEAR(VolumeOf(found->second), volume, 1e-6 * volume) << solid.part->kind;
    Bnd_Box box;
    BRepBndLib::AddOptimal(found->second, box, Standard_False, Standard_False);
    Eigen::AlignedBox3d wanted;
    for (const auto& v : solid.part->vertices) wanted.extend(v);
    for (const auto& c : solid.part->circles)
      for (int axis = 0; axis < 3; ++axis) {
        const double reach = c.radius_mm * std::sqrt(std::max(0.0, 1 - c.normal[axis] * c.normal[axis]));
        wanted.extend(Eigen::Vector3d(c.center + reach * Eigen::Vector3d::Unit(axis)));
        Eigen::Vector3d low = c.center;
        low[axis] -= reach;
        wanted.extend(low);
      }
    double x0, y0, z0, x1, y1, z1;
    box.Get(x0, y0, z0, x1, y1, z1);
    EXPECT_LT((Eigen::Vector3d(x0, y0, z0) - wanted.min()).norm(), 0.01) << solid.part->kind;
    EXPECT_LT((Eigen::Vector3d(x1, y1, z1) - wanted.max()).norm(), 0.01) << solid.part->kind;
  }
}

TEST(Step, HasTrueCylindersForHolesAndPipes) {
  const KnowledgeBase knowledge = Shipped();
  const auto shapes = ReadBack(WriteAll(EveryKind(knowledge), knowledge));
  for (const auto& [name, shape] : shapes) {
    const int wanted = name.find("pipe") != name.npos ? 2 : name.find("holed_plate") != name.npos ? 1 : 0;
    EXPECT_EQ(CountCylinders(shape), wanted) << name;
  }
}

TEST(Step, RoundsTheCornersThatTheKnowledgeBaseRounds) {
  KnowledgeBase knowledge;
  const auto model = ParseObject(R"(object dished "Plate with two rounded corners and a hollow" {
  dimension length: 100 mm .. 9 m
  dimension width: 100 mm .. 9 m
  extrude z from 0 mm to 40 mm {
    outline {
      a (-length/2, -width/2) round 30 mm
      b ( length/2, -width/2)
      c ( length/2,  width/2) round 20 mm
      d ( 0 mm,  width/2)
      e ( 0 mm,  0 mm) round 25 mm
      f (-length/2,  0 mm)
    }
  }
  rests base
  stands on ground
}
)",
                                 "dished.kb");
  ASSERT_TRUE(model) << model.error().message;
  knowledge.objects.push_back(*model);
  Product product;
  product.parts.push_back(PartAt(**model, "part-1", {400, 300}, {10, 20, 0}, 0.2));
  const auto shapes = ReadBack(WriteAll(product, knowledge));
  ASSERT_EQ(shapes.count("part-1 dished"), 1u);
  const TopoDS_Shape& shape = shapes.at("part-1 dished");
  EXPECT_EQ(CountCylinders(shape), 3);
  const double corner = 1 - std::numbers::pi / 4;
  const double area = 400 * 300 - 200 * 150 - corner * (30 * 30 + 20 * 20 - 25 * 25);
  EXPECT_NEAR(VolumeOf(shape), area * 40, 1);
}

TEST(Step, HasANamedEdgeForEachSeamInTheWorld) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = PlateWithUpright(knowledge);
  const auto shapes = ReadBack(WriteAll(product, knowledge));
  EXPECT_EQ(shapes.size(), product.parts.size() + product.seams.size());
  for (std::size_t i = 0; i < product.seams.size(); ++i) {
    const auto found = shapes.find(NameOf(product.seams[i], i));
    ASSERT_NE(found, shapes.end());
    ASSERT_EQ(Count(found->second, TopAbs_EDGE), 1);
    TopExp_Explorer edges(found->second, TopAbs_EDGE);
    double from, to;
    const Handle(Geom_Curve) curve = BRep_Tool::Curve(TopoDS::Edge(edges.Current()), from, to);
    const gp_Pnt a = curve->Value(from), b = curve->Value(to);
    const Eigen::Vector3d p(a.X(), a.Y(), a.Z()), q(b.X(), b.Y(), b.Z());
    const Seam& seam = product.seams[i];
    EXPECT_LT(std::min((p - seam.start).norm() + (q - seam.end).norm(),
                       (p - seam.end).norm() + (q - seam.start).norm()),
              1e-6);
  }
}

TEST(Step, IsTheSameBytesEachTime) {
  const KnowledgeBase knowledge = Shipped();
  const Product product = PlateWithUpright(knowledge);
  EXPECT_TRUE(WriteAll(product, knowledge) == WriteAll(product, knowledge));
  EXPECT_TRUE(CanWriteStep());
}

TEST(Step, OfNothingIsStillAFile) {
  const auto text = WriteStep({}, {});
  ASSERT_TRUE(text) << text.error().message;
  EXPECT_THAT(*text, HasSubstr("END-ISO-10303-21;"));
}

}  // namespace
}  // namespace vss
