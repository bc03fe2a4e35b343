#include "vss/identify/scene.h"

#include "vss/base/parallel.h"
#include "vss/identify/scene_edges.h"
#include "vss/identify/scene_solver.h"

namespace vss {

std::span<const ParameterOf<IdentifyOptions>> IdentifyParameters() {
  static const ParameterOf<IdentifyOptions> rows[] = {
      {"identify.tolerance_px", &IdentifyOptions::tolerance_px, 0, 50, "px",
       "How far a line may lie from a predicted contour; 0: from the size of the pictures."},
      {"identify.max_height_mm", &IdentifyOptions::max_height_mm, 1, 100000, "mm",
       "Nothing of the workpiece is higher than this above the ground."},
      {"identify.accept_log_odds", &IdentifyOptions::accept_log_odds, 0, 1000, "",
       "An object needs this much evidence (natural logarithm of the odds) to be reported."},
      {"identify.doubtful_log_odds", &IdentifyOptions::doubtful_log_odds, 0, 1000, "",
       "Below this an object is reported as doubtful."},
  };
  return rows;
}

std::vector<std::vector<ContourMatch>> MatchLines(std::span<const View> views,
                                                  std::span<const PlacedObject> objects,
                                                  const IdentifyOptions& options, int threads) {
  const SceneIndex scene = MakeSceneIndex(views, TolerancePx(views, options), threads);
  std::vector<WorldSolid> solids;
  for (const auto& object : objects) solids.push_back(PlaceSolid(object, false));
  std::vector<std::vector<ContourMatch>> matches(objects.size());
  Occluders all;
  for (std::size_t i = 0; i < solids.size(); ++i) all.Add(solids[i], int(i));
  all.Prepare(views);
  ParallelFor(objects.size(), threads, [&](std::size_t i) {
    const Occluders others = all.Without(int(i));
    matches[i] = Weigh(solids[i], ViewsThatSee(solids[i], scene, int(views.size())), scene,
                       {.keep_matches = true}, &others)
                     .matches;
  });
  return matches;
}

std::vector<Evidence> WeighObjects(std::span<const View> views, std::span<const PlacedObject> objects,
                                   const IdentifyOptions& options, int threads) {
  const KnowledgeBase none;
  SceneSolver solver(views, none, options, threads, {});
  return solver.WeighEach(objects);
}

Result<SceneResult> IdentifyScene(std::span<const View> views, const KnowledgeBase& knowledge,
                                  const IdentifyOptions& options, int threads, const Progress& progress) {
  SceneSolver solver(views, knowledge, options, threads, progress);
  return solver.Run();
}

}  // namespace vss
