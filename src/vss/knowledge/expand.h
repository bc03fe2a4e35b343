// An object with optional features and alternatives becomes one syntax tree for each of its variants.
#pragma once
#include "vss/knowledge/syntax.h"

namespace vss {

// One variant where there is no feature. The first has none of the optional features and the first of each
// choice; of two optional features a and b the order is: neither, a, b, both. Errors: a double or unknown
// feature's name, too many variants.
Result<std::vector<Syntax>> Expand(const Syntax& syntax);

// "with snipe, without hole"; empty where the object has no feature.
std::string VariantName(const Syntax& variant);

}  // namespace vss
