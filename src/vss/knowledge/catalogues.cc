#include "vss/knowledge/catalogues.h"

#include <algorithm>

#include "shipped_sizes.h"
#include "vss/base/files.h"
#include "vss/knowledge/lexer.h"
#include "vss/knowledge/parser.h"

namespace vss {
namespace {

Result<Catalogues::Text> TextOf(const SizesUse& use, const Catalogues& catalogues,
                                const std::string& kb_file) {
  if (catalogues.folder) {
    const std::filesystem::path beside = *catalogues.folder / use.file;
    std::error_code none;
    if (std::filesystem::is_regular_file(beside, none)) {
      VSS_ASSIGN(std::string text, ReadTextFile(beside, kMaxKnowledgeBytes));
      return Catalogues::Text{beside.string(), std::move(text)};
    }
  }
  if (const auto given = catalogues.in_place.find(use.file); given != catalogues.in_place.end())
    return given->second;
  std::string known;
  for (const EmbeddedFile& file : shipped_sizes()) {
    if (file.name == use.file) return Catalogues::Text{std::string(file.name), std::string(file.text)};
    known += (known.empty() ? "" : ", ") + std::string(file.name);
  }
  return ErrorAt(
      kb_file, use.at,
      fmt::format("the catalogue \"{}\" does not lie beside this file and is not shipped; put it there, or "
                  "name one of {}",
                  use.file, known));
}

Status Connect(const Definition& definition, SizesUse& use) {
  const SizeTable& table = *use.table;
  for (const auto& [column, dimension] : use.named)
    if (std::find(table.columns.begin(), table.columns.end(), column) == table.columns.end())
      return ErrorAt(definition.file, use.at,
                     fmt::format("the catalogue \"{}\" has no column '{}'; its columns are {}", use.file,
                                 column, fmt::join(table.columns, ", ")));
  for (const std::string& column : table.columns) {
    int dimension = -1;
    for (std::size_t d = 0; d < definition.dimensions.size(); ++d)
      if (definition.dimensions[d].name == column) dimension = static_cast<int>(d);
    for (const auto& [name, index] : use.named)
      if (name == column) dimension = index;
    if (dimension < 0)
      return ErrorAt(
          definition.file, use.at,
          fmt::format("the catalogue \"{0}\" has the column '{1}', which is no dimension of this object; "
                      "say which it is: sizes \"{0}\" with {1} = DIMENSION",
                      use.file, column));
    if (std::find(use.dimension_of_column.begin(), use.dimension_of_column.end(), dimension) !=
        use.dimension_of_column.end())
      return ErrorAt(
          definition.file, use.at,
          fmt::format("two columns of the catalogue \"{}\" are the dimension '{}'; give each its own",
                      use.file, definition.dimensions[static_cast<std::size_t>(dimension)].name));
    use.dimension_of_column.push_back(dimension);
  }
  return {};
}

}  // namespace

Status ReadCatalogues(const Catalogues& catalogues, Definition& definition) {
  std::map<std::string, std::shared_ptr<const SizeTable>> read;
  for (SizesUse& use : definition.sizes) {
    auto& table = read[use.file];
    if (!table) {
      VSS_ASSIGN(const Catalogues::Text source, TextOf(use, catalogues, definition.file));
      VSS_ASSIGN(SizeTable parsed, ParseSizes(source.text, source.file));
      table = std::make_shared<const SizeTable>(std::move(parsed));
    }
    use.table = table;
    VSS_RETURN_IF_ERROR(Connect(definition, use));
  }
  return {};
}

std::vector<std::string> CataloguesBeside(const std::string& text, const std::filesystem::path& file) {
  std::vector<std::string> names;
  const auto syntax = ParseSyntax(text, file.string());
  if (!syntax) return names;
  for (const SizesSyntax& sizes : syntax->sizes) {
    std::error_code none;
    const bool known = std::find(names.begin(), names.end(), sizes.file) != names.end();
    if (!known && std::filesystem::is_regular_file(file.parent_path() / sizes.file, none))
      names.push_back(sizes.file);
  }
  return names;
}

}  // namespace vss
