#include "vss/simulate/random_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "vss/simulate/random.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kStopX_mm = 2000, kStopY_mm = 1800, kFirstY_mm = 600;

// Looks from `eye` at `target` (world, mm), level, then turned by `roll_rad` about its axis.
RigidTransform LookingAt(const Vector3d& eye, const Vector3d& target, double roll_rad) {
  const Vector3d forward = (target - eye).normalized();
  const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized(), down = forward.cross(right);
  RigidTransform place;
  place.rotation.row(0) = (std::cos(roll_rad) * right + std::sin(roll_rad) * down).transpose();
  place.rotation.row(1) = (std::cos(roll_rad) * down - std::sin(roll_rad) * right).transpose();
  place.rotation.row(2) = forward.transpose();
  place.translation = -(place.rotation * eye);
  return place;
}

class RigDrawer {
 public:
  RigDrawer(std::uint64_t seed, const RandomRigOptions& options, SimulatedScene& scene)
      : options_(options),
        random_(seed ^ 0x5157ULL),  // its own stream: the same rig whatever stands on the floor
        strong_lens_(random_.Chance(0.3)),
        floor_(Floor(options.stops)),
        scene_(scene) {}

  void Run() {
    switch (options_.rig) {
      case Rig::kCarriage:
        return Carriage();
      case Rig::kCrane:
        return Crane();
      case Rig::kFixed:
        return Fixed();
      case Rig::kHandHeld:
        return HandHeld();
    }
  }

 private:
  // A camera whose focal length is `focal` times its longer side; the shorter is `aspect` of that.
  SceneCamera Camera(int usual_size_px, double aspect, double least_focal, double most_focal) {
    const int size_px = options_.size_px.value_or(usual_size_px);
    const double scale = size_px / 512.0;
    SceneCamera c;
    c.camera.id = fmt::format("cam{}", scene_.cameras.size() + 1);
    c.camera.width_px = size_px;
    c.camera.height_px = int(std::lround(aspect * size_px));
    Intrinsics& lens = c.camera.intrinsics;
    lens.model = LensModel::kOpenCv;
    lens.fx_px = size_px * random_.Uniform(least_focal, most_focal);
    lens.fy_px = random_.Chance(0.5) ? lens.fx_px : lens.fx_px * random_.Uniform(0.98, 1.02);
    lens.cx_px = (c.camera.width_px - 1) / 2.0 + scale * random_.Uniform(-6, 6);
    lens.cy_px = (c.camera.height_px - 1) / 2.0 + scale * random_.Uniform(-6, 6);
    lens.distortion = {strong_lens_ ? random_.Uniform(-0.17, -0.13) : random_.Uniform(-0.07, -0.045),
                       random_.Uniform(0.003, 0.015), random_.Uniform(-8e-4, 8e-4),
                       random_.Uniform(-8e-4, 8e-4), 0};
    lens.num_distortion = 5;
    return c;
  }

  void Sensor(SceneCamera& c) {
    c.blur_px = random_.Uniform(0.45, 0.65);
    c.read_noise = random_.Uniform(0.7, 1.1);
    c.shot_noise = random_.Uniform(0.05, 0.09);
    c.vignetting = random_.Uniform(0.05, 0.25);
  }

  void Carriage() {
    for (int k = 0; k < 4; ++k) {
      SceneCamera c = Camera(512, 1, 500 / 512.0, 540 / 512.0);
      // It hangs towards one side of the carriage and looks inwards and down; the picture's top may be on any
      // side.
      const double side = kPi * (k / 2 * 0.5 + k % 2), out = random_.Uniform(850, 1020),
                   height = random_.Uniform(2950, 3080);
      const double tilt = RadFromDeg(random_.Uniform(18.5, 24.5)),
                   swing = side + RadFromDeg(random_.Uniform(-2.5, 2.5));
      const double roll = kPi / 2 * random_.Integer(0, 3) + RadFromDeg(random_.Uniform(-4, 4));
      c.camera.cam_from_world = CarriageCamera(swing, out, height, tilt, roll);
      Sensor(c);
      scene_.cameras.push_back(std::move(c));
    }
    AddStops(StopsAlong(0, kStopX_mm, options_.stops.x()),
             StopsAlong(kFirstY_mm, kStopY_mm, options_.stops.y()), 0, scene_);
    const int lamps = random_.Integer(2, 4);
    for (int k = 0; k < lamps; ++k) {
      const double angle = 2 * kPi * (k + random_.Uniform(-0.2, 0.2)) / lamps + 0.5,
                   out = random_.Uniform(700, 1500);
      scene_.lamps.push_back({{out * std::cos(angle), out * std::sin(angle), random_.Uniform(2500, 3300)},
                              random_.Uniform(50, 250),
                              random_.Uniform(0.6, 1.2) / lamps * 2,
                              true});
    }
    scene_.ambient = random_.Uniform(0.12, 0.4);
  }

