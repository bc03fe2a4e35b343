#include "vss/identify/rim_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "vss/base/parallel.h"
#include "vss/identify/complete.h"
#include "vss/identify/explained.h"
#include "vss/identify/hypothesis_search.h"
#include "vss/identify/measured_contours.h"
#include "vss/identify/refine.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Of smaller rims no step is left, of larger ones the pictures have arcs (see contour_vote.cc).
constexpr int kLeastRadiusPx = 4, kMostRadiusPx = 19;
constexpr int kDirections = 16;
// So many of them show the step in the first picture and in another: the lens and what stands near hide some.
constexpr int kClear = 14, kConfirmed = 12;
constexpr double kHalfStepPx = 1.5;  // inside and outside of the rim the light is taken so far from it
constexpr double kApartPx = 4;       // rings nearer to each other are one
constexpr std::size_t kMostRings = 4, kViews = 4;
constexpr double kMostCells = 4e5;

struct Ring {
  Vector2d at = Vector2d::Zero();  // in the face, steps
  double radius = 0, score = 0;
};

// A level rectangle of the world, in which a picture's light is read.
struct Face {
  Vector3d origin, along, across;  // unit directions
  double step_mm = 1;
  int columns = 0, rows = 0;

  Vector3d At(const Vector2d& p) const { return origin + step_mm * (p.x() * along + p.y() * across); }
};

// The grey values of a face; NAN where the picture does not show it.
class Patch {
 public:
  Patch(const Face& face, const View& view) : columns_(face.columns), rows_(face.rows) {
    grey_.resize(std::size_t(columns_) * std::size_t(rows_), NAN);
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < columns_; ++c)
        if (const auto img = view.ProjectInside(face.At(Vector2d(c, r))))
          grey_[std::size_t(r) * std::size_t(columns_) + std::size_t(c)] = GreyAt(view.picture, *img);
  }

  // How clear a ring is: its step's mean share of the brighter side; 0 where fewer than `least` directions
  // show a clear one of the same sign.
  double Clearness(const Vector2d& at, double radius, int least) const {
    int rises = 0, falls = 0;
    double sum = 0;
    for (int k = 0; k < kDirections; ++k) {
      const double inside = At(at + (radius - kHalfStepPx) * Direction(k)),
                   outside = At(at + (radius + kHalfStepPx) * Direction(k));
      const double step = (outside - inside) / std::max({inside, outside, 1.0});
      if (!(std::abs(step) > kRingContrast)) continue;
      ++(step > 0 ? rises : falls);
      sum += step;
    }
    return std::max(rises, falls) < least ? 0 : std::abs(sum) / kDirections;
  }

  // A quick look: is the middle of another light than four places outside?
  bool MayBeRing(const Vector2d& at, double radius) const {
    const double middle = At(at);
    int rises = 0, falls = 0;
    for (int k = 0; k < kDirections; k += kDirections / 4) {
      const double outside = At(at + (radius + kHalfStepPx) * Direction(k));
      const double step = (outside - middle) / std::max({middle, outside, 1.0});
      rises += step > kRingContrast;
      falls += step < -kRingContrast;
    }
    return std::max(rises, falls) >= 3;
  }

 private:
  static const Vector2d& Direction(int k) {
    static const auto directions = [] {
      std::array<Vector2d, kDirections> out;
      for (int i = 0; i < kDirections; ++i)
        out[std::size_t(i)] =
            Vector2d(std::cos(2 * kPi * i / kDirections), std::sin(2 * kPi * i / kDirections));
      return out;
    }();
    return directions[std::size_t(k)];
  }
  // Bilinear; the picture holds the place.
  static double GreyAt(const GreyView& picture, const Vector2d& img) {
    const int u = std::clamp(int(std::floor(img.x())), 0, picture.width - 2),
              v = std::clamp(int(std::floor(img.y())), 0, picture.height - 2);
    const double a = img.x() - u, b = img.y() - v;
    return (1 - b) * ((1 - a) * picture.At(u, v) + a * picture.At(u + 1, v)) +
           b * ((1 - a) * picture.At(u, v + 1) + a * picture.At(u + 1, v + 1));
  }
  double At(const Vector2d& p) const {
    const int c = int(std::lround(p.x())), r = int(std::lround(p.y()));
    if (c < 0 || r < 0 || c >= columns_ || r >= rows_) return NAN;
    return grey_[std::size_t(r) * std::size_t(columns_) + std::size_t(c)];
  }

  int columns_, rows_;
  std::vector<double> grey_;
};

