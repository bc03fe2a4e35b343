// The door of vss_step.so, which the library opens when STEP is asked for.
#pragma once
#include <span>
#include <string>

#include "vss/export/part_solid.h"

namespace vss {

using WriteStepFunction = void(const Product& product, std::span<const PartSolid> solids, Result<std::string>& text);
inline constexpr const char* kWriteStepName = "VssWriteStep";

}  // namespace vss
