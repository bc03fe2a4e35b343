// vss simulate: pictures with truth, of a scene file or of a scene drawn from a seed.
#include <cstdio>

#include "command.h"
#include "vss/simulate/random_scene.h"
#include "vss/simulate/scene_file.h"
#include "vss/simulate/simulate.h"

namespace vss::cli {
namespace {

struct SimulateArguments {
  std::string scene, out;
  std::optional<std::uint64_t> seed;
  std::optional<int> parts;
  std::string layout, rig = "carriage";
  bool clutter = false, tidy = false;
  double min_thickness_mm = RandomSceneOptions{}.min_thickness_mm;
};

Result<LoadedScene> SceneOf(const SimulateArguments& a) {
  if (a.seed.has_value() == !a.scene.empty())
    return UsageError("name either a scene file or --random SEED: vss simulate SCENE.toml -o DIR");
  if (!a.seed) return ReadScene(a.scene);
  RandomSceneOptions options;
  options.seed = *a.seed;
  options.num_parts = a.parts;
  options.min_thickness_mm = a.min_thickness_mm;
  if (a.clutter) options.clutter = true;
  if (a.tidy) options.clutter = false;
  if (!a.layout.empty()) {
    VSS_ASSIGN(options.layout, LayoutNamed(a.layout));
  }
  VSS_ASSIGN(options.rig.rig, RigNamed(a.rig));
  LoadedScene loaded;
  VSS_ASSIGN(loaded.knowledge, LoadKnowledge({}, "."));
  VSS_ASSIGN(loaded.scene, DrawRandomScene(options, loaded.knowledge));
  return loaded;
}

Status RunSimulate(const SimulateArguments& a, const Common& common) {
  const Progress progress = MakeProgress(common);
  VSS_ASSIGN(const LoadedScene loaded, SceneOf(a));
  const SimulatedScene& scene = loaded.scene;
  VSS_ASSIGN(OutputFolder out, OutputFolder::Open(a.out));
  if (const auto added = AddSimulatedSurvey(scene, common.threads, progress, out); !added)
    return tl::unexpected(added.error());
  VSS_RETURN_IF_ERROR(out.Commit());
  fmt::print("{}: {} parts in {} pictures\n", out.path().string(), scene.parts.size(), scene.pictures.size());
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand("simulate", "Render a scene as a survey folder with its truth");
  auto a = std::make_shared<SimulateArguments>();
  command->add_option("SCENE", a->scene, "Scene file (vss-scene/1)");
  command->add_option("--random", a->seed, "Draw a scene from this seed instead");
  command->add_option("--parts", a->parts, "How many parts the drawn scene has (left out: 5 to 15)")
      ->check(CLI::Range(0, 200));
  command->add_option("--layout", a->layout, "mixed, panel, stacked, round or bare (left out: drawn)")
      ->check(CLI::IsMember({"mixed", "panel", "stacked", "round", "bare"}));
  command->add_option("--rig", a->rig, "What takes the pictures: carriage, crane, fixed or hand-held")
      ->capture_default_str()
      ->check(CLI::IsMember({"carriage", "crane", "fixed", "hand-held"}));
  auto* clutter =
      command->add_flag("--clutter", a->clutter, "With cables, painted lines, stones, offcuts and rust");
  command->add_flag("--tidy", a->tidy, "Without them (neither given: drawn)")->excludes(clutter);
  command->add_option("--min-thickness", a->min_thickness_mm, "Of plates, webs and flanges, mm")
      ->capture_default_str()
      ->check(CLI::Range(3, 60));
  command->add_option("-o,--out", a->out, "Folder for the survey")->required();
  command->callback([a, &common] { Finish(RunSimulate(*a, common)); });
});

}  // namespace
}  // namespace vss::cli
