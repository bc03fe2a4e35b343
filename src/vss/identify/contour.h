// The visible contour of solids in a picture: which pieces of which edges are seen, with occlusion by all
// parts.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/screen.h"
#include "vss/identify/view.h"

namespace vss {

// One sample point on an edge, a rim or a cylinder's limb.
struct ContourSample {
  enum class Source { kEdge, kCircle, kLimb };
  Source source = Source::kEdge;
  int index = 0;  // edge, circle or cylinder face (limb)
  double t = 0;   // edge: 0 at start, 1 at end; circle: angle in rad from axis_u; limb: 0 to 1 along the axis
  double t_step = 0;  // to the next sample of the same curve, seen or not
  int limb_side = 0;  // limb: -1 or 1
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector2d ideal = Eigen::Vector2d::Zero();          // px without distortion
  Eigen::Vector2d ideal_tangent = Eigen::Vector2d::Zero();  // unit, px, direction of the contour
  Eigen::Vector2d img = Eigen::Vector2d::Zero();            // px as taken
  double step_px = 0;       // the piece of the contour that this sample stands for, as seen
  bool visible = false;     // in the picture and hidden by nothing
  bool silhouette = false;  // one of its two faces is turned away: the background is on one side
};

// What can hide: the triangles of solids, with a bounding sphere each. Cheap to copy.
class Occluders {
 public:
  void Add(const WorldSolid& solid, int owner);
  // Projects the solids into each of `views`, which must stay where they are, once for all that asks later;
  // to be called after the last Add().
  void Prepare(std::span<const View> views);
  // All but what `owner` owns; what was prepared stays so.
  Occluders Without(int owner) const;
  bool Empty() const { return bodies_.empty(); }
  // Is the segment from `eye` to `point` (stopping `margin_mm` short of it) free?
  bool Free(const Eigen::Vector3d& eye, const Eigen::Vector3d& point, double margin_mm) const;
  // How far it is from `origin` along the unit vector `direction` to the next face turned against it (to
  // within some 6 degrees of squarely); INFINITY where there is none within `most_mm`.
  double Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double most_mm) const;
  // The triangles turned to a view's camera: as prepared, or made in `made`. Those of Left() may be among
  // them.
  const Screen& ScreenOf(const View& view, Screen& made) const;
  // The owner that Without() left out.
  int Left() const { return left_; }

 private:
  struct Body {
    Eigen::Vector3d center;
    double radius;
    int owner;
    std::vector<Triangle3d> triangles;
  };
  struct Screens {
    std::span<const View> views;
    std::vector<Screen> of_view;
  };
  std::vector<std::shared_ptr<const Body>> bodies_;
  std::shared_ptr<const Screens> screens_;
  int left_ = Screen::kNobody;
};

// For each solid all others.
std::vector<Occluders> OthersOf(std::span<const WorldSolid> solids);
// The same, each solid projected once into each of `views`, which must stay where they are.
std::vector<Occluders> OthersOf(std::span<const WorldSolid> solids, std::span<const View> views);

// How a contour is sampled.
struct ContourSampling {
  double spacing_px = 6;
  int min_samples = 3, max_samples = 100000;  // an edge
  bool img = true;                            // fill `img`; without it sampling is faster
  bool visibility = true;  // ask for occlusion; without it `visible` is set wherever a face is turned here
  // A part that hides the sample from less than this before it does not: an edge that lies on another part is
  // seen, though by a small error it may lie inside it.
  double touch_mm = 0.5;
};

// Samples of the whole contour of `solid` in `view`, whether visible or not; those outside the picture or
// facing away on both sides are left out. Hidden by: `solid` itself, and `others` if given.
std::vector<ContourSample> SampleContour(const WorldSolid& solid, const View& view,
                                         const ContourSampling& sampling, const Occluders* others = nullptr);
std::vector<ContourSample> SampleContour(const WorldSolid& solid, const View& view, double spacing_px,
                                         int min_samples, const Occluders* others = nullptr,
                                         double touch_mm = 0.5);

// For each point, whether something of `others` hides it in `view` from more than `touch_mm` before it.
std::vector<bool> HiddenBy(const View& view, const Occluders& others,
                           std::span<const Eigen::Vector3d> points_in_world, double touch_mm = 0.5);

// The views that see the object, those that show it largest first, at most `most`.
std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, int most);

// d point / d state of a sample (3 x StateSize) as a material point of its edge, rim or limb.
StateColumns SampleByState(const WorldSolid& solid, const ContourSample& sample);

}  // namespace vss
