// Which plane of a scene each pixel of a picture sees, edges resolved within the pixel.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "vss/simulate/mesh.h"
#include "vss/simulate/pixel_rays.h"

namespace vss {

// A plane as a camera sees it: inverse depth (1/mm) of direction (x, y) is g . (x, y, 1).
struct SeenPlane {
  Eigen::Vector3d inverse_depth = Eigen::Vector3d::Zero();
  bool faces_camera = false;
};

inline constexpr int kSamples = 64;  // a pixel: 16 in each quarter, see SamplePattern

// A piece of a plane that covers a pixel in part: bit i stands for sample i.
struct Fragment {
  std::int32_t pixel = 0, plane = 0;
  std::uint64_t mask = 0;
};

struct Visibility {
  std::vector<SeenPlane> planes;  // as SceneMesh::planes
  std::vector<std::int32_t>
      whole;  // the nearest plane that covers the whole pixel; -1: none (above the horizon)
  std::vector<Fragment> fragments;           // by pixel, in the order of the polygons
  std::vector<std::int32_t> first_fragment;  // of each pixel, one more at the end
};

// Offsets (px) from the pixel's centre of its samples, quarter by quarter (u-, u+ of v-, then of v+): a
// lattice whose projection on either axis has 16 different places a quarter, shifted from pixel to pixel so
// that an edge along a row is not rounded alike in all of its pixels.
const std::array<Eigen::Array2f, kSamples>& SamplePattern(std::uint32_t pixel);

Visibility FindVisible(const SceneMesh& mesh, const RigidTransform& cam_from_world, const PixelRays& rays);

// What a pixel shows: each plane's share of every quarter, and the middle of what is seen of it.
struct PixelShare {
  std::int32_t plane = -1;
  std::array<float, 4> share{};  // of quarter 0..3; sums to 1 over the pixel's planes
  float x = 0, y = 0;            // mean direction
};
void SharesOf(const Visibility& visible, const PixelRays& rays, int u, int v,
              std::vector<PixelShare>& shares);

}  // namespace vss
