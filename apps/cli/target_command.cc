// vss target: a calibration target to print.
#include <cstdio>

#include "command.h"
#include "vss/base/files.h"
#include "vss/calibrate/calibration_file.h"
#include "vss/calibrate/target_drawing.h"

namespace vss::cli {
namespace {

struct Arguments {
  std::string pattern = "discs", out;
  TargetSpec target;
  bool distinguished = false;
};

Status RunTarget(Arguments arguments) {
  TargetSpec& t = arguments.target;
  VSS_ASSIGN(t.pattern, PatternNamed(arguments.pattern));
  if (t.pattern == TargetPattern::kDiscs && t.diameter_mm <= 0)
    t.diameter_mm = 0.5 * t.pitch_mm;  // most contour without touching
  if (t.pattern == TargetPattern::kCharuco && t.marker_mm <= 0)
    t.marker_mm = 0.7 * t.pitch_mm;  // leaves the corners a clear window
  if (arguments.distinguished) {
    if (t.pattern != TargetPattern::kDiscs)
      return UsageError("--distinguished: only a grid of discs has distinguished discs");
    const int c = t.columns / 2, r = t.rows / 2;
    t.distinguished = {{{c, r}, {std::min(c + 2, t.columns - 1), r}, {c, r - 1}}};
    t.distinguished_diameter_mm = std::min(1.4 * t.diameter_mm, 0.85 * t.pitch_mm);
  }
  const bool pdf = arguments.out.ends_with(".pdf");
  if (!pdf && !arguments.out.ends_with(".svg"))
    return UsageError("{}: name the target FILE.svg or FILE.pdf", arguments.out);
  VSS_ASSIGN(const std::string text, pdf ? TargetToPdf(t) : TargetToSvg(t));
  VSS_RETURN_IF_ERROR(WriteFileAtomically(arguments.out, text));
  std::string line = fmt::format("target = {{ pattern = \"{}\", columns = {}, rows = {}, pitch = {}",
                                 arguments.pattern, t.columns, t.rows, t.pitch_mm);
  if (t.pattern == TargetPattern::kDiscs) line += fmt::format(", diameter = {}", t.diameter_mm);
  if (t.pattern == TargetPattern::kCharuco)
    line += fmt::format(", marker = {}, dictionary = \"{}\"", t.marker_mm, t.dictionary);
  if (!t.distinguished.empty()) {
    line += ", distinguished = [";
    for (std::size_t i = 0; i < t.distinguished.size(); ++i)
      line += fmt::format("{}[{}, {}]", i ? ", " : "", t.distinguished[i][0], t.distinguished[i][1]);
    line += fmt::format("], distinguished_diameter = {}", t.distinguished_diameter_mm);
  }
  std::printf(
      "Written: %s\nPrint it at 100 %%, measure the pitch on the print, and put this into "
      "calibration.toml:\n%s }\n",
      arguments.out.c_str(), line.c_str());
  return {};
}

void AddTarget(CLI::App& app, Common&) {
  auto* command = app.add_subcommand("target", "Draws a calibration target, true to scale");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("--pattern", arguments->pattern, "discs, checkerboard or charuco")
      ->check(CLI::IsMember({"discs", "checkerboard", "charuco"}))
      ->capture_default_str();
  command->add_option("--columns", arguments->target.columns, "Discs, or inner corners, a row")
      ->required()
      ->check(CLI::Range(3, 1000));
  command->add_option("--rows", arguments->target.rows, "Discs, or inner corners, a column")
      ->required()
      ->check(CLI::Range(3, 1000));
  command->add_option("--pitch", arguments->target.pitch_mm, "Distance of neighbouring marks, mm")
      ->required()
      ->check(CLI::PositiveNumber);
  command->add_option("--diameter", arguments->target.diameter_mm,
                      "Diameter of the discs, mm; left out: half the pitch");
  command->add_flag("--distinguished", arguments->distinguished, "Three larger discs that tell every side");
  command->add_option("--marker", arguments->target.marker_mm,
                      "Side of the markers (charuco), mm; left out: 0.7 of the pitch");
  command->add_option("--dictionary", arguments->target.dictionary, "Markers' dictionary (charuco)")
      ->capture_default_str();
  command->add_option("-o,--out", arguments->out, "FILE.svg or FILE.pdf")->required();
  command->callback([arguments] { Finish(RunTarget(*arguments)); });
}

const Registration registration(AddTarget);

}  // namespace
}  // namespace vss::cli
