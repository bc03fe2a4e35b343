#include "vss/survey/parameters.h"

#include <algorithm>
#include <numeric>

namespace vss {
namespace {

// Calls visit(rows, member of SurveyOptions) for every step: the one place that lists them.
template <class Visitor>
void ForEachStep(const Visitor& visit) {
  visit(LineParameters(), &SurveyOptions::lines);
  visit(IdentifyParameters(), &SurveyOptions::identify);
  visit(ReconstructParameters(), &SurveyOptions::reconstruct);
  visit(SeamParameters(), &SurveyOptions::seams);
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

}  // namespace vss
