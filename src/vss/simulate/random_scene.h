// A plausible workshop floor, drawn from a seed.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/result.h"
#include "vss/simulate/random_rig.h"
#include "vss/simulate/simulated_scene.h"

namespace vss {

// What a scene is about.
enum class Layout {
  kMixed,    // kinds of all sorts, some standing on plates
  kPanel,    // one large plate with stiffeners and brackets on it
  kStacked,  // plates with much on them
  kRound,    // holed plates and pipes among others
  kBare,     // no part
};
Result<Layout> LayoutNamed(const std::string& name);  // "mixed", "panel", "stacked", "round", "bare"

struct RandomSceneOptions {
  std::uint64_t seed = 1;
  std::optional<Layout> layout;  // left out: drawn, never kBare
  std::optional<int> num_parts;  // left out: 5 to 15
  std::optional<bool>
      clutter;  // cables, painted lines, stones, offcuts, rust; left out: in half of the scenes
  double min_thickness_mm =
      20;  // of plates, webs, flanges: thinner ones are a few pixels at this rig's height
  RandomRigOptions rig;
  std::vector<std::string> kinds;  // only these; empty: all eight shipped kinds
};

// The scene; parts keep clear of each other and rest on the ground or on a plate. Fewer parts than asked for
// where no more fit. Objects point into `knowledge`. An error where it lacks a shipped kind that is needed.
Result<SimulatedScene> DrawRandomScene(const RandomSceneOptions& options, const KnowledgeBase& knowledge);

}  // namespace vss
