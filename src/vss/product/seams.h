// Seams: where two parts touch along a line.
#pragma once
#include <span>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/identify/placed_object.h"
#include "vss/product/product.h"

namespace vss {

struct SeamOptions {
  double max_gap_mm = 3;      // farther apart two parts do not touch; also the error that poses may have
  double min_length_mm = 20;  // shorter contacts are no seams
};
std::span<const ParameterOf<SeamOptions>> SeamParameters();

// Every piece of an edge of one part that lies in a face of another, where the edge's own contact face looks
// against that face: the root of a fillet or butt weld. `part_a` has the face, `part_b` the edge; `normal_a`
// is the face's normal, `normal_b` that of the face of part_b which meets it along the seam. Parts whose kind
// `knowledge` does not describe have no seams.
std::vector<Seam> FindSeams(const Product& product, const KnowledgeBase& knowledge,
                            const SeamOptions& options);

}  // namespace vss
