#include "vss/identify/world_line.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "vss/base/parallel.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Direction = WorldLine::Direction;

// Planes that meet at less than this say nothing of the depth (sine).
constexpr double kMinPlaneAngle = 0.03;
// A plane that is itself nearly horizontal holds horizontal lines of every direction (sine of its tilt).
constexpr double kMinPlaneTilt = 0.1;
// The share of the shorter line that must lie beside the other.
constexpr double kMinOverlap = 0.4;
// A line and the projected edge that it shows differ by no more (cosine of 5 degrees).
constexpr double kMinCosine = 0.996;
// Pieces of one edge may be this far apart, relative to what is already known of it.
constexpr double kMaxGapShare = 0.3;
constexpr double kMinGapMm = 60;
// Of each picture so many of its longest segments are paired with those of the others: every pair of segments
// of every pair of pictures is a candidate, and parts are made of long edges, texture of short ones. All
// others still join the edges that these found.
constexpr std::size_t kMaxPaired = 600;

struct Candidate {
  Direction kind = Direction::kHorizontal;
  Vector3d start, end;
  std::vector<LineRef> support;  // the base line first
  int num_views = 0, num_stops = 0;
  double support_px = 0;
};

class Finder {
 public:
  Finder(std::span<const View> views, std::span<const LineIndex> indices, const WorldLineOptions& options)
      : views_(views), indices_(indices), options_(options) {
    for (const auto& v : views) rooms_.push_back(RoomOf(v));
    together_.resize(views.size());
    for (std::size_t i = 0; i < views.size(); ++i)
      for (std::size_t k = 0; k < views.size(); ++k)
        if (k != i && rooms_[i].intersects(rooms_[k])) together_[i].push_back(int(k));
    for (std::size_t i = 0; i < views.size(); ++i)
      paired_.push_back(Longest(indices[i], options.min_length_px));
  }

  // The segments of view `i` that may start an edge.
  std::span<const int> Paired(std::size_t i) const { return paired_[i]; }

  // The best explanation of line `line` of view `i` as an edge in the world.
  std::optional<Candidate> Explain(int i, int line) const {
    const View& view = views_[std::size_t(i)];
    const ViewLine& a = indices_[std::size_t(i)].lines()[std::size_t(line)];
    std::vector<Candidate> candidates;
    for (const int j_index : together_[std::size_t(i)]) {
      const std::size_t j = std::size_t(j_index);
      const double baseline = (views_[j].center_in_world - view.center_in_world).norm();
      if (baseline < 1e-6) continue;
      for (const int k : paired_[j])
        PairUp(view, a, views_[j], indices_[j].lines()[std::size_t(k)], candidates);
    }
    return Best(i, line, candidates);
  }

  // Lines of all pictures that lie on the infinite line through `start`, `end` beside its (growing) extent.
  void Grow(Candidate& c) const {
    bool grown = true;
    for (int round = 0; grown && round < 8; ++round) {
      grown = false;
      const Vector3d d = (c.end - c.start).normalized();
      const double length = (c.end - c.start).norm();
      const double gap = std::max(kMinGapMm, kMaxGapShare * length);
      double lo = 0, hi = length;
      std::vector<LineRef> found;
      Eigen::AlignedBox3d room(Vector3d(c.start - gap * d));
      room.extend(Vector3d(c.end + gap * d));
      for (std::size_t k = 0; k < views_.size(); ++k)
        if (rooms_[k].intersects(room)) Collinear(int(k), c.start - gap * d, c.end + gap * d, found);
      for (const LineRef& r : found) {
        const auto span = Extent(r, c.start, d);
        if (!span || span->first > length + gap || span->second < -gap) continue;
        if (std::find(c.support.begin(), c.support.end(), r) == c.support.end()) {
          c.support.push_back(r);
          grown = true;
        }
        lo = std::min(lo, span->first);
        hi = std::max(hi, span->second);
      }
      if (grown) Refine(c, lo, hi);
    }
  }

