// Text to checked definitions, one a variant: parse, expand, compile, see that the constraints can be kept
// and that there is a solid.
#pragma once
#include "vss/knowledge/catalogues.h"

namespace vss {

// At least one. Errors: FILE:LINE:COLUMN: one sentence. The loops of the answers run with the material on
// their left.
Result<std::vector<Definition>> Define(const std::string& text, const std::string& file,
                                       const Catalogues& catalogues);
// Catalogues from the folder of `file` and the shipped ones.
Result<std::vector<Definition>> Define(const std::string& text, const std::string& file);

}  // namespace vss
