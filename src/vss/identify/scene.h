// Identification over the whole scene: which objects of the knowledge base stand where.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/base/progress.h"
#include "vss/identify/evidence.h"
#include "vss/identify/placed_object.h"
#include "vss/identify/view.h"
#include "vss/identify/weigh.h"

namespace vss {

struct IdentifyOptions {
  double tolerance_px = 0;      // 0: from the pictures' sizes
  double max_height_mm = 3000;  // nothing of the workpiece is higher
  double accept_log_odds = 12;
  double doubtful_log_odds = 25;
  // What a benchmark leaves out to see what it is worth: the decision over whole sets of parts (each is then taken
  // by its own evidence, the best first); what parts say of each other where they touch (supports, relations,
  // dimensions that end at a neighbour); the search for more once parts are known.
  bool scene_level = true, contact = true, top_down = true;
};
std::span<const ParameterOf<IdentifyOptions>> IdentifyParameters();

// One object found, with which line of which picture is which contour.
struct IdentifiedPart {
  PlacedObject object;
  int stands_on = -1;                 // index of another identified part, -1: the ground
  std::vector<ContourMatch> matches;  // of MatchLines()
  std::vector<int> views;             // that see it
  double log_odds = 0;
  bool doubtful = false;
  std::optional<RunnerUp> runner_up;
};

struct SceneResult {
  std::vector<IdentifiedPart> parts;
  std::vector<UnknownGroup> unknown;
};

// For each object, which lines of the views lie on its visible contour; `ContourMatch::image` is the index
// into the views. For the objects as they are reported: after reconstruction.
std::vector<std::vector<ContourMatch>> MatchLines(std::span<const View> views,
                                                  std::span<const PlacedObject> objects,
                                                  const IdentifyOptions& options, int threads);

// How much the pictures speak for each of the objects, each beside all others, as IdentifyScene() weighs
// them.
std::vector<Evidence> WeighObjects(std::span<const View> views, std::span<const PlacedObject> objects,
                                   const IdentifyOptions& options, int threads);

// Deterministic for any number of threads. An error only on cancel.
Result<SceneResult> IdentifyScene(std::span<const View> views, const KnowledgeBase& knowledge,
                                  const IdentifyOptions& options, int threads, const Progress& progress);

}  // namespace vss
