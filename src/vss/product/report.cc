#include "vss/product/report.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "vss/base/output_folder.h"
#include "vss/base/parallel.h"
#include "vss/product/overlay.h"
#include "vss/product/report_checks.h"
#include "vss/product/report_style.h"
#include "vss/product/scene_view.h"

namespace vss {
namespace {

constexpr int kReportPicture_px =
    1024;  // pictures in the report: enough to judge a line, small enough to load at once
constexpr int kOverlayPicture_px = 4096;  // in a file of its own: as taken, but for the very large

std::string Chip(int part) {
  return fmt::format("<span class=\"chip\" style=\"background:{}\"></span>", PartColor(part));
}

std::string Tile(const std::string& value, const std::string& what) {
  return fmt::format("<div class=\"tile\"><b>{}</b><span>{}</span></div>", value, what);
}

double TotalSeconds(const ReportInput& in) {
  double sum = 0;
  for (const auto& [step, seconds] : in.step_seconds) sum += seconds;
  return sum;
}

std::size_t NumLines(const ReportInput& in) {
  std::size_t n = 0;
  for (const auto& image : in.lines) n += image.segments.size() + image.arcs.size();
  return n;
}

std::string Tiles(const ReportInput& in) {
  const auto& parts = in.product->parts;
  double sum = 0;
  for (const auto& p : parts) sum += p.residual_px * p.residual_px;
  const auto doubtful = std::count_if(parts.begin(), parts.end(), [](const auto& p) { return p.doubtful; });
  return "<div class=\"tiles\">" + Tile(fmt::format("{}", parts.size()), "parts") +
         Tile(fmt::format("{}", doubtful), "doubtful") +
         Tile(fmt::format("{}", in.product->seams.size()), "seams") +
         Tile(fmt::format("{}", in.image_files.size()), fmt::format("{}, {} {}", in.image_files.size() == 1 ? "picture" : "pictures", in.num_cameras,
                          in.num_cameras == 1 ? "camera" : "cameras")) +
         Tile(fmt::format("{}", NumLines(in)), "lines and arcs") +
         Tile(parts.empty() ? "&ndash;"
                            : fmt::format("{:.3f} px", std::sqrt(sum / static_cast<double>(parts.size()))),
              "residual, RMS") +
         Tile(fmt::format("{:.1f} s", TotalSeconds(in)), "computing time") + "</div>";
}

std::string Warnings(const Product& product) {
  std::string items;
  for (const auto& warning : product.warnings) items += "<li>" + Escaped(warning) + "</li>";
  return items.empty() ? "" : "<div class=\"warn\" role=\"note\"><b>To note</b><ul>" + items + "</ul></div>";
}

std::string DimensionHtml(const DimensionValue& d) {
  if (!d.observable)
    return fmt::format("<span class=\"no\" title=\"{}\"><i>{}</i> {:.1f} not observed</span>",
                       Escaped(d.origin.empty() ? "The pictures do not determine it." : d.origin),
                       Escaped(d.name), d.value_mm);
  const std::string nominal = d.nominal_mm ? fmt::format(" title=\"nominal {:g}, deviation {:+.2f}\"",
                                                         *d.nominal_mm, d.value_mm - *d.nominal_mm)
                                           : "";
  const std::string sigma =
      std::isfinite(d.sigma_mm) ? fmt::format(" <span class=\"sig\">&plusmn;{:.2f}</span>", d.sigma_mm) : "";
  return fmt::format("<span{}><i>{}</i> {:.2f}{}</span>", nominal, Escaped(d.name), d.value_mm, sigma);
}

// The largest standard deviation of a part's vertices, in any direction.
std::string VertexSigma(const Part& part) {
  double worst = 0;
  for (const auto& s : part.vertex_sigma) worst = std::max(worst, s.norm());
  return part.vertex_sigma.empty() || !std::isfinite(worst) ? "&ndash;" : fmt::format("{:.2f}", worst);
}

std::string FeaturesHtml(const Part& part) {
  std::string list;
  for (const auto& f : part.features) list += (list.empty() ? "" : ", ") + Escaped(f);
  return list.empty() ? "" : "<br><span class=\"sig\">with " + list + "</span>";
}

// The standard size, or those between which the measurement does not decide.
std::string SizeHtml(const Part& part) {
  if (!part.designation.empty())
    return fmt::format("<br><span title=\"{}\">{}</span>", Escaped(part.standard), Escaped(part.designation));
  std::string list;
  for (const auto& c : part.designation_candidates) list += (list.empty() ? "" : " or ") + Escaped(c);
  return list.empty() ? "" : "<br><span class=\"sig\">" + list + "?</span>";
}

std::string PartRow(const Part& part, int index) {
  std::string dimensions;
  for (const auto& d : part.dimensions) dimensions += DimensionHtml(d);
  const std::string tag = part.doubtful
                              ? "<span class=\"tag doubt\">doubtful</span>"
                              : fmt::format("<span class=\"tag ok\">{}</span>",
                                            part.source == "automatic" ? "found" : Escaped(part.source));
  const std::string runner_up = part.runner_up
                                    ? fmt::format("<br><span class=\"sig\">next: {} {:.1f}</span>",
                                                  Escaped(part.runner_up->kind), part.runner_up->log_odds)
                                    : "";
  const Eigen::Vector3d p = part.world_from_part.translation.unaryExpr(
      [](double mm) { return std::round(10 * mm) / 10 + 0.0; });  // what is shown, without a -0.0
  return fmt::format(
      "<tr><td>{}<b>{}</b></td><td>{}{}</td><td class=\"n\">{:.1f}, {:.1f}, {:.1f}<br><span "
      "class=\"sig\">yaw {:.2f}&deg;</span></td><td><div class=\"dims\">{}</div></td>"
      "<td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{:.3f}</td><td "
      "class=\"n\">{:.1f}{}</td><td>{}</td></tr>",
      Chip(index), Escaped(part.id), Escaped(part.kind),
      (part.resting_pose.empty() ? "" : "<br><span class=\"sig\">" + Escaped(part.resting_pose) + "</span>") +
          FeaturesHtml(part) + SizeHtml(part),
      p.x(), p.y(), p.z(), DegFromRad(part.yaw_rad), dimensions, Escaped(part.stands_on), VertexSigma(part),
      part.images.size(), part.residual_px, part.log_odds, runner_up, tag);
}

std::string PartsSection(const Product& product) {
  if (product.parts.empty()) return "<h2>Parts</h2><div class=\"card\">No parts were found.</div>";
  std::string rows;
  for (std::size_t i = 0; i < product.parts.size(); ++i)
    rows += PartRow(product.parts[i], static_cast<int>(i));
  return "<h2>Parts</h2><div class=\"card\"><table><thead><tr><th>part</th><th>kind</th><th "
         "class=\"n\">position, mm</th><th>dimensions, mm &plusmn; one standard deviation</th><th>stands "
         "on</th>"
         "<th class=\"n\">worst vertex &sigma;, mm</th><th class=\"n\">pictures</th><th "
         "class=\"n\">residual, px</th><th class=\"n\">log-odds</th><th></th></tr></thead><tbody>" +
         rows + "</tbody></table></div>";
}

std::string WorkpieceSection(const ReportInput& in, const std::vector<std::optional<WorldSolid>>& solids) {
  const std::string plan = PlanSvg(*in.product, solids, in.views), angled = AngledSvg(*in.product, solids);
  if (plan.empty()) return {};
  std::string out = "<h2>Workpiece</h2>";
  if (!angled.empty())
    out += "<figure class=\"card\">" + angled +
           "<figcaption>The parts as measured.</figcaption></figure><div style=\"height:14px\"></div>";
  return out + "<figure class=\"card\">" + plan +
         "<figcaption>Plan, to scale; grid in metres, x to the right, y up. Dashed: under another face. Red: "
         "seams. Crosses: where cameras stood.</figcaption></figure>";
}

std::string SeamsSection(const Product& product) {
  if (product.seams.empty()) return {};
  std::string rows;
  for (const auto& s : product.seams)
    rows += fmt::format(
        "<tr><td>{} &ndash; {}</td><td class=\"n\">{:.1f}, {:.1f}, {:.1f}</td><td class=\"n\">{:.1f}, "
        "{:.1f}, {:.1f}</td><td class=\"n\">{:.1f}</td></tr>",
        Escaped(s.part_a), Escaped(s.part_b), s.start.x(), s.start.y(), s.start.z(), s.end.x(), s.end.y(),
        s.end.z(), (s.end - s.start).norm());
  return "<h2>Seams</h2><div class=\"card\"><table><thead><tr><th>between</th><th class=\"n\">start, "
         "mm</th><th class=\"n\">end, mm</th><th class=\"n\">length, mm</th></tr></thead><tbody>" +
         rows + "</tbody></table></div>";
}

std::string UnknownSection(const Product& product) {
  if (product.unknown.empty()) return {};
  std::string rows;
  for (const auto& u : product.unknown)
    rows += fmt::format(
        "<tr><td class=\"n\">{:.0f}, {:.0f}, {:.0f}</td><td class=\"n\">{:.0f} x {:.0f} x {:.0f}</td><td "
        "class=\"n\">{}</td></tr>",
        u.center.x(), u.center.y(), u.center.z(), u.extent.x(), u.extent.y(), u.extent.z(), u.num_lines);
  return "<h2>Unknown</h2><div class=\"card\"><p style=\"margin-top:0\">Lines that look like an object which "
         "no knowledge base describes.</p><table><thead><tr><th class=\"n\">centre, mm</th><th "
         "class=\"n\">extent, mm</th><th "
         "class=\"n\">lines</th></tr></thead><tbody>" +
         rows + "</tbody></table></div>";
}

std::string HeatColor(double residual_px) {
  constexpr double kGood_px = 0.05,
                   kBad_px = 0.5;  // green: the pixel noise of a fair picture; red: half a pixel
  const double t =
      std::clamp(std::log(std::max(residual_px, 1e-3) / kGood_px) / std::log(kBad_px / kGood_px), 0.0, 1.0);
  return fmt::format("hsl({:.0f} 62% {:.0f}%)", 145 - 140 * t, 88 - 10 * t);
}

// A table, parts by pictures: how far the contours lie from the edges.
std::string ResidualSection(const ReportInput& in) {
  const auto& parts = in.product->parts;
  std::vector<int> images;
  for (const auto& part : parts)
    for (const auto& r : part.picture_residuals) images.push_back(r.image);
  std::sort(images.begin(), images.end());
  images.erase(std::unique(images.begin(), images.end()), images.end());
  if (images.empty()) return {};
  std::string head = "<tr><th></th>", rows;
  for (std::size_t i = 0; i < parts.size(); ++i)
    head += fmt::format("<th>{}{}</th>", Chip(static_cast<int>(i)), Escaped(parts[i].id));
  const std::vector<std::string> names = OutputNames(in.image_files);
  for (int image : images) {
    rows += fmt::format("<tr><th>{}</th>", Escaped(names[static_cast<std::size_t>(image)]));
    for (const auto& part : parts) {
      const auto r = std::find_if(part.picture_residuals.begin(), part.picture_residuals.end(),
                                  [&](const auto& x) { return x.image == image; });
      rows += r == part.picture_residuals.end()
                  ? "<td></td>"
                  : fmt::format("<td style=\"background:{}\" title=\"{} edges\">{:.3f}</td>",
                                HeatColor(r->rms_px), r->num_edges, r->rms_px);
    }
    rows += "</tr>";
  }
  return "<h2>Residuals</h2><div class=\"card\"><p style=\"margin-top:0\">Distance of the measured edges "
         "from the projected contours, px, root mean square by part and picture.</p><table class=\"heat\" "
         "style=\"width:auto\"><thead>" +
         head + "</tr></thead><tbody>" + rows + "</tbody></table></div>";
}

std::string StepsSection(const ReportInput& in) {
  std::string rows;
  double longest = 1e-9;
  for (const auto& [step, seconds] : in.step_seconds) longest = std::max(longest, seconds);
  for (const auto& [step, seconds] : in.step_seconds)
    rows += fmt::format(
        "<tr><td style=\"width:160px\">{}</td><td class=\"n\" style=\"width:90px\">{:.3f} s</td><td><span "
        "class=\"bar\" style=\"width:{:.1f}%\"></span></td></tr>",
        Escaped(step), seconds, 100 * seconds / longest);
  return "<h2>Steps</h2><div class=\"card\"><table><tbody>" + rows + "</tbody></table></div>";
}

std::string ParametersSection(const ReportInput& in) {
  std::string rows;
  for (const auto& p : in.parameters) {
    const bool changed = p.value != p.default_value;
    rows +=
        fmt::format("<tr><td>{}{}{}</td><td class=\"n\">{:g} {}</td><td>{}</td></tr>", changed ? "<b>" : "",
                    Escaped(p.name), changed ? "</b> (set)" : "", p.value, Escaped(p.unit), Escaped(p.help));
  }
  return rows.empty() ? ""
                      : "<h2>Parameters</h2><div class=\"card\"><details><summary>All parameters of this "
                        "run</summary><table><tbody>" +
                            rows + "</tbody></table></details></div>";
}

struct PictureFigure {
  std::string html, overlay;
};

PictureFigure MakeFigure(const ReportInput& in, const std::vector<std::optional<WorldSolid>>& solids,
                         std::size_t i, const GreyImage& picture) {
  const View& view = in.views[i];
  const int image = static_cast<int>(i);
  const std::string elements = LineElements(in.lines[i], &view.camera->intrinsics, *in.product, image) +
                               ContourElements(ProjectParts(*in.product, solids, view));
  std::string chips;
  for (std::size_t p = 0; p < in.product->parts.size(); ++p) {
    const auto& images = in.product->parts[p].images;
    if (std::find(images.begin(), images.end(), image) != images.end())
      chips += " " + Chip(static_cast<int>(p)) + Escaped(in.product->parts[p].id);
  }
  PictureFigure figure;
  figure.overlay = OverlaySvg(picture.view(), elements, kOverlayPicture_px);
  figure.html = fmt::format(
      "<figure>{}<figcaption><b>{}</b><br>camera {}, {} segments, {} arcs{}</figcaption></figure>",
      OverlaySvg(picture.view(), elements, kReportPicture_px), Escaped(in.image_files[i]),
      Escaped(view.camera->id), in.lines[i].segments.size(), in.lines[i].arcs.size(),
      chips.empty() ? "" : "<br>" + chips);
  return figure;
}

std::string PicturesSection(const std::vector<PictureFigure>& figures) {
  std::string out =
      "<h2>Pictures</h2><div class=\"layers\">Show <label><input type=\"checkbox\" value=\"nopicture\" "
      "checked>picture</label><label><input type=\"checkbox\" value=\"noused\" checked>lines that parts "
      "use</label>"
      "<label><input type=\"checkbox\" value=\"nolines\" checked>other lines</label><label><input "
      "type=\"checkbox\" value=\"noparts\" checked>parts</label><label><input type=\"checkbox\" "
      "value=\"nohidden\" "
      "checked>hidden edges</label><span>Click a picture to enlarge it.</span></div><div class=\"pics\">";
  for (const auto& figure : figures) out += figure.html;
  return out + "</div>";
}

std::string Html(const ReportInput& in, const std::vector<std::optional<WorldSolid>>& solids,
                 const std::vector<PictureFigure>& figures) {
  std::string out =
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\">";
  out += fmt::format("<title>Survey {}</title><style>{}</style></head><body>", Escaped(in.product->survey),
                     kReportStyle);
  out += fmt::format(
      "<header><div><h1>Survey {}</h1><p>Product definition data by VSS {}. Lengths in mm, angles in "
      "degrees; &plusmn; is one standard deviation.</p></div></header><main>",
      Escaped(in.product->survey), VSS_VERSION);
  out += Tiles(in) + Warnings(*in.product) + WorkpieceSection(in, solids) + PartsSection(*in.product) +
         DeviationSection(*in.product) + SeamsSection(*in.product) + UnknownSection(*in.product);
  const std::vector<std::string> names = OutputNames(in.image_files);
  out += PicturesSection(figures) + ResidualSection(in) + ContoursSection(*in.product, names) +
         ChecksSection(*in.product, names) + StepsSection(in) + ParametersSection(in);
  return out + fmt::format(
                   "<footer>Made by VSS {}. The same data for machines: "
                   "product.json.</footer></main><script>{}</script></body></html>\n",
                   VSS_VERSION, kReportScript);
}

}  // namespace

Result<ReportFiles> MakeReport(const ReportInput& in, int threads) {
  const auto solids = SolidsOf(*in.product, *in.knowledge);
  std::vector<PictureFigure> figures(in.views.size());
  std::vector<Status> read(in.views.size());
  ParallelFor(in.views.size(), threads, [&](std::size_t i) {
    const auto picture = in.picture(static_cast<int>(i));
    if (picture)
      figures[i] = MakeFigure(in, solids, i, *picture);
    else
      read[i] = tl::unexpected(picture.error());
  });
  for (const auto& status : read)
    if (!status) return tl::unexpected(status.error());
  ReportFiles files;
  files.html = Html(in, solids, figures);
  for (auto& figure : figures) files.overlays.push_back(std::move(figure.overlay));
  return files;
}

}  // namespace vss
