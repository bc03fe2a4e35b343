#include "vss/simulate/render.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vss/simulate/random.h"
#include "vss/simulate/shadows.h"
#include "vss/simulate/texture.h"
#include "vss/simulate/visibility.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kLampDistanceMm = 3000;  // at which a lamp has its nominal power
constexpr double kCeilingMm = 1000,
                 kCeilingRadiusMm = 1200;  // the sky of the hall: a disc over each point, 50 degrees wide
constexpr double kBounce =
    0.25;  // of the ambient light that reaches also what is covered, by way of other surfaces
constexpr double kFloorShare =
    0.6;                        // of the lamps' light that reaches the floor around a part and shines back up
constexpr double kDark = 0.02;  // beyond the ground
constexpr double kShininess = 60;  // exponent of a highlight (Blinn 1977): some 10 degrees
constexpr int kTileLevel = 3;      // shadows are looked up for tiles of 8 x 8 pixels

std::vector<PlacedLamp> PlaceLamps(const SimulatedScene& scene, const ScenePicture& picture) {
  std::vector<PlacedLamp> lamps;
  for (const Lamp& lamp : scene.lamps)
    lamps.push_back({lamp.position + (lamp.on_gantry ? picture.carriage_mm : Vector3d::Zero()),
                     lamp.radius_mm, lamp.power, false, 0});
  lamps.push_back({Vector3d::Zero(), kCeilingRadiusMm, scene.ambient, true, kCeilingMm});
  return lamps;
}

// What the floor throws back at a surface that looks down.
double FloorLight(const SimulatedScene& scene) {
  double power = scene.ambient;
  for (const Lamp& lamp : scene.lamps) power += kFloorShare * lamp.power;
  return scene.ground.albedo * power;
}

class Shader {
 public:
  Shader(const SimulatedScene& scene, const SceneMesh& mesh, const ScenePicture& picture,
         const Visibility& visible)
      : mesh_(mesh),
        visible_(visible),
        world_from_cam_(picture.cam_from_world.Inverse()),
        ambient_(scene.ambient),
        from_floor_(FloorLight(scene)),
        has_shadows_(scene.shadows),
        shadows_(mesh, PlaceLamps(scene, picture)) {
    world_from_cam_.translation += picture.stop_error_mm;
  }

  // Says which part of the picture the next calls of Light are about.
  void EnterTile(const PixelRays::Block& block) {
    block_ = block;
    near_.clear();
  }

  // Light that comes from the plane in direction (x, y) of `cam`; a pixel is `pixel` wide there.
  double Light(std::int32_t plane, float x, float y, float pixel) {
    if (plane < 0) return kDark;
    const double nearness = Nearness(plane, x, y);
    if (!(nearness > 0)) return kDark;
    const Vector3d point = World(x, y, nearness);
    const SceneMesh::Plane& p = mesh_.planes[std::size_t(plane)];
    const SceneMesh::Surface& s = mesh_.surfaces[std::size_t(p.surface)];
    const Vector3d to_eye = (world_from_cam_.translation - point).normalized();
    Vector3d normal = p.normal;
    Vector2d place(s.texture_u.dot(point), s.texture_v.dot(point));
    if (s.is_cylinder) Round(s, point, normal, place);
    const double facing =
        std::max(std::abs(p.normal.dot(to_eye)), 0.05);  // a grazed pixel is not endlessly long
    const double pixel_mm = pixel / nearness / std::sqrt(facing);
    double light = ambient_ * kBounce + from_floor_ * (1 - normal.z()) / 2, highlight = 0;
    const auto& lamps = shadows_.lamps();
    for (std::size_t i = 0; i < lamps.size(); ++i) {
      const PlacedLamp& lamp = lamps[i];
      if (lamp.overhead) {
        const double sky = (1 + normal.z()) / 2;
        double covered = 0;
        if (normal.z() > 0.5) covered = Covered(plane, int(i), point, pixel_mm);
        light += lamp.power * sky * (1 - covered);
        continue;
      }
      const Vector3d to_lamp = lamp.position - point;
      const double distance = to_lamp.norm(), cosine = normal.dot(to_lamp) / distance;
      if (cosine <= 0 || p.normal.dot(to_lamp) <= 0) continue;
      const double open = 1 - Covered(plane, int(i), point, pixel_mm);
      const double power = lamp.power * kLampDistanceMm * kLampDistanceMm / (distance * distance) * open;
      light += power * cosine;
      if (s.material.gloss > 0)
        highlight += power * std::pow(std::max(normal.dot((to_lamp / distance + to_eye).normalized()), 0.0),
                                      kShininess);
    }
    const double texture = TextureFactor(place + s.texture_shift, s.material.grain, s.material.patches);
    return texture * (s.material.albedo * light + s.material.gloss * highlight);
  }

 private:
  double Nearness(std::int32_t plane, double x, double y) const {
    const Vector3d& g = visible_.planes[std::size_t(plane)].inverse_depth;
    return g.x() * x + g.y() * y + g.z();
  }
  Vector3d World(double x, double y, double nearness) const {
    return world_from_cam_ * Vector3d(x / nearness, y / nearness, 1 / nearness);
  }

