// vss export: the product as files for other programs.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "command.h"
#include "vss/base/output_folder.h"
#include "vss/export/export.h"

namespace vss::cli {
namespace {

struct ExportArgs {
  std::string product, output = ".";
  std::vector<std::string> formats, knowledge;
};

std::vector<std::string> EveryFormat() {
  std::vector<std::string> names;
  for (const auto& format : ExportFormats())
    if (format.name != "step" || CanWriteStep()) names.emplace_back(format.name);
  return names;
}

std::string FormatHelp() {
  std::string help = "What to write, separated by commas; left out: all of them.";
  for (const auto& format : ExportFormats()) help += fmt::format("\n{}: {}", format.name, format.summary);
  if (!CanWriteStep()) help += "\nSTEP is not part of this build, which was made without Open CASCADE.";
  return help;
}

// What VSS ships with, and before it what the user named.
Result<KnowledgeBase> KnowledgeOf(const std::vector<std::string>& further) {
  VSS_ASSIGN(KnowledgeBase shipped, LoadKnowledge({}, {}));
  if (further.empty()) return shipped;
  VSS_ASSIGN(KnowledgeBase all, LoadKnowledge(further, std::filesystem::current_path()));
  all.objects.insert(all.objects.end(), shipped.objects.begin(), shipped.objects.end());
  return all;
}

Status Export(const ExportArgs& args, bool json) {
  VSS_ASSIGN(const Product product, ReadProduct(args.product, {}));
  VSS_ASSIGN(const KnowledgeBase knowledge, KnowledgeOf(args.knowledge));
  VSS_ASSIGN(const auto files,
             ExportProduct(product, knowledge, args.formats.empty() ? EveryFormat() : args.formats));
  VSS_ASSIGN(OutputFolder folder, OutputFolder::Open(args.output));
  for (const auto& file : files) folder.Add(file.name, file.content);
  VSS_RETURN_IF_ERROR(folder.Commit());
  nlohmann::ordered_json written = nlohmann::ordered_json::array();
  for (const auto& file : files) {
    written.push_back((folder.path() / file.name).string());
    if (!json) fmt::print("{}\n", (folder.path() / file.name).string());
  }
  if (json) std::printf("%s\n", nlohmann::ordered_json{{"files", written}}.dump(1).c_str());
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand(
      "export", "Write a product.json as STEP, glTF and CSV: solids, seams with approach, units in mm");
  auto args = std::make_shared<ExportArgs>();
  command->add_option("PRODUCT", args->product, "product.json")->required();
  command->add_option("-o,--output", args->output, "Folder to write to; made where it is missing")
      ->capture_default_str();
  command->add_option("--format", args->formats, FormatHelp())->delimiter(',');
  command
      ->add_option("--knowledge", args->knowledge,
                   "Files (.kb) with objects beside those that VSS ships with, separated by commas")
      ->delimiter(',');
  command->callback([args, &common] { Finish(Export(*args, common.json)); });
});

}  // namespace
}  // namespace vss::cli
