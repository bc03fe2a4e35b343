// Every figure of reconstruction beside its goal.
//
//   accuracy_reconstruct_figures OUT [--shared FOLDER] [--only STUDY]... [--scenes N] [--trials N]
//                                [--first SEED] [--threads N] [--write README] [--show-scene N]
//                                [--joint PRODUCT|identified]
//
// OUT keeps each study's result (and each simulated scene's), so that a run that was stopped goes on; remove
// a file there to do it again. --shared: the folder that holds surveys/, calibration/ and real/. --write
// replaces the section between this program's two marks in README by what OUT holds. --only: of those
// studies that OUT does not hold yet only these. --first: seed of the first of the N scenes. --show-scene:
// only that simulated scene, edge by edge, and its pictures into the working folder. --joint: what the study
// of the T joint's halves starts from: a product.json (t-joint.json beside this file: its two plates, read
// off the photographs by hand), or what identification makes of it.
#include <time.h>

#include <set>

#include "reconstruct_simulated.h"
#include "vss/calibrate/calibrate.h"
#include "vss/identify/weigh.h"
#include "vss/reconstruct/measure_view.h"
#include "vss/survey/run_survey.h"

namespace {

using namespace vss;
using namespace vss::benchmark;
using Json = nlohmann::json;
namespace fs = std::filesystem;

struct Arguments {
  fs::path out, shared = VSS_SOURCE_DIR "/../shared", write;
  fs::path joint = VSS_SOURCE_DIR "/benchmarks/accuracy/t-joint.json";
  std::set<std::string> only;
  int scenes = 200, first_scene = 1, trials = 40, threads = 2, show_scene = 0;
};

Arguments Parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i < argc; ++i) {
    const std::string s = argv[i];
    const auto next = [&] {
      if (i + 1 >= argc) Stop(s + " needs a value");
      return std::string(argv[++i]);
    };
    if (s == "--shared")
      a.shared = next();
    else if (s == "--only")
      a.only.insert(next());
    else if (s == "--scenes")
      a.scenes = std::stoi(next());
    else if (s == "--first")
      a.first_scene = std::stoi(next());
    else if (s == "--trials")
      a.trials = std::stoi(next());
    else if (s == "--threads")
      a.threads = std::stoi(next());
    else if (s == "--show-scene")
      a.show_scene = std::stoi(next());
    else if (s == "--joint")
      a.joint = next();
    else if (s == "--write")
      a.write = next();
    else if (s.starts_with("--") || !a.out.empty())
      Stop("no such option: " + s);
    else
      a.out = s;
  }
  if (a.out.empty()) Stop("name a folder for the results: accuracy_reconstruct_figures OUT");
  return a;
}

// The file's content, made by `make` where it is not there yet.
Json Kept(const fs::path& file, const std::function<Json()>& make) {
  if (const auto text = ReadTextFile(file)) {
    Json kept = Json::parse(*text, nullptr, false);
    if (!kept.is_discarded()) return kept;
  }
  const Json made = make();
  fs::create_directories(file.parent_path());
  OrStop(WriteFileAtomically(file, made.dump(1)));
  return made;
}

Json ToJson(const Errors& e) {
  return {{"mean_mm", Mean(e.vertex_mm)},
          {"p95_mm", Quantile(e.vertex_mm, 0.95)},
          {"dimensions", e.dimension_mm.size()},
          {"dimension_mm", Mean(e.dimension_mm)},
          {"within_2_sigma", Within(e.dimension_z, 2)},
          {"not_observable", e.not_observable}};
}

// --- studies on rendered surveys ---

const char* const kSurveys[] = {"lab-1", "lab-2", "panel-3", "round-4", "yard-5"};

class Studies {
 public:
  explicit Studies(const Arguments& a) : args_(a), knowledge_(OrStop(LoadKnowledge({}, "."))) {
    fs::create_directories(a.out);
  }

  fs::path SurveyFolder(const std::string& name) const { return args_.shared / "surveys" / name; }