  // Least squares of the line (offsets across it at both ends) to the planes of its lines, then its extent.
  void Refine(Candidate& c, double, double) const {
    for (int iteration = 0; iteration < 3; ++iteration) {
      const Vector3d d = (c.end - c.start).normalized();
      const double length = (c.end - c.start).norm();
      const Vector3d e1 = d.unitOrthogonal(), e2 = d.cross(e1);
      Eigen::Matrix4d ata = Eigen::Matrix4d::Identity() * 1e-9;
      Eigen::Vector4d atb = Eigen::Vector4d::Zero();
      for (const LineRef& r : c.support) {
        const ViewLine& l = LineOf(r);
        const View& view = views_[std::size_t(r.view)];
        for (const Vector3d& ray : {l.ray_start, l.ray_end}) {
          const double t = ClosestOnLine(c.start, d, view.center_in_world, ray);
          const Vector3d x = c.start + t * d;
          const double depth = std::max(1.0, (x - view.center_in_world).norm());
          const double to_px = view.camera->intrinsics.fx_px / depth;
          const double residual = l.plane_normal.dot(x - view.center_in_world) * to_px;
          const double s = t / length;
          Eigen::Vector4d j;
          j << (1 - s) * l.plane_normal.dot(e1), (1 - s) * l.plane_normal.dot(e2), s * l.plane_normal.dot(e1),
              s * l.plane_normal.dot(e2);
          j *= to_px;
          const double u = residual / options_.tolerance_px;
          const double weight = l.length_px / (1 + u * u);
          ata += weight * j * j.transpose();
          atb -= weight * residual * j;
        }
      }
      // Horizontal and vertical are measured facts of steel on a floor: hold them where the pictures are
      // silent.
      const double hold = 1e-3 * ata.trace();
      if (c.kind == Direction::kHorizontal) {
        Eigen::Vector4d h;
        h << e1.z(), e2.z(), -e1.z(), -e2.z();
        ata += hold * h * h.transpose();
        atb -= hold * (c.start.z() - c.end.z()) * h;
      } else if (c.kind == Direction::kVertical) {
        for (int axis = 0; axis < 2; ++axis) {
          Eigen::Vector4d h;
          h << e1[axis], e2[axis], -e1[axis], -e2[axis];
          ata += hold * h * h.transpose();
          atb -= hold * (c.start[axis] - c.end[axis]) * h;
        }
      }
      const Eigen::Vector4d x = ata.ldlt().solve(atb);
      if (!x.allFinite() || x.norm() > length + 1000) return;
      c.start += x[0] * e1 + x[1] * e2;
      c.end += x[2] * e1 + x[3] * e2;
    }
    SetExtent(c);
  }

  void Count(Candidate& c) const {
    std::vector<int> seen, stops;
    c.support_px = 0;
    for (const auto& r : c.support) {
      seen.push_back(r.view);
      const int stop = views_[std::size_t(r.view)].stop;
      stops.push_back(stop < 0 ? -1 - r.view : stop);
      c.support_px += LineOf(r).length_px;
    }
    for (auto* v : {&seen, &stops}) {
      std::sort(v->begin(), v->end());
      v->erase(std::unique(v->begin(), v->end()), v->end());
    }
    c.num_views = int(seen.size());
    c.num_stops = int(stops.size());
  }

