// A scene that is to be photographed: parts of the knowledge base, light, ground, clutter, and the rig.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vss/camera/camera.h"
#include "vss/identify/placed_object.h"

namespace vss {

// How a surface looks. Albedo and gloss are shares of the light; grain and patches scale them from place to
// place.
struct Material {
  double albedo = 0.45;
  double gloss = 0.05;    // of a highlight, at its middle
  double grain = 0.05;    // relative, one standard deviation: fine texture (mill scale, concrete)
  double patches = 0.05;  // relative: how much darker the patches (rust, stains) are
};

struct ScenePart {
  std::string id;
  PlacedObject object;  // placement z: the support's height
  std::string stands_on = "ground";
  Material material;
};

// What is no part.
struct PaintedLine {
  Eigen::Vector2d from = Eigen::Vector2d::Zero(), to = Eigen::Vector2d::Zero();  // world, mm, on the ground
  double width_mm = 80, albedo = 0.6;
};
struct Cable {
  std::vector<Eigen::Vector2d> points;  // world, mm, on the ground; a smooth curve runs through them
  double diameter_mm = 16, albedo = 0.05;
};
// A piece of plate of any outline.
struct Offcut {
  std::vector<Eigen::Vector2d> outline;  // world, mm, convex, counter-clockwise
  double height_mm = 15, base_mm = 0;    // base: height of what it lies on
  Material material;
};
struct Stone {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // world, mm
  double size_mm = 40, albedo = 0.2;
};

// A ball that shines alike to all sides.
struct Lamp {
  Eigen::Vector3d position = {0, 0, 3000};  // mm; from the carriage where it hangs there, else world
  double radius_mm = 100;
  double power = 1;  // light on a surface that faces it at 3 m
  bool on_gantry = true;
};

struct SceneCamera {
  Camera camera;             // true lens; place at displacement camera.gantry_mm
  double blur_px = 0.55;     // standard deviation of the optics' point spread, pixel area not included
  double read_noise = 0.9;   // grey levels
  double shot_noise = 0.07;  // grey levels at grey 1: the noise of grey g is shot * sqrt(g)
  double vignetting = 0.12;  // loss of light at the picture's corner
};

struct ScenePicture {
  std::string name;  // file name without ending
  int camera = 0;
  std::optional<Eigen::Vector3d> gantry_mm;                 // as the survey file gives it
  RigidTransform cam_from_world;                            // as the survey file gives it
  Eigen::Vector3d carriage_mm = Eigen::Vector3d::Zero();    // where the lamps on the carriage are
  Eigen::Vector3d stop_error_mm = Eigen::Vector3d::Zero();  // world: the true camera stands this much further
};

struct SimulatedScene {
  std::string name = "simulated";
  std::uint64_t seed = 1;              // of texture and noise
  std::vector<std::string> knowledge;  // as survey.toml gives it; empty: everything shipped
  std::vector<std::pair<std::string, std::string>>
      knowledge_texts;  // files of it: name in the survey folder, text
  std::vector<ScenePart> parts;
  std::vector<PaintedLine> lines;
  std::vector<Cable> cables;
  std::vector<Offcut> offcuts;
  std::vector<Stone> stones;
  Material ground{0.15, 0, 0.08, 0.1};
  std::vector<Lamp> lamps;
  double ambient = 0.25;       // light of the sky of the hall on a surface that lies open
  bool shadows = true;         // false: nothing covers a lamp or the sky, every flat face is of one light
  double exposure_grey = 225;  // the brightest hundredth of a picture begins about here (see render.h)
  std::vector<SceneCamera> cameras;
  std::vector<ScenePicture> pictures;
};

// Height of the object's highest point in world, mm.
double TopOf(const PlacedObject& object);

}  // namespace vss
