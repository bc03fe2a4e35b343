#include "part_json.h"

#include <algorithm>
#include <climits>
#include <cmath>

#include "checks_json.h"

namespace vss::station {

double NumberOf(const Json& json) { return json.is_null() ? NAN : json.get<double>(); }

int ImageIndex(const std::string& file, const std::vector<std::string>& files) {
  const auto at = std::find(files.begin(), files.end(), file);
  if (at == files.end()) throw std::runtime_error(fmt::format("the survey has no picture {}", file));
  return static_cast<int>(at - files.begin());
}

Eigen::Vector3d VectorOf(const Json& j) {
  if (j.size() != 3) throw std::runtime_error("three numbers are needed");
  const Eigen::Vector3d v(j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>());
  if (!v.allFinite()) throw std::runtime_error("a number is not finite");
  return v;
}
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d Matrix(const Json& j) {
  if (j.size() != 3) throw std::runtime_error("three rows are needed");
  Matrix3d m;
  for (int i = 0; i < 3; ++i) m.row(i) = VectorOf(j.at(std::size_t(i))).transpose();
  return m;
}

std::vector<Vector3d> Vectors(const Json& list) {
  std::vector<Vector3d> out;
  for (const auto& v : list) out.push_back(VectorOf(v));
  return out;
}

Json MatchesToJson(const Part& part, const std::vector<std::string>& files) {
  Json list = Json::array();
  for (const auto& m : part.matches)
    list.push_back({{"image", files.at(std::size_t(m.image))},
                    {"line", m.line},
                    {"edge", m.edge},
                    {"arc", m.is_arc},
                    {"residual_px", m.residual_px}});
  return list;
}

Json DimensionsToJson(const Part& part) {
  Json out = Json::object();
  for (const auto& d : part.dimensions) {
    Json one = {{"value", d.value_mm}, {"sigma", d.sigma_mm}, {"observable", d.observable}};
    if (!d.origin.empty()) one["origin"] = d.origin;
    if (d.nominal_mm) one["nominal"] = *d.nominal_mm;
    out[d.name] = std::move(one);
  }
  return out;
}

// `order`: their names in the object's order, which a JSON object does not keep; the covariance counts on it.
void ReadDimensions(const Json& json, const Json& order, Part& part) {
  std::vector<std::string> names =
      order.is_array() ? order.get<std::vector<std::string>>() : std::vector<std::string>();
  for (const auto& [name, d] : json.items())
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  for (const auto& name : names) {
    const Json& d = json.at(name);
    const Json sigma = d.value("sigma", Json());
    DimensionValue value{name, d.at("value").get<double>(), sigma.is_number() ? sigma.get<double>() : NAN,
                         d.value("observable", true), d.value("origin", "")};
    if (!std::isfinite(value.value_mm)) throw std::runtime_error("a dimension is not finite");
    if (d.contains("nominal")) value.nominal_mm = d.at("nominal").get<double>();
    part.dimensions.push_back(std::move(value));
  }
}

void ReadMatches(const Json& json, const std::vector<std::string>& files, Part& part) {
  for (const auto& m : json)
    part.matches.push_back({ImageIndex(m.at("image"), files), m.at("line").get<int>(),
                            m.at("edge").get<int>(), m.value("arc", false),
                            NumberOf(m.value("residual_px", Json(0.0)))});
}

void ReadNumbers(const Json& list, Eigen::VectorXd& out) {
  out.resize(Eigen::Index(list.size()));
  for (Eigen::Index i = 0; i < out.size(); ++i) out[i] = list.at(std::size_t(i)).get<double>();
}

Eigen::MatrixXd SquareMatrix(const Json& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd m(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Json& row = rows.at(std::size_t(i));
    if (Eigen::Index(row.size()) != n) throw std::runtime_error("the covariance is not square");
    for (Eigen::Index k = 0; k < n; ++k) m(i, k) = row.at(std::size_t(k)).get<double>();
  }
  return m;
}

void ReadGeometry(const Json& json, Part& part) {
  part.vertices = Vectors(json.value("vertices", Json::array()));
  for (const auto& v : json.value("vertex_sigma", Json::array())) {
    const bool known =
        v.is_array() && v.size() == 3 && v[0].is_number() && v[1].is_number() && v[2].is_number();
    part.vertex_sigma.push_back(known ? VectorOf(v) : Vector3d::Constant(NAN));
  }
  for (const auto& e : json.value("edges", Json::array())) {
    const std::array<int, 2> edge{e.at(0).get<int>(), e.at(1).get<int>()};
    if (std::min(edge[0], edge[1]) < 0 || std::max(edge[0], edge[1]) >= int(part.vertices.size()))
      throw std::runtime_error("an edge names a vertex that is not there");
    part.edges.push_back(edge);
  }
  for (const auto& c : json.value("circles", Json::array()))
    part.circles.push_back(
        {VectorOf(c.at("center")), VectorOf(c.at("normal")), c.at("radius").get<double>()});
}

// What the part was measured and checked by.
void ReadQuality(const Json& json, const std::vector<std::string>& files, Part& part) {
  if (json.contains("covariance")) part.covariance = SquareMatrix(json.at("covariance"));
  if (const auto n = part.covariance.rows(); n > 0 && n < 6)
    throw std::runtime_error(fmt::format("the covariance has {} rows; a pose alone has 6", n));
  part.residual_px = NumberOf(json.value("residual_px", Json(0.0)));
  for (const auto& r : json.value("residuals", Json::array()))
    part.picture_residuals.push_back(
        {ImageIndex(r.at("image"), files), NumberOf(r.at("rms_px")), r.at("edges").get<int>()});
  part.contour_residuals = ContourResidualsOf(json.value("contours", Json::array()), files);
  part.straightness = StraightnessOf(json.value("straightness", Json::array()));
  part.observable = json.value("observable", part.observable);
  ReadNumbers(json.value("singular_values", Json::array()), part.singular_values);
  for (const auto& rows : json.value("vertex_covariance", Json::array()))
    part.vertex_covariance.push_back(Matrix(rows));
}

StationPart Parse(const Json& json, const std::vector<std::string>& files) {
  StationPart out;
  Part& part = out.part;
  part.id = json.at("id");
  part.kind = json.at("kind");
  part.source = json.value("source", "automatic");
  part.resting_pose = json.value("resting_pose", "");
  part.has_features = json.contains("features");
  part.features = json.value("features", part.features);
  part.designation = json.value("designation", "");
  part.standard = json.value("standard", "");
  part.designation_candidates = json.value("designation_candidates", part.designation_candidates);
  part.world_from_part = {Matrix(json.at("pose").at("rotation")), VectorOf(json.at("pose").at("position"))};
  part.yaw_rad = RadFromDeg(json.at("pose").value("yaw", 0.0));
  ReadDimensions(json.at("dimensions"), json.value("dimension_order", Json()), part);
  ReadGeometry(json, part);
  part.stands_on = json.value("stands_on", "ground");
  for (const auto& f : json.value("images", Json::array())) part.images.push_back(ImageIndex(f, files));
  ReadMatches(json.value("matches", Json::array()), files, part);
  ReadQuality(json, files, part);
  part.doubtful = json.value("doubtful", false);
  part.log_odds = NumberOf(json.value("log_odds", Json(0.0)));
  part.remarks = json.value("remarks", part.remarks);
  if (json.contains("runner_up"))
    part.runner_up = RunnerUp{json.at("runner_up").at("kind"),
                              NumberOf(json.at("runner_up").value("log_odds", Json(0.0)))};
  out.confirmed = json.value("confirmed", false);
  out.doubt = json.value("doubt", "");
  return out;
}

}  // namespace

