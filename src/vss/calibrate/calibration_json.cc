#include <cmath>
#include <nlohmann/json.hpp>

#include "vss/calibrate/calibrate.h"

namespace vss {
namespace {

using nlohmann::json;

json Matrix(const Eigen::MatrixXd& m) {
  json rows = json::array();
  for (int i = 0; i < m.rows(); ++i) {
    json row = json::array();
    for (int j = 0; j < m.cols(); ++j) row.push_back(m(i, j));
    rows.push_back(row);
  }
  return rows;
}

json Vector(const Eigen::VectorXd& v) {
  json list = json::array();
  for (int i = 0; i < v.size(); ++i) list.push_back(v[i]);
  return list;
}

json Map(const PictureMap& m) {
  json values = json::array();
  for (double v : m.value) values.push_back(std::isfinite(v) ? json(v) : json());
  return {{"columns", m.columns}, {"rows", m.rows}, {"rms", m.rms}, {"max", m.max}, {"values", values}};
}

json LensOf(const Intrinsics& k) {
  json d = json::array();
  for (int i = 0; i < k.num_distortion; ++i) d.push_back(k.distortion[i]);
  return {{"model", k.model == LensModel::kWeng     ? "weng"
                    : k.model == LensModel::kOpenCv ? "opencv"
                                                    : "pinhole"},
          {"fx_px", k.fx_px},
          {"fy_px", k.fy_px},
          {"cx_px", k.cx_px},
          {"cy_px", k.cy_px},
          {"distortion", d}};
}

json Intrinsic(const IntrinsicResult& r) {
  json views = json::array(), dropped = json::array(), choices = json::array(), marks = json::array(),
       terms = json::array();
  for (const auto& q : r.quality) {
    json v{{"file", q.file},       {"used", q.used},
           {"marks", q.num_marks}, {"dropped", q.num_dropped},
           {"rms_px", q.rms_px},   {"tilt_deg", q.tilt_deg},
           {"blur_px", q.blur_px}, {"distance_mm", q.distance_mm}};
    if (!q.used) v["why_not"] = q.why_not;
    views.push_back(v);
  }
  for (const auto& d : r.dropped)
    dropped.push_back({{"file", d.file},
                       {"column", d.column},
                       {"row", d.row},
                       {"distance_px", d.distance_px},
                       {"why", "too far from where the other marks have it"}});
  for (const auto& c : r.choices)
    choices.push_back({{"term", c.term},
                       {"holdout_px", c.holdout_px},
                       {"value", c.value},
                       {"sigma", c.sigma},
                       {"taken", c.taken}});
  for (std::size_t v = 0; v < r.views.size(); ++v)
    for (std::size_t i = 0; i < r.views[v].img.size(); ++i)
      marks.push_back({r.picture_of_view[v], r.views[v].img[i].x(), r.views[v].img[i].y(),
                       r.solution.residual_px[v][i].x(), r.solution.residual_px[v][i].y()});
  for (const auto& t : r.problem.terms) terms.push_back(t.name);
  json out{{"lens", LensOf(r.intrinsics)},
           {"rms_px", r.solution.rms_px},
           {"sigma_px", r.solution.sigma_px},
           {"iterations", r.solution.iterations},
           {"terms", terms},
           {"holdout_px", r.holdout_px},
           {"halves_difference_px", Map(r.halves_difference_px)},
           {"uncertainty_px", Map(r.uncertainty_px)},
           {"coverage", Map(r.coverage)},
           {"covered_share", r.covered_share},
           {"views", views},
           {"dropped_marks", dropped},
           {"choices", choices},
           {"findings", r.findings},
           {"next_view", r.next_view},
           {"marks", {{"columns", {"view", "u", "v", "residual_u", "residual_v"}}, {"values", marks}}}};
  if (r.problem.estimate_bow) out["bow_mm"] = Vector(r.solution.bow_mm);
  return out;
}

json Extrinsic(const CubeResult& r) {
  json edges = json::array(), moves = json::array(), bias = json::object();
  for (const auto& e : r.edges)
    edges.push_back({{"file", e.file},
                     {"class", NameOf(e.edge_class)},
                     {"points", e.num_points},
                     {"used", e.num_used},
                     {"mean_px", e.mean_px},
                     {"rms_px", e.rms_px}});
  for (const auto& m : r.moves)
    moves.push_back({{"file", m.file},
                     {"seen_mm", Vector(m.seen_mm)},
                     {"said_mm", Vector(m.said_mm)},
                     {"sigma_mm", Vector(m.sigma_mm)}});
  for (int c = 0; c < kNumCubeEdgeClasses; ++c)
    bias[NameOf(static_cast<CubeEdgeClass>(c))] = {{"px", r.bias_px[c]}, {"sigma_px", r.bias_sigma_px[c]}};
  const Eigen::Vector3d centre = r.cam_from_world.Inverse().translation;
  return {{"camera_from_world",
           {{"rotation", Matrix(r.cam_from_world.rotation)},
            {"translation", Vector(r.cam_from_world.translation)}}},
          {"centre_mm", Vector(centre)},
          {"rms_px", r.rms_px},
          {"edge_points", r.num_points},
          {"edge_bias", bias},
          {"edges", edges},
          {"moves", moves},
          {"cube_scale", r.cube_scale},
          {"cube_scale_sigma", r.cube_scale_sigma},
          {"findings", r.findings}};
}

}  // namespace

std::string CalibrationToJson(const Calibration& calibration) {
  json cameras = json::array();
  for (const auto& c : calibration.cameras) {
    json camera{{"id", c.camera.id}, {"width", c.camera.width_px}, {"height", c.camera.height_px}};
    if (c.lens) camera["intrinsic"] = Intrinsic(*c.lens);
    if (c.place) camera["extrinsic"] = Extrinsic(*c.place);
    if (c.camera.quality) {
      camera["warnings"] = c.camera.quality->warnings;
      const auto& m = c.camera.quality->covariance;
      if (m.size() > 0) camera["sigma"] = Vector(m.diagonal().cwiseMax(0).cwiseSqrt());
      for (const auto& [name, text] : c.camera.quality->about) camera[name] = text;
    }
    cameras.push_back(camera);
  }
  json out{{"format", "vss-calibration-report/1"},
           {"name", calibration.name},
           {"cameras", cameras},
           {"warnings", calibration.warnings}};
  if (calibration.axes) {
    out["gantry"] = {{"axes", Matrix(calibration.axes->axes)},
                     {"sigma", Matrix(calibration.axes->sigma)},
                     {"findings", calibration.axes->findings}};
  }
  return out.dump(1) + "\n";
}

}  // namespace vss
