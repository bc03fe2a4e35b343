// Product definition data as JSON, format vss-product/1.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "vss/base/files.h"
#include "vss/product/json_pieces.inc"

namespace vss {
namespace {

using namespace product_json;

Json DimensionsJson(const Part& part) {
  Json out = Json::object();
  for (const auto& d : part.dimensions) {
    Json& entry = out[d.name] = {
        {"value", Length(d.value_mm)}, {"sigma", Significant(d.sigma_mm)}, {"observable", d.observable}};
    if (!d.origin.empty()) entry["origin"] = d.origin;
    if (!d.nominal_mm) continue;
    entry["nominal"] = Length(*d.nominal_mm);
    if (d.observable) entry["deviation"] = Length(d.value_mm - *d.nominal_mm);
  }
  return out;
}

Json CirclesJson(const Part& part) {
  Json out = Json::array();
  for (const auto& c : part.circles)
    out.push_back(
        {{"center", Point(c.center)}, {"normal", Direction(c.normal)}, {"radius", Length(c.radius_mm)}});
  return out;
}

// Picture by picture: which line (or arc) is which edge (or circle) of the object's solid.
Json MatchesJson(const Part& part, const std::vector<std::string>& files) {
  std::vector<ContourMatch> sorted = part.matches;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.image < b.image; });
  Json out = Json::array();
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    if (i == 0 || sorted[i].image != sorted[i - 1].image)
      out.push_back(
          {{"image", FileOf(sorted[i].image, files)}, {"lines", Json::array()}, {"arcs", Json::array()}});
    const auto& m = sorted[i];
    Json entry = {{m.is_arc ? "arc" : "line", m.line},
                  {m.is_arc ? "circle" : "edge", m.edge},
                  {"residual_px", Rounded(m.residual_px, kRatioDigits)}};
    out.back()[m.is_arc ? "arcs" : "lines"].push_back(std::move(entry));
  }
  return out;
}

Json CovarianceJson(const Part& part) {
  Json order = {"x", "y", "z", "rotation_x", "rotation_y", "rotation_z"};
  for (const auto& d : part.dimensions) order.push_back(d.name);
  return {{"order", order}, {"matrix", RowsOf(part.covariance, Significant)}};
}

// Zero where an unknown has no variance.
Eigen::MatrixXd CorrelationOf(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd inverse = sigma.unaryExpr([](double s) { return s > 0 ? 1 / s : 0.0; });
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

Json PartJson(const Part& part, const std::vector<std::string>& files) {
  Json out;
  out["id"] = part.id;
  out["kind"] = part.kind;
  if (part.has_features) out["features"] = part.features;
  if (!part.designation.empty()) {
    out["designation"] = part.designation;
    out["standard"] = part.standard;
  }
  if (!part.designation_candidates.empty()) out["designation_candidates"] = part.designation_candidates;
  out["source"] = part.source;
  out["doubtful"] = part.doubtful;
  out["pose"] = {{"position", Point(part.world_from_part.translation)},
                 {"rotation", RowsOf(part.world_from_part.rotation,
                                     [](double x) { return Rounded(x, kRotationDigits); })},
                 {"yaw", Rounded(DegFromRad(part.yaw_rad), 1e6)}};
  if (!part.resting_pose.empty()) out["pose"]["resting"] = part.resting_pose;
  out["dimensions"] = DimensionsJson(part);
  out["vertices"] = Json::array();
  for (const auto& v : part.vertices) out["vertices"].push_back(Point(v));
  out["vertex_sigma"] = Json::array();
  for (const auto& s : part.vertex_sigma) out["vertex_sigma"].push_back(ListOf(s, Significant));
  out["edges"] = part.edges;
  out["circles"] = CirclesJson(part);
  out["stands_on"] = part.stands_on;
  out["images"] = Json::array();
  for (int image : part.images) out["images"].push_back(FileOf(image, files));
  out["residual_px"] = Rounded(part.residual_px, kRatioDigits);
  out["log_odds"] = Rounded(part.log_odds, kRatioDigits);
  if (part.runner_up)
    out["runner_up"] = {{"kind", part.runner_up->kind},
                        {"log_odds", Rounded(part.runner_up->log_odds, kRatioDigits)}};
  if (!part.remarks.empty()) out["remarks"] = part.remarks;
  out["residuals"] = Json::array();
  for (const auto& r : part.picture_residuals)
    out["residuals"].push_back({{"image", FileOf(r.image, files)},
                                {"rms_px", Rounded(r.rms_px, kRatioDigits)},
                                {"edges", r.num_edges}});
  if (!part.contour_residuals.empty()) out["contours"] = ContourResidualsJson(part, files);
  if (!part.straightness.empty()) out["straightness"] = StraightnessJson(part);
  out["matches"] = MatchesJson(part, files);
  if (part.covariance.size() > 0) out["covariance"] = CovarianceJson(part);
  if (!part.vertex_covariance.empty()) {
    out["covariance"]["correlation"] =
        RowsOf(CorrelationOf(part.covariance), [](double x) { return Rounded(x, kRatioDigits); });
    out["vertex_covariance"] = Json::array();
    for (const auto& c : part.vertex_covariance) out["vertex_covariance"].push_back(RowsOf(c, Significant));
  }
  if (!part.observable.empty()) out["observability"] = ObservabilityJson(part);
  return out;
}

Json SeamJson(const Seam& seam) {
  return {{"parts", {seam.part_a, seam.part_b}},
          {"start", Point(seam.start)},
          {"end", Point(seam.end)},
          {"normals", {Direction(seam.normal_a), Direction(seam.normal_b)}},
          {"approach", Direction(ApproachOf(seam))},
          {"gap", Length(seam.gap_mm)}};
}

// JSON that a person can read too: what is short stands on one line.
void Write(const Json& value, int indent, std::string& out) {
  constexpr std::size_t kLineLength = 118;
  const std::string flat = value.dump();
  if (!value.is_structured() || value.empty() ||
      flat.size() + static_cast<std::size_t>(indent) <= kLineLength) {
    out += flat;
    return;
  }
  const auto break_line = [&out](int spaces) {
    out += '\n';
    out.append(static_cast<std::size_t>(spaces), ' ');
  };
  out += value.is_object() ? '{' : '[';
  for (auto it = value.begin(); it != value.end(); ++it) {
    if (it != value.begin()) out += ',';
    break_line(indent + 1);
    if (value.is_object()) out.append(Json(it.key()).dump()).append(": ");
    Write(*it, indent + 1, out);
  }
  break_line(indent);
  out += value.is_object() ? '}' : ']';
}

// Reading: a wrong type or a missing field throws nlohmann's exception, which ReadProduct turns into a
// sentence.

double NumberOrNan(const Json& value) { return value.is_null() ? std::nan("") : value.get<double>(); }

Eigen::Vector3d PointFrom(const Json& value) {
  if (!value.is_array() || value.size() != 3) throw std::invalid_argument("a point needs three numbers");
  return {NumberOrNan(value[0]), NumberOrNan(value[1]), NumberOrNan(value[2])};
}

Eigen::MatrixXd MatrixFrom(const Json& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd m(n, n ? static_cast<Eigen::Index>(rows[0].size()) : 0);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < m.cols(); ++j)
      m(i, j) = NumberOrNan(rows.at(std::size_t(i)).at(std::size_t(j)));
  return m;
}

