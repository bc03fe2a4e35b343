// How accurate reconstruction is, without identification: starts from the truth of a survey, moved at random,
// and compares what comes out with the truth.
//
//   accuracy_reconstruct SURVEY_FOLDER [--move MM] [--turn DEG] [--seed N] [--threads N] [--stop N] [--knock
//   MRAD,MM]
//                     [--cameras FOLDER] [--product FILE] [--verbose] [--set NAME=VALUE]...
#include "reconstruct_survey.h"

namespace {

using namespace vss;
using namespace vss::benchmark;
using Eigen::Vector3d;
using nlohmann::json;

struct Arguments {
  std::string survey, product, cameras;
  double move_mm = 8, turn_deg = 0.5, knock_mrad = 0, knock_mm = 0;
  unsigned seed = 1;
  int threads = 2, stop = -1;
  bool verbose = false;
  ReconstructOptions options;
};

Arguments Parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i < argc; ++i) {
    const std::string s = argv[i];
    auto next = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (s == "--move")
      a.move_mm = std::stod(next());
    else if (s == "--turn")
      a.turn_deg = std::stod(next());
    else if (s == "--seed")
      a.seed = static_cast<unsigned>(std::stoi(next()));
    else if (s == "--threads")
      a.threads = std::stoi(next());
    else if (s == "--stop")
      a.stop = std::stoi(next());
    else if (s == "--knock") {
      const std::string v = next();
      a.knock_mrad = std::stod(v);
      a.knock_mm = std::stod(v.substr(v.find(',') + 1));
    } else if (s == "--cameras")
      a.cameras = next();
    else if (s == "--product")
      a.product = next();
    else if (s == "--verbose")
      a.verbose = true;
    else if (s == "--set") {
      const std::string v = next();
      const auto at = v.find('=');
      const auto set =
          SetParameter(ReconstructParameters(), v.substr(0, at), std::stod(v.substr(at + 1)), a.options);
      if (!set || !*set) std::cerr << "no such parameter: " << v << "\n", std::exit(2);
    } else
      a.survey = s;
  }
  return a;
}

