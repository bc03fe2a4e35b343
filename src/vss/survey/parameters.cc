#include "vss/survey/parameters.h"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <regex>

namespace vss {
namespace {

// Calls visit(rows, member of SurveyOptions) for every step: the one place that lists them.
template <class Visitor>
void ForEachStep(const Visitor& visit) {
  visit(LineParameters(), &SurveyOptions::lines);
  visit(IdentifyParameters(), &SurveyOptions::identify);
  visit(ReconstructParameters(), &SurveyOptions::reconstruct);
  visit(SeamParameters(), &SurveyOptions::seams);
  visit(TemperatureParameters(), &SurveyOptions::temperature);
  visit(NominalParameters(), &SurveyOptions::nominal);
}

// Levenshtein's distance: how many letters to change, add or drop.
std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] != b[j]);
      diagonal = std::exchange(row[j + 1], std::min({row[j] + 1, row[j + 1] + 1, changed}));
    }
  }
  return row.back();
}

std::string Nearest(std::string_view name) {
  const auto all = SurveyParameters();
  const auto nearest = std::min_element(all.begin(), all.end(), [&](const auto& a, const auto& b) {
    return EditDistance(a.name, name) < EditDistance(b.name, name);
  });
  return nearest == all.end() ? std::string() : nearest->name;
}

}  // namespace

Status SetSurveyParameter(std::string_view name, double value, SurveyOptions& options) {
  bool found = false;
  Status status;
  ForEachStep([&](auto rows, auto member) {
    if (found || !status) return;
    const auto set = SetParameter(rows, name, value, options.*member);
    if (!set)
      status = tl::unexpected(set.error());
    else
      found = *set;
  });
  if (status && !found)
    return UsageError("there is no parameter {}; did you mean {}? (`vss parameters` lists all)", name,
                      Nearest(name));
  return status;
}

std::vector<ParameterInfo> SurveyParameters(const SurveyOptions& options) {
  std::vector<ParameterInfo> list;
  ForEachStep([&](auto rows, auto member) { ListParameters(rows, options.*member, list); });
  return list;
}

Result<NamedLength> ParseKnownLength(const std::string& text) {
  static const std::regex form(R"(([^.=]+)\.([^.=]+)=([0-9.eE+]+?)(?:\+-([0-9.eE]+))?)");
  std::smatch match;
  NamedLength out;
  const auto number = [](const std::string& digits, double& value) {
    const auto end = digits.data() + digits.size();
    const auto read = std::from_chars(digits.data(), end, value);
    return read.ec == std::errc() && read.ptr == end && value > 0;
  };
  if (!std::regex_match(text, match, form) || !number(match[3], out.value_mm) ||
      (match[4].matched && !number(match[4], out.sigma_mm)))
    return UsageError(
        "--known-length {}: write PART.DIMENSION=MM, with its standard deviation where it is known, e.g. "
        "part-1.length=1200.0+-0.1",
        text);
  out.part = match[1], out.dimension = match[2];
  return out;
}

}  // namespace vss
