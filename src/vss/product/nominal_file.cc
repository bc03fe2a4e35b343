#include <algorithm>

#include "vss/base/files.h"
#include "vss/base/toml_file.h"
#include "vss/product/nominal.h"
#include "vss/product/product.h"

namespace vss {
namespace {

constexpr std::string_view kExample = "id = \"web 1\", kind = \"tee\", dimensions = { length = 1200.0 }";

std::string Listed(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i)
    out += (i == 0 ? "" : i + 1 < names.size() ? ", " : " and ") + names[i];
  return out;
}

std::string KindsOf(const KnowledgeBase& knowledge) {
  std::vector<std::string> kinds;
  for (const auto& object : knowledge.objects) kinds.push_back(object->kind());
  return Listed(kinds);
}

std::string DimensionsOf(const ObjectModel& model) {
  std::vector<std::string> names;
  for (const auto& d : model.dimensions()) names.push_back(d.name);
  return Listed(names);
}

Status ReadDimensions(const TomlValue& value, const ObjectModel& model, NominalPart& part) {
  VSS_ASSIGN(const TomlValue::Table* table, value.AsTable());
  for (const auto& [name, entry] : *table) {
    const auto defs = model.dimensions();
    const auto def = std::find_if(defs.begin(), defs.end(), [&](const auto& d) { return d.name == name; });
    if (def == defs.end())
      return entry.Complain(
          fmt::format("is no dimension of a {}; it has {}", model.kind(), DimensionsOf(model)));
    VSS_ASSIGN(const double mm, entry.AsNumber());
    if (def->min_mm > 0 && mm <= 0) return entry.Complain(fmt::format("is {} mm; it must be above 0", mm));
    part.dimensions_mm.emplace_back(name, mm);
  }
  return {};
}

Result<NominalPart> ReadPart(const TomlValue& in, const KnowledgeBase& knowledge) {
  NominalPart part;
  VSS_ASSIGN(const TomlValue* id, in.Get("id", "id = \"web 1\""));
  VSS_ASSIGN(part.id, id->AsText());
  VSS_ASSIGN(const TomlValue* kind, in.Get("kind", "kind = \"tee\""));
  VSS_ASSIGN(part.kind, kind->AsText());
  const ObjectModel* model = knowledge.Find(part.kind);
  if (model == nullptr)
    return kind->Complain(fmt::format("is \"{}\", which the knowledge base does not have; known are {}",
                                      part.kind, KindsOf(knowledge)));
  if (const TomlValue* position = in.Find("position")) {
    VSS_ASSIGN(const Eigen::VectorXd p, position->AsVector(3));
    part.position = p;
  }
  if (const TomlValue* yaw = in.Find("yaw")) {
    VSS_ASSIGN(const double deg, yaw->AsNumber());
    part.yaw_rad = RadFromDeg(deg);
  }
  if (const TomlValue* dimensions = in.Find("dimensions"))
    VSS_RETURN_IF_ERROR(ReadDimensions(*dimensions, *model, part));
  if (part.dimensions_mm.empty() && !part.position)
    return in.Complain(
        "gives neither dimensions nor a position; write what was designed, e.g. dimensions = { length = "
        "1200.0 }");
  return part;
}

Result<std::vector<NominalPart>> ReadList(const std::string& text, const std::string& file,
                                          const KnowledgeBase& knowledge) {
  VSS_ASSIGN(const TomlValue top, ParseToml(text, file, "vss-nominal/1"));
  VSS_ASSIGN(const TomlValue* list, top.Get("part", fmt::format("[[part]] {}", kExample)));
  VSS_ASSIGN(const TomlValue::Array* entries, list->AsArray());
  std::vector<NominalPart> out;
  for (const auto& entry : *entries) {
    VSS_ASSIGN(NominalPart part, ReadPart(entry, knowledge));
    if (std::any_of(out.begin(), out.end(), [&](const auto& p) { return p.id == part.id; }))
      return entry.Complain(fmt::format("has the id \"{}\" of a part above; give each its own", part.id));
    out.push_back(std::move(part));
  }
  return out;
}

Result<std::vector<NominalPart>> FromProduct(const std::filesystem::path& path,
                                             const KnowledgeBase& knowledge) {
  VSS_ASSIGN(const Product product, ReadProduct(path, {}));
  if (product.parts.empty())
    return InputError("{}: has no parts; name the product that was designed", path.string());
  std::vector<NominalPart> out;
  for (const auto& part : product.parts) {
    if (knowledge.Find(part.kind) == nullptr)
      return InputError("{}: part {} is a \"{}\", which the knowledge base does not have; known are {}",
                        path.string(), part.id, part.kind, KindsOf(knowledge));
    NominalPart& n = out.emplace_back();
    n.id = part.id, n.kind = part.kind;
    for (const auto& d : part.dimensions) n.dimensions_mm.emplace_back(d.name, d.value_mm);
    n.position = part.world_from_part.translation;
    n.yaw_rad = part.yaw_rad;
  }
  return out;
}

}  // namespace

Result<std::vector<NominalPart>> ReadNominal(const std::filesystem::path& path,
                                             const KnowledgeBase& knowledge) {
  VSS_ASSIGN(const std::string text, ReadTextFile(path));
  const auto first = text.find_first_not_of(" \t\r\n");
  const bool is_json = first != std::string::npos && text[first] == '{';
  return is_json ? FromProduct(path, knowledge) : ReadList(text, path.string(), knowledge);
}

}  // namespace vss
