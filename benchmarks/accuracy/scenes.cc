// Recall and precision over simulated scenes: draws scenes from seeds, runs the whole survey on each, holds
// the product against the truth. A file a scene stays in OUT, so that a run that was stopped goes on where it
// was; with other options name another OUT.
//
//   accuracy_scenes OUT [--scenes N] [--first SEED] [--threads N] [--layout mixed|panel|stacked|round|bare]
//   [--clutter | --tidy]
//                   [--rig carriage|crane|fixed|hand-held] [--parts N] [--min-thickness MM] [--without KIND] [--ablate scene|contact|top-down]
//                   [--keep all|failed|none] [--set NAME=VALUE]...
//
// --ablate: identification does without the decision over the whole scene, without what parts say of each
// other where they touch, or without the search for more once parts are known.
// --without: the knowledge base lacks this kind, and the parts of it count as none. --keep failed (the
// default): the survey folders of scenes with a missed or an invented part stay in OUT/scene-SEED, with their
// result in out/.
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>

#include "vss/base/files.h"
#include "vss/base/parallel.h"
#include "vss/simulate/random_scene.h"
#include "vss/simulate/simulate.h"
#include "vss/survey/survey_files.h"

namespace {

using namespace vss;
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Arguments {
  fs::path out;
  int scenes = 200, threads = 2;
  std::uint64_t first = 1;
  std::string without, ablate, keep = "failed";
  RandomSceneOptions options;
  std::vector<std::pair<std::string, double>> settings;
  std::string said;  // what decides the result, as one line
};

[[noreturn]] void Stop(const std::string& message) {
  std::cerr << message << "\n";
  std::exit(2);
}

template <class T>
T OrStop(Result<T> result) {
  if (!result) Stop(result.error().message);
  return std::move(*result);
}

Arguments Parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i < argc; ++i) {
    const std::string s = argv[i];
    const auto next = [&] {
      if (i + 1 >= argc) Stop(s + " needs a value");
      return std::string(argv[++i]);
    };
    if (s == "--scenes")
      a.scenes = std::stoi(next());
    else if (s == "--first")
      a.first = std::stoull(next());
    else if (s == "--threads")
      a.threads = std::stoi(next());
    else if (s == "--keep")
      a.keep = next();
    else if (s == "--layout")
      a.said += s + " " + next() + " ", a.options.layout = OrStop(LayoutNamed(argv[i]));
    else if (s == "--rig")
      a.said += s + " " + next() + " ", a.options.rig.rig = OrStop(RigNamed(argv[i]));
    else if (s == "--clutter" || s == "--tidy")
      a.said += s + " ", a.options.clutter = s == "--clutter";
    else if (s == "--parts")
      a.said += s + " " + next() + " ", a.options.num_parts = std::stoi(argv[i]);
    else if (s == "--min-thickness")
      a.said += s + " " + next() + " ", a.options.min_thickness_mm = std::stod(argv[i]);
    else if (s == "--without")
      a.said += s + " " + next() + " ", a.without = argv[i];
    else if (s == "--ablate") {
      a.said += s + " " + next() + " ", a.ablate = argv[i];
      if (a.ablate != "scene" && a.ablate != "contact" && a.ablate != "top-down")
        Stop("--ablate knows scene, contact and top-down, not " + a.ablate);
    } else if (s == "--set") {
      const std::string v = next();
      const auto at = v.find('=');
      if (at == std::string::npos) Stop("--set needs NAME=VALUE, got " + v);
      a.settings.emplace_back(v.substr(0, at), std::stod(v.substr(at + 1)));
      a.said += s + " " + v + " ";
    } else if (s.starts_with("--") || !a.out.empty())
      Stop("no such option: " + s);
    else
      a.out = s;
  }
  if (a.out.empty()) Stop("name a folder for the results: accuracy_scenes OUT");
  return a;
}

double CpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

