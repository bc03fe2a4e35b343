#include "vss/simulate/simulate.h"

#include <atomic>
#include <cmath>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>

#include "vss/base/parallel.h"
#include "vss/base/toml_file.h"
#include "vss/simulate/scene_file.h"

namespace vss {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const Eigen::Ref<const Eigen::VectorXd>& v) {
  Json out = Json::array();
  for (Eigen::Index i = 0; i < v.size(); ++i) out.push_back(v[i]);
  return out;
}
Json ToJson(const RigidTransform& t) {
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) rows.push_back(ToJson(t.rotation.row(i).transpose()));
  return {{"r", rows}, {"t", ToJson(t.translation)}};
}

Json PartToJson(const ScenePart& part) {
  const TruePart truth = [&] {
    SimulatedScene alone;
    alone.parts.push_back(part);
    return TruthOf(alone)[0];
  }();
  const PlacedObject& object = part.object;
  const auto& p = object.placement;
  Json out = {{"id", part.id}, {"kind", truth.kind}};
  out["pose"] = {{"x", p[0]}, {"y", p[1]}, {"z", p[2]}, {"yaw", DegFromRad(p[3])}};
  out["rests"] = object.model->resting_poses()[std::size_t(object.resting_pose)].name;
  for (const auto& [name, value] : truth.dimensions_mm) out["dims"][name] = value;
  out["on"] = part.stands_on;
  out["vertices"] = Json::array();
  for (const auto& v : truth.vertices) out["vertices"].push_back(ToJson(v));
  out["edges"] = Json::array();
  for (const SolidEdge& e : PlaceSolid(object, false).edges) out["edges"].push_back({e.start, e.end});
  out["circles"] = Json::array();
  for (const auto& c : truth.circles)
    out["circles"].push_back(
        {{"center", ToJson(c.center)}, {"normal", ToJson(c.normal)}, {"radius", c.radius_mm}});
  return out;
}

Json CameraToJson(const SceneCamera& c) {
  const Intrinsics& lens = c.camera.intrinsics;
  Json out = {{"id", c.camera.id}, {"width", c.camera.width_px}, {"height", c.camera.height_px},
              {"fx", lens.fx_px},  {"fy", lens.fy_px},           {"cx", lens.cx_px},
              {"cy", lens.cy_px}};
  if (lens.model != LensModel::kWeng)
    out["lens"] = {{"k1", lens.distortion[0]},
                   {"k2", lens.distortion[1]},
                   {"k3", lens.distortion[4]},
                   {"p1", lens.distortion[2]},
                   {"p2", lens.distortion[3]}};
  out["psf"] = c.blur_px;
  out["noise"] = c.read_noise;
  if (c.camera.cam_from_world) out.update(ToJson(*c.camera.cam_from_world));
  return out;
}

// What lies about and is no part.
Json ClutterToJson(const SimulatedScene& scene) {
  Json out = Json::array();
  for (const auto& line : scene.lines)
    out.push_back({{"kind", "painted line"},
                   {"from", ToJson(line.from)},
                   {"to", ToJson(line.to)},
                   {"width", line.width_mm}});
  for (const auto& cable : scene.cables) {
    Json points = Json::array();
    for (const auto& p : cable.points) points.push_back(ToJson(p));
    out.push_back({{"kind", "cable"}, {"points", points}, {"diameter", cable.diameter_mm}});
  }
  for (const auto& offcut : scene.offcuts) {
    Json outline = Json::array();
    for (const auto& p : offcut.outline) outline.push_back(ToJson(p));
    out.push_back(
        {{"kind", "offcut"}, {"outline", outline}, {"height", offcut.height_mm}, {"z", offcut.base_mm}});
  }
  for (const auto& stone : scene.stones)
    out.push_back({{"kind", "stone"}, {"place", ToJson(stone.place)}, {"size", stone.size_mm}});
  return out;
}

std::string CameraFile(const SceneCamera& c) { return "cameras/" + c.camera.id + ".toml"; }
std::string ImageFile(const ScenePicture& p) { return "images/" + p.name + ".png"; }

}  // namespace

Status RenderPictures(const SimulatedScene& scene, int threads, const Progress& progress,
                      const std::function<void(int, const RenderedPicture&)>& use) {
  const SceneMesh mesh = MakeMesh(scene);
  std::vector<PixelRays> rays;
  for (const SceneCamera& c : scene.cameras) {
    VSS_ASSIGN(rays.emplace_back(), PixelRays::Make(c.camera, threads));
  }
  std::atomic<int> done = 0;
  std::mutex reporting;
  const int count = static_cast<int>(scene.pictures.size());
  ParallelFor(scene.pictures.size(), threads, [&](std::size_t i) {
    if (progress.Cancelled()) return;
    use(static_cast<int>(i),
        RenderPicture(scene, mesh, static_cast<int>(i), rays[std::size_t(scene.pictures[i].camera)]));
    const std::lock_guard lock(reporting);
    progress.Report("pictures", ++done, count);
  });
  if (progress.Cancelled()) return Cancelled();
  return {};
}

