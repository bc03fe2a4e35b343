// Drawings of the whole workpiece: seen from above to scale, and at an angle with light and shadow.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/view.h"
#include "vss/product/product.h"

namespace vss {

// An SVG element: the workpiece from above (x to the right, y up), a grid in metres, parts with their names,
// seams in red, the places of the cameras. `solids`: of the parts, see SolidsOf.
std::string PlanSvg(const Product& product, const std::vector<std::optional<WorldSolid>>& solids,
                    std::span<const View> views);

// An SVG element: the workpiece at an angle from above, shaded, with its names.
std::string AngledSvg(const Product& product, const std::vector<std::optional<WorldSolid>>& solids);

}  // namespace vss