  Eigen::Matrix3d Sensitivity(const Candidate& c) const {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const auto& r : c.support) {
      const View& view = views_[std::size_t(r.view)];
      const double px_per_mm = view.camera->intrinsics.fx_px /
                               std::max(1.0, ((c.start + c.end) / 2 - view.center_in_world).norm());
      sum += px_per_mm * px_per_mm * LineOf(r).plane_normal * LineOf(r).plane_normal.transpose();
    }
    return sum / double(c.support.size());
  }

  double Rms(const Candidate& c) const {
    double sum = 0;
    for (const auto& r : c.support) sum += std::pow(DistancePx(r, c.start, c.end), 2);
    return std::sqrt(sum / double(c.support.size()));
  }

 private:
  static std::vector<int> Longest(const LineIndex& index, double min_length_px) {
    std::vector<int> segments;
    for (int k = 0; k < index.num_segments(); ++k)
      if (index.lines()[std::size_t(k)].length_px >= min_length_px) segments.push_back(k);
    if (segments.size() > kMaxPaired) {
      std::stable_sort(segments.begin(), segments.end(), [&](int a, int b) {
        return index.lines()[std::size_t(a)].length_px > index.lines()[std::size_t(b)].length_px;
      });
      segments.resize(kMaxPaired);
      std::sort(segments.begin(), segments.end());
    }
    return segments;
  }

  const ViewLine& LineOf(const LineRef& r) const {
    return indices_[std::size_t(r.view)].lines()[std::size_t(r.line)];
  }

  // Parameter t of the point start + t d that is closest to the ray from `center`.
  static double ClosestOnLine(const Vector3d& start, const Vector3d& d, const Vector3d& center,
                              const Vector3d& ray) {
    const Vector3d w = start - center;
    const double b = d.dot(ray), denominator = 1 - b * b;
    if (denominator < 1e-12) return 0;
    return (b * ray.dot(w) - d.dot(w)) / denominator;
  }

  std::optional<std::pair<double, double>> Extent(const LineRef& r, const Vector3d& start,
                                                  const Vector3d& d) const {
    const ViewLine& l = LineOf(r);
    const Vector3d& c = views_[std::size_t(r.view)].center_in_world;
    double a = ClosestOnLine(start, d, c, l.ray_start), b = ClosestOnLine(start, d, c, l.ray_end);
    if ((start + a * d - c).dot(l.ray_start) <= 0 || (start + b * d - c).dot(l.ray_end) <= 0)
      return std::nullopt;
    if (a > b) std::swap(a, b);
    return std::pair{a, b};
  }

  // Where at least two pictures agree (one, where only one looks).
  void SetExtent(Candidate& c) const {
    const Vector3d d = (c.end - c.start).normalized();
    std::map<int, std::pair<double, double>> by_view;
    std::vector<std::pair<double, double>> spans;
    for (const auto& r : c.support)
      if (const auto s = Extent(r, c.start, d)) spans.push_back(*s);
    if (spans.empty()) return;
    std::vector<double> lows, highs;
    for (const auto& s : spans) {
      lows.push_back(s.first);
      highs.push_back(s.second);
    }
    std::sort(lows.begin(), lows.end());
    std::sort(highs.rbegin(), highs.rend());
    // The second outermost end where it is near the outermost: one picture alone may have run on.
    auto pick = [](const std::vector<double>& ends) { return ends.size() > 2 ? ends[1] : ends[0]; };
    const double lo = pick(lows), hi = pick(highs);
    if (hi - lo < 1) return;
    const Vector3d s = c.start;
    c.start = s + lo * d;
    c.end = s + hi * d;
  }

  // Mean distance of the image line from the projected world line, where they lie side by side.
  double DistancePx(const LineRef& r, const Vector3d& start, const Vector3d& end) const {
    const View& view = views_[std::size_t(r.view)];
    const ViewLine& l = LineOf(r);
    const Vector3d d = (end - start).normalized();
    double sum = 0;
    for (const Vector3d& ray : {l.ray_start, l.ray_end}) {
      const double t = ClosestOnLine(start, d, view.center_in_world, ray);
      const auto p = view.ProjectIdeal(start + t * d);
      if (!p) return 1e9;
      sum += std::abs((*p - l.start).dot(l.normal));
    }
    return sum / 2;
  }

  void PairUp(const View& va, const ViewLine& a, const View& vb, const ViewLine& b,
              std::vector<Candidate>& out) const {
    const Vector3d cross = a.plane_normal.cross(b.plane_normal);
    const double sine = cross.norm();
    if (sine < kMinPlaneAngle) return;
    const Vector3d direction = cross / sine;
    // End points of `a` pushed onto the plane of `b`.
    auto meet = [&](const Vector3d& ray) {
      return va.center_in_world -
             ray * (b.plane_normal.dot(va.center_in_world - vb.center_in_world) / b.plane_normal.dot(ray));
    };
    Candidate c;
    const double slack =
        2 * options_.tolerance_px * (1 / a.length_px + 1 / b.length_px) / sine;  // rad, to first order
    const double level = std::abs(direction.z()), plumb = direction.head<2>().norm();
    if (level < std::max(slack, 0.01)) {
      c.kind = Direction::kHorizontal;
      if (a.plane_normal.head<2>().norm() < kMinPlaneTilt) return;
      const Vector3d mid = meet((a.ray_start + a.ray_end).normalized());
      const double h = mid.z() - va.center_in_world.z();
      if (std::abs(a.ray_start.z()) < 1e-6 || std::abs(a.ray_end.z()) < 1e-6) return;
      const double s0 = h / a.ray_start.z(), s1 = h / a.ray_end.z();
      if (!(s0 > 0) || !(s1 > 0)) return;
      c.start = va.center_in_world + s0 * a.ray_start;
      c.end = va.center_in_world + s1 * a.ray_end;
    } else if (plumb < std::max(slack, 0.01)) {
      c.kind = Direction::kVertical;
      const Vector3d mid = meet((a.ray_start + a.ray_end).normalized());
      if ((mid - va.center_in_world).dot(a.ray_start) <= 0) return;
      auto at = [&](const Vector3d& ray) {
        return Vector3d(mid +
                        Vector3d::UnitZ() * ClosestOnLine(mid, Vector3d::UnitZ(), va.center_in_world, ray));
      };
      c.start = at(a.ray_start);
      c.end = at(a.ray_end);
    } else {
      c.kind = Direction::kInclined;
      c.start = meet(a.ray_start);
      c.end = meet(a.ray_end);
      if ((c.start - va.center_in_world).dot(a.ray_start) <= 0 ||
          (c.end - va.center_in_world).dot(a.ray_end) <= 0)
        return;
    }
    for (const Vector3d& x : {c.start, c.end})
      if (!x.allFinite() || x.z() < options_.min_height_mm || x.z() > options_.max_height_mm) return;
    if (!Beside(vb, b, c.start, c.end, kMinOverlap)) return;
    out.push_back(std::move(c));
  }

  // Does the projection of start-end lie on line `l`, overlapping by a share of the shorter?
  bool Beside(const View& view, const ViewLine& l, const Vector3d& start, const Vector3d& end,
              double min_share) const {
    const auto p = view.ProjectIdeal(start), q = view.ProjectIdeal(end);
    if (!p || !q) return false;
    double s = (*p - l.start).dot(l.direction), t = (*q - l.start).dot(l.direction);
    double ds = (*p - l.start).dot(l.normal), dt = (*q - l.start).dot(l.normal);
    if (s > t) {
      std::swap(s, t);
      std::swap(ds, dt);
    }
    const double lo = std::max(0.0, s), hi = std::min(l.length_px, t);
    if (hi - lo < min_share * std::min(l.length_px, t - s) || hi <= lo) return false;
    const double slope = (dt - ds) / std::max(t - s, 1e-9);
    return std::abs(ds + slope * (lo - s)) < options_.tolerance_px &&
           std::abs(ds + slope * (hi - s)) < options_.tolerance_px;
  }

  // The part of start-end that a picture may show, in `ideal` px: straight lines stay straight there.
  static std::optional<std::pair<Vector2d, Vector2d>> Clipped(const View& view, const Vector3d& start,
                                                              const Vector3d& end) {
    constexpr double kMinDepthMm = 1.5;
    Vector3d a = view.cam_from_world * start, b = view.cam_from_world * end;
    if (std::max(a.z(), b.z()) < kMinDepthMm) return std::nullopt;
    for (auto [behind, ahead] : {std::pair(&a, &b), std::pair(&b, &a)})
      if (behind->z() < kMinDepthMm)
        *behind += (*ahead - *behind) * ((kMinDepthMm - behind->z()) / (ahead->z() - behind->z()));
    const auto& lens = view.camera->intrinsics;
    const Vector2d p = lens.IdealFromNormalized({a.x() / a.z(), a.y() / a.z()});
    const Vector2d d = lens.IdealFromNormalized({b.x() / b.z(), b.y() / b.z()}) - p;
    double from = 0, to = 1;
    for (int axis = 0; axis < 2; ++axis) {
      const double lo = view.maybe_inside.min()[axis] - p[axis],
                   hi = view.maybe_inside.max()[axis] - p[axis];
      if (std::abs(d[axis]) < 1e-12) {
        if (lo > 0 || hi < 0) return std::nullopt;
        continue;
      }
      from = std::max(from, std::min(lo / d[axis], hi / d[axis]));
      to = std::min(to, std::max(lo / d[axis], hi / d[axis]));
    }
    if (!(to > from)) return std::nullopt;
    return std::pair{Vector2d(p + from * d), Vector2d(p + to * d)};
  }

  // The lines of view `k` that lie on the projection of start-end.
  void Collinear(int k, const Vector3d& start, const Vector3d& end, std::vector<LineRef>& out) const {
    constexpr int kSteps = 12;
    const auto shown = Clipped(views_[std::size_t(k)], start, end);
    if (!shown) return;
    const Vector2d step = (shown->second - shown->first) / kSteps;
    const double length = step.norm();
    if (length < 1e-12) return;
    const Vector2d along = step / length;
    const LineIndex& index = indices_[std::size_t(k)];
    const std::size_t first = out.size();
    for (int s = 0; s <= kSteps; ++s) {
      const int line =
          index.Nearest(shown->first + s * step, along, options_.tolerance_px, kMinCosine).line;
      if (line < 0 || line >= index.num_segments()) continue;
      const LineRef found{k, line};
      if (std::find(out.begin() + std::ptrdiff_t(first), out.end(), found) == out.end()) out.push_back(found);
    }
    out.erase(std::remove_if(out.begin() + std::ptrdiff_t(first), out.end(),
                             [&](const LineRef& r) {
                               return DistancePx(r, start, end) >= options_.tolerance_px;
                             }),
              out.end());
  }

  std::optional<Candidate> Best(int i, int line, std::vector<Candidate>& candidates) const {
    // Candidates that agree with many others first: those are worth a look at all pictures.
    std::optional<Candidate> best;
    double best_score = 0;
    std::vector<bool> done(candidates.size());
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      if (done[k]) continue;
      Candidate& c = candidates[k];
      for (std::size_t m = k + 1; m < candidates.size();
           ++m)  // the same edge within the tolerance, seen from here
        if (!done[m] && candidates[m].kind == c.kind && SameDepth(views_[std::size_t(i)], c, candidates[m]))
          done[m] = true;
      c.support = {{i, line}};
      for (const int v_index : together_[std::size_t(i)]) {
        const std::size_t v = std::size_t(v_index);
        std::vector<LineRef> found;
        Collinear(int(v), c.start, c.end, found);
        for (const LineRef& r : found)
          if (Beside(views_[v], LineOf(r), c.start, c.end, kMinOverlap)) c.support.push_back(r);
      }
      Count(c);
      const int needed = c.kind == Direction::kInclined ? 3 : 2;
      if (c.num_views < needed) continue;
      // Horizontal and vertical explain more with less: one witness more.
      const double score = c.num_views + 0.5 * c.num_stops + (c.kind == Direction::kInclined ? 0 : 1) +
                           1e-4 * std::min(c.support_px, 2000.0);
      if (score > best_score) {
        best_score = score;
        best = c;
      }
    }
    return best;
  }

  bool SameDepth(const View& view, const Candidate& a, const Candidate& b) const {
    // A depth step that moves the edge by less than half the tolerance in a picture one baseline of 1/5 depth
    // away.
    const double depth = (a.start - view.center_in_world).norm();
    const double step = 0.5 * options_.tolerance_px * depth / view.camera->intrinsics.fx_px * 5;
    return (a.start - b.start).norm() < step && (a.end - b.end).norm() < step;
  }

  // The part of the world, between the least and the largest height, that a picture may show.
  Eigen::AlignedBox3d RoomOf(const View& view) const {
    constexpr double kFarMm = 1e7;
    constexpr int kSteps = 4;
    Eigen::AlignedBox3d room;
    const double w = view.camera->width_px, h = view.camera->height_px;
    for (int a = 0; a <= kSteps; ++a)
      for (int b = 0; b <= kSteps; ++b) {
        if (a % kSteps != 0 && b % kSteps != 0) continue;
        const Vector2d img(w * a / kSteps - 0.5, h * b / kSteps - 0.5);
        const auto normalized = view.camera->intrinsics.NormalizedFromImg(img);
        if (!normalized) return {Vector3d::Constant(-kFarMm), Vector3d::Constant(kFarMm)};
        const Vector3d ray =
            view.cam_from_world.rotation.transpose() * Vector3d(normalized->x(), normalized->y(), 1);
        for (const double z : {options_.min_height_mm, options_.max_height_mm}) {
          // Up to where the ray meets the height, if it does so before the horizon.
          const double rise = z - view.center_in_world.z();
          const double t = rise * ray.z() > 0 ? rise / ray.z() : rise == 0 ? 0 : kFarMm;
          const double limited = rise * ray.z() > 0 || z == options_.min_height_mm ? std::min(t, kFarMm) : 0;
          room.extend(Vector3d(view.center_in_world + limited * ray));
        }
      }
    return room;
  }

  std::span<const View> views_;
  std::span<const LineIndex> indices_;
  const WorldLineOptions& options_;
  std::vector<Eigen::AlignedBox3d> rooms_;  // by view
  std::vector<std::vector<int>> together_;  // by view: those that may show the same
  std::vector<std::vector<int>> paired_;    // by view: the segments that may start an edge
};

}  // namespace