  // From the true identification, moved.
  Json FromTruth(const std::string& name, const std::optional<fs::path>& cameras) const {
    const LoadedSurvey data(OrStop(ReadSurvey(SurveyFolder(name), cameras)), args_.threads);
    const auto truth = TrueParts(SurveyFolder(name), knowledge_);
    std::mt19937 random(1);
    const auto r = OrStop(
        ReconstructScene(data.views, data.pictures, Moved(truth, 8, 0.5, random), {}, args_.threads, {}));
    return ToJson(ErrorsOf(r, truth));
  }

  // The whole survey, scored as tools outside do.
  Json FromSurvey(const std::string& name, const std::optional<fs::path>& cameras) const {
    const Survey survey = OrStop(ReadSurvey(SurveyFolder(name), cameras));
    SurveyOptions options = OrStop(OptionsOf(survey));
    options.threads = args_.threads;
    const auto outcome = OrStop(RunSurvey(survey, options, {}));
    const auto truth = OrStop(ReadTruth(SurveyFolder(name) / "truth.json"));
    const Comparison comparison = CompareWithTruth(truth, outcome.product);
    Errors e;
    int found = 0;
    for (const auto& part : comparison.parts) {
      if (part.part < 0) continue;
      ++found;
      e.vertex_mm.insert(e.vertex_mm.end(), part.errors_mm.begin(), part.errors_mm.end());
      for (const auto& d : part.dimensions) {
        e.dimension_mm.push_back(std::abs(d.error_mm));
        e.dimension_z.push_back(std::abs(d.error_mm) / d.sigma_mm);
      }
      e.not_observable += static_cast<int>(truth[static_cast<std::size_t>(part.truth)].dimensions_mm.size() -
                                           part.dimensions.size());
    }
    Json out = ToJson(e);
    out["found"] = found, out["parts"] = truth.size(), out["invented"] = comparison.invented.size();
    return out;
  }

  fs::path CalibratedCameras() const {
    const fs::path folder = args_.out / "rig-1";
    if (fs::exists(folder / "cameras")) return folder / "cameras";
    const auto job = OrStop(ReadCalibrationJob(args_.shared / "calibration/rig-1/calibration.toml"));
    OrStop(WriteCalibration(OrStop(Calibrate(job, {}, args_.threads, {})), folder));
    return folder / "cameras";
  }

  Json Surveys() const {
    Json out;
    for (const std::string name : kSurveys) {
      out[name]["truth"] = FromTruth(name, {});
      out[name]["survey"] = FromSurvey(name, {});
    }
    out["lab-1, rig-1"]["truth"] = FromTruth("lab-1", CalibratedCameras());
    out["lab-1, rig-1"]["survey"] = FromSurvey("lab-1", CalibratedCameras());
    return out;
  }

  // The four pictures of one stop alone, every stop in turn.
  Json SingleStop() const {
    Json out;
    for (const std::string name : {"lab-1", "lab-2"}) {
      const auto truth = TrueParts(SurveyFolder(name), knowledge_);
      Errors all;
      int unseen = 0;
      for (int stop = 0;; ++stop) {
        const LoadedSurvey data(OrStop(ReadSurvey(SurveyFolder(name))), args_.threads,
                                [&](int, int s) { return s == stop; });
        if (data.views.empty()) break;
        std::mt19937 random(static_cast<unsigned>(stop));
        const auto r = OrStop(
            ReconstructScene(data.views, data.pictures, Moved(truth, 8, 0.5, random), {}, args_.threads, {}));
        for (std::size_t p = 0; p < truth.size(); ++p) {
          if (r.parts[p].views.empty()) ++unseen;
          Errors e = ErrorsOf(r.parts[p], truth[p].object);
          e.vertex_mm.clear();  // the vertices of what is not observed say nothing
          all.Add(e);
        }
      }
      out[name] = ToJson(all);
      out[name]["max_z"] = Quantile(all.dimension_z, 1);
      out[name]["unseen_parts"] = unseen;
    }
    return out;
  }

