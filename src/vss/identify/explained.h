// What parts that are known explain: the lines that are their contours, and what they hide.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/scene_data.h"

namespace vss {

struct Explained {
  Occluders others;
  Claims claims;  // empty: nothing is known
};
// By some of the items; each is held against the pictures once.
Explained ExplainedBy(std::span<const int> items, SceneData& data);
// By all but one of those that `known` is made of.
Explained ExplainedWithout(int item, const Explained& known, std::span<const int> items,
                           const SceneData& data);

// Is most of the line explained already?
bool Explains(const Claims& claims, const WorldLine& line, const SceneIndex& index);
// And the circle, of which one arc speaks for all?
bool Explains(const Claims& claims, const WorldCircle& circle, const SceneIndex& index);

}  // namespace vss
