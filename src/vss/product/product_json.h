// Numbers and lists of product.json, as every piece of it writes them.
#pragma once
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "vss/product/product.h"

namespace vss::product_json {

using Json = nlohmann::ordered_json;

// Digits that carry meaning: a tenth of a micrometre, 1e-9 of a rotation, four digits of a ratio. What lies
// below is the machine's, not the measurement's.
inline constexpr double kLengthDigits = 1e4, kRotationDigits = 1e9, kRatioDigits = 1e4;

inline Json Rounded(double value, double digits) {
  if (!std::isfinite(value)) return nullptr;
  const double rounded = std::round(value * digits) / digits;
  return rounded == 0 ? 0.0 : rounded;  // no -0.0
}
inline Json Length(double mm) { return Rounded(mm, kLengthDigits); }

// A sigma keeps four significant digits, however small.
inline Json Significant(double value) {
  if (!std::isfinite(value)) return nullptr;
  if (value == 0) return 0.0;
  return std::stod(fmt::format("{:.3e}", value));
}

template <class Vector, class Format>
Json ListOf(const Vector& values, Format&& format) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < values.size(); ++i) list.push_back(format(values[i]));
  return list;
}
inline Json Point(const Eigen::Vector3d& p) { return ListOf(p, Length); }
inline Json Direction(const Eigen::Vector3d& n) {
  return ListOf(n, [](double x) { return Rounded(x, kRotationDigits); });
}

template <class Format>
Json RowsOf(const Eigen::MatrixXd& m, Format&& format) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) rows.push_back(ListOf(Eigen::VectorXd(m.row(i)), format));
  return rows;
}

inline std::string FileOf(int image, const std::vector<std::string>& files) {
  return image >= 0 && image < static_cast<int>(files.size()) ? files[static_cast<std::size_t>(image)]
                                                              : std::string();
}

// Fields that only surveys made by VSS have; empty where there are none.
Json ContourResidualsJson(const Part& part, const std::vector<std::string>& files);
Json StraightnessJson(const Part& part);
Json ObservabilityJson(const Part& part);
Json ChecksJson(const SurveyChecks& checks, const std::vector<std::string>& files);
Json NominalJson(const NominalComparison& nominal);

}  // namespace vss::product_json
