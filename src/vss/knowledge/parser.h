// Text to syntax tree: a recursive descent along the grammar of docs/knowledge-base.md.
#pragma once
#include "vss/knowledge/syntax.h"

namespace vss {

// Errors: what stands there, what was expected, and the remedy. Names are not yet looked up.
Result<Syntax> ParseSyntax(const std::string& text, const std::string& file);

}  // namespace vss
