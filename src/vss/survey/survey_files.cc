#include "vss/survey/survey_files.h"

#include "vss/product/report.h"

namespace vss {
namespace {

// The views with the places that reconstruction found.
std::vector<View> AdjustedViews(const Survey& survey, const SurveyOutcome& outcome) {
  std::vector<View> views = MakeViews(survey, outcome.lines);
  for (std::size_t i = 0; i < views.size() && i < outcome.cam_from_world.size(); ++i)
    views[i] =
        MakeView(views[i].image, *views[i].camera, outcome.cam_from_world[i], views[i].stop, views[i].lines);
  return views;
}

}  // namespace

Status AddSurveyFiles(const Survey& survey, const SurveyOptions& options, const SurveyOutcome& outcome,
                      const Progress& progress, OutputFolder& out) {
  const std::vector<View> views = AdjustedViews(survey, outcome);
  ReportInput input;
  input.product = &outcome.product;
  input.knowledge = &outcome.knowledge;
  input.views = views;
  input.lines = outcome.lines;
  input.image_files = ImageFiles(survey);
  for (const auto& step : outcome.steps) input.step_seconds.emplace_back(step.step, step.seconds);
  input.parameters = SurveyParameters(options);
  input.picture = [&](int image) { return ReadSurveyPicture(survey, image); };
  input.num_cameras = static_cast<int>(survey.cameras.size());
  progress.Report("report", 0, 1);
  VSS_ASSIGN(const ReportFiles files, MakeReport(input, options.threads));
  if (progress.Cancelled()) return Cancelled();
  out.Add("product.json", ProductToJson(outcome.product, input.image_files));
  out.Add("report.html", files.html);
  const std::vector<std::string> names = OutputNames(input.image_files);
  for (std::size_t i = 0; i < names.size(); ++i) out.Add("overlays/" + names[i] + ".svg", files.overlays[i]);
  progress.Report("report", 1, 1);
  return {};
}

}  // namespace vss
