// The workpiece as STEP AP242 (ISO 10303-242), by Open CASCADE, where the build has it (CanWriteStep).
#pragma once
#include <span>
#include <string>

#include "vss/export/part_solid.h"

namespace vss {

// An assembly named after the survey: each part a named solid in its own frame, placed by world_from_part,
// with true planes and cylinders; each seam a named edge in `world`. mm.
Result<std::string> WriteStep(const Product& product, std::span<const PartSolid> solids);

}  // namespace vss