  // Each camera of both lab surveys in turn knocked by 0.3 mrad and 1 mm, twice.
  Json Knocked() const {
    Json out = Json::array();
    for (const std::string name : {"lab-1", "lab-2"}) {
      const Survey survey = OrStop(ReadSurvey(SurveyFolder(name)));
      const auto truth = TrueParts(SurveyFolder(name), knowledge_);
      for (int camera = 0; camera < static_cast<int>(survey.cameras.size()); ++camera)
        for (unsigned seed = 1; seed <= 2; ++seed) {
          std::mt19937 random(seed * 100 + static_cast<unsigned>(camera));
          Survey moved = survey;
          const Eigen::Vector3d turn = 0.3e-3 * RandomDirection(random);
          Knock(moved, camera, turn, RandomDirection(random));
          const LoadedSurvey data(moved, args_.threads);
          const auto r = OrStop(ReconstructScene(data.views, data.pictures, Moved(truth, 8, 0.5, random), {},
                                                 args_.threads, {}));
          bool named = false, others = false;
          for (const auto& c : r.cameras) {
            if (!c.moved) continue;
            (c.camera == survey.cameras[static_cast<std::size_t>(camera)].id ? named : others) = true;
          }
          Json run = ToJson(ErrorsOf(r, truth));
          run["survey"] = name, run["camera"] = camera, run["named"] = named, run["others"] = others;
          out.push_back(run);
        }
    }
    return out;
  }

  // What is known of the T joint's photographs (shared/README.md) where the survey's file has no place for
  // it.
  static void KnownOfJoint(ReconstructOptions& o) {
    o.picture_position_sigma_mm = 1, o.picture_rotation_sigma_mrad = 1;  // 0.3 to 1.2 mm, 0.2 to 2 mrad
    o.allow_ground = false, o.ground_sigma_mm = 0.4;  // the table was measured: z = 0, 0.4 mm RMS
    o.contact_sigma_mm = 0.5;                         // a gap that is welded shut
  }

  // The T joint: two halves of its photographs against each other, both started from the same parts.
  Json Halves() const {
    const fs::path folder = args_.shared / "real/t-joint";
    const Survey survey = OrStop(ReadSurvey(folder));
    SurveyOptions options = OrStop(OptionsOf(survey));
    options.threads = args_.threads;
    const bool identified = args_.joint == "identified";
    KnownOfJoint(options.reconstruct);
    const Product product =
        identified ? OrStop(RunSurvey(survey, options, {})).product : OrStop(ReadProduct(args_.joint, {}));
    std::vector<IdentifiedPart> start;
    for (const auto& part : product.parts) {
      IdentifiedPart& p = start.emplace_back();
      p.object = ObjectOf(part);
      for (std::size_t i = 0; i < product.parts.size(); ++i)
        if (product.parts[i].id == part.stands_on) p.stands_on = static_cast<int>(i);
    }
    std::vector<Reconstruction> halves;
    Json out = {
        {"dimensions", Json::array()}, {"residual_px", Json::array()}, {"photographs", Json::array()}};
    out["start"] =
        identified ? "what identification makes of all together"
                   : "two plates read off the photographs by hand to some 5 mm "
                     "(`benchmarks/accuracy/t-joint.json`; `--joint identified` starts from identification)";
    for (const int half : {-1, 0, 1}) {
      const LoadedSurvey data(survey, args_.threads,
                              [&](int image, int) { return half < 0 || image % 2 == half; });
      halves.push_back(
          OrStop(ReconstructScene(data.views, data.pictures, start, options.reconstruct, args_.threads, {})));
      out["photographs"].push_back(data.views.size());
      Json residuals = Json::array();
      for (const auto& p : halves.back().parts) residuals.push_back(p.residual_px);
      out["residual_px"].push_back(residuals);
      out["mm_per_px"] = TypicalMmPerPx(data.views);
      out["systematic_px"] = halves.back().systematic_px;
    }
    for (std::size_t p = 0; p < start.size(); ++p)
      for (std::size_t i = 0; i < halves[0].parts[p].dimensions.size(); ++i) {
        Json d = {{"part", p + 1}, {"name", halves[0].parts[p].dimensions[i].name}};
        for (std::size_t h = 0; h < halves.size(); ++h) {
          const auto& value = halves[h].parts[p].dimensions[i];
          d["value"].push_back(value.value_mm);
          d["sigma"].push_back(value.sigma_mm);
          d["observable"].push_back(value.observable);
        }
        out["dimensions"].push_back(d);
      }
    return out;
  }

