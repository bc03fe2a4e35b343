// What several of these programs need of a survey whose truth is known.
#pragma once
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>
#include <utility>

#include "vss/base/result.h"
#include "vss/identify/placed_object.h"

namespace vss {

// The value, or the error's sentence and the program's end.
template <class T>
T OrStop(Result<T> result) {
  if (result) return std::move(*result);
  std::cerr << result.error().message << "\n";
  std::exit(1);
}

// A part of truth.json as an object in its place.
inline PlacedObject TrueObject(const nlohmann::json& part, const KnowledgeBase& knowledge) {
  PlacedObject object;
  object.model = knowledge.Find(part["kind"].get<std::string>());
  const auto& pose = part["pose"];
  object.placement << pose["x"], pose["y"], pose["z"], RadFromDeg(pose["yaw"].get<double>()), 0, 0;
  for (const auto& d : object.model->dimensions()) object.dimensions_mm.push_back(part["dims"][d.name]);
  const auto poses = object.model->resting_poses();
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (poses[i].name == part.value("rests", "base")) object.resting_pose = int(i);
  return object;
}

}  // namespace vss