  static void Round(const SceneMesh::Surface& s, const Vector3d& point, Vector3d& normal, Vector2d& place) {
    const Vector3d d = point - s.axis_point;
    const double along = s.axis_direction.dot(d);
    const Vector3d radial = d - along * s.axis_direction;
    const double radius = radial.norm();
    normal = s.outward * radial / radius;
    const Vector3d seed = std::abs(s.axis_direction.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
    const Vector3d e = s.axis_direction.cross(seed).normalized(), f = s.axis_direction.cross(e);
    place = {radius * std::atan2(radial.dot(f), radial.dot(e)), along};
  }

  double Covered(std::int32_t seen_plane, int lamp, const Vector3d& point, double pixel_mm) {
    if (!has_shadows_) return 0;
    const int plane = mesh_.planes[std::size_t(seen_plane)].shadow_plane;
    auto found = std::find_if(near_.begin(), near_.end(),
                              [&](const auto& n) { return n.plane == plane && n.lamp == lamp; });
    if (found == near_.end()) {
      near_.push_back({plane, lamp, {}});
      found = near_.end() - 1;
      const auto [middle, radius_mm] = TileOn(plane);
      shadows_.Near(plane, lamp, middle, radius_mm, found->bodies);
    }
    return found->bodies.empty() ? 0 : shadows_.Covered(plane, lamp, point, pixel_mm, found->bodies);
  }

  // A circle around what the tile shows of the plane.
  std::pair<Vector3d, double> TileOn(std::int32_t plane) const {
    const double nearness = Nearness(plane, block_.x, block_.y);
    const Vector3d middle = nearness > 0 ? World(block_.x, block_.y, nearness) : Vector3d::Zero();
    double radius_mm = nearness > 0 ? 0 : std::numeric_limits<double>::infinity();
    for (const auto& [dx, dy] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      const double x = block_.x + dx * block_.radius, y = block_.y + dy * block_.radius,
                   n = Nearness(plane, x, y);
      radius_mm = n > 0 ? std::max(radius_mm, (World(x, y, n) - middle).norm())
                        : std::numeric_limits<double>::infinity();
      if (!(n > 0)) break;
    }
    return {middle, radius_mm};
  }

  struct NearBodies {
    std::int32_t plane;
    int lamp;
    std::vector<int> bodies;
  };
  const SceneMesh& mesh_;
  const Visibility& visible_;
  RigidTransform world_from_cam_;
  double ambient_, from_floor_;
  bool has_shadows_;
  Shadows shadows_;
  PixelRays::Block block_{};
  std::vector<NearBodies> near_;
};

// Light of the pixels' quarters, two a pixel and row.
struct QuarterImage {
  int width = 0, height = 0;
  std::vector<float> light;
};

QuarterImage GatherLight(const SimulatedScene& scene, const SceneMesh& mesh, const ScenePicture& picture,
                         const Visibility& visible, const PixelRays& rays,
                         std::vector<std::int32_t>& seen_px) {
  QuarterImage out{2 * rays.width(), 2 * rays.height(), {}};
  out.light.resize(std::size_t(out.width) * std::size_t(out.height));
  std::vector<double> seen(scene.parts.size());
  Shader shader(scene, mesh, picture, visible);
  std::vector<PixelShare> shares;
  for (int j = 0; j < rays.BlocksDown(kTileLevel); ++j)
    for (int i = 0; i < rays.BlocksAcross(kTileLevel); ++i) {
      shader.EnterTile(rays.BlockAt(kTileLevel, i, j));
      for (int v = j << kTileLevel; v < std::min((j + 1) << kTileLevel, rays.height()); ++v)
        for (int u = i << kTileLevel; u < std::min((i + 1) << kTileLevel, rays.width()); ++u) {
          SharesOf(visible, rays, u, v, shares);
          const PixelRays::Pixel& p = rays.At(u, v);
          const float pixel = std::sqrt(std::abs(p.xu * p.yv - p.xv * p.yu));
          std::array<float, 4> quarters{};
          for (const PixelShare& share : shares) {
            const auto light = float(shader.Light(share.plane, share.x, share.y, pixel));
            float sum = 0;
            for (std::size_t q = 0; q < 4; ++q) quarters[q] += light * share.share[q], sum += share.share[q];
            if (share.plane < 0) continue;
            const int part = mesh.surfaces[std::size_t(mesh.planes[std::size_t(share.plane)].surface)].part;
            if (part >= 0) seen[std::size_t(part)] += sum / 4;
          }
          for (std::size_t q = 0; q < 4; ++q)
            out.light[(2 * std::size_t(v) + q / 2) * std::size_t(out.width) + 2 * std::size_t(u) + q % 2] =
                quarters[q];
        }
    }
  for (const double s : seen) seen_px.push_back(static_cast<std::int32_t>(std::lround(s)));
  return out;
}

// Weights of the quarters at ..., -0.75, -0.25, 0.25, 0.75, ... px from a pixel's centre: the integral over
// each of the pixel's area blurred by the optics.
std::vector<float> QuarterWeights(double blur_px) {
  constexpr double kQuarterVariance = 1.0 / 48;  // that the quarters' own width adds
  const double sigma = std::sqrt(std::max(blur_px * blur_px - kQuarterVariance, 0.01));
  const auto integral_of_normal = [&](double x) {  // of its distribution function
    return x * 0.5 * std::erfc(-x / sigma / std::sqrt(2.0)) +
           sigma / std::sqrt(2 * kPi) * std::exp(-x * x / (2 * sigma * sigma));
  };
  const auto integral = [&](double x) { return integral_of_normal(x + 0.5) - integral_of_normal(x - 0.5); };
  const int reach = std::min(PixelRays::kMargin * 2, static_cast<int>(std::ceil(2 * (0.5 + 4 * sigma))));
  std::vector<float> weights;
  double sum = 0;
  for (int k = -reach; k < reach; ++k) {
    weights.push_back(float(integral((k + 1) * 0.5) - integral(k * 0.5)));
    sum += weights.back();
  }
  for (float& w : weights) w = float(w / sum);
  return weights;
}

// The picture without the margin, light as the sensor's pixels gather it.
std::vector<float> Blur(const QuarterImage& in, double blur_px, int width, int height) {
  const std::vector<float> weights = QuarterWeights(blur_px);
  const int reach = static_cast<int>(weights.size()) / 2;
  std::vector<float> rows(std::size_t(width) * std::size_t(in.height)),
      out(std::size_t(width) * std::size_t(height));
  for (int y = 0; y < in.height; ++y)
    for (int u = 0; u < width; ++u) {
      const float* from = &in.light[std::size_t(y) * std::size_t(in.width) +
                                    std::size_t(2 * (u + PixelRays::kMargin) + 1 - reach)];
      float sum = 0;
      for (std::size_t k = 0; k < weights.size(); ++k) sum += weights[k] * from[k];
      rows[std::size_t(y) * std::size_t(width) + std::size_t(u)] = sum;
    }
  for (int v = 0; v < height; ++v) {
    float* to = &out[std::size_t(v) * std::size_t(width)];
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const float* from =
          &rows[std::size_t(2 * (v + PixelRays::kMargin) + 1 - reach + int(k)) * std::size_t(width)];
      for (int u = 0; u < width; ++u) to[u] += weights[k] * from[u];
    }
  }
  return out;
}

