// Found lines against the projected true edges of rendered surveys: top edges with nothing else within 8 px,
// cameras known. accuracy_lines_surveys [SURVEY FOLDER]...; without arguments those beside the repository. -v
// lists the worst edges.
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "vss/feature/line_image.h"
#include "vss/geometry/rigid_transform.h"

using namespace vss;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Json = nlohmann::json;

namespace {

struct TruthCamera {
  Intrinsics lens;
  int width, height;
};

TruthCamera CameraOf(const Json& j) {
  TruthCamera c{{LensModel::kOpenCv, j["fx"], j["fy"], j["cx"], j["cy"], {}, 5, 0}, j["width"], j["height"]};
  const Json& l = j["lens"];
  c.lens.distortion = {l["k1"], l["k2"], l["p1"], l["p2"], l["k3"]};
  return c;
}

RigidTransform PoseOf(const Json& j) {
  RigidTransform t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) t.rotation(r, c) = j["r"][r][c];
    t.translation[r] = j["t"][r];
  }
  return t;
}

using Polygon = std::vector<Vector2d>;

double Cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

Polygon Hull(Polygon p) {
  std::sort(p.begin(), p.end(), [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  Polygon h;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = h.size();
    for (const auto& q : p) {
      while (h.size() >= base + 2 && Cross(h.back() - h[h.size() - 2], q - h[h.size() - 2]) <= 0)
        h.pop_back();
      h.push_back(q);
    }
    h.pop_back();
    std::reverse(p.begin(), p.end());
  }
  return h;
}

// Distance of a point to a convex polygon (counter-clockwise in x, y), 0 inside.
double DistanceTo(const Polygon& h, const Vector2d& p) {
  bool inside = true;
  double best = 1e9;
  for (std::size_t i = 0; i < h.size(); ++i) {
    const Vector2d &a = h[i], &b = h[(i + 1) % h.size()];
    inside = inside && Cross(b - a, p - a) >= 0;
    const double t = std::clamp((p - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-12), 0.0, 1.0);
    best = std::min(best, (a + t * (b - a) - p).norm());
  }
  return inside ? 0 : best;
}

std::vector<Vector3d> VerticesOf(const Json& part) {
  std::vector<Vector3d> v;
  for (const auto& x : part["vertices"]) v.emplace_back(x[0], x[1], x[2]);
  for (const auto& c : part["circles"]) {
    const Vector3d centre(c["center"][0], c["center"][1], c["center"][2]);
    const double r = c["radius"];
    for (int i = 0; i < 16; ++i)
      v.push_back(centre + r * Vector3d(std::cos(i * kPi / 8), std::sin(i * kPi / 8), 0));
  }
  return v;
}

struct Projected {
  Vector2d from, to;  // ideal, clipped to the picture
  std::string name;
};

struct Edge2 {
  Vector2d from, to;
};

double DistanceTo(const Edge2& e, const Vector2d& p) {
  const double t =
      std::clamp((p - e.from).dot(e.to - e.from) / std::max((e.to - e.from).squaredNorm(), 1e-12), 0.0, 1.0);
  return (e.from + t * (e.to - e.from) - p).norm();
}

constexpr double kClearPx = 8;     // nothing else is nearer: an isolated edge
constexpr double kOwnClearPx = 5;  // of other edges of the part itself, those that it meets aside
constexpr double kMinLengthPx = 15;

// The longest run of the edge that lies in the picture and clear of the other parts.
bool Clip(const TruthCamera& camera, const RigidTransform& pose, const Vector3d& a, const Vector3d& b,
          const std::vector<Polygon>& others, const std::vector<Edge2>& own, Projected& out) {
  constexpr int kSteps = 200;
  int best_from = 0, best = 0, from = 0;
  auto good = [&](int i) {
    const Vector3d p = pose * (a + (b - a) * (double(i) / kSteps));
    const auto img = camera.lens.Project(p);
    if (!img || img->x() < 4 || img->y() < 4 || img->x() > camera.width - 5 || img->y() > camera.height - 5)
      return false;
    const Vector2d ideal = camera.lens.IdealFromNormalized(p.head<2>() / p.z());
    return std::all_of(others.begin(), others.end(),
                       [&](const Polygon& h) { return DistanceTo(h, ideal) > kClearPx; }) &&
           std::all_of(own.begin(), own.end(),
                       [&](const Edge2& o) { return DistanceTo(o, ideal) > kOwnClearPx; });
  };
  for (int i = 0; i <= kSteps; ++i) {
    if (!good(i))
      from = i + 1;
    else if (i - from > best)
      best = i - from, best_from = from;
  }
  auto ideal = [&](int i) {
    const Vector3d p = pose * (a + (b - a) * (double(i) / kSteps));
    return camera.lens.IdealFromNormalized(p.head<2>() / p.z());
  };
  if (best <= 0) return false;
  out.from = ideal(best_from), out.to = ideal(best_from + best);
  return (out.to - out.from).norm() > kMinLengthPx;
}

struct Figures {
  std::vector<double> distance;
  double length = 0, found = 0, milliseconds = 0;
  int pictures = 0, segments = 0, arcs = 0;
  double nees = 0;
  int measured = 0;
};

void Judge(const std::vector<Projected>& edges, const LineImage& lines, bool verbose, Figures& f) {
  constexpr double kMaxDistancePx = 1.5, kMaxTurn = 0.05;
  for (const auto& e : edges) {
    const double length = (e.to - e.from).norm();
    const Vector2d d = (e.to - e.from) / length;
    std::vector<char> covered(static_cast<std::size_t>(length) + 1, 0);
    for (const auto& s : lines.segments) {
      const Vector2d g = (s.ideal_end - s.ideal_start).normalized();
      auto across = [&](const Vector2d& p) { return Cross(d, p - e.from); };
      if (std::abs(Cross(d, g)) > kMaxTurn ||
          std::max(std::abs(across(s.ideal_start)), std::abs(across(s.ideal_end))) >
              kMaxDistancePx + kMaxTurn * length)
        continue;
      const double p = d.dot(s.ideal_start - e.from), q = d.dot(s.ideal_end - e.from),
                   low = std::max(0.0, std::min(p, q)), high = std::min(length, std::max(p, q));
      if (high - low < 3) continue;
      double worst = 0;
      std::vector<double> at;
      for (const double t : {low, 0.5 * (low + high), high}) {
        const double x = across(s.ideal_start + g * ((t - p) / d.dot(g)));
        at.push_back(std::abs(x)), worst = std::max(worst, std::abs(x));
      }
      if (worst > kMaxDistancePx) continue;
      f.distance.insert(f.distance.end(), at.begin(), at.end());
      f.nees += std::pow(at[1] / std::max(1e-4, s.sigma_offset_px), 2), ++f.measured;
      for (auto i = static_cast<std::size_t>(low); i < static_cast<std::size_t>(high); ++i) covered[i] = 1;
      if (verbose && worst > 0.12)
        fmt::print(
            "  {} {}: {:.3f} {:.3f} {:.3f} px of ({:.1f}, {:.1f})-({:.1f}, {:.1f}), contrast {:.1f} blur "
            "{:.2f} sigma {:.3f}\n",
            lines.image, e.name, at[0], at[1], at[2], s.start.x(), s.start.y(), s.end.x(), s.end.y(),
            s.contrast, s.blur_px, s.sigma_offset_px);
    }
    const double share = double(std::count(covered.begin(), covered.end(), 1)) / double(covered.size());
    f.length += length, f.found += length * share;
    if (verbose && share < 0.5)
      fmt::print("  {} {}: {:.0f} % found of ideal ({:.1f}, {:.1f})-({:.1f}, {:.1f})\n", lines.image, e.name,
                 100 * share, e.from.x(), e.from.y(), e.to.x(), e.to.y());
  }
}

std::vector<Projected> TopEdges(const Json& truth, const TruthCamera& camera, const RigidTransform& pose) {
  std::vector<std::vector<Vector3d>> vertices;
  std::vector<Polygon> hulls;
  for (const auto& part : truth["parts"]) {
    vertices.push_back(VerticesOf(part));
    Polygon p;
    bool in_front = true;
    for (const auto& v : vertices.back()) {
      const Vector3d c = pose * v;
      in_front = in_front && c.z() > 100;
      p.push_back(camera.lens.IdealFromNormalized(c.head<2>() / c.z()));
    }
    hulls.push_back(in_front ? Hull(p) : Polygon{});
  }
  std::vector<Projected> out;
  for (std::size_t i = 0; i < truth["parts"].size(); ++i) {
    const Json& part = truth["parts"][i];
    if (part["vertices"].empty() || hulls[i].empty()) continue;
    std::vector<Polygon> others;
    for (std::size_t j = 0; j < hulls.size(); ++j)
      if (j != i && !hulls[j].empty()) others.push_back(hulls[j]);
    double top = -1e9;
    for (const auto& v : part["vertices"]) top = std::max(top, v[2].get<double>());
    for (const auto& e : part["edges"]) {
      const Vector3d a = vertices[i][e[0].get<std::size_t>()], b = vertices[i][e[1].get<std::size_t>()];
      Projected p;
      std::vector<Edge2> own;  // edges of the part that do not meet this one
      for (const auto& o : part["edges"]) {
        if (o[0] == e[0] || o[0] == e[1] || o[1] == e[0] || o[1] == e[1]) continue;
        auto ideal = [&](const Json& k) {
          const Vector3d c = pose * vertices[i][k.get<std::size_t>()];
          return Vector2d(camera.lens.IdealFromNormalized(c.head<2>() / c.z()));
        };
        own.push_back({ideal(o[0]), ideal(o[1])});
      }
      if (a.z() < top - 0.5 || b.z() < top - 0.5 || !Clip(camera, pose, a, b, others, own, p)) continue;
      p.name = fmt::format("{} {}-{}", part["id"].get<std::string>(), e[0].get<int>(), e[1].get<int>());
      out.push_back(p);
    }
  }
  return out;
}

double Quantile(std::vector<double> v, double q) {
  if (v.empty()) return 0;
  const auto at = v.begin() + std::ptrdiff_t(q * double(v.size() - 1));
  std::nth_element(v.begin(), at, v.end());
  return *at;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> folders;
  bool verbose = false;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "-v")
      verbose = true;
    else
      folders.emplace_back(argv[i]);
  }
  const std::filesystem::path beside = std::filesystem::path(VSS_SOURCE_DIR) / "../shared/surveys";
  if (folders.empty())
    for (const char* name : {"lab-1", "lab-2", "panel-3", "round-4", "yard-5"})
      folders.push_back(beside / name);
  fmt::print("{:10}{:>10}{:>8}{:>10}{:>10}{:>10}{:>8}{:>12}{:>10}{:>10}\n", "survey", "edges px", "found",
             "median", "95 %", "lines", "arcs", "error/sig^2", "ms", "samples");
  std::vector<double> all;
  LineWorkspace workspace;
  for (const auto& folder : folders) {
    std::ifstream in(folder / "truth.json");
    if (!in) {
      fmt::print("SKIPPED {}: there is no truth.json\n", folder.string());
      continue;
    }
    const Json truth = Json::parse(in);
    Figures f;
    for (const auto& picture : truth["images"]) {
      const auto camera_json = std::find_if(truth["cameras"].begin(), truth["cameras"].end(),
                                            [&](const Json& c) { return c["id"] == picture["camera"]; });
      const TruthCamera camera = CameraOf(*camera_json);
      const RigidTransform pose = PoseOf(picture["camera_from_world"]);
      const std::string name = picture["name"];
      const auto image = ReadImage(folder / "images" / (name + ".png"));
      if (!image) {
        fmt::print("{}\n", image.error().message);
        return 1;
      }
      const auto start = std::chrono::steady_clock::now();
      LineImage lines = DetectLines(image->view(), &camera.lens, {}, &workspace);
      f.milliseconds +=
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
      lines.image = name;
      ++f.pictures, f.segments += int(lines.segments.size()), f.arcs += int(lines.arcs.size());
      Judge(TopEdges(truth, camera, pose), lines, verbose, f);
    }
    const double n = std::max(1, f.pictures);
    fmt::print("{:10}{:10.0f}{:8.3f}{:10.4f}{:10.4f}{:10.1f}{:8.1f}{:12.2f}{:10.2f}{:10}\n",
               folder.filename().string(), f.length, f.found / std::max(1.0, f.length),
               Quantile(f.distance, 0.5), Quantile(f.distance, 0.95), f.segments / n, f.arcs / n,
               f.nees / std::max(1, f.measured), f.milliseconds / n, f.distance.size());
    all.insert(all.end(), f.distance.begin(), f.distance.end());
  }
  fmt::print("all: median {:.4f} px, 95 % {:.4f} px (bars: 0.03, 0.12)\n", Quantile(all, 0.5),
             Quantile(all, 0.95));
}
