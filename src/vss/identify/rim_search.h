// Small holes of the parts found: rims of which no picture has an arc, from the grey values.
#pragma once
#include <span>

#include "vss/identify/scene_data.h"

namespace vss {

// For each of `items`, some of those `accepted`, whose kind another extends by round edges alone (a plate,
// one with a hole): rings of clear steps, all around and of one sign, that two pictures show on the face
// where the other has a rim become items of that kind.
void AddRims(std::span<const int> items, std::span<const int> accepted, SceneData& data);

}  // namespace vss
