// Tables of parts and seams, comma separated, one heading line; the unit and the frame stand in each heading.
#pragma once
#include <string>

#include "vss/product/product.h"

namespace vss {

// A row a part: place, yaw and rotation world_from_part, then the dimensions that any part has, each with its
// sigma.
std::string PartsCsv(const Product& product);

// Two rows a seam, its start and its end: x y z i j k first (i j k: the unit vector from the seam to where a
// torch comes from), as planners read curves; then the seam's number, its parts, normals, gap and length.
std::string SeamsCsv(const Product& product);

}  // namespace vss
