#include "vss/identify/weigh.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "vss/base/parallel.h"
#include "vss/identify/edge_response.h"

namespace vss {

bool IsCovered(const WorldSolid& solid, const Eigen::Vector3d& point) {
  constexpr double kAboveMm = 1;  // faces that meet in the edge itself are no roof
  for (const auto& f : solid.faces) {
    if (f.is_cylinder || f.normal_in_part.z() > -0.5) continue;  // seen from below
    for (const auto& t : f.triangles) {
      const Eigen::Vector2d a = t[0].head<2>(), b = t[1].head<2>(), c = t[2].head<2>(), p = point.head<2>();
      auto side = [](const Eigen::Vector2d& u, const Eigen::Vector2d& v, const Eigen::Vector2d& w) {
        return (v - u).x() * (w - u).y() - (v - u).y() * (w - u).x();
      };
      const double s1 = side(a, b, p), s2 = side(b, c, p), s3 = side(c, a, p);
      const double touch = 1e-6;
      if (!((s1 >= -touch && s2 >= -touch && s3 >= -touch) || (s1 <= touch && s2 <= touch && s3 <= touch)))
        continue;
      if (std::max({t[0].z(), t[1].z(), t[2].z()}) > point.z() + kAboveMm) return true;
    }
  }
  return false;
}

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A contour that is there is found this often: an outline or convex edge, and one inside (concave).
constexpr double kDetectStrong = 0.8;
constexpr double kDetectWeak = 0.65;
constexpr double kDetectCovered = 0.55;  // under a flange
// Where a part touches its support both sides lie in the contact shadow.
constexpr double kDetectContact = 0.7;
// Without a line, what the grey values say: the logarithm of the odds that a contour is there, by the
// strength of the step (typical of the picture = 1) up to each bound, as accuracy_evidence measured it on
// 115,000 pieces of true contours and 285,000 of others. The last is less than measured: what is strong may
// belong to something else.
constexpr std::array<double, 7> kStepBounds{0.7, 1, 1.5, 2.2, 3.5, 6, 12};
constexpr std::array<double, 8> kStepStrong{-4.2, -3.7, -3.4, -2.8, -2.1, -1.5, -0.8, 0.7};
constexpr std::array<double, 8> kStepWeak{-3.1, -2.6, -2.1, -1.8,
                                          -0.9, -0.4, -0.3, 0.3};  // hollow, or in contact
// Contours of which so few pixels show are seldom lines (a twentieth up to 6 px, half at 16), but show their
// step: of either kind, shorter than the first and than the second of these.
constexpr double kShortPx = 9, kMediumPx = 20;
constexpr std::array<double, 8> kStepShort{-4.6, -4.2, -3.7, -3.0, -1.9, -0.7, 0.6, 2.0};
constexpr std::array<double, 8> kStepMedium{-4.2, -3.7, -3.3, -2.7, -1.5, -0.8, 0.1, 1.2};
// A piece where the grey values show no more of a step than anywhere.
constexpr double kEmptyStep = 1.5;
// The pieces of contour that were measured there.
constexpr double kPiecePx = 8;
// A round edge is darker, or lighter, inside all around: so often a piece of one shows a clear step (more
// than kEmptyStep, and this share of the brighter side: patches of rust are round too, but soft) of the sign
// that most others show, and so often a piece of any other ring.
constexpr double kRisesTrue = 0.75, kRisesChance = 0.2;
constexpr double kRingContrast = 0.25;
// Of those longer than this (px) the pictures' own arcs tell more.
constexpr double kSmallRingPx = 120;
// And shadows run there beside whatever stands above.
constexpr double kChanceContact = 0.2;
// Least chance of a line where nothing is, whatever the density says.
constexpr double kMinChance = 0.04;
// Samples closer than this along a contour stand or fall together: one line covers them.
constexpr double kIndependentPx = 25;
constexpr double kFullIndependent = 4;  // so many count fully, further ones by their logarithm
// Directions of a predicted contour and its line may differ by this.
constexpr double kMinCosine = 0.9962;  // 5 degrees
// Standard deviation of a contour's distance from its line, with a fair calibration, as a share of the
// tolerance.
constexpr double kSigmaShare = 0.35;
// Shadows, chamfers and rust pull so many lines off their contour.
constexpr double kPulled = 0.2;
// A line speaks for a contour so far beyond its own ends.
constexpr double kEndSlackPx = 0.5;
// Ends of a ledge that are rather not there than there: so in none of forty true ones, in most that were made
// of a shadow.
constexpr double kOpenLedge = 8;
// A contour is above its support from this height on, in pixels' size.
constexpr double kElevatedPx = 1.5;
// What is lower than this, in pixels' size, is compared with its own outline painted on the support.
constexpr double kPaintPx = 12;
// Two contours nearer than this in the picture may come out as one line.
constexpr double kResolvePx = 2.5;
constexpr double kDetectUnresolved = 0.3;
constexpr double kDetectCrowded = 0.45;
// And nearer than this the weaker is lost beside the stronger more often than not.
constexpr double kCrowdedPx = 5;
// A line that is a contour's image ends where the contour does, within so many tolerances, far more often
// than it runs on; a line that only passes by mostly runs on.
constexpr double kEndTolerances = 2;
constexpr double kEndsWithTrue = 0.9, kEndsWithChance = 0.15;

int Bin(const Vector2d& tangent) {
  double a = std::atan2(tangent.y(), tangent.x());
  if (a < 0) a += kPi;
  return std::min(SceneIndex::kDirectionBins - 1, static_cast<int>(a / kPi * SceneIndex::kDirectionBins));
}

Eigen::Matrix<double, 2, 3> IdealByWorld(const View& view, const Vector3d& point) {
  const Vector3d p = view.cam_from_world * point;
  const auto& k = view.camera->intrinsics;
  Eigen::Matrix<double, 2, 3> j;
  j << k.fx_px / p.z(), 0, -k.fx_px * p.x() / (p.z() * p.z()), 0, k.fy_px / p.z(),
      -k.fy_px * p.y() / (p.z() * p.z());
  return j * view.cam_from_world.rotation;
}

double TopOf(const WorldSolid& solid, ContourSample::Source source, int index) {
  if (source == ContourSample::Source::kLimb) return INFINITY;
  if (source == ContourSample::Source::kCircle)
    return solid.circles[static_cast<std::size_t>(index)].center.point.z();
  const auto& e = solid.edges[static_cast<std::size_t>(index)];
  return std::max(solid.vertices[static_cast<std::size_t>(e.start)].point.z(),
                  solid.vertices[static_cast<std::size_t>(e.end)].point.z());
}

// How often a contour that is there is found.
double DetectOf(const WorldSolid& solid, ContourSample::Source source, int index, double lowest_z) {
  constexpr double kContactMm = 1;
  if (source == ContourSample::Source::kLimb) return kDetectStrong;
  if (source == ContourSample::Source::kCircle)
    return solid.circles[static_cast<std::size_t>(index)].center.point.z() < lowest_z + kContactMm
               ? kDetectContact
               : kDetectStrong;
  const auto& e = solid.edges[static_cast<std::size_t>(index)];
  if (std::max(solid.vertices[static_cast<std::size_t>(e.start)].point.z(),
               solid.vertices[static_cast<std::size_t>(e.end)].point.z()) < lowest_z + kContactMm)
    return kDetectContact;
  const Vector3d middle = (solid.vertices[static_cast<std::size_t>(e.start)].point +
                           solid.vertices[static_cast<std::size_t>(e.end)].point) /
                          2;
  if (IsCovered(solid, middle)) return kDetectCovered;
  return e.convex ? kDetectStrong : kDetectWeak;
}

double StepLogOdds(double strength, bool weak, double visible_px) {
  const auto bin = std::upper_bound(kStepBounds.begin(), kStepBounds.end(), strength) - kStepBounds.begin();
  const auto& table = visible_px < kShortPx    ? kStepShort
                      : visible_px < kMediumPx ? kStepMedium
                      : weak                   ? kStepWeak
                                               : kStepStrong;
  return table[std::size_t(bin)];
}

double WeightOf(const WorldSolid& solid, const ContourSample& s) {
  if (s.source == ContourSample::Source::kEdge) return solid.edges[static_cast<std::size_t>(s.index)].weight;
  if (s.source == ContourSample::Source::kCircle)
    return solid.circles[static_cast<std::size_t>(s.index)].weight;
  return 1;
}

}  // namespace

