// A Solid of the knowledge base as a boundary representation of Open CASCADE. Only inside this room.
#pragma once
#include <TopoDS_Solid.hxx>

#include "vss/base/result.h"
#include "vss/knowledge/object_model.h"

namespace vss {

// With true planes, cylinders, lines and circles. An error where the faces do not close to a valid solid.
Result<TopoDS_Solid> BrepOf(const Solid& solid);

}  // namespace vss
