// Targets as drawn: rasterised here from their SVG and PDF, found by the finder of marks, and measured.
#include "vss/calibrate/target_drawing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

namespace vss {
namespace {

using Eigen::Vector2d;
using testing::HasSubstr;

constexpr double kPxPerMm = 1.6;
constexpr int kSubsamples = 6;

// Figures in the order of drawing; mm from the top left of the sheet.
struct Figure {
  double x, y, width, height, radius;  // a disc about (x, y) where the radius is above 0
  bool dark;
};
struct Sheet {
  double width_mm = 0, height_mm = 0;
  std::vector<Figure> figures;
};

double Number(const std::smatch& m, int i) { return std::stod(m[static_cast<std::size_t>(i)].str()); }

Sheet SheetOfSvg(const std::string& svg) {
  Sheet sheet;
  std::smatch m;
  EXPECT_TRUE(std::regex_search(
      svg, m,
      std::regex("width=\"([0-9.]+)mm\" height=\"([0-9.]+)mm\" viewBox=\"0 0 ([0-9.]+) ([0-9.]+)\"")));
  sheet.width_mm = Number(m, 1), sheet.height_mm = Number(m, 2);
  EXPECT_EQ(sheet.width_mm, Number(m, 3));
  EXPECT_EQ(sheet.height_mm, Number(m, 4));
  std::istringstream lines(svg);
  const std::regex path("<path fill=\"(#[0-9a-f]+)\""),
      box("M([0-9.]+) ([0-9.]+)h([0-9.]+)v([0-9.]+)h-[0-9.]+z"),
      circle("<circle cx=\"([0-9.]+)\" cy=\"([0-9.]+)\" r=\"([0-9.]+)\"/>");
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_search(line, m, circle)) {
      sheet.figures.push_back({Number(m, 1), Number(m, 2), 0, 0, Number(m, 3), true});
    } else if (std::regex_search(line, m, path)) {
      const bool dark = m[1] == "#000";
      for (std::sregex_iterator i(line.begin(), line.end(), box), end; i != end; ++i)
        sheet.figures.push_back({Number(*i, 1), Number(*i, 2), Number(*i, 3), Number(*i, 4), 0, dark});
    }
  }
  return sheet;
}

Sheet SheetOfPdf(const std::string& pdf) {
  constexpr double kMmPerPoint = 25.4 / 72;
  Sheet sheet;
  std::smatch m;
  EXPECT_TRUE(std::regex_search(pdf, m, std::regex("MediaBox \\[0 0 ([0-9.]+) ([0-9.]+)\\]")));
  sheet.width_mm = Number(m, 1) * kMmPerPoint, sheet.height_mm = Number(m, 2) * kMmPerPoint;
  EXPECT_TRUE(std::regex_search(pdf, m, std::regex("stream\n([0-9.]+) 0 0 ([0-9.]+) 0 0 cm")));
  EXPECT_NEAR(Number(m, 1) * kMmPerPoint, 1, 1e-7);  // a unit of the page is a millimetre
  const std::regex box(" ([0-9.]+) ([0-9.]+) ([0-9.]+) ([0-9.]+) re"),
      disc("^([0-9.]+) ([0-9.]+) m ([0-9.]+) ([0-9.]+) ([0-9.]+) ([0-9.]+) ([0-9.]+) ([0-9.]+) c");
  std::istringstream lines(pdf);
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_search(line, m, disc)) {
      // From the disc's right to its top: (x + r, y) to (x, y + r).
      const double radius = Number(m, 1) - Number(m, 7);
      EXPECT_NEAR(Number(m, 8) - Number(m, 2), radius, 1e-5);
      sheet.figures.push_back({Number(m, 7), sheet.height_mm - Number(m, 2), 0, 0, radius, true});
    } else if (line.rfind("0 g ", 0) == 0 || line.rfind("1 g ", 0) == 0) {
      for (std::sregex_iterator i(line.begin(), line.end(), box), end; i != end; ++i)
        sheet.figures.push_back({Number(*i, 1), sheet.height_mm - Number(*i, 2) - Number(*i, 4),
                                 Number(*i, 3), Number(*i, 4), 0, line[0] == '0'});
    }
  }
  return sheet;
}

