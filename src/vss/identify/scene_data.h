// What the steps of identifying a scene share.
#pragma once
#include <span>
#include <vector>

#include "vss/base/progress.h"
#include "vss/identify/kind_template.h"
#include "vss/identify/scene.h"
#include "vss/identify/scene_edges.h"
#include "vss/identify/scene_index.h"
#include "vss/identify/scene_items.h"

namespace vss {

// The search looks at that many pictures of a place, the decision at many.
inline constexpr int kSearchViews = 12;

struct SceneData {
  // All but the knowledge base's templates must outlive it.
  SceneData(std::span<const View> views, const KnowledgeBase& knowledge, const IdentifyOptions& options,
            int threads, const Progress& progress)
      : views(views),
        options(options),
        threads(threads),
        progress(progress),
        templates(MakeTemplates(knowledge)),
        index(MakeSceneIndex(views, TolerancePx(views, options), threads)) {}

  bool IsSinglePicture() const { return views.size() == 1; }
  SeedContext Context() const { return {index, edges.lines, edges.circles, mm_per_px, kSearchViews}; }

  std::span<const View> views;
  const IdentifyOptions& options;
  int threads;
  const Progress& progress;
  std::vector<KindTemplate> templates;
  SceneIndex index;
  SceneEdges edges;
  double mm_per_px = index.mm_per_px;
  SceneItems items{index.mm_per_px};
};

}  // namespace vss
