// What the reconstruction benchmarks share: a survey in memory with its truth, and how far a reconstruction
// lies from it.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "vss/base/files.h"
#include "vss/base/parallel.h"
#include "vss/product/compare.h"
#include "vss/reconstruct/reconstruct.h"
#include "vss/survey/survey.h"

namespace vss::benchmark {

[[noreturn]] inline void Stop(const std::string& message) {
  std::cerr << message << "\n";
  std::exit(1);
}
template <class T>
T OrStop(Result<T> result) {
  if (!result) Stop(result.error().message);
  return std::move(*result);
}
inline void OrStop(const Status& status) {
  if (!status) Stop(status.error().message);
}

inline double Seconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
}

// Pictures, lines and views of a survey, or of those of its pictures that `wanted` takes. Views point into
// it: it stays where it is.
struct LoadedSurvey {
  Survey survey;
  std::vector<GreyImage> images;
  std::vector<LineImage> lines;
  std::vector<View> views;
  std::vector<GreyView> pictures;

  LoadedSurvey(Survey s, int threads, const std::function<bool(int image, int stop)>& wanted = {})
      : survey(std::move(s)) {
    std::map<std::array<double, 3>, int> stops;
    for (std::size_t i = 0; i < survey.images.size(); ++i) {
      const auto& image = survey.images[i];
      const auto& g = image.gantry_mm;
      const int stop =
          g ? stops.insert({{g->x(), g->y(), g->z()}, static_cast<int>(stops.size())}).first->second : -1;
      if (wanted && !wanted(static_cast<int>(i), stop)) continue;
      const Camera& camera = survey.cameras[static_cast<std::size_t>(image.camera)];
      GreyImage picture = OrStop(ReadImage(image.path));
      images.push_back(camera.response == Response::kSrgb ? LinearFromSrgb(picture.view())
                                                          : std::move(picture));
      views.push_back(MakeView(static_cast<int>(i), camera, image.cam_from_world, stop, nullptr));
    }
    lines.resize(views.size());
    ParallelFor(views.size(), threads, [&](std::size_t v) {
      lines[v] = DetectLines(images[v].view(), &views[v].camera->intrinsics, {});
    });
    for (std::size_t v = 0; v < views.size(); ++v) {
      views[v].lines = &lines[v];
      pictures.push_back(images[v].view());
    }
  }
  LoadedSurvey(const LoadedSurvey&) = delete;
};

// The parts of a rendered survey's truth.json.
inline std::vector<IdentifiedPart> TrueParts(const std::filesystem::path& survey_folder,
                                             const KnowledgeBase& knowledge) {
  const auto parts = nlohmann::json::parse(OrStop(ReadTextFile(survey_folder / "truth.json")))["parts"];
  std::vector<IdentifiedPart> out;
  for (const auto& part : parts) {
    IdentifiedPart& p = out.emplace_back();
    p.object.model = knowledge.Find(part["kind"].get<std::string>());
    if (!p.object.model) Stop("no such kind: " + part["kind"].get<std::string>());
    const auto& pose = part["pose"];
    p.object.placement << pose["x"], pose["y"], pose["z"], RadFromDeg(pose["yaw"]), 0, 0;
    for (const auto& d : p.object.model->dimensions()) p.object.dimensions_mm.push_back(part["dims"][d.name]);
    for (std::size_t i = 0; i < parts.size(); ++i)
      if (parts[i]["id"] == part["on"]) p.stands_on = static_cast<int>(i);
  }
  return out;
}

// As identification leaves parts: places off by `move_mm`, yaw by `turn_deg`, dimensions like the places,
// thicknesses less.
inline std::vector<IdentifiedPart> Moved(std::vector<IdentifiedPart> parts, double move_mm, double turn_deg,
                                         std::mt19937& random) {
  std::normal_distribution<double> normal;
  constexpr double kThinMm = 60, kThinShare = 0.3, kLeastShare = 0.6;
  for (auto& p : parts) {
    for (int i = 0; i < 2; ++i) p.object.placement[i] += move_mm * normal(random);
    p.object.placement[3] += RadFromDeg(turn_deg) * normal(random);
    for (auto& d : p.object.dimensions_mm) {
      const double moved = d + (std::abs(d) < kThinMm ? kThinShare : 1) * move_mm * normal(random);
      d = d > 0 ? std::max(kLeastShare * d, moved) : moved;  // where a hole lies may be negative
    }
  }
  return parts;
}

