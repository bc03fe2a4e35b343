// The edges and circles of the world that the pictures of a scene show.
#pragma once
#include <span>
#include <vector>

#include "vss/base/progress.h"
#include "vss/identify/scene.h"
#include "vss/identify/scene_index.h"
#include "vss/identify/world_circle.h"
#include "vss/identify/world_line.h"

namespace vss {

// Lines at least this long have directions that tell edges apart.
inline constexpr double kSureLinePx = 15;

struct SceneEdges {
  std::vector<WorldLine> lines;
  std::vector<bool> well_shown;  // of each line: found in a fair share of the pictures that look at it
  std::vector<WorldCircle> circles;
};

// How far a line may lie from a predicted contour, px: as asked for, or from the size of the pictures.
double TolerancePx(std::span<const View> views, const IdentifyOptions& options);

// Finds them, and tells `index` which lines are one edge of the world and how far lines lie from their edges.
SceneEdges FindSceneEdges(SceneIndex& index, const IdentifyOptions& options, int threads,
                          const Progress& progress);

}  // namespace vss
