#include "vss/calibrate/target_drawing.h"

#include <algorithm>

#include "vss/image/marker_dictionary.h"

namespace vss {
namespace {

struct Rectangle {
  double x, y, width, height;  // mm, from the top left
};
// Rectangles of one grey, drawn as one figure: no hairline between neighbours.
struct Figure {
  std::vector<Rectangle> rectangles;
  bool dark;
};
struct Disc {
  double x, y, radius;
};
struct Drawing {
  double width_mm = 0, height_mm = 0;
  std::vector<Figure> figures;  // in the order of drawing
  std::vector<Disc> discs;
  std::string caption;
};

void DrawDiscs(const TargetSpec& t, double margin, Drawing& d) {
  for (int r = 0; r < t.rows; ++r)
    for (int c = 0; c < t.columns; ++c) {
      const bool other = std::find(t.distinguished.begin(), t.distinguished.end(),
                                   std::array<int, 2>{c, r}) != t.distinguished.end();
      d.discs.push_back({margin + c * t.pitch_mm, margin + r * t.pitch_mm,
                         0.5 * (other ? t.distinguished_diameter_mm : t.diameter_mm)});
    }
}

Status DrawSquares(const TargetSpec& t, double margin, Drawing& d) {
  std::optional<MarkerDictionary> markers;
  if (t.pattern == TargetPattern::kCharuco) {
    VSS_ASSIGN(markers, PredefinedMarkers(t.dictionary));
    const std::size_t needed = (std::size_t(t.columns + 1) * (t.rows + 1) + 1) / 2;
    if (markers->bits.size() < needed)
      return UsageError(
          "a board of {} x {} corners needs {} markers, but dictionary {} has {}; take a larger one",
          t.columns, t.rows, needed, t.dictionary, markers->bits.size());
  }
  std::size_t id = 0;
  for (int r = 0; r <= t.rows; ++r)
    for (int c = 0; c <= t.columns; ++c) {
      const double x = margin + c * t.pitch_mm, y = margin + r * t.pitch_mm;
      const bool marked = (c + r) % 2 == (t.first_square_white ? 0 : 1);
      if (!marked) {
        d.figures.push_back({{{x, y, t.pitch_mm, t.pitch_mm}}, true});
        continue;
      }
      if (!markers) continue;
      const double gap = 0.5 * (t.pitch_mm - t.marker_mm), bit = t.marker_mm / (markers->side + 2);
      d.figures.push_back({{{x + gap, y + gap, t.marker_mm, t.marker_mm}}, true});
      Figure white{{}, false};
      for (int v = 0; v < markers->side; ++v)
        for (int u = 0; u < markers->side; ++u)
          if (markers->White(id, v, u))
            white.rectangles.push_back({x + gap + (u + 1) * bit, y + gap + (v + 1) * bit, bit, bit});
      d.figures.push_back(white);
      ++id;
    }
  return {};
}

// mm: small beside the marks, and the whole line on the sheet.
double CaptionSize(const TargetSpec& t, const Drawing& d) {
  constexpr double kLetterShare = 0.62;  // width over height of a letter, in the mean of a broad sans serif
  return std::min(
      {5.0, 0.2 * t.pitch_mm, d.width_mm / (kLetterShare * (static_cast<double>(d.caption.size()) + 6))});
}

Result<Drawing> Draw(const TargetSpec& t) {
  if (t.columns < 3 || t.rows < 3)
    return UsageError("a target needs at least 3 columns and 3 rows, not {} x {}", t.columns, t.rows);
  if (!(t.pitch_mm > 0)) return UsageError("the pitch must be above 0 mm");
  Drawing d;
  const double margin = t.pitch_mm;
  if (t.pattern == TargetPattern::kDiscs) {
    if (!(t.diameter_mm > 0 && t.diameter_mm < t.pitch_mm))
      return UsageError("discs {} mm apart need a diameter between 0 and that, not {} mm", t.pitch_mm,
                        t.diameter_mm);
    d.width_mm = (t.columns - 1) * t.pitch_mm + 2 * margin,
    d.height_mm = (t.rows - 1) * t.pitch_mm + 2 * margin;
    DrawDiscs(t, margin, d);
    d.caption = fmt::format("discs, columns = {}, rows = {}, pitch = {} mm, diameter = {} mm", t.columns,
                            t.rows, t.pitch_mm, t.diameter_mm);
  } else {
    d.width_mm = (t.columns + 1) * t.pitch_mm + 2 * margin,
    d.height_mm = (t.rows + 1) * t.pitch_mm + 2 * margin;
    if (t.pattern == TargetPattern::kCharuco && !(t.marker_mm > 0 && t.marker_mm < t.pitch_mm))
      return UsageError("squares of {} mm need a marker between 0 and that, not {} mm", t.pitch_mm,
                        t.marker_mm);
    VSS_RETURN_IF_ERROR(DrawSquares(t, margin, d));
    d.caption = fmt::format("{}, columns = {}, rows = {} (inner corners), pitch = {} mm",
                            t.pattern == TargetPattern::kCharuco ? "charuco" : "checkerboard", t.columns,
                            t.rows, t.pitch_mm);
    if (t.pattern == TargetPattern::kCharuco)
      d.caption += fmt::format(", marker = {} mm, dictionary = {}", t.marker_mm, t.dictionary);
  }
  return d;
}

}  // namespace

Result<std::string> TargetToSvg(const TargetSpec& target) {
  VSS_ASSIGN(const Drawing d, Draw(target));
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" viewBox=\"0 0 {0} "
      "{1}\">\n<title>{2}</title>\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
      d.width_mm, d.height_mm, d.caption);
  for (const auto& figure : d.figures) {
    svg += fmt::format("<path fill=\"{}\" d=\"", figure.dark ? "#000" : "#fff");
    for (const auto& r : figure.rectangles)
      svg += fmt::format("M{:.6g} {:.6g}h{:.6g}v{:.6g}h{:.6g}z", r.x, r.y, r.width, r.height, -r.width);
    svg += "\"/>\n";
  }
  for (const auto& c : d.discs)
    svg += fmt::format("<circle cx=\"{:.6g}\" cy=\"{:.6g}\" r=\"{:.6g}\"/>\n", c.x, c.y, c.radius);
  const double size = CaptionSize(target, d);
  svg += fmt::format(
      "<text x=\"{:.6g}\" y=\"{:.6g}\" font-family=\"sans-serif\" font-size=\"{:.3g}\">VSS "
      "{}</text>\n</svg>\n",
      size, d.height_mm - 0.6 * size, size, d.caption);
  return svg;
}

