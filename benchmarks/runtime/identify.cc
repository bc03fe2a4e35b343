// Processor time of identification, the lines given.
//
//   runtime_identify SURVEY_FOLDER... [--threads N] [--rounds N] [--exact]
//
// Prints ms a picture, the least of the rounds. --exact: and every part found with all its digits, so that
// two versions can be held against each other.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <vector>

#include "accuracy/true_objects.h"
#include "vss/identify/scene.h"
#include "vss/survey/run_survey.h"

namespace {

using namespace vss;

// Of all threads.
double CpuMs() { return 1000 * double(std::clock()) / CLOCKS_PER_SEC; }

void PrintExactly(const SceneResult& scene) {
  for (const auto& part : scene.parts) {
    fmt::print("  {} on {} log-odds {:.17g}{}", part.object.model->kind(), part.stands_on, part.log_odds,
               part.doubtful ? " doubtful" : "");
    for (int i = 0; i < part.object.StateSize(); ++i) fmt::print(" {:.17g}", part.object.State()[i]);
    if (part.runner_up) fmt::print(" or {} {:.17g}", part.runner_up->kind, part.runner_up->log_odds);
    fmt::print("\n");
  }
  fmt::print("  unknown groups {}\n", scene.unknown.size());
}

void Measure(const std::filesystem::path& folder, int threads, int rounds, bool exact) {
  const Survey survey = OrStop(ReadSurvey(folder));
  const KnowledgeBase knowledge = OrStop(LoadKnowledge(survey.knowledge, survey.folder));
  SurveyOptions options;
  options.threads = threads;
  const auto pictures = OrStop(ReadSurveyPictures(survey, threads, {}));
  const auto lines = OrStop(DetectSurveyLines(survey, pictures, options, {}));
  const auto views = MakeViews(survey, lines, pictures);
  double least = INFINITY;
  SceneResult scene;
  for (int round = 0; round < rounds; ++round) {
    const double start = CpuMs();
    scene = OrStop(IdentifyScene(views, knowledge, options.identify, threads, {}));
    least = std::min(least, (CpuMs() - start) / double(views.size()));
  }
  fmt::print("{}: {} pictures, {} parts, {:.1f} ms a picture\n", folder.filename().string(), views.size(),
             scene.parts.size(), least);
  if (exact) PrintExactly(scene);
}

}  // namespace

int main(int argc, char** argv) {
  int threads = 1, rounds = 1;
  bool exact = false;
  std::vector<std::filesystem::path> surveys;
  for (int i = 1; i < argc; ++i) {
    const std::string s = argv[i];
    const bool has_next = i + 1 < argc;
    if (s == "--threads" && has_next)
      threads = std::stoi(argv[++i]);
    else if (s == "--rounds" && has_next)
      rounds = std::stoi(argv[++i]);
    else if (s == "--exact")
      exact = true;
    else
      surveys.emplace_back(s);
  }
  if (surveys.empty()) {
    fmt::print(stderr, "usage: runtime_identify SURVEY_FOLDER... [--threads N] [--rounds N] [--exact]\n");
    return 2;
  }
  for (const auto& survey : surveys) Measure(survey, threads, rounds, exact);
}