double AgreementPx(std::span<const WorldLine> lines) {
  constexpr int kMinViews = 4;  // two pictures always agree, three often
  constexpr std::size_t kMinLines = 8;
  constexpr double kBetter = 0.25;  // quantile: the rest are often mixtures of two edges that lie close
  std::vector<double> rms;
  for (const auto& l : lines)
    if (l.num_views >= kMinViews) rms.push_back(l.rms_px);
  if (rms.size() < kMinLines) return 0;
  std::sort(rms.begin(), rms.end());
  return rms[std::size_t(kBetter * double(rms.size()))];
}

std::vector<WorldLine> FindWorldLines(std::span<const View> views, std::span<const LineIndex> indices,
                                      const WorldLineOptions& options, int threads,
                                      const Progress& progress) {
  const Finder finder(views, indices, options);
  std::vector<std::vector<std::optional<Candidate>>> explained(views.size());
  ParallelFor(views.size(), threads, [&](std::size_t i) {
    if (progress.Cancelled()) return;
    for (const int k : finder.Paired(i)) explained[i].push_back(finder.Explain(int(i), k));
  });
  std::vector<const Candidate*> order;
  for (const auto& view : explained)
    for (const auto& c : view)
      if (c) order.push_back(&*c);
  std::stable_sort(order.begin(), order.end(), [](const Candidate* a, const Candidate* b) {
    if (a->num_views != b->num_views) return a->num_views > b->num_views;
    return a->support_px > b->support_px;
  });
  std::vector<std::vector<bool>> claimed(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) claimed[i].resize(indices[i].lines().size());
  std::vector<WorldLine> out;
  for (const Candidate* base : order) {
    const LineRef& first = base->support.front();
    if (claimed[std::size_t(first.view)][std::size_t(first.line)]) continue;
    Candidate c = *base;
    std::erase_if(c.support,
                  [&](const LineRef& r) { return claimed[std::size_t(r.view)][std::size_t(r.line)]; });
    finder.Count(c);
    if (c.num_views < (c.kind == Direction::kInclined ? 3 : 2)) continue;
    finder.Refine(c, 0, 0);
    finder.Grow(c);
    std::erase_if(c.support,
                  [&](const LineRef& r) { return claimed[std::size_t(r.view)][std::size_t(r.line)]; });
    finder.Count(c);
    const double rms = finder.Rms(c);
    if (rms > options.tolerance_px) continue;
    std::sort(c.support.begin(), c.support.end(), [](const LineRef& a, const LineRef& b) {
      return std::pair(a.view, a.line) < std::pair(b.view, b.line);
    });
    for (const LineRef& r : c.support) claimed[std::size_t(r.view)][std::size_t(r.line)] = true;
    out.push_back({c.kind, c.start, c.end, c.support, c.num_views, c.num_stops, rms, finder.Sensitivity(c)});
  }
  return out;
}

