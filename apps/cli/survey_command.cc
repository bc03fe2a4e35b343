// vss survey: the main job, from the pictures of a survey to product definition data.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

#include "command.h"
#include "vss/product/text_table.h"
#include "vss/survey/survey_files.h"

namespace vss::cli {
namespace {

struct SurveyArguments {
  std::string folder, out, cameras, nominal;
  std::vector<std::string> known_lengths;
};

void PrintSummary(const Survey& survey, const SurveyOutcome& outcome, const OutputFolder& out) {
  fmt::print("{}", PartsTable(outcome.product));
  if (outcome.product.nominal) fmt::print("\n{}", DeviationTable(*outcome.product.nominal));
  for (const auto& warning : outcome.product.warnings) fmt::print("warning: {}\n", warning);
  double total_s = 0;
  std::string steps;
  for (const auto& step : outcome.steps) {
    total_s += step.seconds;
    steps += fmt::format("{}{} {:.2f} s", steps.empty() ? "" : ", ", step.step, step.seconds);
  }
  fmt::print("\n{} pictures in {:.2f} s: {}\n", survey.images.size(), total_s, steps);
  fmt::print("product: {}\nreport:  {}\n", (out.path() / "product.json").string(),
             (out.path() / "report.html").string());
}

void PrintJson(const Survey& survey, const SurveyOutcome& outcome, const OutputFolder& out) {
  nlohmann::ordered_json summary = {{"survey", survey.name},
                                    {"product", (out.path() / "product.json").string()},
                                    {"report", (out.path() / "report.html").string()},
                                    {"pictures", survey.images.size()},
                                    {"parts", outcome.product.parts.size()},
                                    {"seams", outcome.product.seams.size()},
                                    {"unknown", outcome.product.unknown.size()},
                                    {"warnings", outcome.product.warnings}};
  for (const auto& step : outcome.steps) summary["seconds"][step.step] = step.seconds;
  std::printf("%s\n", summary.dump(1).c_str());
}

Status RunSurveyCommand(const SurveyArguments& arguments, const Common& common) {
  const Progress progress = MakeProgress(common);
  std::optional<std::filesystem::path> cameras;
  if (!arguments.cameras.empty()) cameras = arguments.cameras;
  VSS_ASSIGN(const Survey survey, ReadSurvey(arguments.folder, cameras));
  VSS_ASSIGN(SurveyOptions options, OptionsOf(survey));
  VSS_ASSIGN(const auto settings, ParseSettings(common.set));
  for (const auto& [name, value] : settings) VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value, options));
  for (const auto& text : arguments.known_lengths) {
    VSS_ASSIGN(options.known_lengths.emplace_back(), ParseKnownLength(text));
  }
  options.threads = common.threads;
  std::vector<NominalPart> nominal;
  if (!arguments.nominal.empty()) {
    VSS_ASSIGN(const KnowledgeBase knowledge, LoadKnowledge(survey.knowledge, survey.folder));
    VSS_ASSIGN(nominal, ReadNominal(arguments.nominal, knowledge));
  }
  VSS_ASSIGN(OutputFolder out, OutputFolder::Open(arguments.out));
  VSS_ASSIGN(SurveyOutcome outcome, RunSurvey(survey, options, progress));
  if (!nominal.empty()) {
    outcome.product.nominal = CompareWithNominal(nominal, outcome.product, options.nominal);
    outcome.product.nominal->file = std::filesystem::path(arguments.nominal).filename().string();
  }
  VSS_RETURN_IF_ERROR(AddSurveyFiles(survey, options, outcome, progress, out));
  VSS_RETURN_IF_ERROR(out.Commit());
  if (common.json)
    PrintJson(survey, outcome, out);
  else
    PrintSummary(survey, outcome, out);
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand(
      "survey",
      "Turn the pictures of a survey into product definition data: product.json, report.html, overlays");
  auto arguments = std::make_shared<SurveyArguments>();
  command->add_option("DIR", arguments->folder, "Survey folder (with survey.toml)")->required();
  command->add_option("-o,--out", arguments->out, "Folder for the results")->required();
  command->add_option("--cameras", arguments->cameras, "Take the cameras from this folder, by their ids");
  command->add_option("--nominal", arguments->nominal,
                      "Compare with the design: a product.json, or a list of parts (vss-nominal/1)");
  command
      ->add_option("--known-length", arguments->known_lengths,
                   "PART.DIMENSION=MM[+-SIGMA]: a dimension measured otherwise gives the scale; parts are "
                   "called as in the product.json of a run before")
      ->take_all();
  command->add_option("--set", common.set, "NAME=VALUE: any parameter (see vss parameters)")->take_all();
  command->callback([arguments, &common] { Finish(RunSurveyCommand(*arguments, common)); });
});

}  // namespace
}  // namespace vss::cli