Json JsonOf(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Json JsonOf(const Matrix3d& m) {
  return {JsonOf(Vector3d(m.row(0))), JsonOf(Vector3d(m.row(1))), JsonOf(Vector3d(m.row(2)))};
}

namespace {

void WriteGeometry(const Part& part, Json& out) {
  for (const char* name : {"vertices", "vertex_sigma", "edges", "circles"}) out[name] = Json::array();
  for (const auto& v : part.vertices) out["vertices"].push_back(JsonOf(v));
  for (const auto& v : part.vertex_sigma) out["vertex_sigma"].push_back(JsonOf(v));
  for (const auto& e : part.edges) out["edges"].push_back(e);
  for (const auto& c : part.circles)
    out["circles"].push_back(
        {{"center", JsonOf(c.center)}, {"normal", JsonOf(c.normal)}, {"radius", c.radius_mm}});
}

void WriteQuality(const Part& part, const std::vector<std::string>& files, Json& out) {
  out["residuals"] = Json::array();
  for (const auto& r : part.picture_residuals)
    out["residuals"].push_back(
        {{"image", files.at(std::size_t(r.image))}, {"rms_px", r.rms_px}, {"edges", r.num_edges}});
  if (part.covariance.size() > 0) {
    Json rows = Json::array();
    for (Eigen::Index i = 0; i < part.covariance.rows(); ++i) {
      rows.push_back(Json::array());
      for (Eigen::Index k = 0; k < part.covariance.cols(); ++k) rows.back().push_back(part.covariance(i, k));
    }
    out["covariance"] = std::move(rows);
  }
  if (!part.contour_residuals.empty()) out["contours"] = JsonOf(part.contour_residuals, files);
  if (!part.straightness.empty()) out["straightness"] = JsonOf(part.straightness);
  if (!part.observable.empty()) out["observable"] = part.observable;
  if (part.singular_values.size() > 0)
    out["singular_values"] = std::vector<double>(part.singular_values.begin(), part.singular_values.end());
  for (const auto& c : part.vertex_covariance) out["vertex_covariance"].push_back(JsonOf(c));
}

}  // namespace

Json PartToJson(const StationPart& station, const std::vector<std::string>& files) {
  const Part& part = station.part;
  Json out = {{"id", part.id},
              {"kind", part.kind},
              {"source", part.source},
              {"resting_pose", part.resting_pose},
              {"stands_on", part.stands_on},
              {"residual_px", part.residual_px},
              {"doubtful", part.doubtful},
              {"log_odds", part.log_odds},
              {"confirmed", station.confirmed},
              {"doubt", station.doubt}};
  out["pose"] = {{"position", JsonOf(part.world_from_part.translation)},
                 {"rotation", JsonOf(part.world_from_part.rotation)},
                 {"yaw", DegFromRad(part.yaw_rad)}};
  out["dimensions"] = DimensionsToJson(part);
  out["dimension_order"] = Json::array();
  for (const auto& d : part.dimensions) out["dimension_order"].push_back(d.name);
  if (part.has_features) out["features"] = part.features;
  if (!part.designation.empty()) out["designation"] = part.designation, out["standard"] = part.standard;
  if (!part.designation_candidates.empty()) out["designation_candidates"] = part.designation_candidates;
  WriteGeometry(part, out);
  out["images"] = Json::array();
  for (int i : part.images) out["images"].push_back(files.at(std::size_t(i)));
  out["matches"] = MatchesToJson(part, files);
  WriteQuality(part, files, out);
  if (!part.remarks.empty()) out["remarks"] = part.remarks;
  if (part.runner_up)
    out["runner_up"] = {{"kind", part.runner_up->kind}, {"log_odds", part.runner_up->log_odds}};
  return out;
}

Result<int> IntOf(const Json& json, const char* name) {
  const auto at = json.find(name);
  if (at == json.end() || !at->is_number_integer()) return UsageError("{} must be a whole number", name);
  const auto value = at->get<std::int64_t>();
  if (value < INT_MIN || value > INT_MAX || (at->is_number_unsigned() && at->get<std::uint64_t>() > INT_MAX))
    return UsageError("{} is out of range", name);
  return static_cast<int>(value);
}

Result<StationPart> PartFromJson(const Json& json, const std::vector<std::string>& files) {
  try {
    return Parse(json, files);
  } catch (const std::exception& e) {
    const std::string id = json.is_object() && json.contains("id") && json["id"].is_string()
                               ? json["id"].get<std::string>()
                               : "?";
    return InputError("part {}: {}", id, e.what());
  }
}

PlacedObject PlacedObjectOf(const Part& part, const KnowledgeBase& knowledge) {
  PlacedObject object;
  const ObjectModel* model = knowledge.Find(part.kind, part.features);
  if (model == nullptr) model = knowledge.Find(part.kind);
  if (model == nullptr) return object;
  object.model = model;
  std::vector<std::optional<double>> known;
  for (const auto& def : model->dimensions()) {
    const auto at = std::find_if(part.dimensions.begin(), part.dimensions.end(),
                                 [&](const auto& d) { return d.name == def.name; });
    known.push_back(at == part.dimensions.end() ? std::nullopt : std::optional(at->value_mm));
  }
  object.dimensions_mm = model->UsualDimensions(known);
  const auto poses = model->resting_poses();
  const auto pose =
      std::find_if(poses.begin(), poses.end(), [&](const auto& p) { return p.name == part.resting_pose; });
  const Matrix3d& r = part.world_from_part.rotation;
  // Where the file does not name the resting pose: the one that leaves the least tilt.
  auto tilt = [&](const RestingPose& p) { return -(r * p.rested_from_part.transpose())(2, 2); };
  const auto chosen = pose != poses.end()
                          ? pose
                          : std::min_element(poses.begin(), poses.end(),
                                             [&](const auto& a, const auto& b) { return tilt(a) < tilt(b); });
  object.resting_pose = static_cast<int>(chosen - poses.begin());
  const Matrix3d turn = r * chosen->rested_from_part.transpose();  // Rz(yaw) Rx(tilt_x) Ry(tilt_y)
  object.placement[3] = std::atan2(-turn(0, 1), turn(1, 1));
  object.placement[4] = std::asin(std::clamp(turn(2, 1), -1.0, 1.0));
  object.placement[5] = std::atan2(-turn(2, 0), turn(2, 2));
  object.placement.head<3>() =
      part.world_from_part.translation - PlaceSolid(object, false).world_from_part.translation;
  return object;
}

}  // namespace vss::station