double SceneIndex::ChanceHit(int view, const Vector2d& tangent) const {
  return std::clamp(
      density[static_cast<std::size_t>(view)][static_cast<std::size_t>(Bin(tangent))] * 2 * tolerance_px,
      kMinChance, 0.5);
}

void SceneIndex::SetWorldLines(std::span<const WorldLine> all) {
  constexpr int kEstablishedViews = 4;      // two pictures always meet somewhere, a third may by chance
  constexpr double kEstablishedRms = 0.35;  // of the tolerance: more is a mixture of two edges
  world_lines.clear();
  world_of_line.assign(views.size(), {});
  for (std::size_t v = 0; v < views.size(); ++v) world_of_line[v].assign(lines[v].lines().size(), -1);
  for (const auto& l : all) {
    if (l.rms_px > kEstablishedRms * tolerance_px) continue;
    if (MovesWithLamps(l, views)) {
      for (const auto& r : l.lines)
        world_of_line[static_cast<std::size_t>(r.view)][static_cast<std::size_t>(r.line)] = kShadow;
      continue;
    }
    if (l.num_views < kEstablishedViews) continue;
    for (const auto& r : l.lines)
      world_of_line[static_cast<std::size_t>(r.view)][static_cast<std::size_t>(r.line)] =
          static_cast<int>(world_lines.size());
    world_lines.push_back(l);
  }
}

LineHit SceneIndex::Match(int view, const ContourSample& sample, double reach_px, double min_cosine) const {
  constexpr double kWorldReach =
      1.25;  // times the reach: how far the contour may be from the edge in all its pictures
  LineHit hit = lines[static_cast<std::size_t>(view)].Nearest(sample.ideal, sample.ideal_tangent, reach_px,
                                                              min_cosine, kEndSlackPx);
  if (hit.line < 0 || world_of_line.empty()) return hit;
  const int w = world_of_line[static_cast<std::size_t>(view)][static_cast<std::size_t>(hit.line)];
  if (w == kShadow) return {};
  if (w < 0) return hit;
  const WorldLine& l = world_lines[static_cast<std::size_t>(w)];
  const Vector3d d = l.Unit(), along = sample.point_in_world - l.start, offset = along - d * d.dot(along);
  const double allowed_px = kWorldReach * reach_px;
  return offset.dot(l.px2_per_mm2 * offset) > allowed_px * allowed_px ? LineHit{} : hit;
}

