// Standard sizes: what the catalogues of the knowledge base say of a reconstructed part.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "vss/reconstruct/reconstruct.h"

namespace vss {

struct Designation {
  std::string name, standard;           // "IPE 200", "EN 10365"; empty where no size is determined
  std::vector<std::string> candidates;  // the sizes that fit where there are several, the nearest first
  std::vector<std::optional<double>> nominal_mm;  // by dimension
};

// Names the size that the observed dimensions of `part` tell, and gives those that were not observed the
// catalogue's value with its tolerance as sigma: they stay unobserved, `origin` says where the value comes
// from, and the edges that were measured stay where they are. A dimension for which they would have to move
// keeps its value.
Designation Designate(ReconstructedPart& part);

}  // namespace vss
