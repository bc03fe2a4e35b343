// vss lines: line images of pictures or of a whole survey.
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "command.h"
#include "vss/base/output_folder.h"
#include "vss/base/parallel.h"
#include "vss/camera/camera.h"
#include "vss/product/overlay.h"
#include "vss/survey/run_survey.h"

namespace vss::cli {
namespace {
namespace fs = std::filesystem;

struct LinesArguments {
  std::vector<std::string> inputs;
  std::string out, camera;
};

bool IsSurvey(const std::string& input) {
  std::error_code ec;
  return fs::is_directory(input, ec) || fs::path(input).extension() == ".toml";
}

// The pictures as a survey: of one camera, or of none whose lens is known (`lens_known` false).
struct Job {
  Survey survey;
  bool lens_known = true;
};

Result<Job> JobOfPictures(const LinesArguments& arguments) {
  Job job;
  job.lens_known = !arguments.camera.empty();
  if (job.lens_known) {
    VSS_ASSIGN(job.survey.cameras.emplace_back(), ReadCamera(arguments.camera));
  }
  for (const auto& input : arguments.inputs) {
    SurveyImage image;
    image.file = input;
    image.path = input;
    if (!job.lens_known) {
      VSS_ASSIGN(const ImageSize size, ReadImageSize(input));
      image.camera = static_cast<int>(job.survey.cameras.size());
      Camera camera;
      camera.width_px = size.width;
      camera.height_px = size.height;
      job.survey.cameras.push_back(camera);
    }
    job.survey.images.push_back(image);
  }
  return job;
}

Result<Job> MakeJob(const LinesArguments& arguments) {
  const bool survey = IsSurvey(arguments.inputs.front());
  for (const auto& input : arguments.inputs)
    if (IsSurvey(input) != survey || (survey && arguments.inputs.size() > 1))
      return UsageError("name either pictures or one survey folder, not {} and {}", arguments.inputs.front(),
                        input);
  if (!survey) return JobOfPictures(arguments);
  if (!arguments.camera.empty())
    return UsageError("--camera is for single pictures; a survey names its cameras itself");
  Job job;
  VSS_ASSIGN(job.survey, ReadSurvey(arguments.inputs.front()));
  return job;
}

// Pictures without a known lens: each is looked at as it is.
Result<std::vector<LineImage>> Detect(const Job& job, const SurveyOptions& options,
                                      const Progress& progress) {
  VSS_ASSIGN(const std::vector<GreyImage> pictures,
             ReadSurveyPictures(job.survey, options.threads, progress));
  if (job.lens_known) return DetectSurveyLines(job.survey, pictures, options, progress);
  std::vector<LineImage> lines(pictures.size());
  ParallelFor(pictures.size(), options.threads, [&](std::size_t i) {
    if (progress.Cancelled()) return;
    lines[i] = DetectLines(pictures[i].view(), nullptr, options.lines);
    lines[i].image = job.survey.images[i].path.filename().string();
  });
  if (progress.Cancelled()) return Cancelled();
  progress.Report("lines", static_cast<int>(lines.size()), static_cast<int>(lines.size()));
  return lines;
}

Status RunLines(const LinesArguments& arguments, const Common& common) {
  VSS_ASSIGN(const Job job, MakeJob(arguments));
  VSS_ASSIGN(SurveyOptions options, OptionsOf(job.survey));
  VSS_ASSIGN(const auto settings, ParseSettings(common.set));
  for (const auto& [name, value] : settings) VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value, options));
  options.threads = common.threads;
  VSS_ASSIGN(OutputFolder out, OutputFolder::Open(arguments.out));
  const Progress progress = MakeProgress(common);
  VSS_ASSIGN(const std::vector<LineImage> lines, Detect(job, options, progress));
  const std::vector<std::string> names = OutputNames(ImageFiles(job.survey));
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    VSS_ASSIGN(const GreyImage picture, ReadSurveyPicture(job.survey, static_cast<int>(i)));
    const Intrinsics* lens =
        job.lens_known ? &job.survey.cameras[static_cast<std::size_t>(job.survey.images[i].camera)].intrinsics
                       : nullptr;
    out.Add(names[i] + ".lines.json", LineImageToJson(lines[i]));
    out.Add(names[i] + ".svg", LineOverlaySvg(picture.view(), lines[i], lens));
    const std::string file = (out.path() / (names[i] + ".lines.json")).string();
    list.push_back({{"image", job.survey.images[i].file},
                    {"lines", file},
                    {"segments", lines[i].segments.size()},
                    {"arcs", lines[i].arcs.size()}});
    if (!common.json)
      fmt::print("{}: {} segments, {} arcs\n", file, lines[i].segments.size(), lines[i].arcs.size());
  }
  if (progress.Cancelled()) return Cancelled();
  VSS_RETURN_IF_ERROR(out.Commit());
  if (common.json) std::printf("%s\n", list.dump(1).c_str());
  return {};
}

const Registration registration([](CLI::App& app, Common& common) {
  auto* command = app.add_subcommand("lines",
                                     "Find the straight edges and elliptical arcs of pictures: "
                                     "NAME.lines.json and an overlay NAME.svg each");
  auto arguments = std::make_shared<LinesArguments>();
  command->add_option("PICTURE", arguments->inputs, "Pictures (PNG, JPEG, TIFF, PGM), or one survey folder")
      ->required();
  command->add_option("-o,--out", arguments->out, "Folder for the results")->required();
  command->add_option("--camera", arguments->camera,
                      "Camera file: takes the lens distortion out of the lines");
  command->add_option("--set", common.set, "NAME=VALUE: any parameter (see vss parameters)")->take_all();
  command->callback([arguments, &common] { Finish(RunLines(*arguments, common)); });
});

}  // namespace
}  // namespace vss::cli