int ImageFrom(const std::string& file, const std::vector<std::string>& files) {
  const auto found = std::find(files.begin(), files.end(), file);
  return found == files.end() ? -1 : static_cast<int>(found - files.begin());
}

RigidTransform PoseFrom(const Json& pose) {
  const Eigen::MatrixXd rotation = MatrixFrom(pose.at("rotation"));
  if (rotation.rows() != 3 || rotation.cols() != 3)
    throw std::invalid_argument("`rotation` needs three rows of three numbers");
  constexpr double kTolerance = 1e-3;
  const auto nearest = NearestRotation(rotation, kTolerance);
  if (!nearest) throw std::invalid_argument("`rotation` is " + nearest.error().message);
  return {*nearest, PointFrom(pose.at("position"))};
}

std::vector<ContourMatch> MatchesFrom(const Json& list, const std::vector<std::string>& files) {
  std::vector<ContourMatch> out;
  for (const auto& group : list) {
    const int image = ImageFrom(group.at("image").get<std::string>(), files);
    if (image < 0) continue;
    for (const bool is_arc : {false, true})
      for (const auto& m : group.value(is_arc ? "arcs" : "lines", Json::array()))
        out.push_back({image, m.at(is_arc ? "arc" : "line").get<int>(),
                       m.at(is_arc ? "circle" : "edge").get<int>(), is_arc,
                       NumberOrNan(m.value("residual_px", Json()))});
  }
  return out;
}

