// What identification costs a picture as a yard grows: a carriage runs along it, parts and pictures stand as
// thick everywhere. The lines are given.
//
//   runtime_identify_growth FOLDER [STOPS_ALONG]...
//
// A yard of N stops along and two across has 8 N pictures; without numbers 1, 4 and 16. FOLDER keeps the
// pictures of each, drawn where they are not there yet. Every yard is measured in a process of its own, so
// that the greatest memory is its own too.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <vector>

#include "accuracy/true_objects.h"
#include "vss/base/files.h"
#include "vss/base/output_folder.h"
#include "vss/identify/scene.h"
#include "vss/simulate/random_scene.h"
#include "vss/simulate/simulate.h"
#include "vss/survey/run_survey.h"

namespace {

using namespace vss;
namespace fs = std::filesystem;

constexpr int kPartsAStop = 2;  // along, two stops across: as thick as they usually stand in drawn scenes
constexpr std::uint64_t kSeed = 9001;

void Draw(const fs::path& folder, int stops, const KnowledgeBase& knowledge) {
  RandomSceneOptions options;
  options.seed = kSeed;
  options.layout = Layout::kMixed;
  options.num_parts = kPartsAStop * stops;
  options.clutter = false;
  options.rig.stops = {stops, 2};
  const SimulatedScene scene = OrStop(DrawRandomScene(options, knowledge));
  OutputFolder out = OrStop(OutputFolder::Open(folder));
  OrStop(AddSimulatedSurvey(scene, 1, {}, out));
  if (const Status done = out.Commit(); !done) {
    std::cerr << done.error().message << "\n";
    std::exit(1);
  }
}

double PeakMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / 1024;
}

void Measure(const fs::path& folder) {
  const Survey survey = OrStop(ReadSurvey(folder));
  const KnowledgeBase knowledge = OrStop(LoadKnowledge(survey.knowledge, survey.folder));
  SurveyOptions options;
  options.threads = 1;
  const auto pictures = OrStop(ReadSurveyPictures(survey, 1, {}));
  const auto lines = OrStop(DetectSurveyLines(survey, pictures, options, {}));
  const auto views = MakeViews(survey, lines, pictures);
  const double before_mb = PeakMb();
  const std::clock_t start = std::clock();
  const SceneResult scene = OrStop(IdentifyScene(views, knowledge, options.identify, 1, {}));
  const double ms = 1000 * double(std::clock() - start) / CLOCKS_PER_SEC;
  const double n = double(views.size());
  const auto truth = nlohmann::json::parse(OrStop(ReadTextFile(folder / "truth.json")));
  fmt::print(
      "{:4} pictures, {:3} of {:3} parts: {:7.1f} ms a picture; {:6.2f} MB a picture, of which {:6.2f} are "
      "the pictures and their lines\n",
      views.size(), scene.parts.size(), truth["parts"].size(), ms / n, PeakMb() / n, before_mb / n);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "name a folder for the pictures: runtime_identify_growth FOLDER [STOPS_ALONG]...\n";
    return 2;
  }
  std::vector<int> sizes;
  for (int i = 2; i < argc; ++i) sizes.push_back(std::stoi(argv[i]));
  if (sizes.empty()) sizes = {1, 4, 16};
  const KnowledgeBase knowledge = OrStop(LoadKnowledge({}, "."));
  for (const int stops : sizes) {
    const fs::path folder = fs::path(argv[1]) / fmt::format("yard-{}", stops);
    if (!fs::exists(folder / "survey.toml")) Draw(folder, stops, knowledge);
    std::fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
      Measure(folder);
      std::fflush(stdout);
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    if (status != 0) return 1;
  }
}
