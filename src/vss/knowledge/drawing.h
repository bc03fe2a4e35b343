// An object as a drawing: the cross section with its dimensions, every resting pose, the table of dimensions.
#pragma once
#include <string>

#include "vss/base/result.h"

namespace vss {

// SVG of the object in `text` at its usual dimensions, its variants one below the other. Hidden edges are
// thin and dashed; corners carry their names.
Result<std::string> DrawKnowledge(const std::string& text, const std::string& file);

}  // namespace vss
