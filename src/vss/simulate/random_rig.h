// Rigs drawn from a seed: cameras, where they take pictures, and the lamps.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/result.h"
#include "vss/simulate/simulated_scene.h"

namespace vss {

// What takes the pictures.
enum class Rig {
  kCarriage,  // four cameras some 3 m above the floor, tilted inwards; the lamps travel along
  kCrane,     // three cameras some 6 m above the floor, farther inwards; lamps on the walls
  kFixed,     // eight cameras around the floor, 3.5 to 5 m above it, one picture each; lamps on the walls
  kHandHeld,  // one camera at eye height, led around the floor; lamps on the walls
};
Result<Rig> RigNamed(const std::string& name);  // "carriage", "crane", "fixed", "hand-held"

struct RandomRigOptions {
  Rig rig = Rig::kCarriage;
  Eigen::Vector2i stops = {4, 2};  // of a carriage, 2 m and 1.8 m apart; also how large the floor is
  std::optional<int> size_px = std::nullopt;  // of a picture's longer side; left out: as usual for the rig
};

// The floor that the rig's pictures show, world, mm.
Eigen::AlignedBox2d Floor(const Eigen::Vector2i& stops);

// Adds cameras, pictures and lamps.
void AddRandomRig(std::uint64_t seed, const RandomRigOptions& options, SimulatedScene& scene);

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