bool MovesWithLamps(const WorldLine& line, std::span<const View> views) {
  constexpr int kMinViews = 3;    // two pictures always agree on some line of space
  constexpr int kMinLookers = 3;  // one picture or two may miss an edge
  constexpr int kSteps = 5;
  if (line.num_stops != 1 || line.num_views < kMinViews) return false;
  const int stop = views[static_cast<std::size_t>(line.lines.front().view)].stop;
  if (stop < 0) return false;
  int lookers = 0;
  for (const auto& v : views) {
    if (v.stop == stop) continue;
    int inside = 0;
    for (int k = 0; k < kSteps; ++k)
      inside += v.Shows(line.start + (line.end - line.start) * ((k + 0.5) / kSteps));
    lookers += inside >= kSteps - 1;
  }
  return lookers >= kMinLookers;
}

SceneIndex MakeSceneIndex(std::span<const View> views, double tolerance_px, int threads) {
  constexpr double kReachFactor = 5;  // how far FitToLines may look, in tolerances
  SceneIndex scene;
  scene.views = views;
  scene.tolerance_px = tolerance_px;
  scene.sigma_px = kSigmaShare * tolerance_px;
  scene.mm_per_px = TypicalMmPerPx(views);
  scene.lines.resize(views.size());
  scene.density.resize(views.size());
  scene.typical_step.assign(views.size(), 1.0);
  ParallelFor(views.size(), threads, [&](std::size_t i) {
    scene.lines[i] = LineIndex(views[i], kReachFactor * tolerance_px);
    if (views[i].picture.data)
      scene.typical_step[i] = TypicalResponse(views[i].picture, kPiecePx, tolerance_px);
    auto& bins = scene.density[i];
    bins.assign(SceneIndex::kDirectionBins, 0.0);
    const double area = double(views[i].camera->width_px) * views[i].camera->height_px;
    for (const auto& l : scene.lines[i].lines())
      bins[static_cast<std::size_t>(Bin(l.direction))] += l.length_px / area;
  });
  return scene;
}

double TypicalMmPerPx(std::span<const View> views) {
  std::vector<double> sizes;
  for (const auto& v : views) {
    const Vector3d ray = v.RayOfIdeal({v.camera->width_px / 2.0, v.camera->height_px / 2.0});
    if (ray.z() > -0.05) continue;
    sizes.push_back(v.center_in_world.z() / -ray.z() / v.camera->intrinsics.fx_px);
  }
  if (sizes.empty()) return 1;
  std::nth_element(sizes.begin(), sizes.begin() + std::ptrdiff_t(sizes.size() / 2), sizes.end());
  return std::max(1e-3, sizes[sizes.size() / 2]);
}

std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, int most) {
  std::vector<Vector3d> points;
  for (const auto& v : solid.vertices) points.push_back(v.point);
  for (const auto& e : solid.edges)
    for (double t : {0.25, 0.5, 0.75})
      points.push_back((1 - t) * solid.vertices[std::size_t(e.start)].point +
                       t * solid.vertices[std::size_t(e.end)].point);
  for (const auto& c : solid.circles)
    for (int k = 0; k < 8; ++k)
      points.push_back(c.center.point +
                       c.radius_mm * (c.axis_u * std::cos(k * kPi / 4) + c.axis_v * std::sin(k * kPi / 4)));
  std::vector<std::pair<double, int>> seen;
  for (std::size_t i = 0; i < views.size(); ++i) {
    int inside = 0;
    double size = 0;
    for (const auto& p : points) {
      if (!views[i].Shows(p)) continue;
      ++inside;
      size += views[i].camera->intrinsics.fx_px / (p - views[i].center_in_world).norm();
    }
    if (inside > 0) seen.push_back({-size, static_cast<int>(i)});
  }
  std::sort(seen.begin(), seen.end());
  if (static_cast<int>(seen.size()) > most) seen.resize(static_cast<std::size_t>(most));
  std::vector<int> out;
  for (const auto& s : seen) out.push_back(s.second);
  std::sort(out.begin(), out.end());
  return out;
}

