#include "checks_json.h"

namespace vss::station {
namespace {

Eigen::Vector3d NumbersOf(const Json& json) {
  return {NumberOf(json.at(0)), NumberOf(json.at(1)), NumberOf(json.at(2))};
}

Json JsonOf(const PictureCheck& p, const std::vector<std::string>& files) {
  return {{"image", files.at(std::size_t(p.image))},
          {"edges", p.num_edges},
          {"rms_px", p.rms_px},
          {"part", p.part},
          {"unknown", p.unknown},
          {"change", p.change_mm},
          {"sigma", p.sigma_mm},
          {"outlying", p.outlying}};
}
PictureCheck PictureCheckOf(const Json& j, const std::vector<std::string>& files) {
  PictureCheck p;
  p.image = ImageIndex(j.at("image"), files);
  p.num_edges = j.at("edges");
  p.rms_px = NumberOf(j.at("rms_px"));
  p.part = j.at("part");
  p.unknown = j.at("unknown");
  p.change_mm = NumberOf(j.at("change"));
  p.sigma_mm = NumberOf(j.at("sigma"));
  p.outlying = j.at("outlying");
  return p;
}

Json JsonOf(const CameraCheck& c, const std::vector<std::string>& files) {
  Json out = {{"camera", c.camera},
              {"rotation_mrad", station::JsonOf(c.rotation_mrad)},
              {"rotation_sigma_mrad", station::JsonOf(c.rotation_sigma_mrad)},
              {"shift", station::JsonOf(c.shift_mm)},
              {"shift_sigma", station::JsonOf(c.shift_sigma_mm)},
              {"significance", c.significance},
              {"moved", c.moved}};
  if (c.image >= 0) out["image"] = files.at(std::size_t(c.image));
  return out;
}
CameraCheck CameraCheckOf(const Json& j, const std::vector<std::string>& files) {
  CameraCheck c;
  c.camera = j.at("camera");
  if (j.contains("image")) c.image = ImageIndex(j.at("image"), files);
  c.rotation_mrad = NumbersOf(j.at("rotation_mrad"));
  c.rotation_sigma_mrad = NumbersOf(j.at("rotation_sigma_mrad"));
  c.shift_mm = NumbersOf(j.at("shift"));
  c.shift_sigma_mm = NumbersOf(j.at("shift_sigma"));
  c.significance = NumberOf(j.at("significance"));
  c.moved = j.at("moved");
  return c;
}

}  // namespace

Json JsonOf(const std::vector<ContourResidual>& residuals, const std::vector<std::string>& files) {
  Json list = Json::array();
  for (const auto& r : residuals)
    list.push_back({r.contour, r.index, r.side, r.lies, files.at(std::size_t(r.image)), r.mean_px, r.rms_px,
                    r.num_points, r.used, r.shadowed});
  return list;
}

std::vector<ContourResidual> ContourResidualsOf(const Json& json, const std::vector<std::string>& files) {
  std::vector<ContourResidual> out;
  for (const auto& r : json)
    out.push_back({r.at(0).get<std::string>(), r.at(1).get<int>(), r.at(2).get<int>(),
                   r.at(3).get<std::string>(), ImageIndex(r.at(4), files), NumberOf(r.at(5)),
                   NumberOf(r.at(6)), r.at(7).get<int>(), r.at(8).get<bool>(), r.at(9).get<bool>()});
  return out;
}

Json JsonOf(const std::vector<Straightness>& straightness) {
  Json list = Json::array();
  for (const auto& s : straightness)
    list.push_back(
        {{"edge", s.edge}, {"bow", s.bow_mm}, {"sigma", s.sigma_mm}, {"pictures", s.num_pictures}});
  return list;
}

std::vector<Straightness> StraightnessOf(const Json& json) {
  std::vector<Straightness> out;
  for (const auto& s : json)
    out.push_back({s.at("edge").get<int>(), NumberOf(s.at("bow")), NumberOf(s.at("sigma")),
                   s.at("pictures").get<int>()});
  return out;
}

Json JsonOf(const SurveyChecks& checks, const std::vector<std::string>& files) {
  Json out = {{"pictures", Json::array()},
              {"cameras", Json::array()},
              {"systematic_px", checks.systematic_px},
              {"scale",
               {{"from", checks.scale.from},
                {"correction_ppm", checks.scale.correction_ppm},
                {"sigma_ppm", checks.scale.sigma_ppm}}}};
  for (const auto& p : checks.pictures) out["pictures"].push_back(JsonOf(p, files));
  for (const auto& c : checks.cameras) out["cameras"].push_back(JsonOf(c, files));
  if (const auto& g = checks.ground)
    out["ground"] = {{"at", {g->at.x(), g->at.y()}},
                     {"height", g->height_mm},
                     {"sigma", g->sigma_mm},
                     {"slope", {g->slope_mm_per_m.x(), g->slope_mm_per_m.y()}},
                     {"slope_sigma", {g->slope_sigma_mm_per_m.x(), g->slope_sigma_mm_per_m.y()}}};
  return out;
}

SurveyChecks SurveyChecksOf(const Json& json, const std::vector<std::string>& files) {
  SurveyChecks out;
  for (const auto& p : json.at("pictures")) out.pictures.push_back(PictureCheckOf(p, files));
  for (const auto& c : json.at("cameras")) out.cameras.push_back(CameraCheckOf(c, files));
  const Json& scale = json.at("scale");
  out.scale = {scale.at("from").get<std::string>(), NumberOf(scale.at("correction_ppm")),
               NumberOf(scale.at("sigma_ppm"))};
  for (std::size_t i = 0; i < out.systematic_px.size(); ++i)
    out.systematic_px[i] = NumberOf(json.at("systematic_px").at(i));
  if (json.contains("ground")) {
    const Json& g = json.at("ground");
    const auto pair = [&](const char* name) {
      return Eigen::Vector2d(NumberOf(g.at(name).at(0)), NumberOf(g.at(name).at(1)));
    };
    out.ground = {pair("at"), NumberOf(g.at("height")), NumberOf(g.at("sigma")), pair("slope"),
                  pair("slope_sigma")};
  }
  return out;
}

void RemoveChecks(Json& part_or_run) {
  for (const char* name :
       {"contours", "straightness", "observable", "singular_values", "vertex_covariance", "checks"})
    part_or_run.erase(name);
}

}  // namespace vss::station
