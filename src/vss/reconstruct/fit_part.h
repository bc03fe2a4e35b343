// A live fit of one part to a few lines that a person picked and named: which line of which picture is which
// contour edge. Quick (a few milliseconds), from any start on the ground, and frank about what the lines do
// not yet determine.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "vss/base/result.h"
#include "vss/identify/contour.h"

namespace vss {

// Segment (or arc, where `source` is kCircle) `line` of views[view]'s line image is the solid's edge, circle
// or limb `index` (as ContourSample has it).
struct LineAssignment {
  int view = 0, line = 0;
  ContourSample::Source source = ContourSample::Source::kEdge;
  int index = 0;
  int limb_side = 0;
};

struct FitOptions {
  double systematic_px = 0.1;  // beside a line's own sigma: a picked line is never better than that
  bool search_start = true;    // look for the place from many starts; false: `start` is near
  bool fit_tilt = false;
  double support_height_mm = 0;  // height of what the part stands on
};

// "Pick this edge in that picture, and the dimension is determined."
struct UsefulEdge {
  std::string dimension;  // or "position", "yaw"
  int view = 0;
  int edge = 0;         // of the solid
  double sigma_mm = 0;  // of the dimension then (rad for yaw)
};

struct FitResult {
  PlacedObject object;
  Eigen::MatrixXd covariance;       // of the state; what is not observable keeps its range
  std::vector<bool> observable;     // of the state
  std::vector<double> residual_px;  // per assignment: distance of the line's middle from its contour
  double rms_px = 0;
  std::vector<UsefulEdge> useful;    // one for each dimension or placement that is not observable
  std::vector<std::string> remarks;  // the same in sentences
};

// Errors: no assignment; an index that does not exist; a view without lines.
Result<FitResult> FitPart(std::span<const View> views, const PlacedObject& start,
                          std::span<const LineAssignment> assignments, const FitOptions& options);

}  // namespace vss