namespace {

// Contours in one numbering: edges, then circles, then cylinders (limbs).
struct Numbering {
  int edges, circles, total;
  explicit Numbering(const WorldSolid& s)
      : edges(int(s.edges.size())),
        circles(int(s.circles.size())),
        total(edges + circles + int(s.faces.size())) {}
  int Of(const ContourSample& c) const {
    return c.index + (c.source == ContourSample::Source::kEdge     ? 0
                      : c.source == ContourSample::Source::kCircle ? edges
                                                                   : edges + circles);
  }
  ContourSample::Source SourceOf(int k) const {
    return k < edges             ? ContourSample::Source::kEdge
           : k < edges + circles ? ContourSample::Source::kCircle
                                 : ContourSample::Source::kLimb;
  }
  int IndexOf(int k) const { return k < edges ? k : k < edges + circles ? k - edges : k - edges - circles; }
};

struct Hit {
  int contour, line, sample;  // line: where an arc was hit all of it, see HitOf()
  double distance, along;
};

// All chords of an arc are one line, along which one goes by the circle's own angle.
Hit HitOf(const LineHit& hit, const ContourSample& s, int contour, int sample, const LineIndex& index) {
  const auto& l = index.lines()[std::size_t(hit.line)];
  const bool round = l.arc >= 0 && s.source == ContourSample::Source::kCircle && s.t_step > 0;
  return {contour, l.arc < 0 ? hit.line : index.num_segments() + l.arc, sample, std::abs(hit.distance_px),
          round ? s.t / s.t_step * s.step_px : (s.ideal - l.start).dot(l.direction)};
}

// A line that lies on two predicted contours speaks for the nearer one only. The other is marked: 1, neither
// found nor missed (the two are too close to be told apart in the picture), or 2, missed.
void Share(const std::vector<Hit>& hits, std::span<const ContourSample> samples, std::vector<int>& lost) {
  struct Run {
    int contour, line, count = 0;
    double distance = 0, lo = 1e300, hi = -1e300;
  };
  std::vector<Run> runs;
  for (const Hit& h : hits) {
    auto it = std::find_if(runs.begin(), runs.end(),
                           [&](const Run& r) { return r.contour == h.contour && r.line == h.line; });
    if (it == runs.end()) it = runs.insert(runs.end(), {h.contour, h.line});
    ++it->count;
    it->distance += h.distance;
    it->lo = std::min(it->lo, h.along);
    it->hi = std::max(it->hi, h.along);
  }
  for (std::size_t i = 0; i < runs.size(); ++i)
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (i == k || runs[i].line != runs[k].line) continue;
      const double mine = runs[i].distance / runs[i].count, other = runs[k].distance / runs[k].count;
      if (mine < other || (mine == other && i < k)) continue;
      if (std::min(runs[i].hi, runs[k].hi) - std::max(runs[i].lo, runs[k].lo) <
          0.3 * (runs[i].hi - runs[i].lo))
        continue;
      for (const Hit& h : hits) {
        if (h.contour != runs[i].contour || h.line != runs[i].line) continue;
        double nearest = 1e300;
        for (const Hit& o : hits)
          if (o.contour == runs[k].contour && o.line == h.line)
            nearest = std::min(
                nearest,
                std::abs((samples[std::size_t(o.sample)].ideal - samples[std::size_t(h.sample)].ideal)
                             .dot(Vector2d(-samples[std::size_t(h.sample)].ideal_tangent.y(),
                                           samples[std::size_t(h.sample)].ideal_tangent.x()))));
        lost[std::size_t(h.sample)] = std::max(lost[std::size_t(h.sample)], nearest < kResolvePx ? 1 : 2);
      }
    }
}

using Neighbour = MeasuredContours::Neighbour;

// For each circle the nearest other one that runs beside it, by the median of its samples.
void NearestRing(std::span<const ContourSample> samples, const Numbering& numbering,
                 std::vector<Neighbour>& nearest) {
  std::vector<std::vector<const ContourSample*>> rings;
  for (const auto& s : samples) {
    if (!s.visible || s.source != ContourSample::Source::kCircle) continue;
    if (rings.empty() || rings.back()[0]->index != s.index) rings.emplace_back();
    rings.back().push_back(&s);
  }
  std::vector<double> distances;
  for (const auto& a : rings)
    for (const auto& b : rings) {
      if (&a == &b) continue;
      distances.clear();
      for (const auto* s : a) {
        const auto* best = *std::min_element(b.begin(), b.end(), [&](const auto* p, const auto* q) {
          return (p->ideal - s->ideal).squaredNorm() < (q->ideal - s->ideal).squaredNorm();
        });
        distances.push_back(std::abs(
            (best->ideal - s->ideal).dot(Vector2d(-best->ideal_tangent.y(), best->ideal_tangent.x()))));
      }
      const auto middle = distances.begin() + std::ptrdiff_t(distances.size() / 2);
      std::nth_element(distances.begin(), middle, distances.end());
      auto& near = nearest[std::size_t(numbering.Of(*a[0]))];
      if (*middle < near.distance_px) near = {*middle, numbering.Of(*b[0])};
    }
}

// For each contour the nearest other visible contour that runs beside it.
std::vector<Neighbour> NearestParallel(std::span<const ContourSample> samples, const Numbering& numbering) {
  std::vector<Neighbour> nearest(static_cast<std::size_t>(numbering.total));
  struct Middle {
    int contour;
    const ContourSample *first, *last;
  };
  std::vector<Middle> runs;
  for (const auto& s : samples) {
    if (!s.visible) continue;
    if (runs.empty() || runs.back().contour != numbering.Of(s)) runs.push_back({numbering.Of(s), &s, &s});
    runs.back().last = &s;
  }
  std::erase_if(runs, [](const Middle& r) { return r.first->source == ContourSample::Source::kCircle; });
  NearestRing(samples, numbering, nearest);
  for (const auto& a : runs) {
    const Vector2d middle = (a.first->ideal + a.last->ideal) / 2;
    const Vector2d along = a.first->ideal_tangent;
    for (const auto& b : runs) {
      if (a.contour == b.contour || std::abs(along.dot(b.first->ideal_tangent)) < kMinCosine) continue;
      const double s0 = (b.first->ideal - middle).dot(along), s1 = (b.last->ideal - middle).dot(along);
      const double half = std::abs((a.last->ideal - middle).dot(along));
      if (std::min(std::max(s0, s1), half) < std::max(std::min(s0, s1), -half)) continue;
      const double distance = std::abs((b.first->ideal - middle).dot(Vector2d(-along.y(), along.x())));
      auto& best = nearest[std::size_t(a.contour)];
      if (distance < best.distance_px) best = {distance, b.contour};
    }
  }
  return nearest;
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

}  // namespace

