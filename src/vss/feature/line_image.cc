#include "vss/feature/line_image.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "vss/geometry/rigid_transform.h"

namespace vss {
namespace {

using Json = nlohmann::ordered_json;

// Numbers are written to a ten-thousandth (px, grey levels): far below what a picture can tell.
double Rounded(double value, double per_unit = 1e4) { return std::round(value * per_unit) / per_unit + 0.0; }
Json Pair(const Eigen::Vector2d& p) { return Json::array({Rounded(p.x()), Rounded(p.y())}); }
double Degrees(double rad) { return Rounded(DegFromRad(rad)); }

const char* NameOf(SegmentEnd kind) {
  switch (kind) {
    case SegmentEnd::kJunction:
      return "junction";
    case SegmentEnd::kBorder:
      return "border";
    case SegmentEnd::kFree:
      break;
  }
  return "free";
}

Json JsonOf(const LineSegment& s, bool lens_known) {
  Json j{{"start", Pair(s.start)}, {"end", Pair(s.end)}};
  if (lens_known) j["ideal_start"] = Pair(s.ideal_start), j["ideal_end"] = Pair(s.ideal_end);
  j["sigma_px"] = Rounded(s.sigma_offset_px);
  j["sigma_angle"] = Rounded(DegFromRad(s.sigma_angle_rad), 1e6);
  j["contrast"] = Rounded(s.contrast);
  j["blur_px"] = Rounded(s.blur_px);
  j["rms_px"] = Rounded(s.rms_distance_px);
  j["points"] = s.num_points;
  j["ends"] = Json::array({NameOf(s.start_kind), NameOf(s.end_kind)});
  j["junctions"] = Json::array({s.start_junction, s.end_junction});
  return j;
}

Json JsonOf(const EllipticalArc& a, bool lens_known) {
  Json j{{"center", Pair(a.center)},
         {"axes", Pair(a.axes)},
         {"angle", Degrees(a.angle_rad)},
         {"from", Degrees(a.from_rad)},
         {"to", Degrees(a.to_rad)}};
  j["bright"] = a.bright_inside ? "inside" : "outside";
  if (lens_known) {
    j["ideal_center"] = Pair(a.ideal_center), j["ideal_axes"] = Pair(a.ideal_axes),
    j["ideal_angle"] = Degrees(a.ideal_angle_rad);
    j["ideal_from"] = Degrees(a.ideal_from_rad), j["ideal_to"] = Degrees(a.ideal_to_rad);
  }
  Json sigma = Json::array();
  for (int i = 0; i < 4; ++i) sigma.push_back(Rounded(std::sqrt(a.covariance(i, i))));
  j["sigma"] = sigma;
  j["contrast"] = Rounded(a.contrast);
  j["blur_px"] = Rounded(a.blur_px);
  j["rms_px"] = Rounded(a.rms_distance_px);
  j["points"] = a.num_points;
  return j;
}

}  // namespace

std::span<const ParameterOf<LineOptions>> LineParameters() {
  using O = LineOptions;
  static const ParameterOf<O> rows[] = {
      {"lines.min_length_px", &O::min_length_px, 4, 10000, "px", "Shorter segments are dropped."},
      {"lines.edge_threshold", &O::edge_threshold, 1, 100, "",
       "An edge point's gradient is at least so many sigmas of the noise, which is measured in the picture "
       "itself."},
      {"lines.min_contrast", &O::min_contrast, 0, 65535, "grey levels",
       "Edges between brightnesses nearer to each other than this are left out."},
      {"lines.min_significance", &O::min_significance, 3, 1000, "",
       "A line's mean gradient is at least so many sigmas of what the noise and texture around it explain; "
       "at 8 neither noise nor rust has lines."},
      {"lines.tolerance_px", &O::tolerance_px, 0.2, 5, "px",
       "Edge points farther from a line than this, and than their own noise allows, do not belong to it."},
      {"lines.max_gap_px", &O::max_gap_px, 0, 1000, "px",
       "Pieces of one line are joined over gaps up to this where the picture shows a weak edge between "
       "them."},
      {"lines.arcs", &O::arcs, 0, 1, "", "Whether elliptical arcs are looked for."},
  };
  return rows;
}

std::string LineImageToJson(const LineImage& lines) {
  Json j{{"format", "vss-lines/1"},
         {"image", lines.image},
         {"width", lines.width_px},
         {"height", lines.height_px}};
  j["noise"] = Rounded(lines.noise_sigma);
  j["segments"] = Json::array();
  for (const auto& s : lines.segments) j["segments"].push_back(JsonOf(s, lines.lens_known));
  j["arcs"] = Json::array();
  for (const auto& a : lines.arcs) j["arcs"].push_back(JsonOf(a, lines.lens_known));
  return j.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace vss
