#include "vss/simulate/scene_file.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "vss/base/files.h"
#include "vss/base/toml_file.h"
#include "vss/knowledge/catalogues.h"
#include "vss/simulate/random_scene.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A table of the file, of which only the named entries are allowed.
Status OnlyThese(const TomlValue& table, std::initializer_list<std::string_view> names) {
  VSS_ASSIGN(const TomlValue::Table* rows, table.AsTable());
  for (const auto& [name, value] : *rows) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    std::string known;
    for (const auto& n : names) known += (known.empty() ? "" : ", ") + std::string(n);
    return value.Complain("is no entry of a scene file at this place; there are: " + known);
  }
  return {};
}

// Sets `to` where the entry is there.
Status ReadNumber(const TomlValue& table, std::string_view name, double min, double max, double& to) {
  const TomlValue* value = table.Find(name);
  if (!value) return {};
  VSS_ASSIGN(to, value->AsNumber());
  if (!(to >= min && to <= max))
    return value->Complain(fmt::format("must be a number from {} to {}", min, max));
  return {};
}
template <int N>
Status ReadPoint(const TomlValue& table, std::string_view name, std::string_view example,
                 Eigen::Matrix<double, N, 1>& to) {
  VSS_ASSIGN(const TomlValue* value, table.Get(name, example));
  VSS_ASSIGN(to, value->AsVector(N));
  return {};
}
// At least `least` points.
Result<std::vector<Vector2d>> ReadPoints(const TomlValue& table, std::string_view name,
                                         std::string_view example, std::size_t least) {
  VSS_ASSIGN(const TomlValue* value, table.Get(name, example));
  VSS_ASSIGN(const TomlValue::Array* items, value->AsArray());
  std::vector<Vector2d> points;
  for (const auto& item : *items) {
    VSS_ASSIGN(points.emplace_back(), item.AsVector(2));
  }
  if (points.size() < least)
    return value->Complain(fmt::format("needs at least {} points, it has {}", least, points.size()));
  return points;
}
// The tables [[name]].
Result<std::vector<const TomlValue*>> Tables(const TomlValue& file, std::string_view name) {
  std::vector<const TomlValue*> tables;
  const TomlValue* list = file.Find(name);
  if (!list) return tables;
  VSS_ASSIGN(const TomlValue::Array* items, list->AsArray());
  for (const auto& item : *items) {
    if (!item.IsTable()) return item.Complain(fmt::format("must be a table; write it as [[{}]]", name));
    tables.push_back(&item);
  }
  return tables;
}

Status ReadMaterial(const TomlValue& table, Material& m) {
  VSS_RETURN_IF_ERROR(ReadNumber(table, "albedo", 0, 1, m.albedo));
  VSS_RETURN_IF_ERROR(ReadNumber(table, "gloss", 0, 10, m.gloss));
  VSS_RETURN_IF_ERROR(ReadNumber(table, "grain", 0, 1, m.grain));
  return ReadNumber(table, "patches", 0, 1, m.patches);
}

constexpr double kFarMm = 1e6;  // a kilometre: nobody's workshop

class SceneReader {
 public:
  SceneReader(TomlValue file, fs::path folder) : file_(std::move(file)), folder_(std::move(folder)) {}

  Result<LoadedScene> Run() {
    VSS_RETURN_IF_ERROR(
        OnlyThese(file_, {"format", "name", "seed", "knowledge", "random", "rig", "camera", "picture",
                          "light", "lamp", "ground", "part", "line", "cable", "offcut", "stone"}));
    VSS_RETURN_IF_ERROR(ReadKnowledge());
    VSS_RETURN_IF_ERROR(ReadRandom());
    if (const TomlValue* name = file_.Find("name")) {
      VSS_ASSIGN(Scene().name, name->AsText());
    }
    if (const TomlValue* seed = file_.Find("seed")) {
      VSS_ASSIGN(Scene().seed, seed->AsInteger(0, 2147483647));
    }
    VSS_RETURN_IF_ERROR(ReadRig());
    VSS_RETURN_IF_ERROR(ReadLight());
    if (const TomlValue* ground = file_.Find("ground")) {
      VSS_RETURN_IF_ERROR(OnlyThese(*ground, {"albedo", "gloss", "grain", "patches"}));
      VSS_RETURN_IF_ERROR(ReadMaterial(*ground, Scene().ground));
    }
    VSS_RETURN_IF_ERROR(ReadParts());
    VSS_RETURN_IF_ERROR(ReadClutter());
    return std::move(out_);
  }