  static double ProcessorSeconds() {
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }

  // Twelve parts in 56 pictures.
  Json Speed() const {
    RandomSceneOptions options;
    options.seed = 12;
    options.num_parts = 12;
    options.clutter = false;
    options.rig.stops = {7, 2};
    const SimulatedScene scene = OrStop(DrawRandomScene(options, knowledge_));
    std::vector<Camera> cameras;
    for (const auto& c : scene.cameras) cameras.push_back(c.camera);
    const Rendered r = Render(scene, cameras);
    const auto truth = PartsOf(scene);
    std::mt19937 random(1);
    const auto start = Moved(truth, 8, 0.5, random);
    Json out = {{"parts", truth.size()}, {"pictures", r.views.size()}, {"threads", args_.threads}};
    double joint = INFINITY, processor = INFINITY;
    std::optional<Reconstruction> result;
    for (int k = 0; k < 3; ++k) {  // the best of three: the machine has other work too
      const auto begin = std::chrono::steady_clock::now();
      const double busy = ProcessorSeconds();
      result = OrStop(ReconstructScene(r.views, r.pictures, start, {}, args_.threads, {}));
      joint = std::min(joint, Seconds(begin));
      processor = std::min(processor, ProcessorSeconds() - busy);
    }
    out["joint_s"] = joint;
    out["processor_s"] = processor;
    out["errors"] = ToJson(ErrorsOf(*result, truth));
    std::vector<WorldSolid> solids;
    for (const auto& p : truth) solids.push_back(PlaceSolid(p.object, false));
    const auto others = OthersOf(solids);
    int pairs = 0;
    const double busy = ProcessorSeconds();
    for (std::size_t v = 0; v < r.views.size(); ++v) {
      const auto measured = MeasureView(solids, others, r.views[v], static_cast<int>(v), r.pictures[v],
                                        {0.62, 0.1, r.lines[v].noise_sigma}, {});
      std::set<int> parts;
      for (const auto& g : measured.groups) parts.insert(g.part);
      pairs += static_cast<int>(parts.size());
    }
    const double seconds = ProcessorSeconds() - busy;
    out["alignment_ms"] = 1000 * seconds / pairs;
    return out;
  }

  // --- simulated ---

  Json Noise() const {
    Json out = {{"parts", Json::array()}, {"trials", args_.trials}};
    std::vector<Json> trials(static_cast<std::size_t>(args_.trials)), bounds = trials;
    ParallelFor(trials.size(), args_.threads, [&](std::size_t i) {
      const std::string file = fmt::format("{}.json", i + 1);
      bounds[i] = Kept(args_.out / "bounds" / file, [&] { return NoiseBound(i + 1, knowledge_); });
      trials[i] = Kept(args_.out / "noise" / file, [&] { return NoiseTrial(i + 1, knowledge_); });
    });
    for (std::size_t i = 0; i < trials.size(); ++i)
      for (std::size_t p = 0; p < trials[i].size(); ++p) {
        out["parts"].push_back(trials[i][p]);
        out["parts"].back()["bounds"] = bounds[i][p]["sigmas"];
        out["parts"].back()["vertices"] = {trials[i][p]["vertices"], bounds[i][p]["vertices"]};
      }
    return out;
  }

  std::vector<Camera> CalibratedRig() const {
    std::vector<Camera> calibrated;
    for (const auto& file : {"cam1", "cam2", "cam3", "cam4"}) {
      calibrated.push_back(OrStop(ReadCamera(CalibratedCameras() / (std::string(file) + ".toml"))));
      calibrated.back().gantry_axes.reset();  // the simulated carriage moves as it says
    }
    return calibrated;
  }

  void ShowScene(int seed) const {
    (void)CalibratedTrial(static_cast<std::uint64_t>(seed), knowledge_, CalibratedRig(), true);
  }

