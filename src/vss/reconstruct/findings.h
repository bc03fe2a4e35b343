// What a finished adjustment says beside the parts' values: residuals edge by edge, edges that do not fit,
// cameras that were moved, pictures that contradict the others.
#pragma once
#include <vector>

#include "vss/reconstruct/adjustment.h"
#include "vss/reconstruct/reconstruct.h"

namespace vss {

// Fills the parts' edges, views, residuals, straightness and remarks; a warning for a part that no picture
// measured.
void AddEdgeFindings(const Adjustment& adjustment, Reconstruction& out);

// Fills cameras and stops, with a warning for each camera that was moved. `significance[c]`: of camera c's
// correction.
void AddCameraFindings(const Adjustment& adjustment, const std::vector<double>& significance,
                       Reconstruction& out);

// Leaves out each view in turn and notes what would change most.
void AddInfluences(const Adjustment& adjustment, Reconstruction& out);

// Notes what gives the scale: known lengths, else the longest way between two places of one camera. A warning
// where known lengths contradict it. `picture_sigma_mm`: how well places of hand-held pictures are known.
void AddScale(const Adjustment& adjustment, double picture_sigma_mm, Reconstruction& out);
// The ground where it is not z = 0, and a warning that says so.
void AddGround(const Adjustment& a, Reconstruction& out);

}  // namespace vss