  static std::vector<double> StopsAlong(double first, double step, int count) {
    std::vector<double> stops;
    for (int i = 0; i < count; ++i) stops.push_back(first + step * i);
    return stops;
  }

  void Crane() {
    constexpr int kCameras = 3;
    for (int k = 0; k < kCameras; ++k) {
      SceneCamera c = Camera(1024, 0.8, 0.9, 1.1);
      const double side = 2 * kPi * (k + random_.Uniform(-0.1, 0.1)) / kCameras,
                   roll = kPi / 2 * random_.Integer(0, 3) + RadFromDeg(random_.Uniform(-4, 4));
      c.camera.cam_from_world = CarriageCamera(side, random_.Uniform(1200, 2200), random_.Uniform(5500, 6500),
                                               RadFromDeg(random_.Uniform(12, 26)), roll);
      Sensor(c);
      scene_.cameras.push_back(std::move(c));
    }
    const Vector2d from = floor_.min(), size = floor_.sizes();
    const int along = std::max(2, int(std::lround(size.x() / 1600)));
    AddStops(StopsAlong(from.x() + size.x() * 0.5 / along, size.x() / along, along),
             StopsAlong(from.y() + size.y() * 0.25, size.y() * 0.5, 2), 0, scene_);
    AddWallLamps();
  }

  void Fixed() {
    constexpr int kCameras = 8;
    const Vector2d middle = floor_.center(), half = floor_.sizes() / 2;
    for (int k = 0; k < kCameras; ++k) {
      SceneCamera c = Camera(1600, 0.75, 0.65, 0.8);
      // Four along each of the long sides, each looking across the floor.
      const double along = ((k / 2 + 0.5) / (kCameras / 2) * 2 - 1) * half.x(), side = k % 2 ? 1 : -1;
      const Vector3d eye(middle.x() + along + random_.Uniform(-300, 300),
                         middle.y() + side * (half.y() + random_.Uniform(300, 1200)),
                         random_.Uniform(3500, 5000));
      const Vector3d target(middle.x() + 0.8 * along + random_.Uniform(-300, 300),
                            middle.y() + random_.Uniform(-300, 300), 0);
      c.camera.cam_from_world = LookingAt(eye, target, RadFromDeg(random_.Uniform(-4, 4)));
      Sensor(c);
      scene_.cameras.push_back(std::move(c));
      AddPicture(k, *scene_.cameras.back().camera.cam_from_world);
    }
    AddWallLamps();
  }

  // Around the floor and along its middle, at every step a look to the left and one to the right.
  void HandHeld() {
    constexpr double kStepMm = 900;
    SceneCamera c = Camera(1280, 0.75, 0.75, 0.9);
    Sensor(c);
    scene_.cameras.push_back(std::move(c));
    const Vector2d middle = floor_.center(), half = floor_.sizes() / 2;
    const int along = std::max(2, int(std::lround(2 * half.x() / kStepMm)));
    for (int row = -1; row <= 1; ++row)
      for (int i = 0; i < along; ++i) {
        const double x = middle.x() + ((i + 0.5) / along * 2 - 1) * half.x();
        const Vector3d eye(x + random_.Uniform(-200, 200),
                           middle.y() + row * (half.y() + 200) + random_.Uniform(-200, 200),
                           random_.Uniform(1500, 2100));
        for (const double ahead : {-700., 700.}) {
          const double toward = row == 0 ? (ahead < 0 ? -1 : 1) : -row;
          const Vector3d target(x + ahead + random_.Uniform(-200, 200),
                                eye.y() + toward * random_.Uniform(700, 1500), 0);
          AddPicture(0, LookingAt(eye, target, RadFromDeg(random_.Uniform(-10, 10))));
        }
      }
    AddWallLamps();
  }

