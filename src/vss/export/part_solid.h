// The solid of a part of a product, in the part's own frame.
#pragma once
#include <vector>

#include "vss/base/result.h"
#include "vss/knowledge/object_model.h"
#include "vss/product/product.h"

namespace vss {

struct PartSolid {
  const Part* part = nullptr;
  Solid solid;  // in `part`, mm
};

// Of every part, in their order. An error names a part whose kind or dimensions `knowledge` does not
// describe.
Result<std::vector<PartSolid>> SolidsOfProduct(const Product& product, const KnowledgeBase& knowledge);

// The volume that the solid's triangles enclose (mm^3): of a faceted cylinder, where it has one.
double FacetedVolume(const Solid& solid);

// What a part and a seam are called in files for other programs: "part-3 tee", "seam-2 part-1/part-3".
inline std::string NameOf(const Part& part) { return part.id + " " + part.kind; }
inline std::string NameOf(const Seam& seam, std::size_t index) {
  return fmt::format("seam-{} {}/{}", index + 1, seam.part_a, seam.part_b);
}

}  // namespace vss
