#include "vss/product/json_pieces.inc"

namespace vss::product_json {
namespace {

Json DeviationJson(const Deviation& d) {
  Json out = {{"built", Length(d.built)},
              {"designed", Length(d.designed)},
              {"difference", d.observable ? Length(d.difference()) : Json()},
              {"sigma", d.observable ? Significant(d.sigma) : Json()},
              {"sigmas", d.observable ? Rounded(d.sigmas(), 100) : Json()},
              {"significant", d.significant}};
  if (!d.observable) out["observable"] = false;
  return out;
}

}  // namespace

Json NominalJson(const NominalComparison& nominal) {
  Json out = {{"file", nominal.file}, {"parts", Json::array()}};
  for (const auto& part : nominal.parts) {
    Json entry = {{"designed", part.nominal},
                  {"part", part.part},
                  {"kind", part.kind},
                  {"matched_by", part.matched_by},
                  {"deviations", Json::object()}};
    for (const auto& d : part.deviations) entry["deviations"][d.name] = DeviationJson(d);
    out["parts"].push_back(std::move(entry));
  }
  out["missing"] = nominal.missing;
  out["extra"] = nominal.extra;
  return out;
}

Json ContourResidualsJson(const Part& part, const std::vector<std::string>& files) {
  Json out = Json::array();
  const ContourResidual* before = nullptr;
  for (const auto& r : part.contour_residuals) {
    if (!before || before->contour != r.contour || before->index != r.index || before->side != r.side) {
      out.push_back({{r.contour, r.index}, {"lies", r.lies}, {"pictures", Json::array()}});
      if (r.contour == "limb") out.back()["side"] = r.side;
    }
    before = &r;
    Json picture = {{"image", FileOf(r.image, files)},
                    {"mean_px", Rounded(r.mean_px, kRatioDigits)},
                    {"rms_px", Rounded(r.rms_px, kRatioDigits)},
                    {"points", r.num_points}};
    if (!r.used) picture["used"] = false;
    if (r.shadowed) picture["shadowed"] = true;
    out.back()["pictures"].push_back(std::move(picture));
  }
  return out;
}

Json StraightnessJson(const Part& part) {
  Json out = Json::array();
  for (const auto& s : part.straightness)
    out.push_back({{"edge", s.edge},
                   {"bow", Significant(s.bow_mm)},
                   {"sigma", Significant(s.sigma_mm)},
                   {"pictures", s.num_pictures}});
  return out;
}

Json ObservabilityJson(const Part& part) {
  static const char* const places[] = {"x", "y", "z", "yaw", "tilt_x", "tilt_y"};
  Json observable = Json::object();
  for (std::size_t i = 0; i < part.observable.size(); ++i) {
    const std::size_t dimension = i < 6 ? 0 : i - 6;
    if (i >= 6 && dimension >= part.dimensions.size()) break;
    observable[i < 6 ? std::string(places[i]) : part.dimensions[dimension].name] = bool(part.observable[i]);
  }
  return {{"observable", observable}, {"singular_values", ListOf(part.singular_values, Significant)}};
}

Json ChecksJson(const SurveyChecks& checks, const std::vector<std::string>& files) {
  Json out;
  out["leave_one_out"] = Json::array();
  for (const auto& p : checks.pictures)
    out["leave_one_out"].push_back({{"image", FileOf(p.image, files)},
                                    {"edges", p.num_edges},
                                    {"rms_px", Rounded(p.rms_px, kRatioDigits)},
                                    {"part", p.part},
                                    {"unknown", p.unknown},
                                    {"change", Significant(p.change_mm)},
                                    {"sigma", Significant(p.sigma_mm)},
                                    {"outlying", p.outlying}});
  out["cameras"] = Json::array();
  for (const auto& c : checks.cameras) {
    Json entry = {{"camera", c.camera}};
    if (c.image >= 0) entry["image"] = FileOf(c.image, files);
    entry["rotation_mrad"] = ListOf(c.rotation_mrad, Significant);
    entry["rotation_sigma_mrad"] = ListOf(c.rotation_sigma_mrad, Significant);
    entry["shift"] = ListOf(c.shift_mm, Significant);
    entry["shift_sigma"] = ListOf(c.shift_sigma_mm, Significant);
    entry["significance"] = Rounded(c.significance, 100);
    entry["moved"] = c.moved;
    out["cameras"].push_back(std::move(entry));
  }
  out["scale"] = {{"from", checks.scale.from},
                  {"correction_ppm", Significant(checks.scale.correction_ppm)},
                  {"sigma_ppm", Significant(checks.scale.sigma_ppm)}};
  if (checks.ground)
    out["ground"] = {{"at", ListOf(checks.ground->at, Significant)},
                     {"height", Significant(checks.ground->height_mm)},
                     {"sigma", Significant(checks.ground->sigma_mm)},
                     {"slope_mm_per_m", ListOf(checks.ground->slope_mm_per_m, Significant)},
                     {"slope_sigma_mm_per_m", ListOf(checks.ground->slope_sigma_mm_per_m, Significant)}};
  for (std::size_t c = 0; c < checks.systematic_px.size(); ++c)
    out["systematic_px"][NameOf(static_cast<ContourClass>(c))] = Significant(checks.systematic_px[c]);
  return out;
}

}  // namespace vss::product_json
