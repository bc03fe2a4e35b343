// How often pictures show what is predicted: of the contours of true parts, and of contours where nothing is.
// From these shares come the likelihood ratios of src/vss/identify/weigh.cc.
//
//   accuracy_evidence SURVEY_FOLDER...
//
// Every survey has its truth beside it. A decoy is a true part moved, turned and stretched at random; its
// pieces that fall on a true contour do not count.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "accuracy/true_objects.h"
#include "vss/base/files.h"
#include "vss/identify/edge_response.h"
#include "vss/identify/found_contours.h"
#include "vss/identify/scene.h"
#include "vss/identify/weigh.h"
#include "vss/survey/run_survey.h"

namespace {

using namespace vss;
using Eigen::Vector2d;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr int kBins = 8;
constexpr double kEdges[kBins - 1] = {0.7, 1, 1.5, 2.2, 3.5, 6, 12};
int BinOf(double t) { return int(std::upper_bound(kEdges, kEdges + kBins - 1, t) - kEdges); }

struct Row {
  double hit = 0, miss[kBins] = {}, all[kBins] = {}, total = 0;
};

std::string ClassOf(const WorldSolid& solid, const ContourSample& s, double lowest) {
  if (s.source == ContourSample::Source::kLimb) return "limb";
  if (s.source == ContourSample::Source::kCircle)
    return solid.circles[std::size_t(s.index)].center.point.z() < lowest + 1 ? "rim contact" : "rim";
  const auto& e = solid.edges[std::size_t(s.index)];
  const double top =
      std::max(solid.vertices[std::size_t(e.start)].point.z(), solid.vertices[std::size_t(e.end)].point.z());
  const Eigen::Vector3d middle =
      (solid.vertices[std::size_t(e.start)].point + solid.vertices[std::size_t(e.end)].point) / 2;
  if (IsCovered(solid, middle)) return e.convex ? "covered" : "covered hollow";
  if (top < lowest + 1) return s.silhouette ? "contact" : "contact inner";
  if (!e.convex) return "hollow";
  return s.silhouette ? "outline" : "inner";
}

// As weigh.cc tells contours of which less is seen.
std::string WeakOrStrong(const WorldSolid& solid, const ContourSample& s, double lowest) {
  const std::string name = ClassOf(solid, s, lowest);
  return name.starts_with("outline") || name.starts_with("inner") || name == "rim" || name == "limb"
             ? "strong"
             : "weak";
}

std::string LengthClass(double px) {
  for (int bound : {6, 9, 13, 20, 32, 64})
    if (px < bound) return fmt::format("<{:02} px", bound);
  return "more";
}

// Where true contours are, by view: a grid of 4 px with directions.
struct TrueContours {
  std::map<std::pair<int, int>, std::vector<ContourSample>> cells;
  void Add(const ContourSample& s) { cells[{int(s.ideal.x() / 4), int(s.ideal.y() / 4)}].push_back(s); }
  bool Near(const ContourSample& s) const {
    const int cx = int(s.ideal.x() / 4), cy = int(s.ideal.y() / 4);
    for (int a = -2; a <= 2; ++a)
      for (int b = -2; b <= 2; ++b) {
        const auto it = cells.find({cx + a, cy + b});
        if (it == cells.end()) continue;
        for (const auto& t : it->second)
          if ((t.ideal - s.ideal).norm() < 5 && std::abs(t.ideal_tangent.dot(s.ideal_tangent)) > 0.9)
            return true;
      }
    return false;
  }
};

}  // namespace

