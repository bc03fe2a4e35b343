// How accurate reconstruction is, without identification: starts from the truth of a survey, moved at random,
// and compares what comes out with the truth.
//
//   accuracy_reconstruct SURVEY_FOLDER [--move MM] [--turn DEG] [--seed N] [--threads N] [--stop N] [--knock
//   MRAD,MM]
//                     [--cameras FOLDER] [--product FILE] [--verbose] [--set NAME=VALUE]...
#include "vss/reconstruct/reconstruct.h"

#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>

#include "vss/base/files.h"
#include "vss/base/parallel.h"
#include "vss/knowledge/object_model.h"
#include "vss/survey/survey.h"

namespace {

using namespace vss;
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

IdentifiedPart Truth(const json& part, const KnowledgeBase& knowledge, const json& all) {
  IdentifiedPart p;
  p.object.model = knowledge.Find(part["kind"]);
  const auto& pose = part["pose"];
  p.object.placement << pose["x"], pose["y"], pose["z"], RadFromDeg(pose["yaw"]), 0, 0;
  for (const auto& d : p.object.model->dimensions()) p.object.dimensions_mm.push_back(part["dims"][d.name]);
  if (part["on"] != "ground")
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all[i]["id"] == part["on"]) p.stands_on = static_cast<int>(i);
  return p;
}

double Seconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
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

int Fail(const Error& e) {
  std::cerr << e.message << "\n";
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments args = Parse(argc, argv);
  std::optional<std::filesystem::path> cameras;
  if (!args.cameras.empty()) cameras = args.cameras;
  auto survey = ReadSurvey(args.survey, cameras);
  if (!survey) return Fail(survey.error());
  const auto knowledge = LoadKnowledge({}, ".");
  if (!knowledge) return Fail(knowledge.error());
  json truth;
  std::ifstream(std::filesystem::path(args.survey) / "truth.json") >> truth;

  std::mt19937 random(args.seed);
  std::normal_distribution<double> normal;
  if (args.knock_mrad > 0) {  // the first camera, after calibration
    Vector3d w(normal(random), normal(random), normal(random)),
        t(normal(random), normal(random), normal(random));
    w *= args.knock_mrad * 1e-3 / w.norm();
    t *= args.knock_mm / t.norm();
    for (auto& image : survey->images)
      if (image.camera == 0) {
        auto& c = image.cam_from_world;
        const Vector3d center = c.Inverse().translation + t;
        c.rotation = RotationFromVector(w) * c.rotation;
        c.translation = -(c.rotation * center);
      }
  }
  std::vector<GreyImage> images;
  std::vector<LineImage> lines(survey->images.size());
  std::vector<View> views;
  std::vector<GreyView> pictures;
  std::map<std::array<double, 3>, int> stops;
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < survey->images.size(); ++i) {
    const auto& g = survey->images[i].gantry_mm;
    const int stop =
        g ? stops.insert({{g->x(), g->y(), g->z()}, static_cast<int>(stops.size())}).first->second : -1;
    if (args.stop >= 0 && stop != args.stop) continue;
    auto image = ReadImage(survey->images[i].path);
    if (!image) return Fail(image.error());
    const Camera& camera = survey->cameras[static_cast<std::size_t>(survey->images[i].camera)];
    if (camera.response == Response::kSrgb) *image = LinearFromSrgb(image->view());
    images.push_back(std::move(*image));
    chosen.push_back(i);
    views.push_back(MakeView(static_cast<int>(i), camera, survey->images[i].cam_from_world, stop, &lines[i]));
  }
  ParallelFor(views.size(), args.threads, [&](std::size_t v) {
    lines[chosen[v]] = DetectLines(images[v].view(), &views[v].camera->intrinsics, {});
  });
  for (const auto& i : images) pictures.push_back(i.view());

  std::vector<IdentifiedPart> true_parts, start;
  for (const auto& p : truth["parts"]) true_parts.push_back(Truth(p, *knowledge, truth["parts"]));
  for (auto p : true_parts) {
    for (int i = 0; i < 2; ++i) p.object.placement[i] += args.move_mm * normal(random);
    p.object.placement[3] += RadFromDeg(args.turn_deg) * normal(random);
    for (auto& d : p.object.dimensions_mm)
      d = std::max(0.6 * d, d + (d < 60 ? 0.3 : 1) * args.move_mm * normal(random));
    start.push_back(p);
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto result = ReconstructScene(views, pictures, start, args.options, args.threads, {});
  const double seconds = Seconds(begin);
  if (!result) return Fail(result.error());
  if (!args.product.empty()) (void)WriteFileAtomically(args.product, ProductOf(*result).dump(1));

  std::vector<double> vertex, dim, z, vertex_z;
  int hidden = 0;
  for (std::size_t p = 0; p < true_parts.size(); ++p) {
    const auto a = PlaceSolid(result->parts[p].object), b = PlaceSolid(true_parts[p].object);
    double sum = 0, n = 0;
    for (std::size_t i = 0; i < a.vertices.size(); ++i) {
      const Vector3d e = a.vertices[i].point - b.vertices[i].point;
      vertex.push_back(e.norm());
      sum += e.norm(), ++n;
      for (int k = 0; k < 3; ++k)
        if (result->parts[p].vertex_sigma[i][k] > 0)
          vertex_z.push_back(std::abs(e[k]) / result->parts[p].vertex_sigma[i][k]);
    }
    for (std::size_t i = 0; i < a.circles.size(); ++i) {
      vertex.push_back(std::hypot((a.circles[i].center.point - b.circles[i].center.point).norm(),
                                  a.circles[i].radius_mm - b.circles[i].radius_mm));
      sum += vertex.back(), ++n;
    }
    const auto& part = result->parts[p];
    fmt::print("{:>3} {:<12} vertices {:7.3f} mm  residual {:.3f} px  {} views{}\n", p + 1,
               part.object.model->kind(), sum / n, part.residual_px, part.views.size(),
               part.leans ? "  LEANS" : "");
    for (std::size_t i = 0; i < part.dimensions.size(); ++i) {
      const auto& d = part.dimensions[i];
      const double e = d.value_mm - true_parts[p].object.dimensions_mm[i];
      if (!d.observable) {
        ++hidden;
        fmt::print("      {:<14} not observable\n", d.name);
        continue;
      }
      dim.push_back(std::abs(e));
      z.push_back(std::abs(e) / d.sigma_mm);
      if (args.verbose)
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
  auto mean = [](const std::vector<double>& v) {
    double s = 0;
    for (double x : v) s += x;
    return v.empty() ? NAN : s / static_cast<double>(v.size());
  };
  auto within = [](const std::vector<double>& v, double k) {
    double n = 0;
    for (double x : v) n += x <= k;
    return v.empty() ? NAN : 100 * n / static_cast<double>(v.size());
  };
  auto rms = [](const std::vector<double>& v) {
    double s = 0;
    for (double x : v) s += x * x;
    return std::sqrt(s / static_cast<double>(v.size()));
  };
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
      survey->name, mean(vertex), vertex.empty() ? 0 : *std::max_element(vertex.begin(), vertex.end()),
      dim.size(), mean(dim), within(z, 2), rms(z), hidden, rms(vertex_z), seconds);
}
