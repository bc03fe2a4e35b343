// The product for other programs: STEP for CAD and robots' planners, glTF for viewers, CSV for tables.
#pragma once
#include <span>
#include <string>
#include <vector>

#include "vss/base/result.h"
#include "vss/knowledge/object_model.h"
#include "vss/product/product.h"

namespace vss {

struct ExportFormat {
  std::string_view name;     // as a user writes it
  std::string_view summary;  // one sentence
};
// "step", "glb", "csv", in this order. All are listed also where this build cannot write STEP.
std::span<const ExportFormat> ExportFormats();

// Was VSS built with Open CASCADE?
bool CanWriteStep();

struct ExportedFile {
  std::string name, content;
};

// The files of each format in `formats`: workpiece.step, workpiece.glb, parts.csv and seams.csv. Lengths in
// mm (glTF: metres, as it demands) in `world`. The solids are those of `knowledge` at the parts' dimensions.
// The same product gives the same bytes. Errors: a format that there is not or that this build lacks; a part
// whose kind `knowledge` does not describe (not for CSV).
Result<std::vector<ExportedFile>> ExportProduct(const Product& product, const KnowledgeBase& knowledge,
                                                std::span<const std::string> formats);

}  // namespace vss
