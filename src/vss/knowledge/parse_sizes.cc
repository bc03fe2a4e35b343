#include <algorithm>
#include <map>

#include "vss/knowledge/size_table.h"
#include "vss/knowledge/token_cursor.h"

namespace vss {
namespace {

constexpr std::size_t kMaxColumns = 16, kMaxEntries = 10000, kMaxSteps = 100;

class SizesParser : public TokenCursor {
 public:
  SizesParser(std::vector<Token> tokens, const std::string& file) : TokenCursor(std::move(tokens), file) {
    out_.file = file;
  }

  Result<SizeTable> Run() {
    const SourcePosition begin = Here().at;
    VSS_RETURN_IF_ERROR(
        Expect("sizes", "a catalogue begins with: sizes NAME \"the standard\" { columns ... }"));
    VSS_ASSIGN(out_.name, ParseName("the catalogue's name"));
    out_.title = Here().kind == TokenKind::kText ? Take().text : out_.name;
    VSS_RETURN_IF_ERROR(Expect("{", "the catalogue's lines stand between { and }"));
    VSS_RETURN_IF_ERROR(Columns());
    while (!Accept("}")) {
      if (Accept("tolerance")) {
        VSS_RETURN_IF_ERROR(Tolerance());
      } else if (Is("size")) {
        VSS_RETURN_IF_ERROR(Size());
      } else {
        return Fail("tolerance, size or '}'", "each line of a catalogue begins with one of these words");
      }
    }
    if (Here().kind != TokenKind::kEnd)
      return Fail("the end of the file", "a file holds one catalogue; give the next one a file of its own");
    return Checked(begin);
  }

 private:
  Result<std::string> ParseName(const std::string& what) {
    if (Here().kind != TokenKind::kName) return Fail(what, "a name begins with a letter");
    return Take().text;
  }
  Result<double> ParseNumber(const std::string& remedy) {
    if (Here().kind != TokenKind::kNumber) return Fail("a number", remedy);
    return Take().number;
  }

  Status Columns() {
    const std::string form = "a catalogue's columns read: columns height width thickness";
    VSS_RETURN_IF_ERROR(Expect("columns", form));
    while (Here().kind == TokenKind::kName && !Is("tolerance") && !Is("size")) {
      const Token name = Take();
      if (std::find(out_.columns.begin(), out_.columns.end(), name.text) != out_.columns.end())
        return Fail(name.at, fmt::format("the column '{}' is already there; leave one out", name.text));
      if (out_.columns.size() == kMaxColumns)
        return Fail(name.at, fmt::format("more than {} columns; leave some out", kMaxColumns));
      out_.columns.push_back(name.text);
    }
    if (out_.columns.empty()) return Fail("a column's name", form);
    out_.tolerances.resize(out_.columns.size());
    return {};
  }

  Status Tolerance() {
    const std::string form = "a tolerance reads: tolerance height: 1 mm up to 50 mm, -4 +6 mm";
    std::vector<std::size_t> columns;
    do {
      const SourcePosition at = Here().at;
      VSS_ASSIGN(const std::string name, ParseName("a column's name"));
      const auto found = std::find(out_.columns.begin(), out_.columns.end(), name);
      if (found == out_.columns.end())
        return Fail(at, fmt::format("there is no column '{}'; name one of those after 'columns'", name));
      columns.push_back(static_cast<std::size_t>(found - out_.columns.begin()));
      if (!out_.tolerances[columns.back()].empty())
        return Fail(at, fmt::format("the column '{}' has its tolerance already; leave one out", name));
    } while (Accept(","));
    VSS_RETURN_IF_ERROR(Expect(":", form));
    std::vector<ToleranceStep> steps;
    do {
      if (steps.size() == kMaxSteps)
        return Fail("the end of the steps", fmt::format("a tolerance has at most {} steps", kMaxSteps));
      VSS_RETURN_IF_ERROR(Step(form, steps));
    } while (Accept(","));
    if (std::isfinite(steps.back().up_to_mm))
      return Fail("',' and the tolerance of larger sizes", "the last step has no 'up to'");
    for (const std::size_t c : columns) out_.tolerances[c] = steps;
    return {};
  }