  Json Coverage() const {
    const std::vector<Camera> calibrated = CalibratedRig();
    std::vector<Json> scenes(static_cast<std::size_t>(args_.scenes));
    ParallelFor(scenes.size(), args_.threads, [&](std::size_t i) {
      const auto seed = static_cast<std::uint64_t>(args_.first_scene) + i;
      scenes[i] = Kept(args_.out / "scenes" / fmt::format("{}.json", seed),
                       [&] { return CalibratedTrial(seed, knowledge_, calibrated); });
    });
    Errors all;
    for (const auto& s : scenes)
      for (const auto& p : s["parts"]) {
        Errors e;
        e.vertex_mm = p["vertex_mm"].get<std::vector<double>>();
        e.vertex_z = p["vertex_z"].get<std::vector<double>>();
        e.dimension_mm = p["dimension_mm"].get<std::vector<double>>();
        e.dimension_z = p["dimension_z"].get<std::vector<double>>();
        e.region = p["region"].get<std::vector<double>>();
        e.region_size = p["region_size"].get<std::vector<int>>();
        e.not_observable = p["not_observable"];
        all.Add(e);
      }
    Json out = ToJson(all);
    out["scenes"] = scenes.size();
    out["parts"] = all.region.size();
    out["regions_cover"] = RegionsCover(all);
    out["dimension_intervals_cover"] = Within(all.dimension_z, 1.96);
    out["vertex_intervals_cover"] = Within(all.vertex_z, 1.96);
    out["dimension_z"] = Rms(all.dimension_z);
    out["dimension_z_median"] = Quantile(all.dimension_z, 0.5);
    return out;
  }

  Json Run(const std::string& study) const {
    if (study == "surveys") return Surveys();
    if (study == "single-stop") return SingleStop();
    if (study == "knocked") return Knocked();
    if (study == "halves") return Halves();
    if (study == "speed") return Speed();
    if (study == "noise") return Noise();
    return Coverage();
  }

 private:
  PlacedObject ObjectOf(const Part& part) const {
    PlacedObject o;
    o.model = knowledge_.Find(part.kind);
    const auto poses = o.model->resting_poses();
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (poses[i].name == part.resting_pose) o.resting_pose = static_cast<int>(i);
    for (const auto& def : o.model->dimensions())
      for (const auto& d : part.dimensions)
        if (d.name == def.name) o.dimensions_mm.push_back(d.value_mm);
    o.placement[3] = part.yaw_rad;
    // Where the part frame comes to lie is linear in the place.
    const Eigen::Vector3d at_zero = PlaceSolid(o, false).world_from_part.translation;
    o.placement.head<3>() = part.world_from_part.translation - at_zero;
    return o;
  }

  const Arguments& args_;
  KnowledgeBase knowledge_;
};

// --- the section ---

std::string SurveyRows(const Json& s) {
  std::string out =
      "| survey | parts found | vertices mean, p95 (mm) | goal, mean | dimensions, mean (mm) | within 2 "
      "sigma | "
      "not observable | from true identification: vertices, dimensions (mm), within 2 sigma |\n"
      "|---|---|---|---|---|---|---|---|\n";
  const std::map<std::string, std::string> goals = {{"lab-1", "0.5"},   {"lab-2", "0.5"},
                                                    {"panel-3", "1.0"}, {"round-4", "1.0"},
                                                    {"yard-5", "1.0"},  {"lab-1, rig-1", "0.6, p95 1.2"}};
  for (const auto& [name, both] : s.items()) {
    const auto &a = both["survey"], &t = both["truth"];
    out += fmt::format(
        "| {} | {} of {} | {:.2f}, {:.2f} | {} | {:.2f} | {:.0f} % of {} | {} | {:.2f}, {:.2f}, {:.0f} % |\n",
        name, a["found"].get<int>(), a["parts"].get<int>(), a["mean_mm"].get<double>(),
        a["p95_mm"].get<double>(), goals.at(name), a["dimension_mm"].get<double>(),
        a["within_2_sigma"].get<double>(), a["dimensions"].get<int>(), a["not_observable"].get<int>(),
        t["mean_mm"].get<double>(), t["dimension_mm"].get<double>(), t["within_2_sigma"].get<double>());
  }
  return out +
         "\nGoals for all: dimensions 0.4 mm in the mean, 92 to 98 % within 2 sigma. `lab-1, rig-1`: the "
         "cameras are those that `vss calibrate` gives.\n";
}