// Turns camera `camera` and moves its centre in all pictures of the survey.
inline void Knock(Survey& survey, int camera, const Eigen::Vector3d& turn_rad, const Eigen::Vector3d& by_mm) {
  for (auto& image : survey.images) {
    if (image.camera != camera) continue;
    auto& c = image.cam_from_world;
    const Eigen::Vector3d center = c.Inverse().translation + by_mm;
    c.rotation = RotationFromVector(turn_rad) * c.rotation;
    c.translation = -(c.rotation * center);
  }
}

inline Eigen::Vector3d RandomDirection(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
}

// Errors against the truth, as tools measure them: of every vertex and circle; of every dimension that is
// called observable, over its sigma too.
struct Errors {
  std::vector<double> vertex_mm, dimension_mm, dimension_z, vertex_z;
  std::vector<double> region;  // of each part: squared error of what is observable, as a chi-square
  std::vector<int> region_size;
  int not_observable = 0;

  void Add(const Errors& o) {
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(vertex_mm, o.vertex_mm), append(dimension_mm, o.dimension_mm);
    append(dimension_z, o.dimension_z), append(vertex_z, o.vertex_z);
    append(region, o.region), append(region_size, o.region_size);
    not_observable += o.not_observable;
  }
};

inline Errors ErrorsOf(const ReconstructedPart& part, const PlacedObject& truth) {
  Errors e;
  const auto a = PlaceSolid(part.object, false), b = PlaceSolid(truth, false);
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    const Eigen::Vector3d d = a.vertices[i].point - b.vertices[i].point;
    e.vertex_mm.push_back(d.norm());
    for (int k = 0; k < 3; ++k)
      if (part.vertex_sigma[i][k] > 0) e.vertex_z.push_back(std::abs(d[k]) / part.vertex_sigma[i][k]);
  }
  for (std::size_t i = 0; i < a.circles.size(); ++i)
    e.vertex_mm.push_back(std::hypot((a.circles[i].center.point - b.circles[i].center.point).norm(),
                                     a.circles[i].radius_mm - b.circles[i].radius_mm));
  for (std::size_t i = 0; i < part.dimensions.size(); ++i) {
    const auto& d = part.dimensions[i];
    if (!d.observable) {
      ++e.not_observable;
      continue;
    }
    e.dimension_mm.push_back(std::abs(d.value_mm - truth.dimensions_mm[i]));
    e.dimension_z.push_back(e.dimension_mm.back() / d.sigma_mm);
  }
  std::vector<int> seen;
  for (int i = 0; i < part.object.StateSize(); ++i)
    if (part.observable[static_cast<std::size_t>(i)] && part.covariance(i, i) > 0) seen.push_back(i);
  if (seen.empty()) return e;
  const Eigen::VectorXd d = part.object.State() - truth.State();
  const Eigen::VectorXd error = d(seen);
  e.region.push_back(error.dot(Eigen::MatrixXd(part.covariance(seen, seen)).ldlt().solve(error)));
  e.region_size.push_back(static_cast<int>(seen.size()));
  return e;
}

inline Errors ErrorsOf(const Reconstruction& r, const std::vector<IdentifiedPart>& truth) {
  Errors e;
  for (std::size_t p = 0; p < truth.size(); ++p) e.Add(ErrorsOf(r.parts[p], truth[p].object));
  return e;
}

inline double Mean(const std::vector<double>& v) {
  double s = 0;
  for (double x : v) s += x;
  return v.empty() ? NAN : s / static_cast<double>(v.size());
}
inline double Rms(const std::vector<double>& v) {
  double s = 0;
  for (double x : v) s += x * x;
  return v.empty() ? NAN : std::sqrt(s / static_cast<double>(v.size()));
}
inline double Quantile(std::vector<double> v, double q) {
  if (v.empty()) return NAN;
  std::sort(v.begin(), v.end());
  return v[static_cast<std::size_t>(q * static_cast<double>(v.size() - 1) + 0.5)];
}
// Per cent of `v` up to `limit`.
inline double Within(const std::vector<double>& v, double limit) {
  const auto n = std::count_if(v.begin(), v.end(), [&](double x) { return x <= limit; });
  return v.empty() ? NAN : 100.0 * static_cast<double>(n) / static_cast<double>(v.size());
}

// 95 % point of the chi-square distribution (Wilson, Hilferty 1931).
inline double ChiSquare95(int degrees) {
  const double n = degrees, a = 2 / (9 * n);
  return n * std::pow(1 - a + 1.645 * std::sqrt(a), 3);
}
// Per cent of the parts whose 95 % region holds the truth.
inline double RegionsCover(const Errors& e) {
  double n = 0;
  for (std::size_t i = 0; i < e.region.size(); ++i) n += e.region[i] <= ChiSquare95(e.region_size[i]);
  return e.region.empty() ? NAN : 100 * n / static_cast<double>(e.region.size());
}

}  // namespace vss::benchmark
