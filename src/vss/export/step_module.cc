#include "vss/export/step_module.h"

#include <APIHeaderSection_MakeHeader.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPCAFControl_Writer.hxx>
#include <STEPControl_Controller.hxx>
#include <Standard_Failure.hxx>
#include <StepBasic_Product.hxx>
#include <StepBasic_ProductDefinition.hxx>
#include <StepBasic_ProductDefinitionFormation.hxx>
#include <StepData_Protocol.hxx>
#include <StepData_StepModel.hxx>
#include <StepData_StepWriter.hxx>
#include <StepRepr_NextAssemblyUsageOccurrence.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopoDS_Edge.hxx>
#include <XCAFApp_Application.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <XSControl_WorkSession.hxx>
#include <mutex>
#include <sstream>

#include "vss/export/brep.h"

namespace vss {
namespace {

using Text = TCollection_ExtendedString;

constexpr Standard_Boolean kUtf8 = Standard_True;
constexpr double kShortestSeam_mm = 1e-3;  // an edge of no length is none

Text ExtendedText(const std::string& utf8) { return {utf8.c_str(), kUtf8}; }
Handle(TCollection_HAsciiString) HeaderText(const std::string& text) {
  return new TCollection_HAsciiString(text.c_str());
}

gp_Trsf Placement(const RigidTransform& t) {
  const auto& r = t.rotation;
  gp_Trsf placed;
  placed.SetValues(r(0, 0), r(0, 1), r(0, 2), t.translation.x(),  //
                   r(1, 0), r(1, 1), r(1, 2), t.translation.y(),  //
                   r(2, 0), r(2, 1), r(2, 2), t.translation.z());
  return placed;
}

// The document of Open CASCADE's application framework that the writer reads: shapes, names, places. (No
// colours: they are written in the order of addresses.)
class Assembly {
 public:
  explicit Assembly(const std::string& name) {
    XCAFApp_Application::GetApplication()->NewDocument("BinXCAF", document_);
    shapes_ = XCAFDoc_DocumentTool::ShapeTool(document_->Main());
    root_ = shapes_->NewShape();
    TDataStd_Name::Set(root_, ExtendedText(name));
  }
  ~Assembly() { XCAFApp_Application::GetApplication()->Close(document_); }
  Assembly(const Assembly&) = delete;

  void Add(const std::string& name, const TopoDS_Shape& shape, const gp_Trsf& place) {
    const TDF_Label label = shapes_->AddShape(shape, Standard_False);
    TDataStd_Name::Set(label, ExtendedText(name));
    TDataStd_Name::Set(shapes_->AddComponent(root_, label, TopLoc_Location(place)), ExtendedText(name));
  }
  Handle(TDocStd_Document) Finish() {
    shapes_->UpdateAssemblies();
    return document_;
  }

 private:
  Handle(TDocStd_Document) document_;
  Handle(XCAFDoc_ShapeTool) shapes_;
  TDF_Label root_;
};

// The schema has to be set after the controller's Init and before the writer exists, or AP214 is written.
bool SetSchema() {
  STEPControl_Controller::Init();
  return Interface_Static::SetCVal("write.step.schema", "AP242DIS") &&
         Interface_Static::SetCVal("write.step.unit", "MM");
}

void DescribeHeader(const Product& product, const Handle(StepData_StepModel) & model) {
  APIHeaderSection_MakeHeader header(model);
  header.SetName(HeaderText(product.survey));
  // No time: the same product gives the same bytes.
  header.SetTimeStamp(HeaderText("1970-01-01T00:00:00"));
  header.SetAuthorValue(1, HeaderText(""));
  header.SetOrganizationValue(1, HeaderText(""));
  header.SetAuthorisation(HeaderText(""));
  header.SetOriginatingSystem(HeaderText("VSS " VSS_VERSION));
  header.SetPreprocessorVersion(HeaderText("Open CASCADE"));
  header.SetDescriptionValue(
      1, HeaderText(
             "Parts and seams as measured; mm; world frame right-handed, z up, ground at z = 0; each part "
             "in its own frame, base on z = 0, x along its length"));
  header.Apply(model);
}

// Open CASCADE numbers the members of all assemblies of its life, and names only those that are solids.
void NumberMembers(const Handle(StepData_StepModel) & model) {
  int number = 0;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const auto member = Handle(StepRepr_NextAssemblyUsageOccurrence)::DownCast(model->Value(i));
    if (member.IsNull()) continue;
    member->SetId(new TCollection_HAsciiString(++number));
    member->SetName(member->RelatedProductDefinition()->Formation()->OfProduct()->Name());
  }
}

Result<std::string> Written(const Product& product, Assembly& assembly) {
  STEPCAFControl_Writer writer;
  writer.SetNameMode(Standard_True);
  writer.SetColorMode(Standard_False);
  if (!writer.Transfer(assembly.Finish(), STEPControl_AsIs))
    return tl::unexpected<Error>({ErrorCode::kInternal, "Open CASCADE could not put the parts into STEP"});
  const Handle(StepData_StepModel) model = writer.ChangeWriter().Model();
  DescribeHeader(product, model);
  NumberMembers(model);
  StepData_StepWriter text(model);
  text.SendModel(Handle(StepData_Protocol)::DownCast(writer.ChangeWriter().WS()->Protocol()));
  std::ostringstream out;
  if (!text.Print(out))
    return tl::unexpected<Error>({ErrorCode::kInternal, "Open CASCADE could not write STEP"});
  return out.str();
}

Result<std::string> Write(const Product& product, std::span<const PartSolid> solids) {
  if (!SetSchema())
    return tl::unexpected<Error>({ErrorCode::kInternal, "this Open CASCADE does not know STEP AP242"});
  Assembly assembly(product.survey.empty() ? "workpiece" : product.survey);
  for (const auto& one : solids) {
    const auto shape = BrepOf(one.solid);
    if (!shape)
      return InputError("{} cannot be written as STEP: {}; correct its dimensions", one.part->id,
                        shape.error().message);
    assembly.Add(NameOf(*one.part), *shape, Placement(one.part->world_from_part));
  }
  for (std::size_t i = 0; i < product.seams.size(); ++i) {
    const Seam& seam = product.seams[i];
    if (!((seam.end - seam.start).norm() > kShortestSeam_mm)) continue;
    const TopoDS_Edge edge = BRepBuilderAPI_MakeEdge(gp_Pnt(seam.start.x(), seam.start.y(), seam.start.z()),
                                                     gp_Pnt(seam.end.x(), seam.end.y(), seam.end.z()));
    assembly.Add(NameOf(seam, i), edge, gp_Trsf());
  }
  return Written(product, assembly);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) void VssWriteStep(const Product& product, std::span<const PartSolid> solids, Result<std::string>& text) {
  static std::mutex mutex;  // Open CASCADE keeps its settings and its application in globals
  const std::lock_guard lock(mutex);
  Message::DefaultMessenger()->ChangePrinters().Clear();  // it would talk on stdout
  try {
    text = Write(product, solids);
  } catch (const Standard_Failure& e) {
    text = tl::unexpected<Error>(
        {ErrorCode::kInternal, fmt::format("Open CASCADE failed: {}", e.GetMessageString())});
  }
}

}  // namespace vss
