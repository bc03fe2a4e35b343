// All pictures prepared for look-ups: which line may be a contour's image, and how likely one lies there by
// chance.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <vector>

#include "vss/identify/box_grid.h"
#include "vss/identify/contour.h"
#include "vss/identify/line_index.h"
#include "vss/identify/world_line.h"

namespace vss {

// Standard deviation of a contour's distance from its line, with a fair calibration, as a share of the
// tolerance.
inline constexpr double kSigmaShare = 0.35;

// Paint, tape and spatter on the floor, cables and hoses do not become smaller with finer pixels: where parts
// are told from them by how high or thick they are in pixels, pixels are taken to be no finer than this, mm.
inline constexpr double kFinestClutterPixelMm = 3;
inline double ClutterPixelMm(double mm_per_px) { return std::max(mm_per_px, kFinestClutterPixelMm); }

struct SceneIndex {
  std::span<const View> views;
  std::vector<LineIndex> lines;
  std::vector<std::vector<double>>
      density;  // per view and direction bin: chance that some line lies within 1 px of a point, per px
  std::vector<double>
      typical_step;  // per view: of the grey values where nothing is predicted (TypicalResponse)
  // The views that may show some of what lies in the box (world, mm), ascending.
  std::vector<int> ViewsNear(const Eigen::AlignedBox3d& box) const;
  BoxGrid footprints;  // of each view: where it may show what lies between kLowestMm and kHighestMm
  static constexpr double kLowestMm = -500, kHighestMm = 3000;

  double tolerance_px = 1.5;
  double sigma_px = 0.5;  // standard deviation of a line's distance from the contour that it shows
  double mm_per_px = 1;   // typical size of a pixel in the scene

  // Lines that are known to be one edge of the world speak only for contours at that place. By view and line:
  // index into `world_lines`, -1, or kShadow: an edge of a shadow, which speaks for nothing.
  static constexpr int kShadow = -2;
  std::vector<std::vector<int>> world_of_line;
  std::vector<WorldLine> world_lines;
  struct Axis {  // what Match() asks of a world line, close together in memory
    Eigen::Vector3d start, unit;
    Eigen::Matrix3d px2_per_mm2;
  };
  std::vector<Axis> axes;  // of `world_lines`
  void SetWorldLines(std::span<const WorldLine> lines);
  // The nearest line that may be the contour sample's image.
  LineHit Match(int view, const ContourSample& sample, double reach_px, double min_cosine) const;

  static constexpr int kDirectionBins = 18;
  double ChanceHit(int view, const Eigen::Vector2d& tangent) const;
};
// As of all the scene's views, see contour.h.
std::vector<int> ViewsThatSee(const WorldSolid& solid, const SceneIndex& scene, int most);
SceneIndex MakeSceneIndex(std::span<const View> views, double tolerance_px, int threads);
// An edge that is seen from one place of the carriage only, though from others one looks at it too: the edge
// of a shadow or a reflection, which moves with the carriage's lamps.
bool MovesWithLamps(const WorldLine& line, std::span<const View> views);
// Median over the pictures of a pixel's size where the optical axis meets the ground.
double TypicalMmPerPx(std::span<const View> views);

// Which lines accepted parts have explained already: claimed[view][line].
using Claims = std::vector<std::vector<bool>>;

}  // namespace vss