std::string SingleStopText(const Json& s) {
  std::string out = "\nThe four pictures of a single stop, every stop in turn: ";
  for (const auto& [name, r] : s.items())
    out += fmt::format(
        "{}: {} dimensions observed, {:.2f} mm off in the mean, {:.0f} % within 2 sigma (goal: 92 to 98), "
        "{} said to be not observable; ",
        name, r["dimensions"].get<int>(), r["dimension_mm"].get<double>(), r["within_2_sigma"].get<double>(),
        r["not_observable"].get<int>());
  out.replace(out.size() - 2, 2, ".\n");
  return out;
}

std::string KnockedText(const Json& runs) {
  int named = 0, wrong = 0;
  std::vector<double> means;
  for (const auto& r : runs) {
    named += r["named"].get<bool>();
    wrong += r["others"].get<bool>();
    means.push_back(r["mean_mm"]);
  }
  return fmt::format(
      "\nA camera knocked by 0.3 mrad and 1 mm (each camera of both lab surveys in turn, two directions "
      "each): named in {} of {} runs, "
      "another one named in {}; vertex error {:.2f} mm in the mean run, {:.2f} mm in the worst (goal: named, "
      "below 1 mm).\n",
      named, means.size(), wrong, Mean(means), Quantile(means, 1));
}

constexpr double kMedianOfChiSquare = 0.4549;  // one degree of freedom

std::string NoiseText(const Json& n) {
  std::vector<double> ratios;
  double squares = 0, variance = 0;
  int left_out = 0;
  for (const auto& p : n["parts"]) {
    if (!p["observable"]) {
      ++left_out;
      continue;
    }
    for (std::size_t i = 0; i < p["errors"].size(); ++i)
      ratios.push_back(std::pow(p["errors"][i].get<double>() / p["bounds"][i].get<double>(), 2));
    squares += p["vertices"][0].get<double>(), variance += p["vertices"][1].get<double>();
  }
  return fmt::format(
      "\nNoise alone ({} simulated scenes of four parts, {} grey levels; cameras and ground known, even "
      "light, no "
      "texture): mean squared error over the Cramer-Rao bound (levels and blur known, every pixel of the "
      "pictures): {:.2f} over {} unknowns, {:.2f} in the median one, {:.2f} over the vertices (goal: 1.5); "
      "{} parts with a "
      "dimension that is not observable left out.\n",
      n["trials"].get<int>(), kNoise, Mean(ratios), ratios.size(), Quantile(ratios, 0.5) / kMedianOfChiSquare,
      squares / variance, left_out);
}

std::string CoverageText(const Json& c) {
  return fmt::format(
      "\nAll that disturbs ({} simulated scenes, {} parts in eight pictures each, shadows, texture, noise; "
      "calibration errors drawn from the covariance of `vss calibrate`, stops 0.15 mm off): 95 % regions of "
      "the parts (place and dimensions together) hold the truth in {:.1f} % (goal: 92 to 98), 95 % intervals "
      "of the {} dimensions in {:.1f} %, of "
      "the vertices' coordinates in {:.1f} %; vertices {:.2f} mm, dimensions {:.2f} mm off in the mean, {} "
      "dimensions not observable.\n",
      c["scenes"].get<int>(), c["parts"].get<int>(), c["regions_cover"].get<double>(),
      c["dimensions"].get<int>(), c["dimension_intervals_cover"].get<double>(),
      c["vertex_intervals_cover"].get<double>(), c["mean_mm"].get<double>(), c["dimension_mm"].get<double>(),
      c["not_observable"].get<int>());
}