Part PartFrom(const Json& in, const std::vector<std::string>& files) {
  Part part;
  part.id = in.at("id").get<std::string>();
  part.kind = in.at("kind").get<std::string>();
  part.source = in.value("source", part.source);
  part.doubtful = in.value("doubtful", false);
  part.world_from_part = PoseFrom(in.at("pose"));
  part.yaw_rad = RadFromDeg(in.at("pose").value("yaw", 0.0));
  part.resting_pose = in.at("pose").value("resting", "");
  part.has_features = in.contains("features");
  part.features = in.value("features", part.features);
  part.designation = in.value("designation", "");
  part.standard = in.value("standard", "");
  part.designation_candidates = in.value("designation_candidates", part.designation_candidates);
  for (const auto& [name, d] : in.at("dimensions").items()) {
    part.dimensions.push_back({name,
                               d.at("value").get<double>(),
                               NumberOrNan(d.value("sigma", Json())),
                               d.value("observable", true),
                               d.value("origin", ""),
                               {}});
    if (d.contains("nominal")) part.dimensions.back().nominal_mm = d["nominal"].get<double>();
  }
  for (const auto& v : in.value("vertices", Json::array())) part.vertices.push_back(PointFrom(v));
  for (const auto& v : in.value("vertex_sigma", Json::array())) part.vertex_sigma.push_back(PointFrom(v));
  part.edges = in.value("edges", part.edges);
  for (const auto& edge : part.edges)
    for (int v : edge)
      if (v < 0 || v >= static_cast<int>(part.vertices.size()))
        throw std::invalid_argument("an edge names a vertex that is not there");
  for (const auto& c : in.value("circles", Json::array()))
    part.circles.push_back(
        {PointFrom(c.at("center")), PointFrom(c.at("normal")), c.at("radius").get<double>()});
  part.stands_on = in.value("stands_on", part.stands_on);
  for (const auto& file : in.value("images", Json::array()))
    if (const int image = ImageFrom(file.get<std::string>(), files); image >= 0) part.images.push_back(image);
  part.residual_px = NumberOrNan(in.value("residual_px", Json(0.0)));
  part.log_odds = NumberOrNan(in.value("log_odds", Json(0.0)));
  if (in.contains("runner_up"))
    part.runner_up = RunnerUp{in["runner_up"].at("kind").get<std::string>(),
                              NumberOrNan(in["runner_up"].value("log_odds", Json()))};
  part.remarks = in.value("remarks", part.remarks);
  for (const auto& r : in.value("residuals", Json::array()))
    if (const int image = ImageFrom(r.at("image").get<std::string>(), files); image >= 0)
      part.picture_residuals.push_back({image, NumberOrNan(r.at("rms_px")), r.value("edges", 0)});
  if (in.contains("matches")) part.matches = MatchesFrom(in["matches"], files);
  if (in.contains("covariance")) part.covariance = MatrixFrom(in["covariance"].at("matrix"));
  return part;
}

Seam SeamFrom(const Json& in) {
  Seam seam;
  seam.part_a = in.at("parts").at(0).get<std::string>();
  seam.part_b = in.at("parts").at(1).get<std::string>();
  seam.start = PointFrom(in.at("start"));
  seam.end = PointFrom(in.at("end"));
  if (in.contains("normals")) {
    seam.normal_a = PointFrom(in["normals"].at(0));
    seam.normal_b = PointFrom(in["normals"].at(1));
  }
  seam.gap_mm = NumberOrNan(in.value("gap", Json()));
  return seam;
}

}  // namespace

std::string NominalToJson(const NominalComparison& comparison) {
  std::string text;
  Write(NominalJson(comparison), 0, text);
  return text + "\n";
}

std::string ProductToJson(const Product& product, const std::vector<std::string>& image_files) {
  Json out;
  out["format"] = "vss-product/1";
  out["units"] = "mm";
  out["survey"] = product.survey;
  out["parts"] = Json::array();
  for (const auto& part : product.parts) out["parts"].push_back(PartJson(part, image_files));
  out["seams"] = Json::array();
  for (const auto& seam : product.seams) out["seams"].push_back(SeamJson(seam));
  out["unknown"] = Json::array();
  for (const auto& u : product.unknown)
    out["unknown"].push_back(
        {{"center", Point(u.center)}, {"extent", Point(u.extent)}, {"lines", u.num_lines}});
  out["warnings"] = product.warnings;
  if (product.checks) out["checks"] = ChecksJson(*product.checks, image_files);
  if (product.temperature)
    out["temperature"] = {{"workpiece_c", product.temperature->workpiece_c},
                          {"reference_c", 20.0},
                          {"expansion_ppm_per_k", product.temperature->expansion_ppm_per_k},
                          {"factor", product.temperature->factor}};
  if (product.nominal) out["nominal"] = NominalJson(*product.nominal);
  std::string text;
  Write(out, 0, text);
  return text + "\n";
}

Result<Product> ReadProduct(const std::filesystem::path& path, const std::vector<std::string>& image_files) {
  VSS_ASSIGN(const std::string text, ReadTextFile(path));
  try {
    const Json in = Json::parse(text);
    if (!in.is_object() || in.value("format", Json()) != "vss-product/1")
      return InputError("{}: `format` is not \"vss-product/1\"; name a product.json", path.string());
    Product product;
    product.survey = in.value("survey", "");
    for (const auto& part : in.at("parts")) product.parts.push_back(PartFrom(part, image_files));
    for (const auto& seam : in.value("seams", Json::array())) product.seams.push_back(SeamFrom(seam));
    for (const auto& u : in.value("unknown", Json::array()))
      product.unknown.push_back({PointFrom(u.at("center")), PointFrom(u.at("extent")), u.value("lines", 0)});
    product.warnings = in.value("warnings", product.warnings);
    return product;
  } catch (const Json::parse_error& e) {
    const auto line =
        1 + std::count(text.begin(),
                       text.begin() + static_cast<std::ptrdiff_t>(std::min(text.size(), e.byte)), '\n');
    return InputError("{}:{}: not valid JSON; restore the file or survey again", path.string(), line);
  } catch (const std::exception& e) {
    return InputError(
        "{}: not product definition data as VSS writes it ({}); restore the file or survey again",
        path.string(), e.what());
  }
}

}  // namespace vss
