#include "vss/identify/measured_contours.h"

#include <algorithm>
#include <cmath>

#include "vss/identify/edge_response.h"
#include "vss/identify/found_contours.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A line that is a contour's image ends where the contour does, within so many tolerances, far more often
// than it runs on; a line that only passes by mostly runs on.
constexpr double kEndTolerances = 2;
constexpr double kEndsWithTrue = 0.9, kEndsWithChance = 0.15;

double WeightOf(const WorldSolid& solid, ContourSample::Source source, int index) {
  if (source == ContourSample::Source::kEdge) return solid.edges[static_cast<std::size_t>(index)].weight;
  if (source == ContourSample::Source::kCircle) return solid.circles[static_cast<std::size_t>(index)].weight;
  return 1;
}

// Does another edge of the solid leave the end `vertex` of edge `e` almost straight on, as the picture shows
// it? One line then covers both, and where it ends says nothing of the vertex.
bool RunsOn(const WorldSolid& solid, int e, int vertex, const View& view, const Vector2d& outward) {
  constexpr double kStraightOn = 0.97;  // cosine of 14 degrees
  const Vector3d& corner = solid.vertices[std::size_t(vertex)].point;
  const auto from = view.ProjectIdeal(corner);
  if (!from) return false;
  for (std::size_t k = 0; k < solid.edges.size(); ++k) {
    const SolidEdge& other = solid.edges[k];
    if (int(k) == e || (other.start != vertex && other.end != vertex)) continue;
    const auto to =
        view.ProjectIdeal(solid.vertices[std::size_t(other.start == vertex ? other.end : other.start)].point);
    if (to && (*to - *from).dot(outward) > kStraightOn * (*to - *from).norm()) return true;
  }
  return false;
}

// What it says that the line `l`, which covers the sample next to an end of a straight edge, ends with the
// edge or runs on. 0 for samples elsewhere, and where the end is not in the picture.
double EndLogOdds(const WorldSolid& solid, const ContourSample& s, const View& view, const ViewLine& l,
                  double tolerance_px) {
  if (s.source != ContourSample::Source::kEdge || s.t_step <= 0 || l.arc >= 0) return 0;
  double sum = 0;
  for (int end = 0; end < 2; ++end) {
    if ((end == 0 ? s.t : 1 - s.t) > 0.75 * s.t_step) continue;
    const Vector2d outward = (end == 0 ? -1.0 : 1.0) * s.ideal_tangent;
    const Vector2d vertex = s.ideal + 0.5 * s.step_px * outward;
    const double reach = kEndTolerances * tolerance_px;
    if (!view.surely_inside.contains(Vector2d(vertex + reach * outward))) continue;
    const SolidEdge& edge = solid.edges[std::size_t(s.index)];
    if (RunsOn(solid, s.index, end == 0 ? edge.start : edge.end, view, outward)) continue;
    const double beyond = std::max((l.start - vertex).dot(outward), (l.end - vertex).dot(outward));
    if (beyond > reach)
      sum += std::log((1 - kEndsWithTrue) / (1 - kEndsWithChance));
    else if (beyond > -reach)
      sum += std::log(kEndsWithTrue / kEndsWithChance);
  }
  return sum;
}

// Of level faces that lie between the support and the top, and more than `apart_mm` from both, the edges that
// run across their longest one.
std::vector<std::vector<int>> LedgeEnds(const WorldSolid& solid, double apart_mm) {
  constexpr double kLevel = 0.999, kAcross = 0.5;  // cosines
  double low = INFINITY, high = -INFINITY;
  for (const auto& v : solid.vertices) low = std::min(low, v.point.z()), high = std::max(high, v.point.z());
  std::vector<std::vector<int>> out;
  for (std::size_t f = 0; f < solid.faces.size(); ++f) {
    if (solid.faces[f].is_cylinder || solid.faces[f].normal_in_part.z() < kLevel) continue;
    std::vector<std::pair<int, Vector3d>> sides;
    double longest = 0, z = low;
    Vector3d along = Vector3d::Zero();
    for (std::size_t i = 0; i < solid.edges.size(); ++i) {
      const SolidEdge& e = solid.edges[i];
      if (e.left_face != int(f) && e.right_face != int(f)) continue;
      const Vector3d d =
          solid.vertices[std::size_t(e.end)].point - solid.vertices[std::size_t(e.start)].point;
      z = solid.vertices[std::size_t(e.start)].point.z();
      sides.push_back({int(i), d.normalized()});
      if (d.norm() > longest) longest = d.norm(), along = d.normalized();
    }
    if (z < low + apart_mm || z > high - apart_mm) continue;
    std::vector<int> ends;
    for (const auto& [i, d] : sides)
      if (std::abs(d.dot(along)) < kAcross && solid.edges[std::size_t(i)].weight > 0) ends.push_back(i);
    if (ends.size() > 1) out.push_back(std::move(ends));
  }
  return out;
}

std::vector<MeasuredContours::Contour> DescribeContours(const WorldSolid& solid, const Numbering& numbering,
                                                        double mm_per_px) {
  double lowest_z = INFINITY;
  for (const auto& v : solid.vertices) lowest_z = std::min(lowest_z, v.point.z());
  for (const auto& c : solid.circles) lowest_z = std::min(lowest_z, c.center.point.z());
  std::vector<MeasuredContours::Contour> contours(static_cast<std::size_t>(numbering.total));
  for (int k = 0; k < numbering.total; ++k) {
    auto& contour = contours[std::size_t(k)];
    contour.source = numbering.SourceOf(k);
    contour.index = numbering.IndexOf(k);
    contour.weight = WeightOf(solid, contour.source, contour.index);
    if (contour.source != ContourSample::Source::kLimb || solid.faces[std::size_t(contour.index)].is_cylinder)
      contour.detect = DetectOf(solid, contour.source, contour.index, lowest_z);
    contour.elevated =
        TopOf(solid, contour.source, contour.index) > lowest_z + kElevatedPx * ClutterPixelMm(mm_per_px);
  }
  return contours;
}