std::string HalvesText(const Json& h) {
  std::string rows;
  std::vector<double> differences, z;
  for (const auto& d : h["dimensions"]) {
    const bool both = d["observable"][1].get<bool>() && d["observable"][2].get<bool>();
    const double difference = d["value"][1].get<double>() - d["value"][2].get<double>();
    const double sigma = std::hypot(d["sigma"][1].get<double>(), d["sigma"][2].get<double>());
    const auto shown = [&](std::size_t k) {
      return d["observable"][k].get<bool>()
                 ? fmt::format("{:.2f} ± {:.2f}", d["value"][k].get<double>(), d["sigma"][k].get<double>())
                 : std::string("not observable");
    };
    rows +=
        fmt::format("| {} {} | {} | {} | {} | {} |\n", d["part"].get<int>(), d["name"].get<std::string>(),
                    shown(0), shown(1), shown(2),
                    both ? fmt::format("{:.2f} mm, {:.1f} sigma", difference, std::abs(difference) / sigma)
                         : std::string("-"));
    if (!both) continue;
    differences.push_back(std::abs(difference));
    z.push_back(std::abs(difference) / sigma);
  }
  double residual = 0;
  for (const auto& r : h["residual_px"][0]) residual = std::max(residual, r.get<double>());
  return fmt::format(
             "\nThe T joint (real photographs, no dimension known): every second photograph against the "
             "others, both started from {}. {:.2f} mm in the median, {:.1f} sigma at most (goals: 0.7 mm, 3 "
             "sigma); in the mean of a photograph the contours lie {:.1f} px RMS off the edges ({:.2f} mm). "
             "By the overlays what is left is the plates' own: edges that are flame-cut, grooved and rounded "
             "by up "
             "to a millimetre, so that from another side another line is the edge; that was not tested by "
             "itself.\n\n"
             "| part, dimension | all (mm) | one half | other half | difference |\n|---|---|---|---|---|\n",
             h["start"].get<std::string>(), Quantile(differences, 0.5), Quantile(z, 1), residual,
             residual * h["mm_per_px"].get<double>()) +
         rows;
}

std::string SpeedText(const Json& s) {
  return fmt::format(
      "\nSpeed: {} parts in {} pictures jointly {:.2f} s of processor time, {:.2f} s by the clock on {} "
      "cores of a machine that has other "
      "work too (goal: 2 s on 2 cores); dense alignment {:.2f} ms a part and picture on one core (goal: "
      "5).\n",
      s["parts"].get<int>(), s["pictures"].get<int>(), s["processor_s"].get<double>(),
      s["joint_s"].get<double>(), s["threads"].get<int>(), s["alignment_ms"].get<double>());
}

constexpr const char* kBegin = "<!-- accuracy_reconstruct_figures: from here -->\n";
constexpr const char* kEnd = "<!-- accuracy_reconstruct_figures: to here -->\n";

void WriteSection(const fs::path& readme, const std::string& section) {
  std::string text = OrStop(ReadTextFile(readme));
  const auto begin = text.find(kBegin), end = text.find(kEnd);
  if (begin == std::string::npos || end == std::string::npos || end < begin)
    Stop(fmt::format("{}: the two lines {} and {} are missing; put them where the section shall stand",
                     readme.string(), std::string(kBegin), std::string(kEnd)));
  const auto from = begin + std::string(kBegin).size();
  text.replace(from, end - from, section);
  OrStop(WriteFileAtomically(readme, text));
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments args = Parse(argc, argv);
  const Studies studies(args);
  const std::pair<std::string, std::string (*)(const Json&)> all[] = {
      {"surveys", SurveyRows},  {"single-stop", SingleStopText}, {"noise", NoiseText},
      {"scenes", CoverageText}, {"knocked", KnockedText},        {"halves", HalvesText},
      {"speed", SpeedText}};
  if (args.show_scene > 0) {
    studies.ShowScene(args.show_scene);
    return 0;
  }
  std::string section;
  for (const auto& [name, text] : all) {
    const fs::path file = args.out / (name + ".json");
    if (!args.only.empty() && !args.only.contains(name) && !fs::exists(file)) continue;
    const auto result = Kept(file, [&] { return studies.Run(name); });
    const std::string part = text(result);
    std::cout << part << std::flush;
    section += part;
  }
  if (args.write.empty()) return 0;
  WriteSection(args.write, section);
}
