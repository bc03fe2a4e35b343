// A plausible workshop floor, drawn from a seed.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/result.h"
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
  Eigen::Vector2i stops = {4,
                           2};  // of the carriage, 2 m and 1.8 m apart; four cameras take a picture at each
  int size_px = 512;            // of a picture's sides
  std::vector<std::string> kinds;  // only these; empty: all eight shipped kinds
};

// The scene; parts keep clear of each other and rest on the ground or on a plate. Fewer parts than asked for
// where no more fit. Objects point into `knowledge`. An error where it lacks a shipped kind that is needed.
Result<SimulatedScene> DrawRandomScene(const RandomSceneOptions& options, const KnowledgeBase& knowledge);

// The rig alone: four cameras some 3 m above the floor, tilted inwards, and their pictures, and lamps on the
// carriage.
void AddRandomRig(std::uint64_t seed, const Eigen::Vector2i& stops, int size_px, SimulatedScene& scene);

// A camera that hangs at `out_mm` from the carriage's middle in direction `side_rad` and `height_mm` above
// the ground, looks inwards by `tilt_rad` from straight down, and is turned by `roll_rad` about its axis;
// cam_from_world at displacement 0.
RigidTransform CarriageCamera(double side_rad, double out_mm, double height_mm, double tilt_rad,
                              double roll_rad);

// A picture by each camera at each stop of the carriage; the true stops are off by a normal error, the same
// for the pictures of one stop.
void AddStops(const std::vector<double>& stops_x, const std::vector<double>& stops_y, double stop_error_mm,
              SimulatedScene& scene);

}  // namespace vss
