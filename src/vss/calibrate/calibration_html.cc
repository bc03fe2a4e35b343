// The report as one page that needs no other file: sentences, tables and drawn maps.
#include <algorithm>
#include <cmath>

#include "vss/calibrate/calibrate.h"

namespace vss {
namespace {

constexpr double kSide = 300;  // of a drawn picture, in units of the page

const char* kStyle = R"(
body{font:15px/1.5 system-ui,sans-serif;color:#1d2733;max-width:1080px;margin:2em auto;padding:0 1.2em;background:#fff}
h1{font-size:1.5em;margin:0 0 .2em}h2{font-size:1.2em;margin:2.2em 0 .4em;border-bottom:2px solid #1d2733;padding-bottom:.2em}h3{font-size:1em;margin:1.4em 0 .4em}
p{margin:.3em 0}.warn{background:#fff4d6;border-left:4px solid #d98c00;padding:.35em .8em;margin:.35em 0}.next{background:#e8f3ec;border-left:4px solid #2f7d4f;padding:.35em .8em;margin:.6em 0}
table{border-collapse:collapse;font-size:13px;margin:.4em 0}th,td{padding:.2em .7em;text-align:right;border-bottom:1px solid #dde3ea}th{font-weight:600;background:#f3f6f9}td.t,th.t{text-align:left}
tr.bad td{color:#a03000}.maps{display:flex;flex-wrap:wrap;gap:1.2em}.map{width:330px}.map p{font-size:12.5px;color:#44505e;line-height:1.35}svg{display:block}
.good{color:#2f7d4f;font-weight:600})";

std::string Escaped(const std::string& text) {
  std::string out;
  for (char c : text) {
    if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '&')
      out += "&amp;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

// From pale to dark: readable in grey too.
std::string Colour(double share) {
  if (!std::isfinite(share)) return "#888888";
  const double s = std::clamp(share, 0.0, 1.0);
  const auto mix = [&](double a, double b, double c) {
    return static_cast<int>(s < 0.5 ? a + (b - a) * 2 * s : b + (c - b) * (2 * s - 1));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", mix(241, 90, 38), mix(246, 163, 40), mix(249, 186, 86));
}

struct Frame {
  double width = kSide, height = kSide, scale = 1;
};

Frame FrameOf(const Camera& camera) {
  const double scale = kSide / std::max(camera.width_px, camera.height_px);
  return {camera.width_px * scale, camera.height_px * scale, scale};
}

std::string HeatMap(const Camera& camera, const PictureMap& map, double top, const std::string& unit,
                    bool counts = false) {
  const Frame f = FrameOf(camera);
  std::string svg = fmt::format("<svg width=\"{:.0f}\" height=\"{:.0f}\">", f.width, f.height + 24);
  const double w = f.width / map.columns, h = f.height / map.rows;
  for (int j = 0; j < map.rows; ++j)
    for (int i = 0; i < map.columns; ++i) {
      const double value = map.value[j * map.columns + i];
      svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>",
                         i * w, j * h, w + 0.4, h + 0.4,
                         counts && value == 0 ? "#f3c1ae" : Colour(top > 0 ? value / top : 0));
      if (counts)
        svg += fmt::format(
            "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"10\" text-anchor=\"middle\" "
            "fill=\"{}\">{:.0f}</text>",
            (i + 0.5) * w, (j + 0.5) * h + 3.5, value > 0.5 * top ? "#fff" : "#1d2733", value);
    }
  svg += fmt::format("<rect width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"#1d2733\"/>", f.width,
                     f.height);
  for (int i = 0; i < 60; ++i)
    svg += fmt::format("<rect x=\"{}\" y=\"{:.1f}\" width=\"2.2\" height=\"8\" fill=\"{}\"/>", 60 + 2 * i,
                       f.height + 8, Colour(i / 59.0));
  svg += fmt::format(
      "<text x=\"55\" y=\"{0:.1f}\" font-size=\"11\" text-anchor=\"end\">0</text><text x=\"186\" "
      "y=\"{0:.1f}\" font-size=\"11\">{1} {2}</text></svg>",
      f.height + 16, counts ? fmt::format("{:.0f}", top) : fmt::format("{:.3g}", top), unit);
  return svg;
}

// Every mark with its residual as a line, drawn longer by a round factor.
std::string ResidualMap(const Camera& camera, const IntrinsicResult& r, double& factor) {
  const Frame f = FrameOf(camera);
  const double wanted = 8 / std::max(1e-6, f.scale * r.solution.rms_px);
  factor = std::pow(10, std::floor(std::log10(wanted)));
  factor *= wanted / factor >= 5 ? 5 : wanted / factor >= 2 ? 2 : 1;
  std::string svg = fmt::format(
      "<svg width=\"{:.0f}\" height=\"{:.0f}\"><rect width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#f7f9fb\" "
      "stroke=\"#1d2733\"/>",
      f.width, f.height, f.width, f.height);
  for (std::size_t v = 0; v < r.views.size(); ++v) {
    std::string path;
    for (std::size_t i = 0; i < r.views[v].img.size(); ++i) {
      const Eigen::Vector2d p = f.scale * r.views[v].img[i],
                            d = f.scale * factor * r.solution.residual_px[v][i];
      path += fmt::format("M{:.1f} {:.1f}l{:.1f} {:.1f}", p.x(), p.y(), d.x(), d.y());
    }
    svg += fmt::format("<path d=\"{}\" stroke=\"hsl({:.0f} 65% 38%)\" fill=\"none\" stroke-width=\"0.9\"/>",
                       path, 360.0 * v / r.views.size());
  }
  return svg + "</svg>";
}

std::string MapBlock(const std::string& title, const std::string& drawing, const std::string& words) {
  return fmt::format("<div class=\"map\"><h3>{}</h3>{}<p>{}</p></div>\n", title, drawing, words);
}

std::string LensTable(const CameraCalibration& c) {
  const Intrinsics& k = c.camera.intrinsics;
  std::vector<std::string> names{"fx", "fy", "cx", "cy"};
  const std::vector<std::string> weng{"k1", "g1", "g2", "g3", "g4", "k2"},
      opencv{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"};
  for (int i = 0; i < k.num_distortion; ++i)
    names.push_back((k.model == LensModel::kWeng ? weng : opencv)[i]);
  const std::vector<double> first{k.fx_px, k.fy_px, k.cx_px, k.cy_px};
  std::string head, values, sigmas;
  const bool known = c.camera.quality && c.camera.quality->covariance.rows() >= 4 + k.num_distortion;
  for (std::size_t i = 0; i < names.size(); ++i) {
    head += "<th>" + names[i] + "</th>";
    values += i < 4 ? fmt::format("<td>{:.3f}</td>", first[i])
                    : fmt::format("<td>{:.3g}</td>", k.distortion[i - 4]);
    sigmas +=
        known ? fmt::format("<td>{:.2g}</td>", std::sqrt(std::max(0.0, c.camera.quality->covariance(i, i))))
              : "<td></td>";
  }
  return fmt::format(
      "<table><tr><th class=\"t\">{} model</th>{}</tr><tr><td class=\"t\">value</td>{}</tr><tr><td "
      "class=\"t\">sigma</td>{}</tr></table>\n",
      k.model == LensModel::kWeng ? "Weng" : "OpenCV", head, values, sigmas);
}

std::string ViewTable(const IntrinsicResult& r) {
  std::string html =
      "<h3>Views</h3><table><tr><th class=\"t\">picture</th><th>marks</th><th>dropped</th><th>RMS "
      "px</th><th>tilt deg</th><th>blur px</th><th>distance mm</th><th class=\"t\"></th></tr>\n";
  for (const auto& q : r.quality)
    html += q.used ? fmt::format(
                         "<tr><td "
                         "class=\"t\">{}</td><td>{}</td><td>{}</td><td>{:.4f}</td><td>{:.1f}</td><td>{:.2f}</"
                         "td><td>{:.0f}</td><td></td></tr>\n",
                         Escaped(q.file), q.num_marks, q.num_dropped, q.rms_px, q.tilt_deg, q.blur_px,
                         q.distance_mm)
                   : fmt::format(
                         "<tr class=\"bad\"><td "
                         "class=\"t\">{}</td><td>{}</td><td></td><td></td><td></td><td></td><td></td><td "
                         "class=\"t\">not used: {}</td></tr>\n",
                         Escaped(q.file), q.num_marks, Escaped(q.why_not));
  html += "</table>\n";
  if (!r.dropped.empty()) {
    html +=
        "<h3>Dropped marks</h3><table><tr><th class=\"t\">picture</th><th>column</th><th>row</th><th>off by "
        "px</th></tr>\n";
    for (const auto& d : r.dropped)
      html += fmt::format("<tr><td class=\"t\">{}</td><td>{}</td><td>{}</td><td>{:.2f}</td></tr>\n",
                          Escaped(d.file), d.column, d.row, d.distance_px);
    html += "</table>\n";
  }
  return html;
}

std::string LensSection(const CameraCalibration& c) {
  const IntrinsicResult& r = *c.lens;
  std::string html;
  for (const auto& s : r.findings) html += "<p>" + Escaped(s) + "</p>\n";
  if (!r.next_view.empty()) html += "<p class=\"next\">" + Escaped(r.next_view) + "</p>\n";
  html += LensTable(c) + "<div class=\"maps\">";
  double factor = 1;
  const std::string residuals = ResidualMap(c.camera, r, factor);
  html +=
      MapBlock("Residuals", residuals,
               fmt::format("Every mark's residual, {:.0f} times as long, a colour a view. Lines that point "
                           "the same way in one place would show a lens or a board that the model misses.",
                           factor));
  html += MapBlock(
      "Predicted uncertainty", HeatMap(c.camera, r.uncertainty_px, r.uncertainty_px.max, "px"),
      fmt::format(
          "Standard deviation of a pixel's ray, {:.4f} px RMS. Where the map is dark no mark holds the lens.",
          r.uncertainty_px.rms));
  if (!r.halves_difference_px.value.empty())
    html += MapBlock("Odd views against even views",
                     HeatMap(c.camera, r.halves_difference_px, r.halves_difference_px.max, "px"),
                     fmt::format("Two lenses from two halves of the views differ by {:.4f} px RMS: what the "
                                 "residual does not see.",
                                 r.halves_difference_px.rms));
  html +=
      MapBlock("Coverage", HeatMap(c.camera, r.coverage, r.coverage.max, "marks", true),
               fmt::format("Marks in each part of the picture; {:.0f} % have some.", 100 * r.covered_share));
  return html + "</div>\n" + ViewTable(r);
}

std::string PlaceSection(const CubeResult& r) {
  std::string html = "<h3>Place, from the cube</h3>\n";
  for (const auto& s : r.findings) html += "<p>" + Escaped(s) + "</p>\n";
  html +=
      "<table><tr><th class=\"t\">picture</th><th class=\"t\">edge</th><th>points</th><th>used</th><th>mean "
      "px</th><th>RMS px</th></tr>\n";
  for (const auto& e : r.edges)
    html += fmt::format(
        "<tr><td class=\"t\">{}</td><td "
        "class=\"t\">{}</td><td>{}</td><td>{}</td><td>{:.3f}</td><td>{:.3f}</td></tr>\n",
        Escaped(e.file), NameOf(e.edge_class), e.num_points, e.num_used, e.mean_px, e.rms_px);
  html += "</table>\n";
  if (!r.moves.empty()) {
    html +=
        "<h3>Known moves</h3><table><tr><th class=\"t\">picture</th><th>gantry says (mm)</th><th>cube shows "
        "(mm)</th><th>sigma (mm)</th></tr>\n";
    for (const auto& m : r.moves)
      html += fmt::format(
          "<tr><td class=\"t\">{}</td><td>{:.1f}, {:.1f}, {:.1f}</td><td>{:.2f}, {:.2f}, "
          "{:.2f}</td><td>{:.2f}, {:.2f}, {:.2f}</td></tr>\n",
          Escaped(m.file), m.said_mm.x(), m.said_mm.y(), m.said_mm.z(), m.seen_mm.x(), m.seen_mm.y(),
          m.seen_mm.z(), m.sigma_mm.x(), m.sigma_mm.y(), m.sigma_mm.z());
    html += "</table>\n";
  }
  return html;
}

}  // namespace

std::string CalibrationToHtml(const Calibration& calibration) {
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Calibration "
      "{0}</title><style>{1}</style>\n<h1>Calibration {0}</h1>\n",
      Escaped(calibration.name), kStyle);
  html += calibration.warnings.empty() ? "<p class=\"good\">Nothing to warn of.</p>\n"
                                       : fmt::format("<p>{} warning{}:</p>\n", calibration.warnings.size(),
                                                     calibration.warnings.size() == 1 ? "" : "s");
  for (const auto& w : calibration.warnings) html += "<p class=\"warn\">" + Escaped(w) + "</p>\n";
  if (calibration.axes) {
    html += "<h2>Gantry axes</h2>\n";
    for (const auto& sentence : calibration.axes->findings) html += "<p>" + Escaped(sentence) + "</p>\n";
    html += "<table>";
    for (int i = 0; i < 3; ++i)
      html += fmt::format(
          "<tr><td>{:.6f} &plusmn; {:.6f}</td><td>{:.6f} &plusmn; {:.6f}</td><td>{:.6f} &plusmn; "
          "{:.6f}</td></tr>",
          calibration.axes->axes(i, 0), calibration.axes->sigma(i, 0), calibration.axes->axes(i, 1),
          calibration.axes->sigma(i, 1), calibration.axes->axes(i, 2), calibration.axes->sigma(i, 2));
    html += "</table>\n";
  }
  for (const auto& c : calibration.cameras) {
    html += fmt::format("<h2>{}</h2>\n", Escaped(c.camera.id));
    if (c.camera.quality)
      for (const auto& [name, text] : c.camera.quality->about)
        html += fmt::format("<p>{}: {}</p>\n", name, Escaped(text));
    if (c.lens) html += LensSection(c);
    if (c.place) html += PlaceSection(*c.place);
  }
  return html + "</html>\n";
}

}  // namespace vss