double PriorLogOdds(const PlacedObject& object, double mm_per_px) {
  constexpr double kPerDimension = 4;  // half the logarithm of some 3000 px of contour (BIC)
  constexpr double kUnseenDimension =
      30;                            // at most a pixel: the pictures cannot show it; from two on they do
  constexpr double kOtherPose = 30;  // parts mostly lie as their knowledge base says first
  constexpr double kFlatPx = 4,
                   kFlat =
                       10;  // a pixel: what is hardly higher than a pixel may be paint, a shadow or a cable
  constexpr double kBarPx = 10, kBar = 20;  // a pixel: a bar as thin as that both ways may be a cable
  double prior = object.resting_pose > 0 ? -kOtherPose : 0;
  const auto defs = object.model->dimensions();
  for (std::size_t i = 0; i < defs.size(); ++i) {
    const bool is_size = defs[i].min_mm >= 0;  // else a place, which may well be 0
    const double px = object.dimensions_mm[i] / mm_per_px;
    prior -= kPerDimension + (is_size ? kUnseenDimension * std::clamp(2 - px, 0.0, 1.0) : 0);
  }
  const Solid solid = object.model->InstantiateUnchecked(object.dimensions_mm);
  const Eigen::Matrix3d& rested_from_part =
      object.model->resting_poses()[static_cast<std::size_t>(object.resting_pose)].rested_from_part;
  Eigen::AlignedBox3d box;
  for (const auto& v : solid.vertices) box.extend(Vector3d(rested_from_part * v.point_in_part));
  for (const auto& c : solid.circles) {
    const Vector3d center = rested_from_part * c.center.point_in_part;
    const Vector3d spread = Vector3d(c.radius_mm, c.radius_mm, 0);
    box.extend(Vector3d(center + spread));
    box.extend(Vector3d(center - spread));
  }
  Vector3d extent_px = box.sizes() / mm_per_px;
  if (extent_px.z() < kFlatPx) prior -= kFlat * (kFlatPx - extent_px.z());
  std::sort(extent_px.data(), extent_px.data() + 3);
  if (extent_px[1] < kBarPx) prior -= kBar * (kBarPx - extent_px[1]);
  return prior;
}

namespace {

// The solid pressed flat onto its support, with those of its contours that stand above it.
WorldSolid Painted(const WorldSolid& solid, double lowest_z, double elevated_mm) {
  WorldSolid flat = solid;
  for (auto& v : flat.vertices) v.point.z() = lowest_z;
  for (auto& f : flat.faces)
    for (auto& t : f.triangles)
      for (auto& p : t) p.z() = lowest_z;
  for (std::size_t i = 0; i < solid.edges.size(); ++i)
    if (TopOf(solid, ContourSample::Source::kEdge, int(i)) <= lowest_z + elevated_mm)
      flat.edges[i].weight = 0;
  for (std::size_t i = 0; i < solid.circles.size(); ++i) {
    flat.circles[i].center.point.z() = lowest_z;
    if (solid.circles[i].center.point.z() <= lowest_z + elevated_mm) flat.circles[i].weight = 0;
  }
  return flat;
}

void AppendMatches(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                   const SceneIndex& scene, std::vector<ContourMatch>& out) {
  std::map<std::pair<int, int>, std::pair<int, double>> lines;
  for (const auto& m : in_view.samples) {
    if (m.line < 0 || m.lost != 0) continue;
    auto& l = lines[{m.line, m.contour}];
    ++l.first;
    l.second += m.distance_px;
  }
  for (const auto& [key, l] : lines) {
    const auto& contour = measured.contours[std::size_t(key.second)];
    if (l.first < 2 || contour.source == ContourSample::Source::kLimb) continue;
    const int arc = scene.lines[std::size_t(in_view.view)].lines()[std::size_t(key.first)].arc;
    out.push_back({in_view.view, arc < 0 ? key.first : arc, contour.index,
                   contour.source == ContourSample::Source::kCircle, l.second / l.first});
  }
}

// Of one contour in one picture.
struct Tally {
  int visible = 0, open = 0, supported = 0;  // open: neither another part's nor unresolvable
  int stepped = 0;                           // without a line, but the grey values were asked
  int rises = 0, falls = 0, rings = 0;       // of a round edge: clear steps of either sign, pieces asked
  double px = 0, chance = 0, squared = 0;
  double steps = 0;  // log-odds of what the grey values say there
  double empty_px = 0;
  double ends = 0;  // log-odds of where the lines end
  double Share() const { return open > 0 ? double(supported) / open : 0; }
  // Log-odds of what the grey values say of a round edge as a whole, whichever side is dark.
  double Ring() const {
    const int same = std::max(rises, falls);
    return same * std::log(kRisesTrue / kRisesChance) +
           (rings - same) * std::log((1 - kRisesTrue) / (1 - kRisesChance)) - std::log(2);
  }
};

}  // namespace

namespace {

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

}  // namespace