 private:
  SimulatedScene& Scene() { return out_.scene; }

  Status ReadKnowledge() {
    std::vector<std::string> names;
    if (const TomlValue* given = file_.Find("knowledge")) {
      VSS_ASSIGN(names, given->AsTexts());
    }
    VSS_ASSIGN(out_.knowledge, LoadKnowledge(names, folder_));
    knowledge_ = names;
    for (std::string& name : names) {
      if (!name.ends_with(".kb") && !name.ends_with(".sizes")) continue;
      const fs::path path = folder_ / name;
      VSS_ASSIGN(std::string text, ReadTextFile(path));
      for (const std::string& catalogue : CataloguesBeside(text, path)) {
        VSS_ASSIGN(std::string sizes, ReadTextFile(path.parent_path() / catalogue));
        const std::string copy = "knowledge/" + catalogue;
        if (std::ranges::find(knowledge_texts_, copy, [](const auto& t) { return t.first; }) ==
            knowledge_texts_.end())
          knowledge_texts_.emplace_back(copy, std::move(sizes));
      }
      name = "knowledge/" + path.filename().string();
      knowledge_texts_.emplace_back(name, std::move(text));
    }
    knowledge_ = std::move(names);
    return {};
  }

  Status ReadRandom() {
    const TomlValue* table = file_.Find("random");
    if (table) {
      VSS_RETURN_IF_ERROR(OnlyThese(
          *table, {"seed", "layout", "parts", "clutter", "min_thickness", "rig", "stops", "size", "kinds"}));
      RandomSceneOptions options;
      VSS_ASSIGN(const TomlValue* seed, table->Get("seed", "seed = 1"));
      VSS_ASSIGN(options.seed, seed->AsInteger(0, 2147483647));
      if (const TomlValue* layout = table->Find("layout")) {
        VSS_ASSIGN(const std::string name, layout->AsText());
        const auto named = LayoutNamed(name);
        if (!named) return layout->Complain("is \"" + name + "\"; " + named.error().message);
        options.layout = *named;
      }
      if (const TomlValue* parts = table->Find("parts")) {
        VSS_ASSIGN(options.num_parts, parts->AsInteger(0, 1000));
      }
      if (const TomlValue* clutter = table->Find("clutter")) {
        VSS_ASSIGN(const double yes, clutter->AsNumberOrBool());
        options.clutter = yes != 0;
      }
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "min_thickness", 3, 60, options.min_thickness_mm));
      if (const TomlValue* rig = table->Find("rig")) {
        VSS_ASSIGN(const std::string name, rig->AsText());
        const auto named = RigNamed(name);
        if (!named) return rig->Complain("is \"" + name + "\"; " + named.error().message);
        options.rig.rig = *named;
      }
      if (const TomlValue* stops = table->Find("stops")) {
        VSS_ASSIGN(const Eigen::VectorXd n, stops->AsVector(2));
        options.rig.stops = n.cast<int>();
        if (options.rig.stops.minCoeff() < 1 || options.rig.stops.maxCoeff() > 1000)
          return stops->Complain(
              "must be two numbers from 1 to 1000: how often the carriage stops along x and y");
      }
      if (const TomlValue* size = table->Find("size")) {
        VSS_ASSIGN(options.rig.size_px, size->AsInteger(32, 8192));
      }
      if (const TomlValue* kinds = table->Find("kinds")) {
        VSS_ASSIGN(options.kinds, kinds->AsTexts());
      }
      const auto drawn = DrawRandomScene(options, out_.knowledge);
      if (!drawn) return table->Complain(drawn.error().message);
      out_.scene = *drawn;
    }
    Scene().knowledge = knowledge_;
    Scene().knowledge_texts = knowledge_texts_;
    return {};
  }

  // --- rig ---

  static Status ReadSensor(const TomlValue& table, SceneCamera& c) {
    VSS_RETURN_IF_ERROR(ReadNumber(table, "blur", 0.15, 1.5, c.blur_px));
    VSS_RETURN_IF_ERROR(ReadNumber(table, "read_noise", 0, 100, c.read_noise));
    VSS_RETURN_IF_ERROR(ReadNumber(table, "shot_noise", 0, 10, c.shot_noise));
    return ReadNumber(table, "vignetting", 0, 1, c.vignetting);
  }

  // Cameras around a carriage, all alike, and the places where it stops.
  Status ReadRig() {
    const TomlValue* rig = file_.Find("rig");
    VSS_ASSIGN(const auto cameras, Tables(file_, "camera"));
    VSS_ASSIGN(const auto pictures, Tables(file_, "picture"));
    if (rig && (!cameras.empty() || !pictures.empty()))
      return rig->Complain("stands beside [[camera]] or [[picture]]; leave one of them out");
    if (!cameras.empty()) return ReadCameras(cameras, pictures);
    if (!pictures.empty())
      return pictures[0]->Complain(
          "needs a camera; add a table like: [[camera]] file = \"cameras/cam1.toml\"");
    if (!rig && !Scene().cameras.empty()) return {};  // drawn
    static const TomlValue kNothing;
    return MakeRig(rig ? *rig : kNothing);
  }

  Status MakeRig(const TomlValue& rig) {
    int count = 4;
    double height = 3000, out = 930, tilt_deg = 21, focal_px = 520, stop_error = 0;
    Vector2d size(512, 512);
    std::vector<double> distortion{-0.06, 0.005, 0, 0, 0}, stops_x{0, 2000, 4000, 6000}, stops_y{600, 2400};
    SceneCamera model;
    if (rig.IsTable()) {
      VSS_RETURN_IF_ERROR(
          OnlyThese(rig, {"cameras", "height", "out", "tilt", "focal_length", "size", "distortion", "stops_x",
                          "stops_y", "stop_error", "blur", "read_noise", "shot_noise", "vignetting"}));
      if (const TomlValue* n = rig.Find("cameras")) {
        VSS_ASSIGN(count, n->AsInteger(1, 100));
      }
      VSS_RETURN_IF_ERROR(ReadNumber(rig, "height", 10, 1e5, height));
      VSS_RETURN_IF_ERROR(ReadNumber(rig, "out", 0, 1e5, out));
      VSS_RETURN_IF_ERROR(ReadNumber(rig, "tilt", -80, 80, tilt_deg));
      VSS_RETURN_IF_ERROR(ReadNumber(rig, "focal_length", 10, 1e6, focal_px));
      VSS_RETURN_IF_ERROR(ReadNumber(rig, "stop_error", 0, 100, stop_error));
      if (const TomlValue* value = rig.Find("size")) {
        VSS_ASSIGN(size, value->AsVector(2));
        if (size.minCoeff() < 32 || size.maxCoeff() > 8192)
          return value->Complain("must be width and height of a picture, from 32 to 8192 px");
      }
      for (const auto& [name, list] :
           {std::pair{"stops_x", &stops_x}, {"stops_y", &stops_y}, {"distortion", &distortion}})
        if (const TomlValue* value = rig.Find(name)) {
          VSS_ASSIGN(*list, value->AsNumbers());
          if (list->empty()) return value->Complain("is empty; give at least one number");
          if (list == &distortion && list->size() > 5)
            return value->Complain("has more than the five numbers k1, k2, p1, p2, k3");
        }
      VSS_RETURN_IF_ERROR(ReadSensor(rig, model));
    }
    Scene().cameras.clear();
    Scene().pictures.clear();
    for (int k = 0; k < count; ++k) {
      SceneCamera c = model;
      c.camera.id = fmt::format("cam{}", k + 1);
      c.camera.width_px = int(size.x());
      c.camera.height_px = int(size.y());
      Intrinsics& lens = c.camera.intrinsics;
      lens.model = LensModel::kOpenCv;
      lens.fx_px = lens.fy_px = focal_px;
      lens.cx_px = (size.x() - 1) / 2;
      lens.cy_px = (size.y() - 1) / 2;
      std::copy(distortion.begin(), distortion.end(), lens.distortion.begin());
      lens.num_distortion = 5;
      c.camera.cam_from_world = CarriageCamera(2 * kPi * k / count, out, height, RadFromDeg(tilt_deg), 0);
      Scene().cameras.push_back(std::move(c));
    }
    AddStops(stops_x, stops_y, stop_error, Scene());
    return {};
  }

  Status ReadCameras(const std::vector<const TomlValue*>& cameras,
                     const std::vector<const TomlValue*>& pictures) {
    Scene().cameras.clear();
    Scene().pictures.clear();
    for (const TomlValue* table : cameras) {
      VSS_RETURN_IF_ERROR(OnlyThese(*table, {"file", "blur", "read_noise", "shot_noise", "vignetting"}));
      VSS_ASSIGN(const TomlValue* file, table->Get("file", "file = \"cameras/cam1.toml\""));
      VSS_ASSIGN(const std::string name, file->AsText());
      SceneCamera c;
      VSS_ASSIGN(c.camera, ReadCamera(folder_ / name));
      if (c.camera.response != Response::kLinear)
        return file->Complain("names a camera whose response is \"srgb\"; only linear cameras are simulated");
      VSS_RETURN_IF_ERROR(ReadSensor(*table, c));
      Scene().cameras.push_back(std::move(c));
    }
    if (pictures.empty())
      return cameras[0]->Complain("takes no picture; add tables like: [[picture]] camera = \"" +
                                  Scene().cameras[0].camera.id + "\" gantry = [0, 0, 0]");
    for (const TomlValue* table : pictures) VSS_RETURN_IF_ERROR(ReadPicture(*table));
    return {};
  }

  Status ReadPicture(const TomlValue& table) {
    VSS_RETURN_IF_ERROR(
        OnlyThese(table, {"name", "camera", "gantry", "rotation", "translation", "carriage", "stop_error"}));
    ScenePicture p;
    VSS_ASSIGN(const TomlValue* id, table.Get("camera", "camera = \"cam1\""));
    VSS_ASSIGN(const std::string camera, id->AsText());
    const auto& cameras = Scene().cameras;
    const auto found =
        std::find_if(cameras.begin(), cameras.end(), [&](const auto& c) { return c.camera.id == camera; });
    if (found == cameras.end())
      return id->Complain("is \"" + camera + "\", which no [[camera]] is; correct it");
    p.camera = static_cast<int>(found - cameras.begin());
    p.name = fmt::format("picture{:04}", Scene().pictures.size() + 1);
    if (const TomlValue* name = table.Find("name")) {
      VSS_ASSIGN(p.name, name->AsText());
      if (p.name.find_first_of("/\\") != std::string::npos)
        return name->Complain("must be a file name without folder or ending");
    }
    if (table.Find("rotation") || table.Find("translation")) {
      VSS_ASSIGN(p.cam_from_world, ReadRigidTransform(table));
    } else {
      Vector3d gantry;
      VSS_RETURN_IF_ERROR(ReadPoint<3>(table, "gantry", "gantry = [0.0, 600.0, 0.0]", gantry));
      if (!found->camera.cam_from_world)
        return id->Complain(
            "names a camera without a [pose] in its file; give the picture a rotation and a translation");
      p.gantry_mm = p.carriage_mm = gantry;
      p.cam_from_world = Gantry{}.CamFromWorld(found->camera, gantry);
    }
    if (table.Find("carriage")) VSS_RETURN_IF_ERROR(ReadPoint<3>(table, "carriage", "", p.carriage_mm));
    if (table.Find("stop_error")) VSS_RETURN_IF_ERROR(ReadPoint<3>(table, "stop_error", "", p.stop_error_mm));
    Scene().pictures.push_back(std::move(p));
    return {};
  }

  Status ReadLight() {
    if (const TomlValue* light = file_.Find("light")) {
      VSS_RETURN_IF_ERROR(OnlyThese(*light, {"ambient", "exposure", "shadows"}));
      if (const TomlValue* shadows = light->Find("shadows")) {
        VSS_ASSIGN(const double yes, shadows->AsNumberOrBool());
        Scene().shadows = yes != 0;
      }
      VSS_RETURN_IF_ERROR(ReadNumber(*light, "ambient", 0, 100, Scene().ambient));
      VSS_RETURN_IF_ERROR(ReadNumber(*light, "exposure", 1, 1000, Scene().exposure_grey));
    }
    VSS_ASSIGN(const auto lamps, Tables(file_, "lamp"));
    if (!lamps.empty()) Scene().lamps.clear();
    for (const TomlValue* table : lamps) {
      VSS_RETURN_IF_ERROR(OnlyThese(*table, {"position", "radius", "power", "on_gantry"}));
      Lamp lamp;
      VSS_RETURN_IF_ERROR(ReadPoint<3>(*table, "position", "position = [800.0, 0.0, 3000.0]", lamp.position));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "radius", 1, 1e4, lamp.radius_mm));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "power", 0, 1000, lamp.power));
      if (const TomlValue* on_gantry = table->Find("on_gantry")) {
        VSS_ASSIGN(const double yes, on_gantry->AsNumberOrBool());
        lamp.on_gantry = yes != 0;
      }
      Scene().lamps.push_back(lamp);
    }
    if (Scene().lamps.empty() && !file_.Find("light"))
      Scene().lamps = {{{1000, 500, 3000}, 120, 0.8, true}, {{-1000, -500, 2800}, 120, 0.7, true}};
    return {};
  }

  // --- parts ---

  Status ReadParts() {
    VSS_ASSIGN(const auto parts, Tables(file_, "part"));
    for (const TomlValue* table : parts) VSS_RETURN_IF_ERROR(ReadPart(*table));
    return {};
  }

  Status ReadPart(const TomlValue& table) {
    VSS_RETURN_IF_ERROR(OnlyThese(table, {"id", "kind", "features", "dimensions", "position", "z", "yaw",
                                          "tilt", "rests", "on", "albedo", "gloss", "grain", "patches"}));
    ScenePart part;
    VSS_ASSIGN(const TomlValue* kind, table.Get("kind", "kind = \"box\""));
    VSS_ASSIGN(const std::string name, kind->AsText());
    part.object.model = out_.knowledge.Find(name);
    if (!part.object.model) {
      std::string known;
      for (const auto& o : out_.knowledge.objects) known += (known.empty() ? "" : ", ") + o->kind();
      return kind->Complain("is \"" + name + "\", which the knowledge base lacks; it has: " + known);
    }
    if (const TomlValue* features = table.Find("features")) {
      VSS_ASSIGN(const std::vector<std::string> wanted, features->AsTexts());
      part.object.model = out_.knowledge.Find(name, wanted);
      if (!part.object.model)
        return features->Complain("are none that a " + name +
                                  " can have together; look at the knowledge base");
    }
    part.id = fmt::format("p{}", Scene().parts.size() + 1);
    if (const TomlValue* id = table.Find("id")) {
      VSS_ASSIGN(part.id, id->AsText());
      if (FindPart(part.id))
        return id->Complain("is \"" + part.id + "\", as another part's; give each part an id of its own");
    }
    VSS_RETURN_IF_ERROR(ReadDimensions(table, part.object));
    VSS_RETURN_IF_ERROR(ReadPlace(table, part));
    VSS_RETURN_IF_ERROR(ReadMaterial(table, part.material));
    Scene().parts.push_back(std::move(part));
    return {};
  }

  const ScenePart* FindPart(const std::string& id) {
    for (const auto& p : Scene().parts)
      if (p.id == id) return &p;
    return nullptr;
  }

  static Status ReadDimensions(const TomlValue& table, PlacedObject& object) {
    const auto defs = object.model->dimensions();
    std::vector<std::optional<double>> known(defs.size());
    if (const TomlValue* given = table.Find("dimensions")) {
      VSS_ASSIGN(const TomlValue::Table* rows, given->AsTable());
      for (const auto& [name, value] : *rows) {
        const auto def =
            std::find_if(defs.begin(), defs.end(), [&](const auto& d) { return d.name == name; });
        if (def == defs.end()) {
          std::string list;
          for (const auto& d : defs) list += (list.empty() ? "" : ", ") + d.name;
          return value.Complain(
              fmt::format("is no dimension of a {}; there are: {}", object.model->kind(), list));
        }
        VSS_ASSIGN(known[std::size_t(def - defs.begin())], value.AsNumber());
      }
    }
    object.dimensions_mm = object.model->UsualDimensions(known);
    for (std::size_t i = 0; i < known.size(); ++i)
      if (known[i]) object.dimensions_mm[i] = *known[i];
    if (const auto solid = object.model->Instantiate(object.dimensions_mm); !solid)
      return InputError("{}: `{}` is impossible: {}", table.Where(), table.name(), solid.error().message);
    return {};
  }

  Status ReadPlace(const TomlValue& table, ScenePart& part) {
    PlacedObject& object = part.object;
    Vector2d position;
    VSS_RETURN_IF_ERROR(ReadPoint<2>(table, "position", "position = [1000.0, 500.0]", position));
    object.placement.head<2>() = position;
    double yaw_deg = 0;
    VSS_RETURN_IF_ERROR(ReadNumber(table, "yaw", -360, 360, yaw_deg));
    object.placement[3] = RadFromDeg(yaw_deg);
    if (table.Find("tilt")) {
      Vector2d tilt_deg;
      VSS_RETURN_IF_ERROR(ReadPoint<2>(table, "tilt", "", tilt_deg));
      object.placement[4] = RadFromDeg(tilt_deg.x());
      object.placement[5] = RadFromDeg(tilt_deg.y());
    }
    if (const TomlValue* rests = table.Find("rests")) {
      VSS_ASSIGN(const std::string name, rests->AsText());
      const auto poses = object.model->resting_poses();
      const auto found =
          std::find_if(poses.begin(), poses.end(), [&](const auto& p) { return p.name == name; });
      if (found == poses.end()) {
        std::string known;
        for (const auto& p : poses) known += (known.empty() ? "" : ", ") + p.name;
        return rests->Complain(fmt::format("is \"{}\", no way for a {} to rest; there are: {}", name,
                                           object.model->kind(), known));
      }
      object.resting_pose = static_cast<int>(found - poses.begin());
    }
    if (const TomlValue* on = table.Find("on")) {
      VSS_ASSIGN(part.stands_on, on->AsText());
      if (part.stands_on != "ground") {
        const ScenePart* support = FindPart(part.stands_on);
        if (!support)
          return on->Complain(
              "is \"" + part.stands_on +
              "\", which no part before this one is called; correct it, or put that part first");
        object.placement[2] = TopOf(support->object);
      }
    }
    return ReadNumber(table, "z", -kFarMm, kFarMm, object.placement[2]);
  }

  // --- clutter ---

  Status ReadClutter() {
    VSS_ASSIGN(const auto lines, Tables(file_, "line"));
    for (const TomlValue* table : lines) {
      VSS_RETURN_IF_ERROR(OnlyThese(*table, {"from", "to", "width", "albedo"}));
      PaintedLine line;
      VSS_RETURN_IF_ERROR(ReadPoint<2>(*table, "from", "from = [0.0, 0.0]", line.from));
      VSS_RETURN_IF_ERROR(ReadPoint<2>(*table, "to", "to = [3000.0, 0.0]", line.to));
      if (!((line.to - line.from).norm() > 0))
        return table->Complain("is a line without length; set `from` and `to` apart");
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "width", 0.1, 1e5, line.width_mm));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "albedo", 0, 1, line.albedo));
      Scene().lines.push_back(line);
    }
    VSS_ASSIGN(const auto cables, Tables(file_, "cable"));
    for (const TomlValue* table : cables) {
      VSS_RETURN_IF_ERROR(OnlyThese(*table, {"points", "diameter", "albedo"}));
      Cable cable;
      VSS_ASSIGN(cable.points,
                 ReadPoints(*table, "points", "points = [[0.0, 0.0], [500.0, 100.0], [900.0, 600.0]]", 2));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "diameter", 0.1, 1000, cable.diameter_mm));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "albedo", 0, 1, cable.albedo));
      Scene().cables.push_back(std::move(cable));
    }
    VSS_ASSIGN(const auto offcuts, Tables(file_, "offcut"));
    for (const TomlValue* table : offcuts) VSS_RETURN_IF_ERROR(ReadOffcut(*table));
    VSS_ASSIGN(const auto stones, Tables(file_, "stone"));
    for (const TomlValue* table : stones) {
      VSS_RETURN_IF_ERROR(OnlyThese(*table, {"place", "size", "albedo"}));
      Stone stone;
      VSS_RETURN_IF_ERROR(ReadPoint<2>(*table, "place", "place = [1000.0, 500.0]", stone.place));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "size", 1, 5000, stone.size_mm));
      VSS_RETURN_IF_ERROR(ReadNumber(*table, "albedo", 0, 1, stone.albedo));
      Scene().stones.push_back(stone);
    }
    return {};
  }

  Status ReadOffcut(const TomlValue& table) {
    VSS_RETURN_IF_ERROR(OnlyThese(table, {"outline", "height", "z", "albedo", "gloss", "grain", "patches"}));
    Offcut offcut;
    VSS_ASSIGN(offcut.outline,
               ReadPoints(table, "outline", "outline = [[0.0, 0.0], [90.0, 20.0], [40.0, 80.0]]", 3));
    const std::size_t n = offcut.outline.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Vector2d &a = offcut.outline[i], b = offcut.outline[(i + 1) % n] - a,
                     c = offcut.outline[(i + 2) % n] - a;
      if (!(b.x() * c.y() - b.y() * c.x() > 0))
        return table.Find("outline")->Complain(
            "must be convex and run counter-clockwise; turn its order round, or make two offcuts of it");
    }
    VSS_RETURN_IF_ERROR(ReadNumber(table, "height", 0.1, 1e4, offcut.height_mm));
    VSS_RETURN_IF_ERROR(ReadNumber(table, "z", 0, 1e5, offcut.base_mm));
    VSS_RETURN_IF_ERROR(ReadMaterial(table, offcut.material));
    Scene().offcuts.push_back(std::move(offcut));
    return {};
  }

  TomlValue file_;
  fs::path folder_;
  std::vector<std::string> knowledge_;
  std::vector<std::pair<std::string, std::string>> knowledge_texts_;
  LoadedScene out_;
};

