#include "vss/knowledge/match_sizes.h"

#include <algorithm>
#include <cmath>

#include "vss/knowledge/repair.h"

namespace vss {
namespace {

constexpr double kSigmas = 3;  // what a measurement is off by at most, as far as it is believed

// Does the catalogue speak of an object of these dimensions?
bool Applies(const SizesUse& use, const Definition& definition, std::span<const double> values_mm) {
  if (!use.condition) return true;
  const std::vector<double> values = Evaluate(definition.program, values_mm);
  const double gap = values[use.condition->left] - values[use.condition->right];
  constexpr double kRounding = 1e-9;
  return use.condition->equal ? std::abs(gap) <= kRounding : gap <= kRounding;
}

// The entry against what was observed; empty where an observed dimension is too far off or none was observed.
std::optional<SizeMatch> Match(const SizesUse& use, const SizeTable::Entry& entry,
                               std::span<const MeasuredDimension> measured) {
  SizeMatch match;
  match.designation = entry.designation;
  match.standard = use.table->title;
  match.nominal_mm.resize(measured.size());
  match.tolerance_mm.resize(measured.size());
  for (std::size_t c = 0; c < use.dimension_of_column.size(); ++c) {
    const auto d = static_cast<std::size_t>(use.dimension_of_column[c]);
    const double nominal = entry.nominal_mm[c];
    const ToleranceStep& tolerance = use.table->ToleranceOf(c, nominal);
    match.nominal_mm[d] = nominal;
    match.tolerance_mm[d] = std::max(tolerance.below_mm, tolerance.above_mm);
    const MeasuredDimension& m = measured[d];
    if (!m.observed) continue;
    const double off = m.value_mm - nominal;
    const double limit = off < 0 ? tolerance.below_mm : tolerance.above_mm;
    if (!(std::abs(off) <= limit + kSigmas * m.sigma_mm)) return std::nullopt;
    ++match.num_observed;
    // Within its tolerance a size is as likely as another, more so near the nominal: a normal law whose three
    // sigma are the limit.
    const double variance = limit * limit / (kSigmas * kSigmas) + m.sigma_mm * m.sigma_mm;
    match.chi2 += off * off / std::max(variance, 1e-12);
  }
  if (match.num_observed == 0) return std::nullopt;
  match.complete = match.num_observed == static_cast<int>(use.dimension_of_column.size());
  return match;
}

}  // namespace

std::vector<SizeMatch> MatchSizes(const Definition& definition, std::span<const MeasuredDimension> measured) {
  std::vector<double> values_mm;
  for (const MeasuredDimension& m : measured) values_mm.push_back(m.value_mm);
  std::vector<SizeMatch> matches;
  for (const SizesUse& use : definition.sizes) {
    if (!Applies(use, definition, values_mm)) continue;
    for (const SizeTable::Entry& entry : use.table->entries)
      if (auto match = Match(use, entry, measured)) matches.push_back(std::move(*match));
  }
  std::stable_sort(matches.begin(), matches.end(),
                   [](const SizeMatch& a, const SizeMatch& b) { return a.chi2 < b.chi2; });
  // One entry that fits in two ways (an angle with equal legs) counts as the better one.
  std::vector<SizeMatch> unique;
  for (SizeMatch& match : matches)
    if (std::none_of(unique.begin(), unique.end(), [&](const SizeMatch& u) {
          return u.designation == match.designation && u.standard == match.standard;
        }))
      unique.push_back(std::move(match));
  return unique;
}

const SizeMatch* DeterminedSize(std::span<const SizeMatch> matches) {
  constexpr double kSurer = kSigmas * kSigmas;
  if (matches.empty()) return nullptr;
  const SizeMatch& best = matches[0];
  // One dimension of several fits by chance too often to say which size it is.
  if (!best.complete && best.num_observed < 2) return nullptr;
  if (matches.size() > 1 && matches[1].chi2 < best.chi2 + kSurer) return nullptr;
  return &best;
}

}  // namespace vss
