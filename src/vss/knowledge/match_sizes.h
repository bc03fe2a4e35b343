// Which standard size do measured dimensions tell?
#pragma once
#include <span>

#include "vss/knowledge/definition.h"
#include "vss/knowledge/object_model.h"

namespace vss {

// See ObjectModel::MatchSizes.
std::vector<SizeMatch> MatchSizes(const Definition& definition, std::span<const MeasuredDimension> measured);

}  // namespace vss