namespace {

// A horizontal circle as one picture sees it: at height z its centre is eye + center_per_mm * (eye.z - z),
// its radius radius_per_mm * (eye.z - z).
struct FlatCircle {
  LineRef ref;
  Vector3d eye;
  Vector2d center_per_mm;
  double radius_per_mm = 0;
  double mm_per_px_per_mm = 0;  // size of a pixel there, per mm of depth

  Vector2d CenterAt(double z) const { return eye.head<2>() + center_per_mm * (eye.z() - z); }
  double RadiusAt(double z) const { return radius_per_mm * (eye.z() - z); }
};

// The arc's rays met with a horizontal plane; empty where that is no circle to within the tolerance.
std::optional<FlatCircle> Flatten(const View& view, int v, int arc, double tolerance_px) {
  constexpr int kPoints = 24;
  constexpr double kMinSlope = 0.1;  // rays nearer to the horizon say nothing
  const auto& a = view.lines->arcs[std::size_t(arc)];
  const Eigen::Rotation2Dd turn(a.ideal_angle_rad);
  Eigen::MatrixXd m(kPoints, 3);
  Eigen::VectorXd rhs(kPoints);
  std::vector<Vector2d> points;
  for (int k = 0; k < kPoints; ++k) {
    const double t = a.ideal_from_rad + (a.ideal_to_rad - a.ideal_from_rad) * (k + 0.5) / kPoints;
    const Vector2d p =
        a.ideal_center + turn * Vector2d(a.ideal_axes.x() * std::cos(t), a.ideal_axes.y() * std::sin(t));
    const Vector3d ray = view.RayOfIdeal(p);
    if (ray.z() > -kMinSlope) return std::nullopt;
    points.push_back(ray.head<2>() / -ray.z());
    m.row(k) << points.back().x(), points.back().y(), 1;
    rhs[k] = points.back().squaredNorm();
  }
  const Vector3d x = m.colPivHouseholderQr().solve(rhs);
  const Vector2d center = x.head<2>() / 2;
  const double squared = x[2] + center.squaredNorm();
  if (!(squared > 0)) return std::nullopt;
  FlatCircle c{{v, arc}, view.center_in_world, center, std::sqrt(squared), 0};
  c.mm_per_px_per_mm = std::sqrt(1 + center.squaredNorm()) / view.camera->intrinsics.fx_px;
  for (const auto& p : points)
    if (std::abs((p - center).norm() - c.radius_per_mm) > tolerance_px * c.mm_per_px_per_mm)
      return std::nullopt;
  return c;
}

}  // namespace

