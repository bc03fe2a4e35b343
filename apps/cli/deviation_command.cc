// vss deviation: a product as built against the design.
#include <cstdio>

#include "command.h"
#include "vss/product/nominal.h"
#include "vss/product/product.h"
#include "vss/survey/parameters.h"
#include "vss/survey/survey.h"

namespace vss::cli {
namespace {

struct DeviationArguments {
  std::string nominal, product, survey;
};

// The knowledge base of a survey, or everything shipped.
Result<KnowledgeBase> KnowledgeOf(const std::string& survey_folder) {
  if (survey_folder.empty()) return LoadKnowledge({}, ".");
  VSS_ASSIGN(const Survey survey, ReadSurvey(survey_folder));
  return LoadKnowledge(survey.knowledge, survey.folder);
}

Status RunDeviation(const DeviationArguments& arguments, const Common& common) {
  SurveyOptions options;
  VSS_ASSIGN(const auto settings, ParseSettings(common.set));
  for (const auto& [name, value] : settings) VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value, options));
  VSS_ASSIGN(const KnowledgeBase knowledge, KnowledgeOf(arguments.survey));
  VSS_ASSIGN(const std::vector<NominalPart> nominal, ReadNominal(arguments.nominal, knowledge));
  VSS_ASSIGN(const Product product, ReadProduct(arguments.product, {}));
  NominalComparison comparison = CompareWithNominal(nominal, product, options.nominal);
  comparison.file = std::filesystem::path(arguments.nominal).filename().string();
  std::printf("%s", common.json ? NominalToJson(comparison).c_str() : DeviationTable(comparison).c_str());
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand("deviation",
                                     "Compare a product.json with the design: as built minus as designed, "
                                     "with sigma and significance");
  auto arguments = std::make_shared<DeviationArguments>();
  command
      ->add_option("NOMINAL", arguments->nominal,
                   "The design: a product.json, or a list of parts (vss-nominal/1)")
      ->required();
  command->add_option("PRODUCT", arguments->product, "product.json as built")->required();
  command->add_option("--survey", arguments->survey, "Survey whose knowledge base describes the parts");
  command->add_option("--set", common.set, "NAME=VALUE: nominal.gate_mm or nominal.significant_sigmas")
      ->take_all();
  command->callback([arguments, &common] { Finish(RunDeviation(*arguments, common)); });
});

}  // namespace
}  // namespace vss::cli