std::string MaterialToToml(const Material& m) {
  return fmt::format("albedo = {}\ngloss = {}\ngrain = {}\npatches = {}\n", TomlNumber(m.albedo),
                     TomlNumber(m.gloss), TomlNumber(m.grain), TomlNumber(m.patches));
}
std::string PointsToToml(const std::vector<Vector2d>& points) {
  std::string out = "[";
  for (std::size_t i = 0; i < points.size(); ++i) out += (i ? ", " : "") + TomlArray(points[i]);
  return out + "]";
}

std::string FeaturesToToml(const ObjectModel& model) {
  if (model.features().empty()) return "";
  std::string list;
  for (const std::string& f : FeaturesOf(model)) list += (list.empty() ? "" : ", ") + TomlText(f);
  return "features = [" + list + "]\n";
}

std::string PartToToml(const ScenePart& part) {
  const PlacedObject& o = part.object;
  std::string dimensions;
  for (std::size_t i = 0; i < o.dimensions_mm.size(); ++i)
    dimensions += fmt::format("{}{} = {}", i ? ", " : "", o.model->dimensions()[i].name,
                              TomlNumber(o.dimensions_mm[i]));
  std::string out = fmt::format(
      "\n[[part]]\nid = {}\nkind = {}\n{}dimensions = {{ {} }}\nposition = {}\nz = {}\nyaw = {}\n",
      TomlText(part.id), TomlText(o.model->kind()), FeaturesToToml(*o.model), dimensions,
      TomlArray(o.placement.head<2>()), TomlNumber(o.placement[2]), TomlNumber(DegFromRad(o.placement[3])));
  if (o.placement[4] != 0 || o.placement[5] != 0)
    out += "tilt = " + TomlArray(Vector2d(DegFromRad(o.placement[4]), DegFromRad(o.placement[5]))) + "\n";
  out += "rests = " + TomlText(o.model->resting_poses()[std::size_t(o.resting_pose)].name) +
         "\non = " + TomlText(part.stands_on) + "\n";
  return out + MaterialToToml(part.material);
}

}  // namespace

