// SCENE.toml: a scene as a text file (`vss-scene/1`, see docs/manual/simulate.md).
#pragma once
#include <filesystem>
#include <string>

#include "vss/base/result.h"
#include "vss/simulate/simulated_scene.h"

namespace vss {

// A scene with the knowledge base that its parts point into.
struct LoadedScene {
  KnowledgeBase knowledge;
  SimulatedScene scene;
};

// Camera and knowledge files are looked for beside the scene file. Errors name file, line and remedy.
Result<LoadedScene> ReadScene(const std::filesystem::path& path);

// The scene as a file that reads back to the same pictures; its cameras lie in cameras/ID.toml beside it.
std::string SceneToToml(const SimulatedScene& scene);

}  // namespace vss