std::vector<WorldCircle> FindWorldCircles(std::span<const View> views, const WorldLineOptions& options) {
  std::vector<FlatCircle> flat;
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t k = 0; k < views[v].lines->arcs.size(); ++k)
      if (const auto c = Flatten(views[v], int(v), int(k), options.tolerance_px)) flat.push_back(*c);
  // Do two circles agree at height z, to within the tolerance?
  auto agree = [&](const FlatCircle& a, const FlatCircle& b, double z) {
    const double mm =
        options.tolerance_px * (a.mm_per_px_per_mm * (a.eye.z() - z) + b.mm_per_px_per_mm * (b.eye.z() - z));
    return (a.CenterAt(z) - b.CenterAt(z)).norm() < mm && std::abs(a.RadiusAt(z) - b.RadiusAt(z)) < mm;
  };
  struct Group {
    double z = 0;
    std::vector<std::size_t> members;
  };
  std::vector<Group> groups;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    Group best;
    for (std::size_t j = 0; j < flat.size(); ++j) {
      if (flat[i].ref.view == flat[j].ref.view) continue;
      // Least squares of centre and radius over z: both are linear in it.
      const Vector3d slope(flat[j].center_per_mm.x() - flat[i].center_per_mm.x(),
                           flat[j].center_per_mm.y() - flat[i].center_per_mm.y(),
                           flat[j].radius_per_mm - flat[i].radius_per_mm);
      const Vector2d c0 = flat[i].CenterAt(0) - flat[j].CenterAt(0);
      const Vector3d at0(c0.x(), c0.y(), flat[i].RadiusAt(0) - flat[j].RadiusAt(0));
      if (slope.squaredNorm() < kMinPlaneAngle * kMinPlaneAngle) continue;
      const double z = -at0.dot(slope) / slope.squaredNorm();
      if (z < options.min_height_mm || z > options.max_height_mm || !agree(flat[i], flat[j], z)) continue;
      Group g{z, {i}};
      std::vector<bool> seen(views.size());
      seen[std::size_t(flat[i].ref.view)] = true;
      for (std::size_t k = 0; k < flat.size(); ++k) {
        if (seen[std::size_t(flat[k].ref.view)] || !agree(flat[i], flat[k], z)) continue;
        seen[std::size_t(flat[k].ref.view)] = true;
        g.members.push_back(k);
      }
      if (g.members.size() > best.members.size()) best = std::move(g);
    }
    if (best.members.size() >= 2) groups.push_back(std::move(best));
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.members.size() > b.members.size(); });
  std::vector<WorldCircle> out;
  std::vector<bool> claimed(flat.size());
  for (const Group& g : groups) {
    if (claimed[g.members[0]]) continue;
    WorldCircle c;
    Vector2d center = Vector2d::Zero();
    for (std::size_t k : g.members) {
      if (claimed[k]) continue;
      claimed[k] = true;
      center += flat[k].CenterAt(g.z);
      c.radius_mm += flat[k].RadiusAt(g.z);
      c.arcs.push_back(flat[k].ref);
    }
    c.num_views = int(c.arcs.size());
    if (c.num_views < 2) continue;
    center /= c.num_views;
    c.radius_mm /= c.num_views;
    c.center = {center.x(), center.y(), g.z};
    out.push_back(std::move(c));
  }
  return out;
}

