// What identification makes of surveys whose truth is known, part by part: how much the pictures speak for
// the true part beside the other true parts, and for what was found there; what was invented. Tells a part
// that the search never met from one that the evidence is against.
//
//   accuracy_identify SURVEY_FOLDER... [--threads N] [--edges ID]... [--set NAME=VALUE]...
//
// --edges: the evidence of every contour of the true part ID, "all": of every one, "false": of every invented
// one, "given": of every one that was found, as it was found.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "accuracy/true_objects.h"
#include "vss/base/files.h"
#include "vss/identify/overlap.h"
#include "vss/identify/scene.h"
#include "vss/survey/run_survey.h"

namespace {

using namespace vss;
using nlohmann::json;
namespace fs = std::filesystem;

std::string Described(const PlacedObject& o) {
  std::string out = fmt::format("{:<11} {:6.0f} {:6.0f} {:4.0f} {:6.1f}", o.model->kind(), o.placement[0],
                                o.placement[1], o.placement[2], DegFromRad(o.placement[3]));
  for (double d : o.dimensions_mm) out += fmt::format(" {:.0f}", d);
  if (o.resting_pose) out += fmt::format(" ({})", o.model->resting_poses()[std::size_t(o.resting_pose)].name);
  return out;
}

// Mean distance of the vertices under the nearest-neighbour assignment both ways: near 0 for one part.
double Apart(const PlacedObject& a, const PlacedObject& b) {
  const WorldSolid sa = PlaceSolid(a, false), sb = PlaceSolid(b, false);
  if (a.model != b.model) return INFINITY;
  auto points = [](const WorldSolid& s) {
    std::vector<Eigen::Vector3d> p;
    for (const auto& v : s.vertices) p.push_back(v.point);
    for (const auto& c : s.circles) p.push_back(c.center.point + Eigen::Vector3d(0, 0, c.radius_mm));
    return p;
  };
  const auto pa = points(sa), pb = points(sb);
  double sum = 0;
  for (const auto* from : {&pa, &pb})
    for (const auto& p : *from) {
      double nearest = 1e9;
      for (const auto& q : from == &pa ? pb : pa) nearest = std::min(nearest, (p - q).norm());
      sum += nearest / double(from->size());
    }
  return sum / 2;
}

void PrintEdges(const PlacedObject& object, const Evidence& evidence) {
  const WorldSolid solid = PlaceSolid(object, false);
  for (const auto& e : evidence.edges) {
    std::string where;
    if (e.source == ContourSample::Source::kEdge) {
      const auto& edge = solid.edges[std::size_t(e.index)];
      const auto &a = solid.vertices[std::size_t(edge.start)].point,
                 &b = solid.vertices[std::size_t(edge.end)].point;
      where = fmt::format("edge {:2} {} ({:.0f} {:.0f} {:.0f}) - ({:.0f} {:.0f} {:.0f})", e.index,
                          edge.convex ? "convex" : "hollow", a.x(), a.y(), a.z(), b.x(), b.y(), b.z());
    } else {
      where = fmt::format("{} {}", e.source == ContourSample::Source::kCircle ? "circle" : "limb", e.index);
    }
    fmt::print("      {:<70} {:3} pictures, {:5.0f} of {:5.0f} px ({:.0f} empty) rms {:.2f}, {:6.1f}\n",
               where, e.views, e.supported_px, e.visible_px, e.empty_px, e.rms_px, e.log_odds);
  }
}

struct Arguments {
  std::vector<fs::path> surveys;
  std::set<std::string> edges;
  SurveyOptions options;
};

Arguments Parse(int argc, char** argv) {
  Arguments a;
  a.options.threads = 2;
  for (int i = 1; i < argc; ++i) {
    const std::string s = argv[i];
    const auto next = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (s == "--threads")
      a.options.threads = std::stoi(next());
    else if (s == "--edges")
      a.edges.insert(next());
    else if (s == "--set") {
      const std::string v = next();
      const auto at = v.find('=');
      if (!SetSurveyParameter(v.substr(0, at), std::stod(v.substr(at + 1)), a.options))
        std::cerr << "no such parameter: " << v << "\n", std::exit(2);
    } else
      a.surveys.push_back(s);
  }
  return a;
}

struct Tally {
  int parts = 0, found = 0, given = 0, right = 0, confirmed_wrong = 0, missed_by_search = 0;
};

void Run(const fs::path& folder, const Arguments& args, Tally& tally) {
  constexpr double kSameMm = 25;  // as score.py
  const Survey survey = OrStop(ReadSurvey(folder));
  const KnowledgeBase knowledge = OrStop(LoadKnowledge(survey.knowledge, survey.folder));
  const auto pictures = OrStop(ReadSurveyPictures(survey, args.options.threads, {}));
  const auto lines = OrStop(DetectSurveyLines(survey, pictures, args.options, {}));
  const auto views = MakeViews(survey, lines, pictures);
  const std::clock_t start = std::clock();
  const SceneResult scene =
      OrStop(IdentifyScene(views, knowledge, args.options.identify, args.options.threads, {}));
  const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;  // of all processors
  const json truth = json::parse(OrStop(ReadTextFile(folder / "truth.json")));
  std::vector<PlacedObject> objects;
  for (const json& p : truth["parts"]) objects.push_back(TrueObject(p, knowledge));
  const auto evidence = WeighObjects(views, objects, args.options.identify, args.options.threads);
  std::vector<int> part_of(objects.size(), -1), truth_of(scene.parts.size(), -1);
  for (std::size_t i = 0; i < objects.size(); ++i)
    for (std::size_t k = 0; k < scene.parts.size(); ++k)
      if (truth_of[k] < 0 && part_of[i] < 0 && Apart(objects[i], scene.parts[k].object) < kSameMm)
        part_of[i] = int(k), truth_of[k] = int(i);
  fmt::print("{}: {:.0f} ms a picture\n", folder.string(), 1000 * seconds / double(views.size()));
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const json& p = truth["parts"][i];
    ++tally.parts;
    tally.found += part_of[i] >= 0;
    const std::string id = p["id"];
    fmt::print("  {} {:<4} {:<60} on {:<7} {:7.1f} ({:.0f} elevated)", part_of[i] < 0 ? "MISSED" : "      ",
               id, Described(objects[i]), p["on"].get<std::string>(), evidence[i].Score(),
               evidence[i].elevated_log_odds);
    if (part_of[i] >= 0)
      fmt::print(" found {:7.1f}{} {}", scene.parts[std::size_t(part_of[i])].log_odds,
                 scene.parts[std::size_t(part_of[i])].doubtful ? " doubtful" : "",
                 Described(scene.parts[std::size_t(part_of[i])].object));
    if (p.contains("seen_px")) fmt::print(" [{} px]", p["seen_px"].get<int>());
    fmt::print("\n");
    if (args.edges.contains(id) || args.edges.contains("all")) PrintEdges(objects[i], evidence[i]);
  }
  std::vector<PlacedObject> given;
  for (const auto& part : scene.parts) given.push_back(part.object);
  const auto given_evidence = WeighObjects(views, given, args.options.identify, args.options.threads);
  for (std::size_t k = 0; k < scene.parts.size(); ++k) {
    const auto& part = scene.parts[k];
    ++tally.given;
    tally.right += truth_of[k] >= 0;
    if (truth_of[k] >= 0) {
      if (!args.edges.contains("given")) continue;
      fmt::print("  GIVEN       {:<60} {:7.1f}\n", Described(part.object), part.log_odds);
      PrintEdges(part.object, given_evidence[k]);
      continue;
    }
    tally.confirmed_wrong += !part.doubtful;
    fmt::print("  FALSE       {:<60} on {:<7} {:7.1f}{}", Described(part.object),
               part.stands_on < 0 ? "ground" : fmt::format("#{}", part.stands_on), part.log_odds,
               part.doubtful ? " doubtful" : "");
    if (part.runner_up) fmt::print(" runner-up {} {:.1f}", part.runner_up->kind, part.runner_up->log_odds);
    const Volume volume = MakeVolume(PlaceSolid(part.object, false));
    for (std::size_t i = 0; i < objects.size(); ++i)
      if (SharedVolume(volume, MakeVolume(PlaceSolid(objects[i], false)), 2) > 0.02)
        fmt::print(" over {}", truth["parts"][i]["id"].get<std::string>());
    fmt::print("\n");
    if (args.edges.contains("false")) PrintEdges(part.object, given_evidence[k]);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments args = Parse(argc, argv);
  Tally tally;
  for (const auto& folder : args.surveys) Run(folder, args, tally);
  fmt::print("recall {} of {}, precision {} of {}, confirmed but wrong {}\n", tally.found, tally.parts,
             tally.right, tally.given, tally.confirmed_wrong);
}
