// Identification over the whole scene, step by step.
#pragma once
#include <set>
#include <span>
#include <vector>

#include "vss/identify/explained.h"
#include "vss/identify/plates.h"
#include "vss/identify/scene_choice.h"
#include "vss/identify/scene_data.h"

namespace vss {

class SceneSolver {
 public:
  // All but the knowledge base's templates must outlive it.
  SceneSolver(std::span<const View> views, const KnowledgeBase& knowledge, const IdentifyOptions& options,
              int threads, const Progress& progress)
      : data_(views, knowledge, options, threads, progress) {}

  // An error only on cancel.
  Result<SceneResult> Run();
  // How much the pictures speak for each of `objects`, the others known.
  std::vector<Evidence> WeighEach(std::span<const PlacedObject> objects);

 private:
  void FindEdges();
  void SlideAccepted();
  void BringUpToWalls();
  void SeekRims();
  bool SearchAfresh(int support, const std::vector<int>& known);
  SceneResult Collect();
  std::vector<UnknownGroup> Unexplained();

  SceneData data_;
  std::set<int> brought_;  // serial numbers of the items that were brought up to walls
  std::set<int> sought_;  // serial numbers of the items on which rims were sought
  std::set<int> searched_;  // items that were searched as if nothing stood on them
  SceneChoice choice_{data_};
  PlateJoiner joiner_{data_};
};

}  // namespace vss
