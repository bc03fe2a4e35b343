// The workpiece as binary glTF 2.0 (Khronos, 2021; ISO/IEC 12113), for viewers and collision checks.
#pragma once
#include <span>
#include <string>

#include "vss/export/part_solid.h"

namespace vss {

// A root node turns VSS's world (z up, mm) into glTF's (y up, m). Below it a node a part, placed by
// world_from_part, whose mesh (in `part`, mm) has its faces as triangles and its edges and rims as lines; and
// a node "seams" with a line a seam. `extras` hold what product.json says of the part or the seam.
std::string WriteGlb(const Product& product, std::span<const PartSolid> solids);

}  // namespace vss
