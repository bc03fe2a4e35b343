// Definition and dimensions to a solid: vertices, edges, circles and faces of an extruded cross section.
#pragma once
#include "vss/knowledge/definition.h"

namespace vss {

// The solid, with derivatives. No look at ranges or constraints; faces of an impossible cross section are of
// no use.
//
// Faces: the low cap, the high cap, then the sides loop by loop. Vertices: the low ones loop by loop, then
// the high ones.
Solid BuildSolid(const Definition& definition, std::span<const double> dimensions_mm);

// Is there such a body at these dimensions? The sentence says what is wrong with it, and where it is written:
// an extrusion that ends before it begins, a radius that is not positive, roundings that overlap, loops that
// cross, a cutout outside the outline, a base that is not on z = 0 or not centred on the origin.
Status CheckSolid(const Definition& definition, std::span<const double> dimensions_mm);

// Twice the signed area of a loop as it is written: the sign says which way it runs.
double LoopDoubleArea(const Definition& definition, const ProfileLoop& loop,
                      std::span<const double> dimensions_mm);

}  // namespace vss