  void AddPicture(int camera, const RigidTransform& cam_from_world) {
    ScenePicture p;
    p.name = fmt::format("picture{:03}", scene_.pictures.size() + 1);
    p.camera = camera;
    p.cam_from_world = cam_from_world;
    scene_.pictures.push_back(std::move(p));
  }

  // Lamps that stay where they are: a survey's shadows do not move.
  void AddWallLamps() {
    constexpr double kUsualMm = 3000;  // what a lamp's power is said at
    const Vector2d middle = floor_.center();
    const int lamps = random_.Integer(3, 5);
    for (int k = 0; k < lamps; ++k) {
      const double angle = 2 * kPi * (k + random_.Uniform(-0.3, 0.3)) / lamps;
      const Vector2d at = middle + Vector2d(std::cos(angle), std::sin(angle))
                                       .cwiseProduct(floor_.sizes() / 2 * random_.Uniform(0.5, 1.3));
      const double height = random_.Uniform(4500, 7000);
      scene_.lamps.push_back({{at.x(), at.y(), height},
                              random_.Uniform(100, 500),
                              random_.Uniform(0.6, 1.2) / lamps * 2 * std::pow(height / kUsualMm, 2),
                              false});
    }
    scene_.ambient = random_.Uniform(0.2, 0.5);
  }

  const RandomRigOptions& options_;
  Random random_;
  bool strong_lens_;
  Eigen::AlignedBox2d floor_;
  SimulatedScene& scene_;
};

}  // namespace

Result<Rig> RigNamed(const std::string& name) {
  if (name == "carriage") return Rig::kCarriage;
  if (name == "crane") return Rig::kCrane;
  if (name == "fixed") return Rig::kFixed;
  if (name == "hand-held") return Rig::kHandHeld;
  return UsageError("there is no rig \"{}\"; take carriage, crane, fixed or hand-held", name);
}

Eigen::AlignedBox2d Floor(const Eigen::Vector2i& stops) {
  constexpr double kMarginX_mm = 200, kMarginY_mm = 800, kOneStopX_mm = 900;
  const Vector2d margin(stops.x() == 1 ? kOneStopX_mm : kMarginX_mm, kMarginY_mm), first(0, kFirstY_mm);
  const Vector2d last = first + Vector2d(kStopX_mm * (stops.x() - 1), kStopY_mm * (stops.y() - 1));
  return {first - margin, last + margin};
}

void AddRandomRig(std::uint64_t seed, const RandomRigOptions& options, SimulatedScene& scene) {
  RigDrawer(seed, options, scene).Run();
}

RigidTransform CarriageCamera(double side_rad, double out_mm, double height_mm, double tilt_rad,
                              double roll_rad) {
  const Vector3d outwards(std::cos(side_rad), std::sin(side_rad), 0);
  const Vector3d forward = -std::sin(tilt_rad) * outwards - std::cos(tilt_rad) * Vector3d::UnitZ();
  const Vector3d level = Vector3d::UnitZ().cross(outwards), down = forward.cross(level);
  RigidTransform place;
  place.rotation.row(0) = (std::cos(roll_rad) * level + std::sin(roll_rad) * down).transpose();
  place.rotation.row(1) = (std::cos(roll_rad) * down - std::sin(roll_rad) * level).transpose();
  place.rotation.row(2) = forward.transpose();
  place.translation = -(place.rotation * (out_mm * outwards + height_mm * Vector3d::UnitZ()));
  return place;
}

void AddStops(const std::vector<double>& stops_x, const std::vector<double>& stops_y, double stop_error_mm,
              SimulatedScene& scene) {
  Random random(scene.seed + 77);
  for (const double x : stops_x)
    for (const double y : stops_y) {
      const Vector3d g(x, y, 0);
      Vector3d error;
      for (double& e : error) e = stop_error_mm * random.Normal();
      for (std::size_t k = 0; k < scene.cameras.size(); ++k) {
        ScenePicture p;
        p.name = fmt::format("x{:05}_y{:05}_{}", std::lround(x), std::lround(y), scene.cameras[k].camera.id);
        p.camera = static_cast<int>(k);
        p.gantry_mm = p.carriage_mm = g;
        p.cam_from_world = Gantry{}.CamFromWorld(scene.cameras[k].camera, g);
        p.stop_error_mm = error;
        scene.pictures.push_back(std::move(p));
      }
    }
}

}  // namespace vss
