// vss parameters: every parameter of every step.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "command.h"
#include "vss/calibrate/intrinsic.h"
#include "vss/survey/parameters.h"

namespace vss::cli {
namespace {

std::string RangeOf(const ParameterInfo& p) {
  if (p.type == "bool") return "false or true";
  return fmt::format("{:g} to {:g}{}{}", p.min, p.max, p.unit.empty() ? "" : " ", p.unit);
}

std::string DefaultOf(const ParameterInfo& p) {
  if (p.type == "bool") return p.default_value != 0 ? "true" : "false";
  return fmt::format("{:g}", p.default_value);
}

std::vector<ParameterInfo> AllParameters() {
  std::vector<ParameterInfo> all = SurveyParameters();
  ListParameters(CalibrationParameters(), CalibrationOptions{}, all);
  return all;
}

void PrintTable() {
  fmt::print("{:<34} {:>10}  {:<24} {}\n", "NAME", "DEFAULT", "RANGE", "WHAT IT DOES");
  for (const auto& p : AllParameters())
    fmt::print("{:<34} {:>10}  {:<24} {}\n", p.name, DefaultOf(p), RangeOf(p), p.help);
  fmt::print(
      "\nSet them in survey.toml ([parameters], \"{0}\" = VALUE) or on the command line (--set {0}=VALUE); "
      "those of "
      "calibrate.* on the command line of vss calibrate.\n",
      SurveyParameters().front().name);
}

void PrintJson() {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& p : AllParameters())
    list.push_back({{"name", p.name},
                    {"type", p.type},
                    {"unit", p.unit},
                    {"default", p.default_value},
                    {"min", p.min},
                    {"max", p.max},
                    {"help", p.help}});
  std::printf("%s\n", list.dump(1).c_str());
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand(
      "parameters", "List every parameter of every step: default, range, unit, what it does");
  command->callback([&common] { common.json ? PrintJson() : PrintTable(); });
});

}  // namespace
}  // namespace vss::cli
