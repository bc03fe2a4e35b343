// A simulated scene becomes a survey folder with its truth.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "vss/base/output_folder.h"
#include "vss/base/progress.h"
#include "vss/product/compare.h"
#include "vss/simulate/render.h"
#include "vss/simulate/simulated_scene.h"
#include "vss/survey/survey.h"

namespace vss {

// One picture's bytes at a time is all that is kept in memory, beside what `use` keeps. `use(i, picture)` is
// called once for each picture, from several threads. An error on cancel, or where a camera's lens cannot be
// undone.
Status RenderPictures(const SimulatedScene& scene, int threads, const Progress& progress,
                      const std::function<void(int, const RenderedPicture&)>& use);

// The survey as ReadSurvey gives it from the folder; `folder` is where its pictures will be.
Survey SurveyOf(const SimulatedScene& scene, const std::filesystem::path& folder);
std::string SurveyToToml(const SimulatedScene& scene);

// truth.json: parts, cameras, pictures, clutter. `seen_px`: of each picture, what RenderedPicture says; may
// be empty. A part carries its greatest number of pixels in one picture and how many pictures show it.
std::string TruthToJson(const SimulatedScene& scene, const std::vector<std::vector<std::int32_t>>& seen_px);
std::vector<TruePart> TruthOf(const SimulatedScene& scene);

// Adds survey.toml, cameras/, images/, scene.toml, truth.json and the scene's own knowledge files to `out`.
// Nothing is written before out.Commit(). Gives what TruthToJson takes: the pixels of each picture that show
// each part.
Result<std::vector<std::vector<std::int32_t>>> AddSimulatedSurvey(const SimulatedScene& scene, int threads,
                                                                  const Progress& progress,
                                                                  OutputFolder& out);

}  // namespace vss
