#include "vss/export/csv.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

// A field with what separates fields is quoted (RFC 4180).
std::string Text(const std::string& field) {
  if (field.find_first_of(",\"\r\n") == std::string::npos) return field;
  std::string quoted = "\"";
  for (const char c : field) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

// As product.json: lengths to 0.1 um, directions to 1e-9. What is not known stays empty.
std::string Number(double value, const char* format, double smallest) {
  if (!std::isfinite(value)) return {};
  return fmt::format(fmt::runtime(format), std::abs(value) < smallest ? 0.0 : value);
}
std::string Length(double mm) { return Number(mm, "{:.4f}", 0.5e-4); }
std::string Direction(double x) { return Number(x, "{:.9f}", 0.5e-9); }
std::string Sigma(double mm) { return Number(mm, "{:.4g}", 0); }

template <class Format>
std::string Vector(const Eigen::Vector3d& v, Format&& format) {
  return format(v.x()) + "," + format(v.y()) + "," + format(v.z());
}

std::vector<std::string> DimensionNames(const Product& product) {
  std::vector<std::string> names;
  for (const auto& part : product.parts)
    for (const auto& d : part.dimensions)
      if (std::find(names.begin(), names.end(), d.name) == names.end()) names.push_back(d.name);
  return names;
}

std::string DimensionCells(const Part& part, const std::vector<std::string>& names) {
  std::string cells;
  for (const auto& name : names) {
    const auto d = std::find_if(part.dimensions.begin(), part.dimensions.end(),
                                [&](const auto& one) { return one.name == name; });
    if (d == part.dimensions.end())
      cells += ",,,";
    else
      cells += "," + Length(d->value_mm) + "," + Sigma(d->sigma_mm) + (d->observable ? ",yes" : ",no");
  }
  return cells;
}

}  // namespace

std::string PartsCsv(const Product& product) {
  const std::vector<std::string> names = DimensionNames(product);
  std::string out =
      "part,kind,source,doubtful,stands_on,residual_px,x_world_mm,y_world_mm,z_world_mm,yaw_deg";
  for (const char row : {'x', 'y', 'z'})
    for (const char column : {'x', 'y', 'z'}) out += fmt::format(",world_from_part_{}{}", row, column);
  for (const auto& name : names)
    out += "," + Text(name + "_mm") + "," + Text(name + "_sigma_mm") + "," + Text(name + "_observable");
  out += "\n";
  for (const auto& part : product.parts) {
    out += Text(part.id) + "," + Text(part.kind) + "," + Text(part.source) + "," +
           (part.doubtful ? "yes" : "no") + "," + Text(part.stands_on) + "," + Length(part.residual_px) +
           "," + Vector(part.world_from_part.translation, Length) + "," +
           Number(DegFromRad(part.yaw_rad), "{:.6f}", 0.5e-6);
    for (int row = 0; row < 3; ++row)
      out += "," + Vector(part.world_from_part.rotation.row(row).transpose(), Direction);
    out += DimensionCells(part, names) + "\n";
  }
  return out;
}

std::string SeamsCsv(const Product& product) {
  std::string out = "x_world_mm,y_world_mm,z_world_mm,i,j,k,seam,point,part_a,part_b";
  for (const char part : {'a', 'b'})
    for (const char axis : {'x', 'y', 'z'}) out += fmt::format(",normal_{}_{}", part, axis);
  out += ",gap_mm,length_mm\n";
  for (std::size_t i = 0; i < product.seams.size(); ++i) {
    const Seam& seam = product.seams[i];
    const std::string rest = "," + Text(seam.part_a) + "," + Text(seam.part_b) + "," +
                             Vector(seam.normal_a, Direction) + "," + Vector(seam.normal_b, Direction) + "," +
                             Length(seam.gap_mm) + "," + Length((seam.end - seam.start).norm()) + "\n";
    for (const bool start : {true, false})
      out += Vector(start ? seam.start : seam.end, Length) + "," + Vector(ApproachOf(seam), Direction) + "," +
             std::to_string(i + 1) + (start ? ",start" : ",end") + rest;
  }
  return out;
}

}  // namespace vss