// One solid against one picture after the other.
class Measurer {
 public:
  Measurer(const WorldSolid& solid, const Numbering& numbering,
           std::span<const MeasuredContours::Contour> contours, const SceneIndex& scene,
           const WeighOptions& options, const Occluders* others)
      : solid_(solid),
        numbering_(numbering),
        contours_(contours),
        scene_(scene),
        options_(options),
        others_(others) {}

  MeasuredContours::InView Measure(int v) {
    MeasuredContours::InView in_view;
    in_view.view = v;
    view_ = v;
    const ContourSampling sampling{.spacing_px = options_.spacing_px,
                                   .min_samples = options_.min_samples,
                                   .max_samples = options_.max_samples,
                                   .img = false};
    samples_ = SampleContour(solid_, View_(), sampling, others_);
    FindHits();
    in_view.crowded = NearestParallel(samples_, numbering_, kMinCosine);
    visible_px_.assign(contours_.size(), 0);
    for (const auto& s : samples_)
      if (s.visible) visible_px_[std::size_t(numbering_.Of(s))] += s.step_px;
    std::size_t next_hit = 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const Hit* hit =
          next_hit < hits_.size() && hits_[next_hit].sample == int(i) ? &hits_[next_hit] : nullptr;
      const int line = hit ? lines_[next_hit++] : -1;
      if (Counts(samples_[i])) in_view.samples.push_back(MeasureSample(i, hit, line));
    }
    return in_view;
  }

 private:
  const View& View_() const { return scene_.views[std::size_t(view_)]; }
  const LineIndex& Index() const { return scene_.lines[std::size_t(view_)]; }

  bool Counts(const ContourSample& s) const {
    return s.visible && contours_[std::size_t(numbering_.Of(s))].weight > 0;
  }

  // The lines that the samples lie on, and which of them are another contour's.
  void FindHits() {
    hits_.clear();
    lines_.clear();
    lost_.assign(samples_.size(), 0);
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const auto& s = samples_[i];
      if (!Counts(s)) continue;
      const LineHit hit = scene_.Match(view_, s, scene_.tolerance_px, kMinCosine);
      if (hit.line < 0) continue;
      hits_.push_back(HitOf(hit, s, numbering_.Of(s), int(i), Index()));
      lines_.push_back(hit.line);
    }
    ShareLines(hits_, samples_, lost_);
  }

  MeasuredContours::Sample MeasureSample(std::size_t i, const Hit* hit, int line) const {
    const auto& s = samples_[i];
    MeasuredContours::Sample m;
    m.contour = numbering_.Of(s);
    m.point_in_world = s.point_in_world;
    m.step_px = s.step_px;
    m.chance = scene_.ChanceHit(view_, s.ideal_tangent);
    m.lost = lost_[i];
    if (hit) {
      m.line = line;
      m.distance_px = hit->distance;
      m.along_px = hit->along;
      if (m.lost == 0)
        m.ends = EndLogOdds(solid_, s, View_(), Index().lines()[std::size_t(m.line)], scene_.tolerance_px);
    }
    if (View_().picture.data) AskGreyValues(s, m);
    return m;
  }

  // Where there is no line; and all around circles.
  void AskGreyValues(const ContourSample& s, MeasuredContours::Sample& m) const {
    const bool ask = options_.grey && m.line < 0;
    const bool round = (options_.grey || options_.rings) && s.source == ContourSample::Source::kCircle;
    if (!ask && !round) return;
    const auto img = View_().ProjectInside(s.point_in_world);
    if (!img) return;
    const auto response = RespondToEdge(View_().picture, *img, s.ideal_tangent, std::min(kPiecePx, s.step_px),
                                        scene_.tolerance_px);
    if (!response) return;
    const double strength = std::abs(response->step) / scene_.typical_step[std::size_t(view_)];
    if (round) {
      const bool clear = strength > kEmptyStep && std::abs(response->step) > kRingContrast * response->bright;
      m.rises = !clear ? 0 : response->step > 0 ? 1 : -1;
    }
    if (!ask) return;
    m.asked = true;
    m.step = StepLogOdds(strength, contours_[std::size_t(m.contour)].detect < kDetectStrong,
                         visible_px_[std::size_t(m.contour)]);
    m.empty = strength < kEmptyStep;
  }

  const WorldSolid& solid_;
  const Numbering& numbering_;
  std::span<const MeasuredContours::Contour> contours_;
  const SceneIndex& scene_;
  const WeighOptions& options_;
  const Occluders* others_;
  int view_ = 0;
  std::vector<ContourSample> samples_;
  std::vector<Hit> hits_;
  std::vector<int> lost_, lines_;   // lost: by sample; lines: of the picture's index, by hit
  std::vector<double> visible_px_;  // of each contour
};

}  // namespace

MeasuredContours MeasureContours(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                                 const WeighOptions& options, const Occluders* others) {
  const Numbering numbering(solid);
  MeasuredContours out;
  out.contours = DescribeContours(solid, numbering, scene.mm_per_px);
  out.ledge_ends = LedgeEnds(solid, kElevatedPx * ClutterPixelMm(scene.mm_per_px));
  Measurer measurer(solid, numbering, out.contours, scene, options, others);
  for (int v : views) {
    MeasuredContours::InView in_view = measurer.Measure(v);
    if (!in_view.samples.empty()) out.views.push_back(std::move(in_view));
  }
  return out;
}

}  // namespace vss