int main(int argc, char** argv) {
  std::map<std::string, Row> rows;
  const SurveyOptions options;
  for (int a = 1; a < argc; ++a) {
    const Survey survey = OrStop(ReadSurvey(argv[a]));
    const KnowledgeBase knowledge = OrStop(LoadKnowledge(survey.knowledge, survey.folder));
    const auto pictures = OrStop(ReadSurveyPictures(survey, 2, {}));
    const auto lines = OrStop(DetectSurveyLines(survey, pictures, options, {}));
    const auto views = MakeViews(survey, lines, pictures);
    const json truth = json::parse(OrStop(ReadTextFile(fs::path(argv[a]) / "truth.json")));
    std::vector<PlacedObject> objects;
    for (const json& p : truth["parts"]) objects.push_back(TrueObject(p, knowledge));
    SceneIndex scene = MakeSceneIndex(views, 1.2 + 512 / 2000., 2);
    const ContourSampling sampling{.spacing_px = 8, .min_samples = 1};
    std::mt19937 random(1);
    std::vector<TrueContours> true_contours(views.size());
    std::vector<double> typical;
    for (const auto& v : views) typical.push_back(TypicalResponse(v.picture, 8, scene.tolerance_px));
    auto count = [&](const WorldSolid& solid, int v, const std::vector<ContourSample>& samples, bool decoy) {
      double lowest = INFINITY;
      for (const auto& p : solid.vertices) lowest = std::min(lowest, p.point.z());
      for (const auto& c : solid.circles) lowest = std::min(lowest, c.center.point.z());
      std::map<std::pair<ContourSample::Source, int>, double> length;  // px, of each contour's visible pieces
      for (const auto& s : samples)
        if (s.visible) length[{s.source, s.index}] += s.step_px;
      for (const auto& s : samples) {
        if (!s.visible || s.step_px < 2) continue;
        if (decoy && true_contours[std::size_t(v)].Near(s)) continue;
        double beside = 1e9;
        for (const auto& o : samples)
          if (o.visible && (o.index != s.index || o.source != s.source) && (o.ideal - s.ideal).norm() < 12 &&
              std::abs(o.ideal_tangent.dot(s.ideal_tangent)) > 0.99)
            beside = std::min(
                beside,
                std::abs((o.ideal - s.ideal).dot(Vector2d(-s.ideal_tangent.y(), s.ideal_tangent.x()))));
        const auto r = RespondToEdge(views[std::size_t(v)].picture, s.img, s.ideal_tangent,
                                     std::min(8., s.step_px), scene.tolerance_px);
        if (!r) continue;
        const int bin = BinOf(std::abs(r->step) / typical[std::size_t(v)]);
        const bool hit = scene.Match(v, s, scene.tolerance_px, 0.9962).line >= 0;
        std::vector<std::string> names{decoy ? "DECOY all" : "all"};
        const std::string crowd = beside < 2.5 ? " <2.5" : beside < 5 ? " <5" : "";
        names.push_back((decoy ? "DECOY " : "") + ClassOf(solid, s, lowest) + crowd);
        names.push_back(fmt::format("{}{} of {}", decoy ? "DECOY " : "", WeakOrStrong(solid, s, lowest),
                                    LengthClass(length[{s.source, s.index}])));
        for (const auto& n : names) {
          Row& row = rows[n];
          ++row.total;
          ++row.all[bin];
          if (hit)
            ++row.hit;
          else
            ++row.miss[bin];
        }
      }
    };
    std::vector<std::vector<std::vector<ContourSample>>> samples(objects.size());
    for (std::size_t i = 0; i < objects.size(); ++i) {
      Occluders others;
      for (std::size_t k = 0; k < objects.size(); ++k)
        if (k != i) others.Add(PlaceSolid(objects[k], false), int(k));
      const WorldSolid solid = PlaceSolid(objects[i], false);
      samples[i].resize(views.size());
      for (std::size_t v = 0; v < views.size(); ++v) {
        samples[i][v] = SampleContour(solid, views[v], sampling, &others);
        for (const auto& s : samples[i][v])
          if (s.visible) true_contours[v].Add(s);
      }
    }
    for (std::size_t i = 0; i < objects.size(); ++i)
      for (std::size_t v = 0; v < views.size(); ++v)
        count(PlaceSolid(objects[i], false), int(v), samples[i][v], false);
    for (std::size_t i = 0; i < objects.size(); ++i)
      for (int trial = 0; trial < 3; ++trial) {
        std::uniform_real_distribution<double> u(-1, 1);
        PlacedObject decoy = objects[i];
        const double reach = 30 * scene.mm_per_px;
        decoy.placement[0] += reach * u(random);
        decoy.placement[1] += reach * u(random);
        decoy.placement[3] += 0.15 * u(random);
        for (double& d : decoy.dimensions_mm) d *= std::exp(0.3 * u(random));
        if (!decoy.model->Violations(decoy.dimensions_mm).empty() && trial == 0) continue;
        const WorldSolid solid = PlaceSolid(decoy, false);
        for (std::size_t v = 0; v < views.size(); ++v)
          count(solid, int(v), SampleContour(solid, views[v], sampling), true);
      }
  }
  fmt::print("{:<22} {:>8} {:>6} | without a line, by strength of the step (typical = 1): share in %\n", "",
             "pieces", "line");
  fmt::print("{:<39}", "");
  for (double e : kEdges) fmt::print(" <{:<5}", e);
  fmt::print(" more\n");
  for (const auto& [name, row] : rows) {
    fmt::print("{:<22} {:8.0f} {:6.3f} |", name, row.total, row.hit / row.total);
    for (double m : row.miss) fmt::print(" {:6.2f}", 100 * m / row.total);
    fmt::print("\n");
  }
}
