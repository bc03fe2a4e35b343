#include "vss/simulate/visibility.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "vss/simulate/random.h"

namespace vss {
namespace {

using Eigen::Vector3d;

constexpr int kPatterns = 256;
constexpr int kSamplesAQuarter = kSamples / 4;

std::vector<std::array<Eigen::Array2f, kSamples>> MakePatterns() {
  constexpr int kGenerator = 7;  // of the lattice of 16: its shortest vector is among the longest possible
  std::vector<std::array<Eigen::Array2f, kSamples>> patterns(kPatterns);
  Random random(1);
  for (auto& pattern : patterns)
    for (int quarter = 0; quarter < 4; ++quarter) {
      const double shift_u = random.Uniform(), shift_v = random.Uniform();
      for (int i = 0; i < kSamplesAQuarter; ++i) {
        const double u = std::fmod((i + shift_u) / kSamplesAQuarter, 1.0);
        const double v = std::fmod((i * kGenerator % kSamplesAQuarter + shift_v) / kSamplesAQuarter, 1.0);
        pattern[std::size_t(quarter * kSamplesAQuarter + i)] = {float(u / 2 - (quarter % 2 ? 0 : 0.5)),
                                                                float(v / 2 - (quarter / 2 ? 0 : 0.5))};
      }
    }
  return patterns;
}

// Side of a polygon as seen: inside where e . (x, y, 1) >= 0; e.head<2>() is unit. Swapping the ends gives
// -e to the bit.
struct Side {
  double x, y, c;
};

class Rasterizer {
 public:
  Rasterizer(const PixelRays& rays, Visibility& out) : rays_(rays), out_(out) {
    nearest_.assign(out.whole.size(), 0.0F);
  }

  void FillGround() {
    const SeenPlane& ground = out_.planes[0];
    for (int v = 0; v < rays_.height(); ++v)
      for (int u = 0; u < rays_.width(); ++u) Cover(u, v, 0, ground.inverse_depth);
  }

  void Draw(std::span<const Vector3d> corners_in_cam, int plane) {
    plane_ = plane;
    sides_.clear();
    const std::size_t n = corners_in_cam.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Vector3d e = corners_in_cam[i].cross(corners_in_cam[(i + 1) % n]);
      const double norm = std::hypot(e.x(), e.y());
      if (!(norm > 0)) return;
      sides_.push_back({-e.x() / norm, -e.y() / norm,
                        -e.z() / norm});  // seen from outside the corners run clockwise in y-down
    }
    Descend(rays_.levels() - 1, 0, 0, (1U << n) - 1);
  }

 private:
  void Descend(int level, int i, int j, unsigned open) {
    const PixelRays::Block& block = rays_.BlockAt(level, i, j);
    for (std::size_t k = 0; k < sides_.size(); ++k) {
      if (!(open >> k & 1)) continue;
      const double d = sides_[k].x * block.x + sides_[k].y * block.y + sides_[k].c;
      if (d <= -block.radius) return;
      if (d >= block.radius) open &= ~(1U << k);
    }
    if (open == 0) {
      const int u1 = std::min((i + 1) << level, rays_.width()),
                v1 = std::min((j + 1) << level, rays_.height());
      for (int v = j << level; v < v1; ++v)
        for (int u = i << level; u < u1; ++u)
          Cover(u, v, plane_, out_.planes[std::size_t(plane_)].inverse_depth);
    } else if (level == 0) {
      CoverPart(i, j, open);
    } else {
      const int across = rays_.BlocksAcross(level - 1), down = rays_.BlocksDown(level - 1);
      for (int y = 2 * j; y < std::min(2 * j + 2, down); ++y)
        for (int x = 2 * i; x < std::min(2 * i + 2, across); ++x) Descend(level - 1, x, y, open);
    }
  }

  void Cover(int u, int v, int plane, const Vector3d& inverse_depth) {
    const PixelRays::Pixel& p = rays_.At(u, v);
    const auto nearness = float(inverse_depth.x() * p.x + inverse_depth.y() * p.y + inverse_depth.z());
    const std::size_t at = std::size_t(v) * std::size_t(rays_.width()) + std::size_t(u);
    if (!(nearness > 0) || nearness < nearest_[at])
      return;  // paint has the ground's nearness and comes after it
    nearest_[at] = nearness;
    out_.whole[at] = plane;
  }

  void CoverPart(int u, int v, unsigned open) {
    const PixelRays::Pixel& p = rays_.At(u, v);
    const std::size_t at = std::size_t(v) * std::size_t(rays_.width()) + std::size_t(u);
    const auto& pattern = SamplePattern(std::uint32_t(at));
    std::array<float, kSamples> inside;
    inside.fill(1);
    for (std::size_t k = 0; k < sides_.size(); ++k) {
      if (!(open >> k & 1)) continue;
      const Side& s = sides_[k];
      const auto d0 = float(s.x * p.x + s.y * p.y + s.c);
      const auto du = float(s.x * p.xu + s.y * p.yu), dv = float(s.x * p.xv + s.y * p.yv);
      for (std::size_t i = 0; i < kSamples; ++i)
        inside[i] = std::min(inside[i], d0 + (du * pattern[i].x() + dv * pattern[i].y()));
    }
    std::uint64_t mask = 0;
    for (std::size_t i = 0; i < kSamples; ++i) mask |= std::uint64_t{inside[i] >= 0} << i;
    if (mask) out_.fragments.push_back({std::int32_t(at), plane_, mask});
  }

