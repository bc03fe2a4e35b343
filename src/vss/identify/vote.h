// Where contours of an object would meet lines of many pictures if it moved one way.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/scene_index.h"

namespace vss {

// How far to go along `direction` (of the state), between `least` and `most`, for predicted contours to meet
// lines of many of `views`: the best few, the best first. In units of `direction`.
std::vector<double> VoteAlong(const PlacedObject& object, const Eigen::VectorXd& direction, double least,
                              double most, std::span<const int> views, const SceneIndex& scene);

}  // namespace vss