std::vector<WorldLine> LevelLines(const View& view, const LineIndex& index, double z_mm,
                                  double min_length_px) {
  constexpr double kMinSlope = 0.05;  // rays nearer to the horizon say nothing
  std::vector<WorldLine> out;
  for (int k = 0; k < index.num_segments(); ++k) {
    const ViewLine& l = index.lines()[std::size_t(k)];
    if (l.length_px < min_length_px) continue;
    WorldLine line;
    line.start = line.end = view.center_in_world;
    line.lines = {{0, k}};
    line.num_views = line.num_stops = 1;
    const double rise = z_mm - view.center_in_world.z();
    if (rise / l.ray_start.z() > 0 && rise / l.ray_end.z() > 0 && std::abs(l.ray_start.z()) > kMinSlope &&
        std::abs(l.ray_end.z()) > kMinSlope && l.plane_normal.head<2>().norm() > kMinPlaneTilt) {
      line.start += l.ray_start * (rise / l.ray_start.z());
      line.end += l.ray_end * (rise / l.ray_end.z());
    }
    out.push_back(std::move(line));
  }
  return out;
}

std::vector<WorldCircle> LevelCircles(const View& view, double z_mm, double tolerance_px) {
  std::vector<WorldCircle> out;
  for (std::size_t k = 0; k < view.lines->arcs.size(); ++k) {
    const auto c = Flatten(view, 0, int(k), tolerance_px);
    if (!c || z_mm >= c->eye.z()) continue;
    const Vector2d center = c->CenterAt(z_mm);
    out.push_back({{center.x(), center.y(), z_mm}, c->RadiusAt(z_mm), {c->ref}, 1});
  }
  return out;
}

}  // namespace vss
