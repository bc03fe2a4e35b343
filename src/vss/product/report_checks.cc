#include "vss/product/report_checks.h"

#include <cmath>

#include "vss/product/overlay.h"

namespace vss {
namespace {

std::string Number(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : std::string("&ndash;");
}

std::string DeviationRow(const PartDeviation& part, const Deviation& d, bool first) {
  const std::string unit = d.name == "yaw" ? "&deg;" : "";
  const std::string verdict = !d.observable   ? "<span class=\"sig\">not observable</span>"
                              : d.significant ? "<span class=\"tag doubt\">deviates</span>"
                                              : "";
  return fmt::format(
      "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{}{}</td><td class=\"n\">{}{}</td><td "
      "class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
      first ? "<b>" + Escaped(part.nominal) + "</b>" : "",
      first ? fmt::format("{} {} <span class=\"sig\">by {}</span>", Escaped(part.part), Escaped(part.kind),
                          Escaped(part.matched_by))
            : "",
      Escaped(d.name), Number(d.built, 2), unit, Number(d.designed, 2), unit,
      d.observable ? fmt::format("{:+.2f}{}", d.difference(), unit) : "&ndash;",
      d.observable ? Number(d.sigma, 2) : "&ndash;",
      d.observable ? Number(std::abs(d.sigmas()), 1) : "&ndash;", verdict);
}

std::string ListOfIds(const char* what, const std::vector<std::string>& ids) {
  if (ids.empty()) return {};
  std::string out = fmt::format("<p>{}: ", what);
  for (std::size_t i = 0; i < ids.size(); ++i) out += (i ? ", " : "") + Escaped(ids[i]);
  return out + "</p>";
}

std::string NameOf(int image, const std::vector<std::string>& names) {
  return image >= 0 && image < static_cast<int>(names.size()) ? names[static_cast<std::size_t>(image)] : "";
}

// One contour of a part over all its pictures: [begin, end) of the part's residuals.
std::string ContourRow(const Part& part, std::size_t begin, std::size_t end,
                       const std::vector<std::string>& names) {
  const ContourResidual& first = part.contour_residuals[begin];
  double sum = 0, squares = 0, used = 0;
  const ContourResidual* worst = nullptr;
  for (std::size_t i = begin; i < end; ++i) {
    const auto& r = part.contour_residuals[i];
    if (!worst || std::abs(r.mean_px) > std::abs(worst->mean_px)) worst = &r;
    if (!r.used) continue;
    sum += r.mean_px, squares += r.mean_px * r.mean_px, ++used;
  }
  std::string bow;
  for (const auto& s : part.straightness)
    if (first.contour == "edge" && s.edge == first.index)
      bow = fmt::format("{:.2f} <span class=\"sig\">&plusmn;{:.2f}</span>", s.bow_mm, s.sigma_mm);
  return fmt::format(
      "<tr><td>{} {}{}</td><td>{}</td><td class=\"n\">{:.0f} of {}</td><td class=\"n\">{}</td><td "
      "class=\"n\">{}</td><td class=\"n\">{:+.3f} <span class=\"sig\">{}</span></td><td "
      "class=\"n\">{}</td></tr>",
      first.contour, first.index,
      first.side == 0  ? ""
      : first.side < 0 ? " left"
                       : " right",
      first.lies, used, end - begin, used > 0 ? fmt::format("{:+.3f}", sum / used) : "&ndash;",
      used > 0 ? fmt::format("{:.3f}", std::sqrt(squares / used)) : "&ndash;", worst->mean_px,
      Escaped(NameOf(worst->image, names)), bow);
}

std::string CameraRow(const CameraCheck& c, const std::vector<std::string>& names) {
  const auto three = [](const Eigen::Vector3d& v, int digits) {
    return fmt::format("{:+.{}f}, {:+.{}f}, {:+.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
  };
  return fmt::format(
      "<tr><td>{}{}</td><td class=\"n\">{} <span class=\"sig\">&plusmn;{:.3f}</span></td><td "
      "class=\"n\">{} <span class=\"sig\">&plusmn;{:.2f}</span></td><td "
      "class=\"n\">{:.1f}</td><td>{}</td></tr>",
      Escaped(c.camera), c.image < 0 ? "" : " " + Escaped(NameOf(c.image, names)), three(c.rotation_mrad, 3),
      c.rotation_sigma_mrad.norm(), three(c.shift_mm, 2), c.shift_sigma_mm.norm(), c.significance,
      c.moved ? "<span class=\"tag doubt\">moved</span>" : "");
}

std::string PictureCheckRow(const PictureCheck& p, const std::vector<std::string>& names) {
  return fmt::format(
      "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.3f}</td><td>{} {}</td><td "
      "class=\"n\">{:+.3f}</td><td class=\"n\">{:.1f}</td><td>{}</td></tr>",
      Escaped(NameOf(p.image, names)), p.num_edges, p.rms_px, Escaped(p.part), Escaped(p.unknown),
      p.change_mm, std::abs(p.change_mm) / p.sigma_mm,
      p.outlying ? "<span class=\"tag doubt\">contradicts the others</span>" : "");
}

std::string ScaleSentence(const ScaleCheck& scale) {
  if (scale.from == "known length")
    return fmt::format(
        "The scale comes from the known lengths: {:+.0f} ppm (&plusmn;{:.0f}) on the cameras' "
        "places.",
        scale.correction_ppm, scale.sigma_ppm);
  return fmt::format(
      "The scale comes from the {}{}.", Escaped(scale.from),
      std::isfinite(scale.sigma_ppm) ? fmt::format(" (&plusmn;{:.0f} ppm)", scale.sigma_ppm) : "");
}

std::string GroundSentence(const GroundCheck& ground) {
  return fmt::format(
      " The ground is not z = 0: at ({:.0f}, {:.0f}) it lies {:.2f} mm (&plusmn;{:.2f}) high, and rises by "
      "{:.2f} mm (&plusmn;{:.2f}) per metre along x and {:.2f} mm (&plusmn;{:.2f}) along y.",
      ground.at.x(), ground.at.y(), ground.height_mm, ground.sigma_mm, ground.slope_mm_per_m.x(),
      ground.slope_sigma_mm_per_m.x(), ground.slope_mm_per_m.y(), ground.slope_sigma_mm_per_m.y());
}

}  // namespace

std::string ContoursSection(const Product& product, const std::vector<std::string>& names) {
  std::string out;
  for (const auto& part : product.parts) {
    const auto& all = part.contour_residuals;
    std::string rows;
    for (std::size_t begin = 0, end = 0; begin < all.size(); begin = end) {
      while (end < all.size() && all[end].contour == all[begin].contour &&
             all[end].index == all[begin].index && all[end].side == all[begin].side)
        ++end;
      rows += ContourRow(part, begin, end, names);
    }
    if (rows.empty()) continue;
    out += fmt::format(
        "<details><summary>{} ({})</summary><table><thead><tr><th>contour</th><th>lies</th><th "
        "class=\"n\">pictures in use</th><th class=\"n\">mean, px</th><th class=\"n\">RMS, px</th><th "
        "class=\"n\">worst picture, px</th><th class=\"n\">bow, mm</th></tr></thead><tbody>{}</tbody></table>"
        "</details>",
        Escaped(part.id), Escaped(part.kind), rows);
  }
  if (out.empty()) return {};
  return "<h2>Contours</h2><div class=\"card\"><p style=\"margin-top:0\">Measured less predicted, across "
         "each "
         "edge, rim and limb; bow: how far an edge's middle lies off straight. Every picture of every "
         "contour "
         "stands in product.json.</p>" +
         out + "</div>";
}

std::string ChecksSection(const Product& product, const std::vector<std::string>& names) {
  if (!product.checks) return {};
  const SurveyChecks& checks = *product.checks;
  std::string pictures, cameras;
  for (const auto& p : checks.pictures) pictures += PictureCheckRow(p, names);
  for (const auto& c : checks.cameras) cameras += CameraRow(c, names);
  std::string out =
      "<h2>Checks</h2><div class=\"card\"><p style=\"margin-top:0\">" + ScaleSentence(checks.scale);
  if (product.temperature)
    out +=
        fmt::format(" Lengths are given as at 20 &deg;C: what was measured at {:.1f} &deg;C, times {:.6f}.",
                    product.temperature->workpiece_c, product.temperature->factor);
  if (checks.ground) out += GroundSentence(*checks.ground);
  out += "</p>";
  if (!cameras.empty())
    out +=
        "<table><thead><tr><th>camera</th><th class=\"n\">turned by, mrad</th><th class=\"n\">moved by, "
        "mm</th><th class=\"n\">chi-square</th><th></th></tr></thead><tbody>" +
        cameras + "</tbody></table>";
  if (!pictures.empty())
    out +=
        "<p>Leaving out one picture at a time: what would change most, and in how many of the standard "
        "deviations that such a change has.</p><table><thead><tr><th>picture</th><th "
        "class=\"n\">edges</th><th class=\"n\">RMS, px</th><th>what</th><th class=\"n\">change, "
        "mm</th><th class=\"n\">in &sigma;</th><th></th></tr></thead><tbody>" +
        pictures + "</tbody></table>";
  return out + "</div>";
}

std::string DeviationSection(const Product& product) {
  if (!product.nominal) return {};
  const NominalComparison& nominal = *product.nominal;
  std::string rows;
  for (const auto& part : nominal.parts)
    for (std::size_t i = 0; i < part.deviations.size(); ++i)
      rows += DeviationRow(part, part.deviations[i], i == 0);
  return fmt::format(
             "<h2>As built against as designed</h2><div class=\"card\"><p style=\"margin-top:0\">Design: {}. "
             "mm, as built minus as designed; sigma: of what was "
             "built.</p><table><thead><tr><th>designed</th>"
             "<th>built</th><th></th><th class=\"n\">as built</th><th class=\"n\">designed</th><th "
             "class=\"n\">difference</th><th class=\"n\">&sigma;</th><th class=\"n\">in "
             "&sigma;</th><th></th></tr></thead><tbody>",
             Escaped(nominal.file)) +
         rows + "</tbody></table>" + ListOfIds("Designed, not found", nominal.missing) +
         ListOfIds("Found, not designed", nominal.extra) + "</div>";
}

}  // namespace vss