Json Compared(const SimulatedScene& scene, const std::vector<std::vector<std::int32_t>>& seen_px,
              const Product& product, const std::string& without) {
  std::vector<TruePart> truth = TruthOf(scene);
  const Json seen = Json::parse(TruthToJson(scene, seen_px))["parts"];
  const Comparison comparison = CompareWithTruth(truth, product);
  Json out;
  out["parts"] = Json::array();
  for (const auto& c : comparison.parts) {
    const TruePart& t = truth[std::size_t(c.truth)];
    Json part = {{"id", t.id}, {"kind", t.kind}, {"on", scene.parts[std::size_t(c.truth)].stands_on}};
    part["seen_px"] = seen[std::size_t(c.truth)]["seen_px"];
    part["seen_in_pictures"] = seen[std::size_t(c.truth)]["seen_in_pictures"];
    part["known"] = t.kind != without;
    part["found"] = c.part >= 0;
    if (c.part >= 0) {
      const Part& p = product.parts[std::size_t(c.part)];
      part["as"] = p.id;
      part["doubtful"] = p.doubtful;
      part["errors_mm"] = c.errors_mm;
    }
    out["parts"].push_back(std::move(part));
  }
  int confirmed = 0;
  for (const Part& p : product.parts) confirmed += !p.doubtful;
  out["given"] = product.parts.size();
  out["confirmed"] = confirmed;
  out["unknown"] = product.unknown.size();
  out["invented"] = Json::array();
  for (const int i : comparison.invented) {
    const Part& p = product.parts[std::size_t(i)];
    const auto& at = p.world_from_part.translation;
    out["invented"].push_back({{"id", p.id},
                               {"kind", p.kind},
                               {"doubtful", p.doubtful},
                               {"log_odds", p.log_odds},
                               {"position", {at.x(), at.y(), at.z()}}});
  }
  return out;
}

// Draws, renders, surveys, compares.
Result<Json> RunScene(const Arguments& a, std::uint64_t seed, const KnowledgeBase& knowledge) {
  RandomSceneOptions options = a.options;
  options.seed = seed;
  VSS_ASSIGN(SimulatedScene scene, DrawRandomScene(options, knowledge));
  if (!a.without.empty())
    for (const auto& object : knowledge.objects)
      if (object->kind() != a.without) scene.knowledge.push_back(object->kind());
  const fs::path folder = a.out / fmt::format("scene-{}", seed);
  std::vector<std::vector<std::int32_t>> seen_px;
  const double start = CpuSeconds();
  {
    VSS_ASSIGN(OutputFolder out, OutputFolder::Open(folder));
    VSS_ASSIGN(seen_px, AddSimulatedSurvey(scene, 1, {}, out));
    VSS_RETURN_IF_ERROR(out.Commit());
  }
  const double rendered = CpuSeconds();
  VSS_ASSIGN(const Survey survey, ReadSurvey(folder));
  SurveyOptions survey_options;
  survey_options.identify.scene_level = a.ablate != "scene";
  survey_options.identify.contact = a.ablate != "contact";
  survey_options.identify.top_down = a.ablate != "top-down";
  for (const auto& [name, value] : a.settings)
    VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value, survey_options));
  survey_options.threads = 1;
  VSS_ASSIGN(const SurveyOutcome outcome, RunSurvey(survey, survey_options, {}));
  const double done = CpuSeconds();
  Json result = {
      {"options", a.said}, {"seed", seed}, {"name", scene.name}, {"pictures", scene.pictures.size()}};
  result.update(Compared(scene, seen_px, outcome.product, a.without));
  result["render_cpu_s"] = rendered - start;
  result["survey_cpu_s"] = done - rendered;
  for (const auto& step : outcome.steps) result["seconds"][step.step] = step.seconds;
  const bool failed =
      !result["invented"].empty() || std::any_of(result["parts"].begin(), result["parts"].end(),
                                                 [](const Json& p) { return p["known"] && !p["found"]; });
  if (a.keep == "all" || (a.keep == "failed" && failed)) {
    VSS_ASSIGN(OutputFolder out, OutputFolder::Open(folder / "out"));
    VSS_RETURN_IF_ERROR(AddSurveyFiles(survey, survey_options, outcome, {}, out));
    VSS_RETURN_IF_ERROR(out.Commit());
  } else {
    fs::remove_all(folder);
  }
  return result;
}

// A share of n with its interval of 95 % (Wilson 1927).
std::string Share(int k, int n) {
  if (n == 0) return "-";
  constexpr double z = 1.96;
  const double p = double(k) / n, middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4.0 * n * n));
  return fmt::format("{:.2f} % ({} of {}; {:.2f} to {:.2f})", 100 * p, k, n,
                     100 * std::max(middle - half, 0.0), 100 * std::min(middle + half, 1.0));
}

struct Tally {
  int scenes = 0, parts = 0, found = 0, seen = 0, seen_found = 0, given = 0, invented = 0, confirmed = 0,
      confirmed_wrong = 0;
  double error_mm = 0;
  int errors = 0;

