// vss compare: a product against the truth, where somebody knows it.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

#include "command.h"
#include "vss/product/compare.h"

namespace vss::cli {
namespace {

double Mean(const std::vector<double>& v) {
  return v.empty() ? 0 : std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}
double Max(const std::vector<double>& v) { return v.empty() ? 0 : *std::max_element(v.begin(), v.end()); }

struct Totals {
  int found = 0;
  std::vector<double> errors_mm, dimension_errors_mm;
  int within_two_sigma = 0, with_sigma = 0;
};

Totals Sum(const Comparison& comparison) {
  Totals t;
  for (const auto& part : comparison.parts) {
    if (part.part < 0) continue;
    ++t.found;
    t.errors_mm.insert(t.errors_mm.end(), part.errors_mm.begin(), part.errors_mm.end());
    for (const auto& d : part.dimensions) {
      t.dimension_errors_mm.push_back(std::abs(d.error_mm));
      if (!(d.sigma_mm > 0)) continue;
      ++t.with_sigma;
      t.within_two_sigma += std::abs(d.error_mm) <= 2 * d.sigma_mm;
    }
  }
  return t;
}

std::string DimensionErrors(const PartComparison& part) {
  std::string out;
  for (const auto& d : part.dimensions)
    out += fmt::format("{}{} {:+.2f}", out.empty() ? "" : ", ", d.name, d.error_mm);
  return out;
}

void PrintTable(const std::vector<TruePart>& truth, const Product& product, const Comparison& comparison) {
  fmt::print("{:<9} {:<12} {:<9} {:>9} {:>9}  {}\n", "TRUTH", "KIND", "FOUND AS", "MEAN mm", "MAX mm",
             "ERRORS OF THE DIMENSIONS mm");
  for (const auto& part : comparison.parts) {
    const TruePart& t = truth[static_cast<std::size_t>(part.truth)];
    if (part.part < 0)
      fmt::print("{:<9} {:<12} {:<9}\n", t.id, t.kind, "MISSED");
    else
      fmt::print("{:<9} {:<12} {:<9} {:>9.3f} {:>9.3f}  {}\n", t.id, t.kind,
                 product.parts[static_cast<std::size_t>(part.part)].id, Mean(part.errors_mm),
                 Max(part.errors_mm), DimensionErrors(part));
  }
  for (int i : comparison.invented)
    fmt::print("{:<9} {:<12} {}\n", "-", product.parts[static_cast<std::size_t>(i)].kind,
               product.parts[static_cast<std::size_t>(i)].id + " IS NOT THERE");
  const Totals t = Sum(comparison);
  fmt::print(
      "{} of {} parts found, {} invented; vertex error {:.3f} mm in the mean, {:.3f} mm at most; dimensions "
      "{:.3f} mm in the mean, {} of {} within two of their sigmas\n",
      t.found, truth.size(), comparison.invented.size(), Mean(t.errors_mm), Max(t.errors_mm),
      Mean(t.dimension_errors_mm), t.within_two_sigma, t.with_sigma);
}

void PrintJson(const std::vector<TruePart>& truth, const Product& product, const Comparison& comparison) {
  const Totals t = Sum(comparison);
  nlohmann::ordered_json out = {{"parts", truth.size()},
                                {"given", product.parts.size()},
                                {"found", t.found},
                                {"invented", comparison.invented.size()},
                                {"mean_mm", Mean(t.errors_mm)},
                                {"max_mm", Max(t.errors_mm)},
                                {"dimensions_mean_mm", Mean(t.dimension_errors_mm)},
                                {"dimensions_with_sigma", t.with_sigma},
                                {"dimensions_within_2_sigma", t.within_two_sigma}};
  std::printf("%s\n", out.dump(1).c_str());
}

Status Compare(const std::string& truth_file, const std::string& product_file, bool json) {
  VSS_ASSIGN(const std::vector<TruePart> truth, ReadTruth(truth_file));
  VSS_ASSIGN(const Product product, ReadProduct(product_file, {}));
  const Comparison comparison = CompareWithTruth(truth, product);
  json ? PrintJson(truth, product, comparison) : PrintTable(truth, product, comparison);
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand("compare",
                                     "Compare a product.json with the truth of a rendered survey: what was "
                                     "found, what was invented, the errors");
  auto files = std::make_shared<std::pair<std::string, std::string>>();
  command->add_option("TRUTH", files->first, "truth.json of the survey")->required();
  command->add_option("PRODUCT", files->second, "product.json")->required();
  command->callback([files, &common] { Finish(Compare(files->first, files->second, common.json)); });
});

}  // namespace
}  // namespace vss::cli