MeasuredContours MeasureContours(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                                 const WeighOptions& options, const Occluders* others) {
  const Numbering numbering(solid);
  MeasuredContours out;
  double lowest_z = INFINITY;
  for (const auto& v : solid.vertices) lowest_z = std::min(lowest_z, v.point.z());
  for (const auto& c : solid.circles) lowest_z = std::min(lowest_z, c.center.point.z());
  out.contours.resize(std::size_t(numbering.total));
  for (int k = 0; k < numbering.total; ++k) {
    auto& contour = out.contours[std::size_t(k)];
    ContourSample probe;
    probe.source = contour.source = numbering.SourceOf(k);
    probe.index = contour.index = numbering.IndexOf(k);
    contour.weight = WeightOf(solid, probe);
    if (contour.source != ContourSample::Source::kLimb || solid.faces[std::size_t(contour.index)].is_cylinder)
      contour.detect = DetectOf(solid, contour.source, contour.index, lowest_z);
    contour.elevated = TopOf(solid, contour.source, contour.index) > lowest_z + kElevatedPx * scene.mm_per_px;
  }
  out.ledge_ends = LedgeEnds(solid, kElevatedPx * scene.mm_per_px);
  const ContourSampling sampling{.spacing_px = options.spacing_px,
                                 .min_samples = options.min_samples,
                                 .max_samples = options.max_samples,
                                 .img = options.grey || options.rings};
  std::vector<Hit> hits;
  std::vector<int> lost, lines;    // lines: of the picture's index, by hit
  std::vector<double> visible_px;  // of each contour
  for (int v : views) {
    const GreyView& picture = scene.views[std::size_t(v)].picture;
    const bool grey = options.grey && picture.data != nullptr;
    const bool rings = (options.grey || options.rings) && picture.data != nullptr;
    const auto samples = SampleContour(solid, scene.views[std::size_t(v)], sampling, others);
    const auto& index = scene.lines[std::size_t(v)];
    MeasuredContours::InView in_view;
    in_view.view = v;
    hits.clear();
    lines.clear();
    lost.assign(samples.size(), 0);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto& s = samples[i];
      if (!s.visible || out.contours[std::size_t(numbering.Of(s))].weight <= 0) continue;
      const LineHit hit = scene.Match(v, s, scene.tolerance_px, kMinCosine);
      if (hit.line < 0) continue;
      hits.push_back(HitOf(hit, s, numbering.Of(s), int(i), index));
      lines.push_back(hit.line);
    }
    Share(hits, samples, lost);
    in_view.crowded = NearestParallel(samples, numbering);
    visible_px.assign(out.contours.size(), 0);
    for (const auto& s : samples)
      if (s.visible) visible_px[std::size_t(numbering.Of(s))] += s.step_px;
    std::size_t next_hit = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto& s = samples[i];
      const bool is_hit = next_hit < hits.size() && hits[next_hit].sample == int(i);
      MeasuredContours::Sample m;
      if (is_hit) {
        m.line = lines[next_hit];
        m.distance_px = hits[next_hit].distance;
        m.along_px = hits[next_hit++].along;
      }
      m.contour = numbering.Of(s);
      if (!s.visible || out.contours[std::size_t(m.contour)].weight <= 0) continue;
      m.point_in_world = s.point_in_world;
      m.step_px = s.step_px;
      m.chance = scene.ChanceHit(v, s.ideal_tangent);
      m.lost = lost[i];
      if (m.line >= 0 && m.lost == 0)
        m.ends = EndLogOdds(solid, s, scene.views[std::size_t(v)], index.lines()[std::size_t(m.line)],
                            scene.tolerance_px);
      const bool ask = grey && m.line < 0, round = rings && s.source == ContourSample::Source::kCircle;
      if (ask || round) {
        if (const auto response = RespondToEdge(picture, s.img, s.ideal_tangent,
                                                std::min(kPiecePx, s.step_px), scene.tolerance_px)) {
          const double strength = std::abs(response->step) / scene.typical_step[std::size_t(v)];
          if (round) {
            const bool clear =
                strength > kEmptyStep && std::abs(response->step) > kRingContrast * response->bright;
            m.rises = !clear ? 0 : response->step > 0 ? 1 : -1;
          }
          if (ask) {
            m.asked = true;
            m.step = StepLogOdds(strength, out.contours[std::size_t(m.contour)].detect < kDetectStrong,
                                 visible_px[std::size_t(m.contour)]);
            m.empty = strength < kEmptyStep;
          }
        }
      }
      in_view.samples.push_back(m);
    }
    if (!in_view.samples.empty()) out.views.push_back(std::move(in_view));
  }
  return out;
}

double OpenLedges(const MeasuredContours& measured, std::span<const double> log_odds) {
  double sum = 0;
  for (const auto& ends : measured.ledge_ends) {
    double of_ends = 0;
    for (int k : ends) of_ends += log_odds[std::size_t(k)];
    if (of_ends < 0) sum -= kOpenLedge;
  }
  return sum;
}

double IndependentPieces(double px) {
  // A contour that is shorter is one observation all the same, if as long as the pieces that were measured.
  if (px < kIndependentPx) return std::min(px / kPiecePx, 1.0);
  const double pieces = px / kIndependentPx;
  return pieces < kFullIndependent ? pieces : kFullIndependent * (1 + std::log(pieces / kFullIndependent));
}