  void Add(const Json& scene) {
    // A part of which no picture shows more than this, or which fewer pictures show, is hidden.
    constexpr int kSeenPx = 300, kPictures = 3;
    ++scenes;
    for (const Json& p : scene["parts"]) {
      if (!p["known"]) continue;
      const bool is_seen = p["seen_px"] >= kSeenPx && p["seen_in_pictures"] >= kPictures;
      ++parts, seen += is_seen;
      if (!p["found"]) continue;
      ++found, seen_found += is_seen;
      for (const double e : p["errors_mm"]) error_mm += e, ++errors;
    }
    given += scene["given"].get<int>();
    invented += int(scene["invented"].size());
    confirmed += scene["confirmed"].get<int>();
    for (const Json& p : scene["invented"]) confirmed_wrong += !p["doubtful"];
  }
  void Print(const std::string& title) const {
    fmt::print(
        "{} ({} scenes)\n  recall {}\n  recall of what is seen {}\n  precision {}\n  confirmed but wrong "
        "{}\n",
        title, scenes, Share(found, parts), Share(seen_found, seen), Share(given - invented, given),
        Share(confirmed_wrong, confirmed));
    if (given == 0) fmt::print("  no part was given\n");
    if (errors) fmt::print("  vertex error {:.3f} mm in the mean\n", error_mm / errors);
  }
};

void Print(const std::vector<Json>& scenes) {
  Tally all;
  std::map<std::string, Tally> by_name;
  std::map<std::string, std::pair<int, int>> by_kind;  // found, parts
  std::map<std::string, int> invented;
  std::vector<double> identify_ms;
  double render_s = 0, survey_s = 0;
  int pictures = 0;
  for (const Json& s : scenes) {
    all.Add(s);
    const std::string name = s["name"];
    by_name[name.substr(std::min(name.find(", "), name.size()))].Add(s);
    for (const Json& p : s["parts"])
      if (p["known"]) by_kind[p["kind"]].first += p["found"].get<bool>(), ++by_kind[p["kind"]].second;
    for (const Json& p : s["invented"]) ++invented[p["kind"]];
    const int n = s["pictures"];
    pictures += n;
    identify_ms.push_back(1000 * s["seconds"]["identify"].get<double>() / n);
    render_s += s["render_cpu_s"].get<double>();
    survey_s += s["survey_cpu_s"].get<double>();
    std::string failures;
    for (const Json& p : s["parts"])
      if (p["known"] && !p["found"])
        failures +=
            fmt::format(" {} {} on {} ({} px);", p["id"].get<std::string>(), p["kind"].get<std::string>(),
                        p["on"].get<std::string>(), p["seen_px"].get<int>());
    for (const Json& p : s["invented"])
      failures += fmt::format(" INVENTED {} {}{};", p["id"].get<std::string>(), p["kind"].get<std::string>(),
                              p["doubtful"].get<bool>() ? " (doubtful)" : "");
    if (!failures.empty()) fmt::print("{}:{}\n", name, failures);
  }
  fmt::print("\n");
  for (const auto& [name, tally] : by_name) tally.Print(name.size() > 2 ? name.substr(2) : "scenes");
  for (const auto& [kind, count] : by_kind)
    fmt::print("{:<12} {} of {}, invented {}\n", kind, count.first, count.second, invented[kind]);
  all.Print("all");
  std::sort(identify_ms.begin(), identify_ms.end());
  if (pictures)
    fmt::print(
        "  identification {:.1f} ms a picture in the median scene (by the clock), survey {:.0f} ms, "
        "rendering {:.0f} ms (processor)\n",
        identify_ms[identify_ms.size() / 2], 1000 * survey_s / pictures, 1000 * render_s / pictures);
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments a = Parse(argc, argv);
  const KnowledgeBase knowledge = OrStop(LoadKnowledge({}, "."));
  fs::create_directories(a.out);
  std::vector<Json> results(std::size_t(a.scenes));
  std::mutex printing;
  ParallelFor(results.size(), a.threads, [&](std::size_t i) {
    const std::uint64_t seed = a.first + i;
    const fs::path file = a.out / fmt::format("scene-{}.json", seed);
    if (const auto text = ReadTextFile(file)) {
      results[i] = Json::parse(*text, nullptr, false);
      if (!results[i].is_discarded() && results[i]["options"] == a.said) return;
      const std::lock_guard lock(printing);
      Stop(fmt::format("{}: made with other options; name another folder", file.string()));
    }
    auto result = RunScene(a, seed, knowledge);
    const std::lock_guard lock(printing);
    if (!result) Stop(fmt::format("seed {}: {}", seed, result.error().message));
    results[i] = std::move(*result);
    if (const Status written = WriteFileAtomically(file, results[i].dump(1)); !written)
      Stop(written.error().message);
    std::cerr << fmt::format("{} done\n", results[i]["name"].get<std::string>());
  });
  Print(results);
}