// The clearest ring within a step of `near`.
Ring Refined(const Patch& patch, const Ring& near) {
  Ring best;
  for (int dx = -1; dx <= 1; ++dx)
    for (int dy = -1; dy <= 1; ++dy)
      for (int dr = -1; dr <= 1; ++dr) {
        const Ring ring{near.at + Vector2d(dx, dy), near.radius + dr, 0};
        const double score = patch.Clearness(ring.at, ring.radius, kClear);
        if (score > best.score) best = {ring.at, ring.radius, score};
      }
  return best;
}

// On every other place and radius first: a ring shows a step off, too.
std::vector<Ring> RingsIn(const Patch& patch, const Face& face) {
  constexpr int kStride = 2;
  std::vector<Ring> found;
  for (int r = kLeastRadiusPx; r < face.rows - kLeastRadiusPx; r += kStride)
    for (int c = kLeastRadiusPx; c < face.columns - kLeastRadiusPx; c += kStride) {
      Ring best;
      for (int radius = kLeastRadiusPx; radius <= kMostRadiusPx; radius += kStride) {
        const Vector2d at(c, r);
        if (!patch.MayBeRing(at, radius)) continue;
        const double score = patch.Clearness(at, radius, kConfirmed);
        if (score > best.score) best = {at, double(radius), score};
      }
      if (best.score > 0) best = Refined(patch, best);
      if (best.score > 0) found.push_back(best);
    }
  std::stable_sort(found.begin(), found.end(),
                   [](const Ring& a, const Ring& b) { return a.score > b.score; });
  std::vector<Ring> out;
  for (const Ring& ring : found) {
    if (out.size() == kMostRings) break;
    if (std::none_of(out.begin(), out.end(),
                     [&](const Ring& o) { return (o.at - ring.at).norm() < kApartPx + o.radius; }))
      out.push_back(ring);
  }
  return out;
}

bool IsConfirmed(const Ring& ring, const Patch& patch) {
  for (int dx = -2; dx <= 2; ++dx)
    for (int dy = -2; dy <= 2; ++dy)
      for (int dr = -1; dr <= 1; ++dr)
        if (patch.Clearness(ring.at + Vector2d(dx, dy), ring.radius + dr, kConfirmed) > 0) return true;
  return false;
}

// The rings that two pictures show on the level rectangle of the solid's vertices at height `z_mm`.
std::vector<WorldCircle> FindRings(const WorldSolid& solid, double yaw_rad, double z_mm,
                                   const SceneIndex& scene) {
  Face face;
  face.along = Vector3d(std::cos(yaw_rad), std::sin(yaw_rad), 0);
  face.across = Vector3d(-face.along.y(), face.along.x(), 0);
  Eigen::AlignedBox2d extent;
  for (const auto& v : solid.vertices)
    if (std::abs(v.point.z() - z_mm) < scene.mm_per_px)
      extent.extend(Vector2d(face.along.dot(v.point), face.across.dot(v.point)));
  if (extent.isEmpty()) return {};
  face.step_mm = std::max(scene.mm_per_px, std::sqrt(extent.volume() / kMostCells));
  face.origin = extent.min().x() * face.along + extent.min().y() * face.across + z_mm * Vector3d::UnitZ();
  face.columns = int(extent.sizes().x() / face.step_mm) + 1;
  face.rows = int(extent.sizes().y() / face.step_mm) + 1;
  std::vector<WorldCircle> out;
  std::vector<Patch> patches;
  for (int v : ViewsThatSee(solid, scene, int(kViews)))
    if (scene.views[std::size_t(v)].picture.data) patches.emplace_back(face, scene.views[std::size_t(v)]);
  for (std::size_t i = 0; i < patches.size(); ++i)
    for (const Ring& ring : RingsIn(patches[i], face)) {
      const Vector3d center = face.At(ring.at);
      const bool again = std::any_of(out.begin(), out.end(), [&](const WorldCircle& o) {
        return (o.center - center).norm() < kApartPx * face.step_mm + o.radius_mm;
      });
      const bool confirmed = std::any_of(patches.begin(), patches.end(), [&](const Patch& other) {
        return &other != &patches[i] && IsConfirmed(ring, other);
      });
      if (!again && confirmed) out.push_back({center, ring.radius * face.step_mm, {}, 2});
    }
  return out;
}