ContourVote VoteOf(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                   const std::function<bool(std::size_t)>& visible,
                   const std::function<bool(std::size_t)>& taken, const SceneIndex& scene, bool rough) {
  ContourVote out;
  static thread_local std::vector<Tally> tallies;
  tallies.assign(measured.contours.size(), {});
  for (std::size_t i = 0; i < in_view.samples.size(); ++i) {
    if (visible && !visible(i)) continue;
    const auto& m = in_view.samples[i];
    auto& t = tallies[std::size_t(m.contour)];
    ++t.visible;
    t.px += m.step_px;
    t.chance += m.chance;
    if (m.line >= 0 && taken && taken(i)) continue;
    ++t.open;
    if (m.rises) {
      ++t.rings;
      t.rises += *m.rises > 0;
      t.falls += *m.rises < 0;
    }
    if (m.asked) {
      ++t.stepped;
      t.steps += m.step;
      t.empty_px += m.empty ? m.step_px : 0;
    }
    if (m.line < 0 || m.lost != 0) continue;
    ++t.supported;
    t.squared += m.distance_px * m.distance_px;
    t.ends += m.ends;
  }
  for (std::size_t k = 0; k < tallies.size(); ++k) {
    const Tally& t = tallies[k];
    if (t.visible == 0) continue;
    const auto& contour = measured.contours[k];
    ContourVote::Contour c{.contour = int(k), .visible_px = t.px};
    if (t.open > 0) {
      const double share = t.Share();
      c.open_px = t.px * t.open / t.visible;
      c.supported_px = share * c.open_px;
      c.empty_px = t.empty_px;
      c.squared = t.squared / std::max(1, t.supported) * c.supported_px;
      const double chance =
          std::max(t.chance / t.visible, contour.detect == kDetectContact ? kChanceContact : 0.0);
      // Of two crowded contours the one that was found was the stronger.
      const Neighbour& near_by = in_view.crowded[k];
      const bool weaker = near_by.contour >= 0 && share < tallies[std::size_t(near_by.contour)].Share();
      const double beside = weaker || share == 0 ? near_by.distance_px : 1e9;
      const double detect = std::max(std::min(contour.detect, beside < kResolvePx   ? kDetectUnresolved
                                                              : beside < kCrowdedPx ? kDetectCrowded
                                                                                    : 1.0),
                                     chance + 0.05);
      // A true contour lies near its line (normal, sigma; now and then pulled off it), a chance one anywhere
      // within the tolerance.
      const double sigma = rough ? kSigmaShare * scene.tolerance_px : scene.sigma_px;
      const double density = 2 * scene.tolerance_px / (sigma * std::sqrt(2 * kPi));
      const double near =
          t.supported == 0
              ? 0
              : std::log((1 - kPulled) * density * std::exp(-t.squared / t.supported / (2 * sigma * sigma)) +
                         kPulled);
      const double missed = t.open - t.supported - t.stepped;
      c.ends = contour.weight * t.ends;
      // A step beside another contour is that contour's as likely as this one's.
      const double steps = near_by.distance_px < kCrowdedPx ? std::min(t.steps, 0.0) : t.steps;
      c.per_piece = contour.weight * (share * (std::log(detect / chance) + near) + steps / t.open +
                                      missed / t.open * std::log((1 - detect) / (1 - chance)));
      if (t.rings > 0 && t.px < kSmallRingPx) {
        // Of two that run close together the clearer one has the steps.
        const double ring = t.Ring(), other = near_by.distance_px < kCrowdedPx
                                                  ? tallies[std::size_t(near_by.contour)].Ring()
                                                  : -INFINITY;
        if (ring > other || (ring == other && int(k) > near_by.contour))
          c.per_piece = std::max(c.per_piece, contour.weight * ring / IndependentPieces(c.open_px));
      }
    }
    out.contours.push_back(c);
  }
  return out;
}

namespace {

Evidence WeighContours(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                       const WeighOptions& options, const Occluders* others, const Claims* claims) {
  const MeasuredContours measured = MeasureContours(solid, views, scene, options, others);
  Evidence out;
  out.views = int(measured.views.size());
  std::vector<EdgeEvidence> edges(measured.contours.size());
  std::vector<int> votes(measured.contours.size());
  for (const auto& in_view : measured.views) {
    std::function<bool(std::size_t)> taken;
    if (claims)
      taken = [&](std::size_t i) {
        return (*claims)[std::size_t(in_view.view)][std::size_t(in_view.samples[i].line)];
      };
    for (const auto& c : VoteOf(measured, in_view, {}, taken, scene, options.rough).contours) {
      auto& e = edges[std::size_t(c.contour)];
      ++e.views;
      e.visible_px += c.visible_px;
      if (c.open_px <= 0) continue;
      e.supported_px += c.supported_px;
      e.empty_px += c.empty_px;
      e.rms_px += c.squared;
      e.log_odds += c.ends + IndependentPieces(c.open_px) * c.per_piece;
      ++votes[std::size_t(c.contour)];
    }
    if (options.keep_matches) AppendMatches(measured, in_view, scene, out.matches);
  }
  for (std::size_t k = 0; k < edges.size(); ++k) {
    EdgeEvidence& e = edges[k];
    if (e.views == 0) continue;
    e.source = measured.contours[k].source;
    e.index = measured.contours[k].index;
    // Pictures of one edge fail together (its contrast is what it is): n pictures count as sqrt(n).
    e.rms_px = e.supported_px > 0 ? std::sqrt(e.rms_px / e.supported_px) : 0;
    e.log_odds = votes[k] > 0 ? e.log_odds / std::sqrt(double(e.views)) : 0;
    out.log_odds += e.log_odds;
    if (measured.contours[k].elevated) out.elevated_log_odds += e.log_odds;
    out.visible_px += e.visible_px;
    out.supported_px += e.supported_px;
    out.edges.push_back(e);
  }
  std::vector<double> by_contour;
  for (const auto& e : edges) by_contour.push_back(e.log_odds);
  const double open_ledges = OpenLedges(measured, by_contour);
  out.log_odds += open_ledges;
  out.elevated_log_odds += open_ledges;
  out.log_odds += options.prior_log_odds;
  out.elevated_log_odds += kElevatedPrior * options.prior_log_odds;
  return out;
}

}  // namespace