Survey SurveyOf(const SimulatedScene& scene, const std::filesystem::path& folder) {
  Survey survey;
  survey.name = scene.name;
  survey.folder = folder;
  survey.knowledge = scene.knowledge;
  for (const SceneCamera& c : scene.cameras) survey.cameras.push_back(c.camera);
  for (const ScenePicture& p : scene.pictures)
    survey.images.push_back({ImageFile(p), folder / ImageFile(p), p.camera, p.cam_from_world, p.gantry_mm});
  return survey;
}

std::string SurveyToToml(const SimulatedScene& scene) {
  std::string out = fmt::format("format = \"vss-survey/1\"\nname = {}\ncameras = [", TomlText(scene.name));
  for (std::size_t i = 0; i < scene.cameras.size(); ++i)
    out += (i ? ", " : "") + TomlText(CameraFile(scene.cameras[i]));
  out += "]\n";
  if (!scene.knowledge.empty()) {
    out += "knowledge = [";
    for (std::size_t i = 0; i < scene.knowledge.size(); ++i)
      out += (i ? ", " : "") + TomlText(scene.knowledge[i]);
    out += "]\n";
  }
  for (const ScenePicture& p : scene.pictures) {
    out += fmt::format("\n[[image]]\nfile = {}\ncamera = {}\n", TomlText(ImageFile(p)),
                       TomlText(scene.cameras[std::size_t(p.camera)].camera.id));
    if (p.gantry_mm)
      out += "gantry = " + TomlArray(*p.gantry_mm) + "\n";
    else
      out += "rotation = " + TomlMatrix(p.cam_from_world.rotation) +
             "\ntranslation = " + TomlArray(p.cam_from_world.translation) + "\n";
  }
  return out;
}

std::vector<TruePart> TruthOf(const SimulatedScene& scene) {
  std::vector<TruePart> truth;
  for (const ScenePart& part : scene.parts) {
    const WorldSolid solid = PlaceSolid(part.object, false);
    TruePart& out = truth.emplace_back();
    out.id = part.id;
    out.kind = part.object.model->kind();
    for (std::size_t i = 0; i < part.object.dimensions_mm.size(); ++i)
      out.dimensions_mm.emplace_back(part.object.model->dimensions()[i].name, part.object.dimensions_mm[i]);
    for (const auto& v : solid.vertices) out.vertices.push_back(v.point);
    for (const auto& c : solid.circles) out.circles.push_back({c.center.point, c.normal, c.radius_mm});
  }
  return truth;
}

std::string TruthToJson(const SimulatedScene& scene, const std::vector<std::vector<std::int32_t>>& seen_px) {
  constexpr int kSeenPx = 20;  // a picture that shows less of a part than this does not show it
  Json out = {{"units", "mm"}, {"level", "simulated"}, {"seed", scene.seed}, {"parts", Json::array()}};
  for (std::size_t i = 0; i < scene.parts.size(); ++i) {
    Json part = PartToJson(scene.parts[i]);
    if (!seen_px.empty()) {
      int most = 0, pictures = 0;
      for (const auto& seen : seen_px) {
        most = std::max(most, int(seen[i]));
        pictures += seen[i] >= kSeenPx;
      }
      part["seen_px"] = most;
      part["seen_in_pictures"] = pictures;
    }
    out["parts"].push_back(std::move(part));
  }
  out["cameras"] = Json::array();
  for (const SceneCamera& c : scene.cameras) out["cameras"].push_back(CameraToJson(c));
  out["images"] = Json::array();
  for (const ScenePicture& p : scene.pictures) {
    RigidTransform true_place = p.cam_from_world;
    true_place.translation -= true_place.rotation * p.stop_error_mm;
    Json image = {{"name", p.name}, {"camera", scene.cameras[std::size_t(p.camera)].camera.id}};
    if (p.gantry_mm) image["gantry"] = ToJson(*p.gantry_mm);
    image["camera_from_world"] = ToJson(true_place);
    out["images"].push_back(std::move(image));
  }
  out["clutter"] = ClutterToJson(scene);
  return out.dump(1) + "\n";
}

Result<std::vector<std::vector<std::int32_t>>> AddSimulatedSurvey(const SimulatedScene& scene, int threads,
                                                                  const Progress& progress,
                                                                  OutputFolder& out) {
  std::vector<std::string> pngs(scene.pictures.size());
  std::vector<std::vector<std::int32_t>> seen_px(scene.pictures.size());
  VSS_RETURN_IF_ERROR(RenderPictures(scene, threads, progress, [&](int i, const RenderedPicture& picture) {
    const std::vector<std::uint8_t> png = EncodePng(picture.image.view());
    pngs[std::size_t(i)].assign(png.begin(), png.end());
    seen_px[std::size_t(i)] = picture.seen_px;
  }));
  out.Add("survey.toml", SurveyToToml(scene));
  for (const SceneCamera& c : scene.cameras) out.Add(CameraFile(c), CameraToToml(c.camera));
  for (std::size_t i = 0; i < pngs.size(); ++i) out.Add(ImageFile(scene.pictures[i]), std::move(pngs[i]));
  for (const auto& [name, text] : scene.knowledge_texts) out.Add(name, text);
  out.Add("scene.toml", SceneToToml(scene));
  out.Add("truth.json", TruthToJson(scene, seen_px));
  return seen_px;
}

}  // namespace vss