Result<LoadedScene> ReadScene(const fs::path& path) {
  VSS_ASSIGN(TomlValue file, ReadToml(path, "vss-scene/1"));
  return SceneReader(std::move(file), path.parent_path()).Run();
}

std::string SceneToToml(const SimulatedScene& scene) {
  std::string out =
      fmt::format("format = \"vss-scene/1\"\nname = {}\nseed = {}\n", TomlText(scene.name), scene.seed);
  if (!scene.knowledge.empty()) {
    out += "knowledge = [";
    for (std::size_t i = 0; i < scene.knowledge.size(); ++i)
      out += (i ? ", " : "") + TomlText(scene.knowledge[i]);
    out += "]\n";
  }
  out += "\n[ground]\n" + MaterialToToml(scene.ground);
  out += fmt::format("\n[light]\nambient = {}\nexposure = {}\nshadows = {}\n", TomlNumber(scene.ambient),
                     TomlNumber(scene.exposure_grey), scene.shadows);
  for (const Lamp& l : scene.lamps)
    out += fmt::format("\n[[lamp]]\nposition = {}\nradius = {}\npower = {}\non_gantry = {}\n",
                       TomlArray(l.position), TomlNumber(l.radius_mm), TomlNumber(l.power), l.on_gantry);
  for (const ScenePart& part : scene.parts) out += PartToToml(part);
  for (const PaintedLine& l : scene.lines)
    out += fmt::format("\n[[line]]\nfrom = {}\nto = {}\nwidth = {}\nalbedo = {}\n", TomlArray(l.from),
                       TomlArray(l.to), TomlNumber(l.width_mm), TomlNumber(l.albedo));
  for (const Cable& c : scene.cables)
    out += fmt::format("\n[[cable]]\npoints = {}\ndiameter = {}\nalbedo = {}\n", PointsToToml(c.points),
                       TomlNumber(c.diameter_mm), TomlNumber(c.albedo));
  for (const Offcut& o : scene.offcuts)
    out += fmt::format("\n[[offcut]]\noutline = {}\nheight = {}\nz = {}\n", PointsToToml(o.outline),
                       TomlNumber(o.height_mm), TomlNumber(o.base_mm)) +
           MaterialToToml(o.material);
  for (const Stone& s : scene.stones)
    out += fmt::format("\n[[stone]]\nplace = {}\nsize = {}\nalbedo = {}\n", TomlArray(s.place),
                       TomlNumber(s.size_mm), TomlNumber(s.albedo));
  for (const SceneCamera& c : scene.cameras)
    out +=
        fmt::format("\n[[camera]]\nfile = {}\nblur = {}\nread_noise = {}\nshot_noise = {}\nvignetting = {}\n",
                    TomlText("cameras/" + c.camera.id + ".toml"), TomlNumber(c.blur_px),
                    TomlNumber(c.read_noise), TomlNumber(c.shot_noise), TomlNumber(c.vignetting));
  for (const ScenePicture& p : scene.pictures) {
    out += fmt::format("\n[[picture]]\nname = {}\ncamera = {}\n", TomlText(p.name),
                       TomlText(scene.cameras[std::size_t(p.camera)].camera.id));
    if (p.gantry_mm)
      out += "gantry = " + TomlArray(*p.gantry_mm) + "\n";
    else
      out += "rotation = " + TomlMatrix(p.cam_from_world.rotation) +
             "\ntranslation = " + TomlArray(p.cam_from_world.translation) + "\n";
    if (!p.gantry_mm || *p.gantry_mm != p.carriage_mm) out += "carriage = " + TomlArray(p.carriage_mm) + "\n";
    if (!p.stop_error_mm.isZero()) out += "stop_error = " + TomlArray(p.stop_error_mm) + "\n";
  }
  return out;
}

}  // namespace vss
