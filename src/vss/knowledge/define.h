// Text to a checked definition: parse, compile, see that the constraints can be kept and that there is a
// solid.
#pragma once
#include "vss/knowledge/definition.h"

namespace vss {

// Errors: FILE:LINE:COLUMN: one sentence. The loops of the answer run with the material on their left.
Result<Definition> Define(const std::string& text, const std::string& file);

}  // namespace vss