  Status Step(const std::string& form, std::vector<ToleranceStep>& steps) {
    if (!steps.empty() && !std::isfinite(steps.back().up_to_mm))
      return Fail("the end of the steps", "only the last step has no 'up to'");
    ToleranceStep step;
    if (Accept("-")) {
      VSS_ASSIGN(step.below_mm, ParseNumber(form));
      VSS_RETURN_IF_ERROR(Expect("+", form));
      VSS_ASSIGN(step.above_mm, ParseNumber(form));
    } else {
      VSS_ASSIGN(step.below_mm, ParseNumber(form));
      step.above_mm = step.below_mm;
    }
    VSS_RETURN_IF_ERROR(Expect("mm", form));
    const bool up_to = Is("up");
    if (up_to || Is("below")) {
      Take();
      if (up_to) VSS_RETURN_IF_ERROR(Expect("to", form));
      const SourcePosition at = Here().at;
      VSS_ASSIGN(step.up_to_mm, ParseNumber(form));
      VSS_RETURN_IF_ERROR(Expect("mm", form));
      step.including = up_to;
      if (!steps.empty() && !(step.up_to_mm > steps.back().up_to_mm))
        return Fail(at, "the steps must grow; put the smaller sizes first");
    }
    steps.push_back(step);
    return {};
  }

  Status Size() {
    const SourcePosition at = Take().at;
    const std::string form =
        fmt::format("a size reads: size \"NAME\" and {} numbers in mm, one a column", out_.columns.size());
    if (Here().kind != TokenKind::kText) return Fail("the designation in quotes", form);
    SizeTable::Entry entry;
    entry.designation = Take().text;
    if (entry.designation.empty())
      return Fail(at, "this size has no designation; write one between the quotes");
    const auto [first, fresh] = lines_.emplace(entry.designation, at.line);
    if (!fresh)
      return Fail(at, fmt::format("the size \"{}\" stands already in line {}; leave one out",
                                  entry.designation, first->second));
    for (const std::string& column : out_.columns) {
      const SourcePosition number_at = Here().at;
      VSS_ASSIGN(const double mm, ParseNumber(fmt::format("the column '{}' is missing; {}", column, form)));
      if (!(mm > 0)) return Fail(number_at, "a size must be above 0; write it in mm");
      entry.nominal_mm.push_back(mm);
    }
    if (Here().kind == TokenKind::kNumber) return Fail("the next size", form);
    if (out_.entries.size() == kMaxEntries)
      return Fail(at, fmt::format("more than {} sizes; split the catalogue", kMaxEntries));
    out_.entries.push_back(std::move(entry));
    return {};
  }

  Result<SizeTable> Checked(SourcePosition begin) {
    for (std::size_t c = 0; c < out_.columns.size(); ++c)
      if (out_.tolerances[c].empty())
        return Fail(begin, fmt::format("the column '{0}' has no tolerance; write: tolerance {0}: 1 mm",
                                       out_.columns[c]));
    if (out_.entries.empty())
      return Fail(begin, "this catalogue has no size; write: size \"NAME\" and its numbers");
    return std::move(out_);
  }

  std::map<std::string, int> lines_;  // of the designations
  SizeTable out_;
};

}  // namespace

const ToleranceStep& SizeTable::ToleranceOf(std::size_t column, double nominal_mm) const {
  for (const ToleranceStep& step : tolerances[column])
    if (nominal_mm < step.up_to_mm || (step.including && nominal_mm == step.up_to_mm)) return step;
  return tolerances[column].back();
}

Result<SizeTable> ParseSizes(const std::string& text, const std::string& file) {
  VSS_ASSIGN(auto tokens, Tokenize(text, file));
  return SizesParser(std::move(tokens), file).Run();
}

}  // namespace vss
