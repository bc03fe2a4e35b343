// What pulls edges: how far from its true place each edge is measured, where parts and cameras stand as in
// the truth, by the edge's class, by what lies behind it, by its height above what the part stands on, and by
// how far the nearest other contour lies ("near": within three blurs, "beside": within six).
//
//   accuracy_pulls [SURVEY]... [--scenes N] [--first SEED] [--list] [--threads N]
//
// SURVEY: rendered surveys with truth.json. --scenes: N simulated scenes of five parts in eight pictures.
// --list: every edge in every picture, too.
#include "reconstruct_simulated.h"
#include "vss/knowledge/object_model.h"
#include "vss/reconstruct/measure_view.h"

namespace {

using namespace vss;
using namespace vss::benchmark;

constexpr double kSearchPx = 1.5;

struct Row {
  std::string kind;
  ContourSample::Source source{};
  int index = 0, view = 0, pieces = 0;
  ContourClass edge_class{};
  bool silhouette = false;
  double neighbour_blurs = 0;         // to the nearest contour beside it
  double above_px = 0;                // of the edge above the part's foot, as a length in the picture
  double out_px = 0;                  // measured less true place, away from the part's middle
  double sigma_px = 0, contrast = 0;  // of the outer side less the inner
};

std::vector<Row> Measure(std::span<const IdentifiedPart> parts, std::span<const View> views,
                         std::span<const GreyView> pictures, int threads) {
  std::vector<WorldSolid> solids;
  for (const auto& p : parts) solids.push_back(PlaceSolid(p.object, false));
  const auto others = OthersOf(solids);
  std::vector<std::vector<Row>> rows(views.size());
  ParallelFor(views.size(), threads, [&](std::size_t v) {
    const PictureState state = StateBefore(views[v]);
    const auto measured =
        MeasureView(solids, others, views[v], static_cast<int>(v), pictures[v], state, {kSearchPx, 8});
    for (const auto& g : measured.groups) {
      const auto& solid = solids[static_cast<std::size_t>(g.part)];
      Eigen::Vector3d middle = Eigen::Vector3d::Zero();
      for (const auto& vertex : solid.vertices)
        middle += vertex.point / static_cast<double>(solid.vertices.size());
      const auto center = views[v].ProjectInside(middle);
      if (!center) continue;
      const auto& object = parts[static_cast<std::size_t>(g.part)].object;
      const auto& first = g.observations.front().sample;
      Row r;
      r.kind = object.model->kind();
      r.source = first.source, r.index = first.index, r.view = static_cast<int>(v);
      r.edge_class = g.edge_class, r.silhouette = first.silhouette;
      r.pieces = static_cast<int>(g.observations.size());
      const double depth = (views[v].cam_from_world * first.point_in_world).z();
      r.above_px =
          (first.point_in_world.z() - object.placement[2]) * views[v].camera->intrinsics.fx_px / depth;
      double weight = 0;
      std::vector<double> gaps;
      for (const auto& o : g.observations) gaps.push_back(o.neighbour_blurs);
      r.neighbour_blurs = Quantile(gaps, 0.5);
      for (const auto& o : g.observations) {
        const double w = 1 / (o.sigma_px * o.sigma_px);
        const double sign = o.normal.dot(o.sample.img - *center) < 0 ? -1 : 1;
        r.out_px += w * sign * o.normal.dot(o.measured - o.sample.img);
        r.contrast += w * sign * o.contrast;
        weight += w;
      }
      r.out_px /= weight, r.contrast /= weight, r.sigma_px = 1 / std::sqrt(weight);
      rows[v].push_back(std::move(r));
    }
  });
  std::vector<Row> all;
  for (auto& r : rows) all.insert(all.end(), r.begin(), r.end());
  return all;
}

const char* HeightOf(const Row& r) {
  return r.above_px < 0.5  ? "0 foot"
         : r.above_px < 3  ? "1 < 3"
         : r.above_px < 6  ? "2 < 6"
         : r.above_px < 12 ? "3 < 12"
                           : "4 12...";
}

void PrintTable(const std::vector<Row>& rows) {
  std::map<std::array<std::string, 5>, std::vector<double>> bins;
  for (const auto& r : rows)
    bins[{NameOf(r.edge_class), r.silhouette ? "silhouette" : "inner", HeightOf(r),
          r.contrast > 0 ? "behind bright" : "behind dark",
          r.neighbour_blurs < 3   ? "near"
          : r.neighbour_blurs < 6 ? "beside"
                                  : "alone"}]
        .push_back(r.contrast > 0 ? r.out_px : -r.out_px);
  fmt::print(
      "towards the bright side, px\n{:<8} {:<10} {:<8} {:<13} {:<6} {:>5} {:>7} {:>7} {:>7} {:>7} {:>7}\n",
      "class", "", "above px", "", "other", "edges", "5 %", "25 %", "50 %", "75 %", "95 %");
  for (const auto& [key, values] : bins) {
    fmt::print("{:<8} {:<10} {:<8} {:<13} {:<6} {:>5}", key[0], key[1], key[2], key[3], key[4],
               values.size());
    for (double q : {0.05, 0.25, 0.5, 0.75, 0.95}) fmt::print(" {:>7.3f}", Quantile(values, q));
    fmt::print("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> surveys;
  int scenes = 0, first = 1, threads = 2;
  bool list = false;
  for (int i = 1; i < argc; ++i) {
    const std::string s = argv[i];
    if (s == "--list")
      list = true;
    else if ((s == "--scenes" || s == "--first" || s == "--threads") && i + 1 < argc)
      (s == "--scenes" ? scenes : s == "--first" ? first : threads) = std::stoi(argv[++i]);
    else if (s.starts_with("--"))
      Stop("accuracy_pulls [SURVEY]... [--scenes N] [--first SEED] [--list] [--threads N], not " + s);
    else
      surveys.push_back(s);
  }
  const KnowledgeBase knowledge = OrStop(LoadKnowledge({}, "."));
  std::vector<Row> rows;
  for (const auto& folder : surveys) {
    const LoadedSurvey data(OrStop(ReadSurvey(folder)), threads);
    const auto more = Measure(TrueParts(folder, knowledge), data.views, data.pictures, threads);
    rows.insert(rows.end(), more.begin(), more.end());
  }
  std::vector<std::vector<Row>> simulated(static_cast<std::size_t>(scenes));
  ParallelFor(simulated.size(), threads, [&](std::size_t i) {
    RandomSceneOptions options;
    options.seed = static_cast<std::uint64_t>(first) + i;
    options.num_parts = 5;
    options.rig.stops = {2, 1};
    const SimulatedScene scene = OrStop(DrawRandomScene(options, knowledge));
    std::vector<Camera> cameras;
    for (const auto& c : scene.cameras) cameras.push_back(c.camera);
    const Rendered r = Render(scene, cameras);
    simulated[i] = Measure(PartsOf(scene), r.views, r.pictures, 1);
  });
  for (const auto& s : simulated) rows.insert(rows.end(), s.begin(), s.end());
  if (list)
    for (const auto& r : rows)
      fmt::print(
          "{} source {} edge {:>2} {} {} view {:>2} above {:5.1f} out {:7.3f} sigma {:.3f} contrast "
          "{:6.1f} pieces {}\n",
          r.kind, static_cast<int>(r.source), r.index, NameOf(r.edge_class),
          r.silhouette ? "silhouette" : "inner", r.view, r.above_px, r.out_px, r.sigma_px, r.contrast,
          r.pieces);
  PrintTable(rows);
}