json ProductOf(const Reconstruction& r) {
  json parts = json::array();
  for (std::size_t i = 0; i < r.parts.size(); ++i) {
    const auto& p = r.parts[i];
    json dims, vertices = json::array(), circles = json::array();
    for (const auto& d : p.dimensions)
      dims[d.name] = {{"value", d.value_mm}, {"sigma", d.sigma_mm}, {"observable", d.observable}};
    const auto solid = PlaceSolid(p.object);
    for (const auto& v : solid.vertices) vertices.push_back({v.point.x(), v.point.y(), v.point.z()});
    for (const auto& c : solid.circles)
      circles.push_back({{"center", {c.center.point.x(), c.center.point.y(), c.center.point.z()}},
                         {"radius", c.radius_mm}});
    parts.push_back({{"id", "part-" + std::to_string(i + 1)},
                     {"kind", p.object.model->kind()},
                     {"dimensions", dims},
                     {"vertices", vertices},
                     {"circles", circles}});
  }
  return {{"parts", parts}};
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments args = Parse(argc, argv);
  std::optional<std::filesystem::path> cameras;
  if (!args.cameras.empty()) cameras = args.cameras;
  Survey survey = OrStop(ReadSurvey(args.survey, cameras));
  const KnowledgeBase knowledge = OrStop(LoadKnowledge({}, "."));
  std::mt19937 random(args.seed);
  if (args.knock_mrad > 0) {  // the first camera, after calibration
    const Vector3d turn = args.knock_mrad * 1e-3 * RandomDirection(random);
    Knock(survey, 0, turn, args.knock_mm * RandomDirection(random));
  }
  const LoadedSurvey data(survey, args.threads,
                          [&](int, int stop) { return args.stop < 0 || stop == args.stop; });
  const auto true_parts = TrueParts(args.survey, knowledge);
  const auto start = Moved(true_parts, args.move_mm, args.turn_deg, random);
  const auto begin = std::chrono::steady_clock::now();
  const auto result = ReconstructScene(data.views, data.pictures, start, args.options, args.threads, {});
  const double seconds = Seconds(begin);
  if (!result) Stop(result.error().message);
  if (!args.product.empty()) (void)WriteFileAtomically(args.product, ProductOf(*result).dump(1));

  const Errors errors = ErrorsOf(*result, true_parts);
  for (std::size_t p = 0; p < true_parts.size(); ++p) {
    const auto& part = result->parts[p];
    fmt::print("{:>3} {:<12} vertices {:7.3f} mm  residual {:.3f} px  {} views{}\n", p + 1,
               part.object.model->kind(), Mean(ErrorsOf(part, true_parts[p].object).vertex_mm),
               part.residual_px, part.views.size(), part.leans ? "  LEANS" : "");
    for (std::size_t i = 0; i < part.dimensions.size(); ++i) {
      const auto& d = part.dimensions[i];
      const double e = d.value_mm - true_parts[p].object.dimensions_mm[i];
      if (!d.observable)
        fmt::print("      {:<14} not observable\n", d.name);
      else if (args.verbose)
        fmt::print("      {:<14} {:10.3f} error {:7.3f} sigma {:6.3f} z {:5.1f}\n", d.name, d.value_mm, e,
                   d.sigma_mm, e / d.sigma_mm);
    }
    if (args.verbose) {
      const auto e = (part.object.placement - true_parts[p].object.placement).eval();
      for (int i = 0; i < 6; ++i)
        fmt::print("      {:<14} error {:9.5f} sigma {:8.5f}\n", i, e[i], std::sqrt(part.covariance(i, i)));
      std::map<std::tuple<int, int, int>, std::vector<EdgeResidual>> edges;
      for (const auto& r : part.edges) edges[{static_cast<int>(r.source), r.index, r.limb_side}].push_back(r);
      for (const auto& [key, list] : edges) {
        double m = 0, s = 0, points = 0, used = 0;
        for (const auto& r : list)
          if (r.used) m += r.mean_px, s += r.mean_px * r.mean_px, points += r.num_points, ++used;
        fmt::print(
            "      {} {:>2} {:>2} class {} views {:>2} used {:>2} points {:>5} mean {:7.3f} rms {:6.3f}\n",
            std::get<0>(key), std::get<1>(key), std::get<2>(key), static_cast<int>(list[0].edge_class),
            list.size(), used, points, m / std::max(used, 1.0), std::sqrt(s / std::max(used, 1.0)));
      }
    }
    for (const auto& s : part.remarks) fmt::print("      {}\n", s);
  }
  fmt::print(
      "systematic px free {:.3f} contact {:.3f} round {:.3f}; prior scales camera {:.3f} stop {:.3f}; {} "
      "observations\n",
      result->systematic_px[0], result->systematic_px[1], result->systematic_px[2], result->camera_scale,
      result->stop_scale, result->num_observations);
  if (args.verbose)
    for (const auto& c : result->cameras)
      fmt::print(
          "camera {} rotation {:.3f} {:.3f} {:.3f} mrad (+- {:.3f}) shift {:.3f} {:.3f} {:.3f} mm (+- "
          "{:.3f}) significance {:.2f}\n",
          c.camera, c.rotation_rad.x() * 1e3, c.rotation_rad.y() * 1e3, c.rotation_rad.z() * 1e3,
          c.rotation_sigma_rad.norm() * 1e3, c.shift_mm.x(), c.shift_mm.y(), c.shift_mm.z(),
          c.shift_sigma_mm.norm(), c.significance);
  for (const auto& w : result->warnings) fmt::print("{}\n", w);
  fmt::print(
      "{}: mean {:.3f} mm max {:.3f}; dimensions {} mean {:.3f} mm, within 2 sigma {:.1f} %, rms z {:.2f}, "
      "{} not observable; vertex rms z {:.2f}; {:.2f} s\n",
      survey.name, Mean(errors.vertex_mm), Quantile(errors.vertex_mm, 1), errors.dimension_mm.size(),
      Mean(errors.dimension_mm), Within(errors.dimension_z, 2), Rms(errors.dimension_z),
      errors.not_observable, Rms(errors.vertex_z), seconds);
}