  const PixelRays& rays_;
  Visibility& out_;
  std::vector<float> nearest_;
  std::vector<Side> sides_;
  int plane_ = 0;
};

// The polygon's part in front of the camera.
std::vector<Vector3d> ClipNear(std::span<const Vector3d> polygon) {
  constexpr double kNearMm = 1;
  std::vector<Vector3d> out;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    if (a.z() >= kNearMm) out.push_back(a);
    if ((a.z() >= kNearMm) != (b.z() >= kNearMm))
      out.push_back(a + (b - a) * (kNearMm - a.z()) / (b.z() - a.z()));
  }
  return out;
}

void SortByPixel(Visibility& out) {
  out.first_fragment.assign(out.whole.size() + 1, 0);
  for (const Fragment& f : out.fragments) ++out.first_fragment[std::size_t(f.pixel) + 1];
  for (std::size_t i = 1; i < out.first_fragment.size(); ++i)
    out.first_fragment[i] += out.first_fragment[i - 1];
  std::vector<std::int32_t> next(out.first_fragment.begin(), out.first_fragment.end() - 1);
  std::vector<Fragment> sorted(out.fragments.size());
  for (const Fragment& f : out.fragments) sorted[std::size_t(next[std::size_t(f.pixel)]++)] = f;
  out.fragments = std::move(sorted);
}

}  // namespace

const std::array<Eigen::Array2f, kSamples>& SamplePattern(std::uint32_t pixel) {
  static const auto patterns = MakePatterns();
  return patterns[Scramble(pixel) % kPatterns];
}

Visibility FindVisible(const SceneMesh& mesh, const RigidTransform& cam_from_world, const PixelRays& rays) {
  Visibility out;
  out.whole.assign(std::size_t(rays.width()) * std::size_t(rays.height()), -1);
  for (const auto& plane : mesh.planes) {
    const Vector3d n = cam_from_world.rotation * plane.normal;
    const double d = plane.offset + n.dot(cam_from_world.translation);
    out.planes.push_back({n / d, d < 0});
  }
  Rasterizer rasterizer(rays, out);
  rasterizer.FillGround();
  for (const auto& polygon : mesh.polygons) {
    if (!out.planes[std::size_t(polygon.plane)].faces_camera) continue;
    std::array<Vector3d, 4> in_cam;
    for (std::size_t i = 0; i < polygon.Corners().size(); ++i)
      in_cam[i] = cam_from_world * polygon.corners[i];
    const std::vector<Vector3d> clipped = ClipNear({in_cam.data(), polygon.Corners().size()});
    if (clipped.size() >= 3) rasterizer.Draw(clipped, polygon.plane);
  }
  SortByPixel(out);
  return out;
}

void SharesOf(const Visibility& visible, const PixelRays& rays, int u, int v,
              std::vector<PixelShare>& shares) {
  shares.clear();
  const std::size_t at = std::size_t(v) * std::size_t(rays.width()) + std::size_t(u);
  const PixelRays::Pixel& p = rays.At(u, v);
  const auto first = std::size_t(visible.first_fragment[at]),
             last = std::size_t(visible.first_fragment[at + 1]);
  const std::int32_t whole = visible.whole[at];
  if (first == last) {
    shares.push_back({whole, {1, 1, 1, 1}, p.x, p.y});
    return;
  }
  const auto& pattern = SamplePattern(std::uint32_t(at));
  // Inverse depth at a sample: base + du * u + dv * v.
  struct Layer {
    std::int32_t plane;
    std::uint64_t mask;
    double base, du, dv;
  };
  const auto layer = [&](std::int32_t plane, std::uint64_t mask) {
    if (plane < 0) return Layer{plane, mask, 0, 0, 0};
    const Vector3d& g = visible.planes[std::size_t(plane)].inverse_depth;
    return Layer{plane, mask, g.x() * p.x + g.y() * p.y + g.z(), g.x() * p.xu + g.y() * p.yu,
                 g.x() * p.xv + g.y() * p.yv};
  };
  thread_local std::vector<Layer> layers;
  layers.clear();
  layers.push_back(layer(whole, ~std::uint64_t{0}));
  for (std::size_t i = first; i < last; ++i) {
    const Fragment& f = visible.fragments[i];
    const auto same =
        std::find_if(layers.begin(), layers.end(), [&](const Layer& l) { return l.plane == f.plane; });
    if (same == layers.end())
      layers.push_back(layer(f.plane, f.mask));
    else
      same->mask |= f.mask;
  }
  thread_local std::vector<std::array<int, 4>> counts;
  thread_local std::vector<std::array<float, 2>> sums;
  counts.assign(layers.size(), {});
  sums.assign(layers.size(), {});
  for (std::size_t i = 0; i < kSamples; ++i) {
    std::size_t best = 0;
    double nearest = -1;
    for (std::size_t k = 0; k < layers.size(); ++k) {
      if (!(layers[k].mask >> i & 1)) continue;
      const double nearness = layers[k].base + layers[k].du * pattern[i].x() + layers[k].dv * pattern[i].y();
      if (nearness >= nearest) best = k, nearest = nearness;
    }
    ++counts[best][i / kSamplesAQuarter];
    sums[best][0] += pattern[i].x();
    sums[best][1] += pattern[i].y();
  }
  for (std::size_t k = 0; k < layers.size(); ++k) {
    const int total = counts[k][0] + counts[k][1] + counts[k][2] + counts[k][3];
    if (total == 0) continue;
    PixelShare share{layers[k].plane, {}, 0, 0};
    for (std::size_t q = 0; q < 4; ++q) share.share[q] = float(counts[k][q]) / kSamplesAQuarter;
    const float mu = sums[k][0] / float(total), mv = sums[k][1] / float(total);
    share.x = p.x + p.xu * mu + p.xv * mv;
    share.y = p.y + p.yu * mu + p.yv * mv;
    shares.push_back(share);
  }
}

}  // namespace vss
