#include "vss/identify/edge_fitter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Direction = WorldLine::Direction;

// A line and the projected edge that it shows differ by no more (cosine of 5 degrees).
constexpr double kMinCosine = 0.996;
// Pieces of one edge may be this far apart, relative to what is already known of it.
constexpr double kMaxGapShare = 0.3;
constexpr double kMinGapMm = 60;

// The part of the world, between the least and the largest height, that a picture may show.
Eigen::AlignedBox3d RoomOf(const View& view, const WorldLineOptions& options) {
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
      for (const double z : {options.min_height_mm, options.max_height_mm}) {
        // Up to where the ray meets the height, if it does so before the horizon.
        const double rise = z - view.center_in_world.z();
        const double t = rise * ray.z() > 0 ? rise / ray.z() : rise == 0 ? 0 : kFarMm;
        const double limited = rise * ray.z() > 0 || z == options.min_height_mm ? std::min(t, kFarMm) : 0;
        room.extend(Vector3d(view.center_in_world + limited * ray));
      }
    }
  return room;
}

// The part of start-end that a picture may show, in `ideal` px: straight lines stay straight there.
std::optional<std::pair<Vector2d, Vector2d>> Clipped(const View& view, const Vector3d& start,
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
    const double lo = view.maybe_inside.min()[axis] - p[axis], hi = view.maybe_inside.max()[axis] - p[axis];
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

}  // namespace

double ClosestOnLine(const Vector3d& start, const Vector3d& d, const Vector3d& center, const Vector3d& ray) {
  const Vector3d w = start - center;
  const double b = d.dot(ray), denominator = 1 - b * b;
  if (denominator < 1e-12) return 0;
  return (b * ray.dot(w) - d.dot(w)) / denominator;
}

EdgeFitter::EdgeFitter(std::span<const View> views, std::span<const LineIndex> indices,
                       const WorldLineOptions& options)
    : views_(views), indices_(indices), options_(options) {
  for (const auto& v : views) rooms_.push_back(RoomOf(v, options));
  together_.resize(views.size());
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t k = 0; k < views.size(); ++k)
      if (k != i && rooms_[i].intersects(rooms_[k])) together_[i].push_back(int(k));
}

void EdgeFitter::Grow(EdgeCandidate& c) const {
  constexpr int kMaxRounds = 8;
  for (int round = 0; round < kMaxRounds; ++round) {
    if (!GrowOnce(c)) break;
    Refine(c);
  }
}

// Whether lines were added.
bool EdgeFitter::GrowOnce(EdgeCandidate& c) const {
  bool grown = false;
  const Vector3d d = (c.end - c.start).normalized();
  const double length = (c.end - c.start).norm();
  const double gap = std::max(kMinGapMm, kMaxGapShare * length);
  std::vector<LineRef> found;
  Eigen::AlignedBox3d room(Vector3d(c.start - gap * d));
  room.extend(Vector3d(c.end + gap * d));
  for (std::size_t k = 0; k < views_.size(); ++k)
    if (rooms_[k].intersects(room)) Collinear(int(k), c.start - gap * d, c.end + gap * d, found);
  for (const LineRef& r : found) {
    const auto span = Extent(r, c.start, d);
    if (!span || span->first > length + gap || span->second < -gap) continue;
    if (std::find(c.support.begin(), c.support.end(), r) != c.support.end()) continue;
    c.support.push_back(r);
    grown = true;
  }
  return grown;
}

void EdgeFitter::Refine(EdgeCandidate& c) const {
  constexpr int kIterations = 3;
  for (int iteration = 0; iteration < kIterations; ++iteration)
    if (!Step(c)) return;
  SetExtent(c);
}

// One iteration of Refine(); false where it leads nowhere.
bool EdgeFitter::Step(EdgeCandidate& c) const {
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
  if (!x.allFinite() || x.norm() > length + 1000) return false;
  c.start += x[0] * e1 + x[1] * e2;
  c.end += x[2] * e1 + x[3] * e2;
  return true;
}

void EdgeFitter::Count(EdgeCandidate& c) const {
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

Eigen::Matrix3d EdgeFitter::Sensitivity(const EdgeCandidate& c) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const auto& r : c.support) {
    const View& view = views_[std::size_t(r.view)];
    const double px_per_mm =
        view.camera->intrinsics.fx_px / std::max(1.0, ((c.start + c.end) / 2 - view.center_in_world).norm());
    sum += px_per_mm * px_per_mm * LineOf(r).plane_normal * LineOf(r).plane_normal.transpose();
  }
  return sum / double(c.support.size());
}

double EdgeFitter::Rms(const EdgeCandidate& c) const {
  double sum = 0;
  for (const auto& r : c.support) sum += std::pow(DistancePx(r, c.start, c.end), 2);
  return std::sqrt(sum / double(c.support.size()));
}

std::optional<std::pair<double, double>> EdgeFitter::Extent(const LineRef& r, const Vector3d& start,
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
void EdgeFitter::SetExtent(EdgeCandidate& c) const {
  const Vector3d d = (c.end - c.start).normalized();
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
double EdgeFitter::DistancePx(const LineRef& r, const Vector3d& start, const Vector3d& end) const {
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

void EdgeFitter::Collinear(int k, const Vector3d& start, const Vector3d& end,
                           std::vector<LineRef>& out) const {
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
    const int line = index.Nearest(shown->first + s * step, along, options_.tolerance_px, kMinCosine).line;
    if (line < 0 || line >= index.num_segments()) continue;
    const LineRef found{k, line};
    if (std::find(out.begin() + std::ptrdiff_t(first), out.end(), found) == out.end()) out.push_back(found);
  }
  out.erase(
      std::remove_if(out.begin() + std::ptrdiff_t(first), out.end(),
                     [&](const LineRef& r) { return DistancePx(r, start, end) >= options_.tolerance_px; }),
      out.end());
}

}  // namespace vss
