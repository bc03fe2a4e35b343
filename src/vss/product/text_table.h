// The parts as a table for a terminal.
#pragma once
#include <string>

#include "vss/product/product.h"

namespace vss {

// One line a part: id, kind, place, yaw, dimensions with their sigmas ("?" where the pictures do not
// determine one).
std::string PartsTable(const Product& product);

}  // namespace vss