// `object` as one of the kind of `extended`, where that is the same solid but for round edges.
std::optional<PlacedObject> Extended(const PlacedObject& object, const KindTemplate& extended,
                                     std::vector<bool>& fixed) {
  if (extended.rims.empty() || extended.model == object.model) return std::nullopt;
  const auto mine = object.model->dimensions(), theirs = extended.model->dimensions();
  std::vector<std::optional<double>> known(theirs.size());
  std::size_t num_known = 0;
  for (std::size_t i = 0; i < theirs.size(); ++i)
    for (std::size_t k = 0; k < mine.size(); ++k)
      if (theirs[i].name == mine[k].name) known[i] = object.dimensions_mm[k], ++num_known;
  if (num_known != mine.size() || num_known == theirs.size()) return std::nullopt;
  PlacedObject out;
  out.model = extended.model;
  out.resting_pose = extended.resting_pose;
  out.placement = object.placement;
  out.dimensions_mm = extended.model->UsualDimensions(known);
  fixed.clear();
  for (std::size_t i = 0; i < known.size(); ++i) {
    fixed.push_back(known[i].has_value());
    if (known[i]) out.dimensions_mm[i] = *known[i];
  }
  const WorldSolid a = PlaceSolid(object, false), b = PlaceSolid(out, false);
  if (a.vertices.size() != b.vertices.size()) return std::nullopt;
  constexpr double kSameMm = 0.1;
  for (const auto& v : a.vertices)
    if (std::none_of(b.vertices.begin(), b.vertices.end(),
                     [&](const WorldPoint& o) { return (o.point - v.point).norm() < kSameMm; }))
      return std::nullopt;
  return out;
}

// The hypotheses that rings on item `i` make.
std::vector<Hypothesis> WithRims(int i, const Explained& known, std::span<const int> accepted,
                                 const SceneData& data) {
  std::vector<Hypothesis> out;
  const SceneItem& item = data.items[i];
  std::optional<Explained> around;
  for (const KindTemplate& kind : data.templates) {
    std::vector<bool> fixed;
    const auto object = Extended(item.h.object, kind, fixed);
    if (!object) continue;
    const WorldSolid solid = PlaceSolid(*object, false);
    const int rim = kind.rims.front();
    const double z = solid.circles[std::size_t(rim)].center.point.z();
    for (const WorldCircle& ring : FindRings(solid, object->placement[3], z, data.index)) {
      const auto laid = LaidOnCircle(*object, fixed, {rim, ring.center, ring.radius_mm}, data.mm_per_px);
      if (!laid) continue;
      if (!around) around = ExplainedWithout(i, known, accepted, data);
      SeedContext context = data.Context();
      context.others = &around->others;
      context.claims = &around->claims;
      Hypothesis h = item.h;
      h.object = *laid;
      h.determined.assign(fixed.size(), true);
      h.views = ViewsThatSee(PlaceSolid(h.object, false), data.index, context.max_views);
      RefineAndWeigh(h, context);
      if (PlaceSolid(h.object, false).circles[std::size_t(rim)].radius_mm < kLeastRadiusPx * data.mm_per_px)
        continue;
      WeighInAllViews(h, context);
      out.push_back(std::move(h));
    }
  }
  return out;
}

}  // namespace

void AddRims(std::span<const int> items, std::span<const int> accepted, SceneData& data) {
  if (items.empty()) return;
  std::vector<std::vector<Hypothesis>> found(items.size());
  const Explained known = ExplainedBy(accepted, data);
  ParallelFor(items.size(), data.threads, [&](std::size_t k) {
    if (!data.progress.Cancelled()) found[k] = WithRims(items[k], known, accepted, data);
  });
  for (std::size_t k = 0; k < found.size(); ++k) {
    const int support = data.items[items[k]].support_item;
    for (auto& h : found[k])
      if (h.log_odds >= data.options.accept_log_odds) data.items.Keep(std::move(h), support);
  }
}

}  // namespace vss
