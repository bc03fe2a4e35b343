// vss identify: the objects in a single picture, which stand on the ground plane.
#include <cstdio>

#include "command.h"
#include "vss/product/text_table.h"
#include "vss/survey/survey_files.h"

namespace vss::cli {
namespace {

struct IdentifyArguments {
  std::string picture, camera, out;
  std::vector<double> gantry_mm;
  std::vector<std::string> knowledge;
};

Result<Survey> SurveyOfPicture(const IdentifyArguments& arguments) {
  Survey survey;
  VSS_ASSIGN(survey.cameras.emplace_back(), ReadCamera(arguments.camera));
  const Camera& camera = survey.cameras.front();
  if (!camera.cam_from_world)
    return InputError("{}: the camera has no [pose], so that its place is not known; add one",
                      arguments.camera);
  SurveyImage image;
  image.path = arguments.picture;
  image.file = image.path.filename().string();
  image.gantry_mm =
      arguments.gantry_mm.empty() ? camera.gantry_mm : Eigen::Vector3d(arguments.gantry_mm.data());
  image.cam_from_world = survey.gantry.CamFromWorld(camera, *image.gantry_mm);
  survey.name = image.path.stem().string();
  survey.folder = ".";
  survey.knowledge = arguments.knowledge;
  survey.images.push_back(image);
  return survey;
}

Status Identify(const IdentifyArguments& arguments, const Common& common) {
  VSS_ASSIGN(const Survey survey, SurveyOfPicture(arguments));
  SurveyOptions options;
  VSS_ASSIGN(const auto settings, ParseSettings(common.set));
  for (const auto& [name, value] : settings) VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value, options));
  options.threads = common.threads;
  std::optional<OutputFolder> out;
  if (!arguments.out.empty()) {
    VSS_ASSIGN(OutputFolder folder, OutputFolder::Open(arguments.out));
    out.emplace(std::move(folder));
  }
  const Progress progress = MakeProgress(common);
  VSS_ASSIGN(const SurveyOutcome outcome, RunSurvey(survey, options, progress));
  if (out) {
    VSS_RETURN_IF_ERROR(AddSurveyFiles(survey, options, outcome, progress, *out));
    VSS_RETURN_IF_ERROR(out->Commit());
  }
  if (common.json)
    fmt::print("{}", ProductToJson(outcome.product, ImageFiles(survey)));
  else
    fmt::print("{}", PartsTable(outcome.product));
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand(
      "identify", "Find the objects of the knowledge base in a single picture, standing on the ground plane");
  auto arguments = std::make_shared<IdentifyArguments>();
  command->add_option("PICTURE", arguments->picture, "The picture")->required();
  command->add_option("--camera", arguments->camera, "Camera file with a [pose]")->required();
  command
      ->add_option(
          "--gantry", arguments->gantry_mm,
          "Displacement of the carriage at exposure: x y z, mm; left out: that of the camera's [pose]")
      ->expected(3);
  command->add_option("--knowledge", arguments->knowledge,
                      "Objects to look for: shipped names or .kb files; left out: everything shipped");
  command->add_option("-o,--out", arguments->out, "Folder for product.json, report.html and the overlay");
  command->add_option("--set", common.set, "NAME=VALUE: any parameter (see vss parameters)")->take_all();
  command->callback([arguments, &common] { Finish(Identify(*arguments, common)); });
});

}  // namespace
}  // namespace vss::cli
