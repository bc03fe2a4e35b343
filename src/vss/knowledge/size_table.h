// A catalogue of standard sizes (`*.sizes`): nominal dimensions by designation, with the makers' tolerances.
#pragma once
#include <limits>
#include <string>
#include <vector>

#include "vss/base/result.h"

namespace vss {

// What a nominal size up to `up_to_mm` may be off by.
struct ToleranceStep {
  double below_mm = 0, above_mm = 0;
  double up_to_mm = std::numeric_limits<double>::infinity();
  bool including = true;  // up_to_mm itself belongs to the step
};

struct SizeTable {
  struct Entry {
    std::string designation;
    std::vector<double> nominal_mm;  // of each column
  };
  std::string file, name, title;
  std::vector<std::string> columns;
  std::vector<std::vector<ToleranceStep>> tolerances;  // of each column, the last step without end
  std::vector<Entry> entries;

  const ToleranceStep& ToleranceOf(std::size_t column, double nominal_mm) const;
};

// Errors: FILE:LINE:COLUMN: what was expected. See docs/knowledge-base.md for the grammar.
Result<SizeTable> ParseSizes(const std::string& text, const std::string& file);

}  // namespace vss
