// A placed object fitted to the lines nearest to its predicted contour.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/scene_index.h"

namespace vss {

// Gauss-Newton of the state to the lines nearest to the predicted contour. `free`: which state entries may
// move. `reach_px`: lines further away are not looked at, from the first to the last iteration. Returns the
// rms in px of the samples used, or a negative number where there were too few.
struct FitToLinesResult {
  double rms_px = -1;
  int samples = 0;
  Eigen::MatrixXd information;  // of the state, before the prior, for 1 px noise a sample
};
FitToLinesResult FitToLines(PlacedObject& object, std::span<const int> views, const SceneIndex& scene,
                            const std::vector<bool>& free, double first_reach_px, double last_reach_px,
                            int iterations, const Occluders* others = nullptr);

}  // namespace vss
