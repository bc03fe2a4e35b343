// What is left of the world's edges when the parts are known: groups that look like an object which no
// knowledge base describes.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/evidence.h"
#include "vss/identify/world_circle.h"
#include "vss/identify/world_line.h"

namespace vss {

// `lines`, `circles`: what no part explains. `parts`: the boxes (world) of the parts found; what lies in one
// is a part's own, badly met. `mm_per_px`: typical size of a pixel in the scene. Largest groups first.
std::vector<UnknownGroup> FindUnknown(std::span<const WorldLine> lines, std::span<const WorldCircle> circles,
                                      std::span<const Eigen::AlignedBox3d> parts, double mm_per_px);

}  // namespace vss