Result<std::string> TargetToPdf(const TargetSpec& target) {
  VSS_ASSIGN(const Drawing d, Draw(target));
  constexpr double kPoint = 72 / 25.4;      // points a millimetre
  constexpr double kCircle = 0.5522847498;  // of a Bezier quarter of a circle
  const double height = d.height_mm;
  std::string page = fmt::format("{0:.8f} 0 0 {0:.8f} 0 0 cm\n", kPoint);
  for (const auto& figure : d.figures) {
    page += figure.dark ? "0 g" : "1 g";
    for (const auto& r : figure.rectangles)
      page += fmt::format(" {:.6f} {:.6f} {:.6f} {:.6f} re", r.x, height - r.y - r.height, r.width, r.height);
    page += " f\n";
  }
  page += "0 g\n";
  for (const auto& c : d.discs) {
    const double x = c.x, y = height - c.y, r = c.radius, k = kCircle * r;
    page += fmt::format(
        "{:.6f} {:.6f} m {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} c {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} "
        "{:.6f} c {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} c {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} c "
        "f\n",
        x + r, y, x + r, y + k, x + k, y + r, x, y + r, x - k, y + r, x - r, y + k, x - r, y, x - r, y - k,
        x - k, y - r, x, y - r, x + k, y - r, x + r, y - k, x + r, y);
  }
  const double size = CaptionSize(target, d);
  page += fmt::format("BT /F1 {:.3f} Tf {:.3f} {:.3f} Td (VSS {}) Tj ET\n", size, size, 0.6 * size, [&] {
    std::string text;
    for (char c : d.caption) text += c == '(' || c == ')' ? std::string("\\") + c : std::string(1, c);
    return text;
  }());
  std::vector<std::string> objects{"<< /Type /Catalog /Pages 2 0 R >>",
                                   "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
                                   fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.4f} {:.4f}] "
                                               "/Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
                                               d.width_mm * kPoint, d.height_mm * kPoint),
                                   fmt::format("<< /Length {} >>\nstream\n{}endstream", page.size(), page),
                                   "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"};
  std::string pdf = "%PDF-1.4\n";
  std::vector<std::size_t> offset;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    offset.push_back(pdf.size());
    pdf += fmt::format("{} 0 obj\n{}\nendobj\n", i + 1, objects[i]);
  }
  const std::size_t table = pdf.size();
  pdf += fmt::format("xref\n0 {}\n0000000000 65535 f \n", objects.size() + 1);
  for (std::size_t o : offset) pdf += fmt::format("{:010} 00000 n \n", o);
  return pdf + fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", objects.size() + 1,
                           table);
}

}  // namespace vss
