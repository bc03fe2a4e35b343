#include "vss/knowledge/define.h"

#include <algorithm>

#include "vss/knowledge/build_solid.h"
#include "vss/knowledge/compile.h"
#include "vss/knowledge/expand.h"
#include "vss/knowledge/parser.h"
#include "vss/knowledge/repair.h"

namespace vss {
namespace {

// Each loop is made to run with the material on its left.
void OrientLoops(Definition& definition, std::span<const double> usual_mm) {
  for (ProfileLoop& loop : definition.extrusion.loops) {
    if (loop.is_circle || (LoopDoubleArea(definition, loop, usual_mm) > 0) == loop.is_outline) continue;
    std::reverse(loop.corners.begin(), loop.corners.end());
    // rim_weight belongs to the edge that follows a corner: after the turn it is the edge that came before
    // it.
    std::vector<std::array<double, 2>> weights;
    for (const Corner& c : loop.corners) weights.push_back(c.rim_weight);
    for (std::size_t i = 0; i < weights.size(); ++i)
      loop.corners[i].rim_weight = weights[(i + 1) % weights.size()];
  }
}

Result<Definition> DefineVariant(const Syntax& syntax, const Catalogues& catalogues) {
  VSS_ASSIGN(Definition definition, Compile(syntax));
  VSS_RETURN_IF_ERROR(ReadCatalogues(catalogues, definition));
  VSS_RETURN_IF_ERROR(CheckConstraintsCanHold(definition));
  const std::vector<std::optional<double>> unknown(definition.dimensions.size());
  const std::vector<double> usual_mm = UsualDimensions(definition, unknown);
  OrientLoops(definition, usual_mm);
  VSS_RETURN_IF_ERROR(CheckSolid(definition, usual_mm));
  return definition;
}

}  // namespace

Result<std::vector<Definition>> Define(const std::string& text, const std::string& file) {
  return Define(text, file, {std::filesystem::path(file).parent_path(), {}});
}

Result<std::vector<Definition>> Define(const std::string& text, const std::string& file,
                                       const Catalogues& catalogues) {
  VSS_ASSIGN(const Syntax syntax, ParseSyntax(text, file));
  VSS_ASSIGN(const std::vector<Syntax> variants, Expand(syntax));
  std::vector<Definition> out;
  for (const Syntax& variant : variants) {
    auto definition = DefineVariant(variant, catalogues);
    if (!definition) return InputError("{}", InVariant(definition.error().message, VariantName(variant)));
    out.push_back(std::move(*definition));
  }
  return out;
}

}  // namespace vss