// The lens takes light away towards the corners.
void Vignette(std::vector<float>& light, int width, int height, double loss) {
  const double cx = (width - 1) / 2.0, cy = (height - 1) / 2.0, corner2 = cx * cx + cy * cy;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      light[std::size_t(v) * std::size_t(width) + std::size_t(u)] *=
          float(1 - loss * ((u - cx) * (u - cx) + (v - cy) * (v - cy)) / corner2);
}

GreyImage Expose(const std::vector<float>& light, int width, int height, const SceneCamera& camera,
                 double target_grey, std::uint64_t seed) {
  constexpr double kExposedShare = 0.993;
  std::vector<float> sorted = light;
  const auto place = sorted.begin() + std::ptrdiff_t(kExposedShare * double(sorted.size() - 1));
  std::nth_element(sorted.begin(), place, sorted.end());
  const double gain = target_grey / std::max(double(*place), 1e-6);
  GreyImage image(width, height, 8);
  Random random(seed);
  for (int v = 0; v < height; ++v) {
    std::uint8_t* row = image.Row8(v);
    for (int u = 0; u < width; ++u) {
      const double grey = gain * light[std::size_t(v) * std::size_t(width) + std::size_t(u)];
      const double variance =
          camera.read_noise * camera.read_noise + camera.shot_noise * camera.shot_noise * grey;
      const double noisy = variance > 0 ? grey + std::sqrt(variance) * random.Normal() : grey;
      row[u] = static_cast<std::uint8_t>(std::clamp(std::lround(noisy), 0L, 255L));
    }
  }
  return image;
}

}  // namespace

RenderedPicture RenderPicture(const SimulatedScene& scene, const SceneMesh& mesh, int picture,
                              const PixelRays& rays) {
  const ScenePicture& p = scene.pictures[std::size_t(picture)];
  const SceneCamera& camera = scene.cameras[std::size_t(p.camera)];
  RigidTransform true_cam_from_world = p.cam_from_world;
  true_cam_from_world.translation -= true_cam_from_world.rotation * p.stop_error_mm;
  const Visibility visible = FindVisible(mesh, true_cam_from_world, rays);
  RenderedPicture out;
  const QuarterImage quarters = GatherLight(scene, mesh, p, visible, rays, out.seen_px);
  const int width = camera.camera.width_px, height = camera.camera.height_px;
  std::vector<float> light = Blur(quarters, camera.blur_px, width, height);
  Vignette(light, width, height, camera.vignetting);
  out.image = Expose(light, width, height, camera, scene.exposure_grey,
                     Scramble(scene.seed) + std::uint64_t(picture));
  return out;
}

}  // namespace vss
