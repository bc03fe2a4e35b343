#include "vss/export/export.h"

#include <algorithm>

#include "vss/export/csv.h"
#include "vss/export/glb.h"
#include "vss/export/part_solid.h"
#include "vss/export/step.h"

namespace vss {
namespace {

constexpr ExportFormat kFormats[] = {
    {"step", "STEP AP242: named solids and seams, for CAD and robots' planners"},
    {"glb", "binary glTF 2.0: faces, edges and seams, for viewers and collision checks"},
    {"csv", "tables of the parts and of the seams (x y z i j k)"},
};

Status CheckFormats(std::span<const std::string> formats) {
  if (formats.empty()) return UsageError("no format is named; name step, glb or csv");
  for (const auto& format : formats)
    if (std::none_of(std::begin(kFormats), std::end(kFormats),
                     [&](const auto& known) { return known.name == format; }))
      return UsageError("there is no format \"{}\"; name step, glb or csv", format);
  return {};
}

}  // namespace

std::span<const ExportFormat> ExportFormats() { return kFormats; }

Result<std::vector<ExportedFile>> ExportProduct(const Product& product, const KnowledgeBase& knowledge,
                                                std::span<const std::string> formats) {
  VSS_RETURN_IF_ERROR(CheckFormats(formats));
  const auto wanted = [&](const char* format) {
    return std::find(formats.begin(), formats.end(), format) != formats.end();
  };
  std::vector<PartSolid> solids;
  if (wanted("step") || wanted("glb")) {
    VSS_ASSIGN(solids, SolidsOfProduct(product, knowledge));
  }
  std::vector<ExportedFile> files;
  if (wanted("step")) {
    VSS_ASSIGN(std::string text, WriteStep(product, solids));
    files.push_back({"workpiece.step", std::move(text)});
  }
  if (wanted("glb")) files.push_back({"workpiece.glb", WriteGlb(product, solids)});
  if (wanted("csv")) {
    files.push_back({"parts.csv", PartsCsv(product)});
    files.push_back({"seams.csv", SeamsCsv(product)});
  }
  return files;
}

}  // namespace vss