GreyImage Raster(const Sheet& sheet) {
  const int w = static_cast<int>(sheet.width_mm * kPxPerMm), h = static_cast<int>(sheet.height_mm * kPxPerMm);
  const double step = 1 / (kPxPerMm * kSubsamples);
  std::vector<std::uint8_t> fine(std::size_t(w) * h * kSubsamples * kSubsamples, 1);
  const int fine_w = w * kSubsamples, fine_h = h * kSubsamples;
  for (const Figure& f : sheet.figures) {
    const double left = f.radius > 0 ? f.x - f.radius : f.x, top = f.radius > 0 ? f.y - f.radius : f.y,
                 right = f.radius > 0 ? f.x + f.radius : f.x + f.width,
                 bottom = f.radius > 0 ? f.y + f.radius : f.y + f.height;
    for (int v = std::max(0, int(top / step) - 1); v < std::min(fine_h, int(bottom / step) + 2); ++v)
      for (int u = std::max(0, int(left / step) - 1); u < std::min(fine_w, int(right / step) + 2); ++u) {
        const double x = (u + 0.5) * step, y = (v + 0.5) * step;
        const bool in = f.radius > 0 ? std::hypot(x - f.x, y - f.y) < f.radius
                                     : x >= left && x < right && y >= top && y < bottom;
        if (in) fine[std::size_t(v) * fine_w + u] = !f.dark;
      }
  }
  // A camera's blur: a box of three pixels, so that the edges spread as they do in a picture.
  GreyImage image(w, h, 16);
  for (int v = 0; v < h; ++v)
    for (int u = 0; u < w; ++u) {
      int light = 0, all = 0;
      for (int y = (v - 1) * kSubsamples; y < (v + 2) * kSubsamples; ++y)
        for (int x = (u - 1) * kSubsamples; x < (u + 2) * kSubsamples; ++x) {
          if (x < 0 || y < 0 || x >= fine_w || y >= fine_h) continue;
          light += fine[std::size_t(y) * fine_w + x], ++all;
        }
      image.Row16(v)[u] = static_cast<std::uint16_t>(6000 + 50000 * light / all);
    }
  return image;
}

std::vector<TargetSpec> Targets() {
  TargetSpec discs;
  discs.columns = 6, discs.rows = 5, discs.pitch_mm = 30, discs.diameter_mm = 15;
  TargetSpec distinguished = discs;
  distinguished.distinguished = {{{3, 2}, {5, 2}, {3, 1}}};
  distinguished.distinguished_diameter_mm = 21;
  TargetSpec checkerboard = discs;
  checkerboard.pattern = TargetPattern::kCheckerboard;
  TargetSpec charuco = checkerboard;
  charuco.pattern = TargetPattern::kCharuco;
  charuco.marker_mm = 21;
  TargetSpec old = charuco;
  old.first_square_white = true, old.dictionary = "6x6_250";
  return {discs, distinguished, checkerboard, charuco, old};
}

TEST(TargetDrawing, IsFoundByTheFinderOfMarksAndTrueToScale) {
  for (const TargetSpec& t : Targets())
    for (bool pdf : {false, true}) {
      const auto text = pdf ? TargetToPdf(t) : TargetToSvg(t);
      ASSERT_TRUE(text) << text.error().message;
      const Sheet sheet = pdf ? SheetOfPdf(*text) : SheetOfSvg(*text);
      const auto board = FindMarks(Raster(sheet).view(), t);
      ASSERT_TRUE(board) << board.error().message;
      const std::string which = fmt::format("{} {}", static_cast<int>(t.pattern), pdf ? "pdf" : "svg");
      EXPECT_EQ(board->marks.size(), std::size_t(t.columns * t.rows)) << which;
      EXPECT_TRUE(board->anchored && !board->mirrored && !board->codes_disagree) << which;
      if (t.pattern == TargetPattern::kCharuco) {
        EXPECT_TRUE(board->by_codes) << which;
      }
      // Over the board's diagonal: a tenth of a pixel of some 300 is 0.03 %.
      const auto at = [&](int column, int row) {
        for (const Mark& m : board->marks)
          if (m.column == column && m.row == row) return m.img;
        return Vector2d(0, 0);
      };
      const Vector2d diagonal = at(t.columns - 1, t.rows - 1) - at(0, 0),
                     expected = kPxPerMm * t.PointOnBoard(t.columns - 1, t.rows - 1);
      // A plain grid may be taken the other way round.
      EXPECT_LT(std::min((diagonal - expected).norm(), (diagonal + expected).norm()), 0.1) << which;
    }
}

TEST(TargetDrawing, CaptionStaysOnTheSheet) {
  TargetSpec t = Targets()[3];
  t.columns = t.rows = 3;
  const auto svg = TargetToSvg(t);
  ASSERT_TRUE(svg);
  std::smatch m;
  ASSERT_TRUE(std::regex_search(*svg, m, std::regex("font-size=\"([0-9.]+)\">([^<]*)<")));
  EXPECT_LT(Number(m, 1) * 0.6 * static_cast<double>(m[2].length()), SheetOfSvg(*svg).width_mm);
}

TEST(TargetDrawing, WhatCannotBeDrawnIsTold) {
  TargetSpec t = Targets()[0];
  t.diameter_mm = 30;
  EXPECT_THAT(TargetToSvg(t).error().message, HasSubstr("need a diameter"));
  t = Targets()[3];
  t.columns = t.rows = 12;
  EXPECT_THAT(TargetToPdf(t).error().message, HasSubstr("take a larger one"));
  t.marker_mm = 31;
  EXPECT_THAT(TargetToSvg(t).error().message, HasSubstr("need a marker"));
}

}  // namespace
}  // namespace vss
