#include "vss/product/text_table.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

std::string DimensionText(const DimensionValue& d) {
  if (!d.observable) return fmt::format("{} {:.1f} (?)", d.name, d.value_mm);
  if (!std::isfinite(d.sigma_mm)) return fmt::format("{} {:.1f}", d.name, d.value_mm);
  return fmt::format("{} {:.1f} +-{:.2f}", d.name, d.value_mm, d.sigma_mm);
}

// The standard size and how far off its observed dimensions are.
std::string SizeText(const Part& part) {
  if (part.designation.empty()) return "";
  std::string off;
  for (const auto& d : part.dimensions)
    if (d.nominal_mm && d.observable)
      off += fmt::format("{}{} {:+.1f}", off.empty() ? "" : ", ", d.name, d.value_mm - *d.nominal_mm);
  return fmt::format("  = {} ({})", part.designation, off);
}

}  // namespace

std::string PartsTable(const Product& product) {
  if (product.parts.empty()) return "no parts found\n";
  std::string out = fmt::format("{:<9} {:<12} {:>9} {:>9} {:>8} {:>8}  {:<10} {:>5}  {}\n", "PART", "KIND",
                                "X mm", "Y mm", "Z mm", "YAW deg", "STANDS ON", "PICT.",
                                "DIMENSIONS mm +-1 sigma; (?): the pictures do not determine it");
  for (const auto& part : product.parts) {
    std::string dimensions;
    for (const auto& f : part.features) dimensions += (dimensions.empty() ? "with " : " and ") + f;
    for (const auto& d : part.dimensions) dimensions += (dimensions.empty() ? "" : ", ") + DimensionText(d);
    const Eigen::Vector3d p = part.world_from_part.translation.unaryExpr(
        [](double mm) { return std::round(10 * mm) / 10 + 0.0; });  // what is shown, without a -0.0
    out += fmt::format("{:<9} {:<12} {:>9.1f} {:>9.1f} {:>8.1f} {:>8.2f}  {:<10} {:>5}  {}{}{}\n", part.id,
                       part.kind, p.x(), p.y(), p.z(), DegFromRad(part.yaw_rad), part.stands_on,
                       part.images.size(), dimensions, SizeText(part), part.doubtful ? "  DOUBTFUL" : "");
  }
  const auto doubtful =
      std::count_if(product.parts.begin(), product.parts.end(), [](const auto& p) { return p.doubtful; });
  out += fmt::format("{} parts ({} doubtful), {} seams, {} unknown groups of lines\n", product.parts.size(),
                     doubtful, product.seams.size(), product.unknown.size());
  return out;
}

}  // namespace vss
