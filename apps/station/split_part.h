// A part cut where the operator points at it.
#pragma once
#include "workspace.h"

namespace vss::station {

// {"part", "image", "at": [u, v], "along"?: a dimension} -> {"share", "along", "lengths": [mm, mm], "pieces",
// "refused"?}: where along that dimension (0 to 1) the place that the operator points at lies, how long the
// two pieces would be, the outline of the cut in that picture, and why it cannot be cut there.
Result<Json> CutPreview(Workspace& workspace, const Json& body);

}  // namespace vss::station