double PaintedLogOdds(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                      const WeighOptions& options, const Occluders* others, const Claims* claims) {
  double low = INFINITY, high = -INFINITY;
  for (const auto& v : solid.vertices) {
    low = std::min(low, v.point.z());
    high = std::max(high, v.point.z());
  }
  for (const auto& c : solid.circles) {
    low = std::min(low, c.center.point.z());
    high = std::max(high, c.center.point.z());
  }
  if (high - low > kPaintPx * scene.mm_per_px) return 0;
  WeighOptions bare = options;
  bare.rings = options.grey || options.rings;
  bare.keep_matches = bare.grey = false;
  bare.prior_log_odds = 0;
  double sum = 0;
  const WorldSolid flat = Painted(solid, low, kElevatedPx * scene.mm_per_px);
  for (const auto& e : WeighContours(flat, views, scene, bare, others, claims).edges)
    sum += std::max(0.0, e.log_odds);
  return sum;
}

Evidence Weigh(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
               const WeighOptions& options, const Occluders* others, const Claims* claims) {
  Evidence out = WeighContours(solid, views, scene, options, others, claims);
  if (options.rough || out.log_odds <= 0) return out;  // hopeless either way
  out.elevated_log_odds -= PaintedLogOdds(solid, views, scene, options, others, claims);
  return out;
}

FitToLinesResult FitToLines(PlacedObject& object, std::span<const int> views, const SceneIndex& scene,
                            const std::vector<bool>& free, double first_reach_px, double last_reach_px,
                            int iterations, const Occluders* others) {
  FitToLinesResult result;
  const ContourSampling sampling{.spacing_px = 8, .min_samples = 3, .max_samples = 24, .img = false};
  const int n = object.StateSize();
  const auto defs = object.model->dimensions();
  for (int it = 0; it < iterations; ++it) {
    const double share = iterations > 1 ? it / double(iterations - 1) : 1;
    const double reach = first_reach_px + share * (last_reach_px - first_reach_px);
    const WorldSolid solid = PlaceSolid(object);
    Eigen::MatrixXd ata = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd atb = Eigen::VectorXd::Zero(n);
    const Numbering numbering(solid);
    std::vector<Hit> hits;
    std::vector<double> signed_distance;
    std::vector<int> lost;
    double sum = 0;
    int count = 0;
    for (int v : views) {
      const View& view = scene.views[std::size_t(v)];
      const auto samples = SampleContour(solid, view, sampling, others);
      const auto& index = scene.lines[std::size_t(v)];
      hits.clear();
      signed_distance.clear();
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const auto& s = samples[i];
        if (!s.visible) continue;
        const LineHit hit = scene.Match(v, s, reach, 0.99);
        if (hit.line < 0) continue;
        hits.push_back(HitOf(hit, s, numbering.Of(s), int(i), index));
        signed_distance.push_back(hit.distance_px);
      }
      lost.assign(samples.size(), 0);
      Share(hits, samples, lost);
      for (std::size_t k = 0; k < hits.size(); ++k) {
        if (lost[std::size_t(hits[k].sample)] != 0) continue;
        const auto& s = samples[std::size_t(hits[k].sample)];
        const double distance_px = signed_distance[k];
        const Vector2d normal(-s.ideal_tangent.y(), s.ideal_tangent.x());
        const Eigen::RowVectorXd j =
            (normal.transpose() * IdealByWorld(view, s.point_in_world)) * SampleByState(solid, s);
        const double u = distance_px / (0.5 * reach);
        const double w = 1 / (1 + u * u);
        ata += w * j.transpose() * j;
        atb += w * distance_px * j.transpose();
        sum += distance_px * distance_px;
        ++count;
      }
    }
    result.samples = count;
    if (count < 4) return result;
    result.rms_px = std::sqrt(sum / count);
    result.information = ata;
    // A weak hold on everything (10 mm, 0.01 rad to a tenth of a sample's weight) keeps what no line moves.
    for (int i = 0; i < n; ++i) {
      const double scale = i >= 3 && i < kPlacementSize ? 0.01 : 10.0;
      ata(i, i) += 0.1 / (scale * scale);
      if (free[std::size_t(i)]) continue;
      ata.row(i).setZero();
      ata.col(i).setZero();
      ata(i, i) = 1;
      atb[i] = 0;
    }
    Eigen::VectorXd state = object.State() + Eigen::VectorXd(ata.ldlt().solve(atb));
    if (!state.allFinite()) return {};
    for (std::size_t i = 0; i < defs.size(); ++i) {
      double& d = state[kPlacementSize + int(i)];
      d = std::clamp(d, defs[i].min_mm, defs[i].max_mm);
    }
    object.SetState(state);
  }
  return result;
}

}  // namespace vss
