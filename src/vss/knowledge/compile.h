// Syntax tree (of one variant: expand.h) to definition: names, units, ranges, weights and turns are looked up
// and checked.
#pragma once
#include "vss/knowledge/definition.h"

namespace vss {

// Errors: an unknown or double name, a cycle of definitions, a unit that does not fit, an empty range, a
// missing part.
Result<Definition> Compile(const Syntax& syntax);

}  // namespace vss
