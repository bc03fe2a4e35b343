// Every option of every step is declared once: a room has a plain struct of options, whose member initialisers are the
// defaults, and one table of ParameterOf<Options> rows that names each member. Command line, survey file, station form
// and manual are made from the rows.
//
//   struct LineOptions { double min_length_px = 10; };
//   std::span<const ParameterOf<LineOptions>> LineParameters() {
//     static const ParameterOf<LineOptions> rows[] = {
//         {"lines.min_length_px", &LineOptions::min_length_px, 3, 1000, "px", "Shorter segments are dropped."}};
//     return rows;
//   }
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "vss/base/result.h"

namespace vss {

template <class Options>
struct ParameterOf {
  std::string_view name;  // room.member_unit
  std::variant<double Options::*, int Options::*, bool Options::*> member;
  double min = 0, max = 0;  // inclusive; not used for bool
  std::string_view unit;    // "px", "mm", "deg", "" for none
  std::string_view help;    // one sentence
};

// A parameter as doors show it: independent of the options' type.
struct ParameterInfo {
  std::string name, type, unit, help;  // type: "number", "integer" or "bool"
  double min = 0, max = 0, default_value = 0, value = 0;
};

// Sets `name` in `options`. False where no row has that name; an error where the value is not of the row's type or range.
template <class Options>
Result<bool> SetParameter(std::span<const ParameterOf<Options>> rows, std::string_view name, double value, Options& options) {
  for (const auto& row : rows) {
    if (row.name != name) continue;
    const bool is_bool = std::holds_alternative<bool Options::*>(row.member);
    const double lo = is_bool ? 0 : row.min, hi = is_bool ? 1 : row.max;
    if (!(value >= lo && value <= hi))
      return UsageError("parameter {}: {} is outside its range {} to {}{}{}", name, value, lo, hi, row.unit.empty() ? "" : " ", row.unit);
    if (auto m = std::get_if<double Options::*>(&row.member)) options.**m = value;
    else if (value != static_cast<double>(static_cast<int>(value))) return UsageError("parameter {}: {} is not a whole number", name, value);
    else if (auto n = std::get_if<int Options::*>(&row.member)) options.**n = static_cast<int>(value);
    else options.*std::get<bool Options::*>(row.member) = value != 0;
    return true;
  }
  return false;
}

template <class Options>
double ParameterValue(const ParameterOf<Options>& row, const Options& options) {
  if (const auto m = std::get_if<double Options::*>(&row.member)) return options.**m;
  if (const auto n = std::get_if<int Options::*>(&row.member)) return options.**n;
  return options.*std::get<bool Options::*>(row.member) ? 1 : 0;
}

// The rows with the values of `options` beside the defaults.
template <class Options>
void ListParameters(std::span<const ParameterOf<Options>> rows, const Options& options, std::vector<ParameterInfo>& list) {
  static const Options defaults{};
  for (const auto& row : rows) {
    ParameterInfo info{std::string(row.name), "number", std::string(row.unit), std::string(row.help), row.min, row.max,
                       ParameterValue(row, defaults), ParameterValue(row, options)};
    if (std::holds_alternative<int Options::*>(row.member)) info.type = "integer";
    if (std::holds_alternative<bool Options::*>(row.member)) { info.type = "bool"; info.max = 1; }
    list.push_back(std::move(info));
  }
}

}  // namespace vss
