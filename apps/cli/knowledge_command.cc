// vss knowledge check | show | list
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.h"
#include "shipped_knowledge.h"
#include "shipped_sizes.h"
#include "vss/base/files.h"
#include "vss/knowledge/check.h"
#include "vss/knowledge/drawing.h"
#include "vss/knowledge/object_model.h"
#include "vss/knowledge/size_table.h"

namespace vss::cli {
namespace {

struct Source {
  std::string text, file;
};

// A file, or the text of a shipped object.
Result<Source> ReadSource(const std::string& name) {
  if (name.ends_with(".kb") || name.ends_with(".sizes")) {
    VSS_ASSIGN(std::string text, ReadTextFile(name));
    return Source{std::move(text), name};
  }
  for (const EmbeddedFile& file : shipped_knowledge())
    if (file.name == name + ".kb") return Source{std::string(file.text), std::string(file.name)};
  return InputError(
      "'{}' is neither a file that ends in .kb nor a shipped object; vss knowledge list names those", name);
}

// A catalogue is sound where it can be read.
std::vector<KnowledgeFinding> CheckSource(const Source& source) {
  if (!source.file.ends_with(".sizes")) return CheckKnowledge(source.text, source.file);
  if (const auto table = ParseSizes(source.text, source.file); !table) return {{true, table.error().message}};
  return {};
}

Status Check(const std::vector<std::string>& names, bool json) {
  int errors = 0, warnings = 0;
  std::string first;
  nlohmann::json list = nlohmann::json::array();
  for (const std::string& name : names) {
    VSS_ASSIGN(const Source source, ReadSource(name));
    const auto findings = CheckSource(source);
    for (const KnowledgeFinding& f : findings) {
      (f.is_error ? errors : warnings) += 1;
      if (f.is_error && first.empty()) first = f.message;
      if (json)
        list.push_back({{"severity", f.is_error ? "error" : "warning"}, {"message", f.message}});
      else if (!f.is_error || f.message != first)
        std::printf("%s: %s\n", f.is_error ? "error" : "warning", f.message.c_str());
    }
    if (!json && findings.empty()) std::printf("%s: sound\n", source.file.c_str());
  }
  if (json)
    std::printf(
        "%s\n",
        nlohmann::json{{"errors", errors}, {"warnings", warnings}, {"findings", list}}.dump(1).c_str());
  if (errors > 0)
    return InputError("{}{}", first, errors > 1 ? fmt::format(" (and {} more)", errors - 1) : "");
  return {};
}

Status Show(const std::string& name, std::string out) {
  VSS_ASSIGN(const Source source, ReadSource(name));
  if (name.ends_with(".sizes"))
    return InputError("{}: a catalogue of sizes has nothing to draw; name a file that ends in .kb", name);
  VSS_ASSIGN(const std::string svg, DrawKnowledge(source.text, source.file));
  if (out == "-") {
    std::fwrite(svg.data(), 1, svg.size(), stdout);
    return {};
  }
  if (out.empty()) out = std::filesystem::path(source.file).stem().string() + ".svg";
  VSS_RETURN_IF_ERROR(WriteFileAtomically(out, svg));
  std::printf("%s\n", out.c_str());
  return {};
}

nlohmann::json DimensionsJson(const ObjectModel& object) {
  nlohmann::json list = nlohmann::json::array();
  for (const DimensionDef& d : object.dimensions())
    list.push_back({{"name", d.name}, {"min_mm", d.min_mm}, {"max_mm", d.max_mm}, {"help", d.help}});
  return list;
}

Status List(bool json) {
  VSS_ASSIGN(const KnowledgeBase base, LoadKnowledge({}, "."));
  nlohmann::json list = nlohmann::json::array();
  for (const auto& object : base.objects) {
    std::string names;
    for (const DimensionDef& d : object->dimensions()) names += (names.empty() ? "" : ", ") + d.name;
    if (json)
      list.push_back({{"kind", object->kind()},
                      {"title", object->title()},
                      {"features", FeaturesOf(*object)},
                      {"dimensions", DimensionsJson(*object)}});
    else
      std::printf("%-12s %s: %s\n", object->kind().c_str(), object->title().c_str(), names.c_str());
  }
  if (json) {
    std::printf("%s\n", list.dump(1).c_str());
    return {};
  }
  for (const EmbeddedFile& file : shipped_sizes()) {
    VSS_ASSIGN(const SizeTable table, ParseSizes(std::string(file.text), std::string(file.name)));
    fmt::print("{}: {}, {} sizes\n", file.name, table.title, table.entries.size());
  }
  return {};
}

void Add(CLI::App& app, Common& common) {
  auto* knowledge =
      app.add_subcommand("knowledge", "The objects that VSS can find: check, show and list them");
  knowledge->require_subcommand(1);
  auto names = std::make_shared<std::vector<std::string>>();
  auto name = std::make_shared<std::string>(), out = std::make_shared<std::string>();

  auto* check = knowledge->add_subcommand(
      "check", "Is this object sound, all over its ranges? Or this catalogue of sizes?");
  check->add_option("FILE", *names, "A file that ends in .kb or .sizes, or the name of a shipped object")
      ->required();
  check->callback([names, &common] { Finish(Check(*names, common.json)); });

  auto* show = knowledge->add_subcommand("show", "Draws an object with its dimensions as SVG");
  show->add_option("FILE", *name, "A file that ends in .kb, or the name of a shipped object")->required();
  show->add_option("-o,--output", *out, "The SVG file; -: standard output; left out: NAME.svg here");
  show->callback([name, out] { Finish(Show(*name, *out)); });

  auto* list = knowledge->add_subcommand("list", "The objects that VSS ships with");
  list->callback([&common] { Finish(List(common.json)); });
}

const Registration registration(Add);

}  // namespace
}  // namespace vss::cli
