// A part cut across its length where the operator points at it.
#pragma once
#include "workspace.h"

namespace vss::station {

// {"part", "image", "at": [u, v]} -> {"share", "lengths": [mm, mm], "pieces"}: where along its length (0 to
// 1) the place that the operator points at lies, how long the two pieces would be, and the outline of the cut
// in that picture.
Result<Json> CutPreview(Workspace& workspace, const Json& body);

}  // namespace vss::station
