// A straight edge of the world fitted to the lines of the pictures that show it.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "vss/identify/line_index.h"
#include "vss/identify/view.h"
#include "vss/identify/world_line.h"

namespace vss {

// A plane that is itself nearly horizontal holds horizontal lines of every direction (sine of its tilt).
inline constexpr double kMinPlaneTilt = 0.1;

// An edge of the world and the lines that may show it.
struct EdgeCandidate {
  WorldLine::Direction kind = WorldLine::Direction::kHorizontal;
  Eigen::Vector3d start, end;    // world, mm
  std::vector<LineRef> support;  // the base line first
  int num_views = 0, num_stops = 0;
  double support_px = 0;
};

// Parameter t (mm) of the point start + t d, d a unit vector, that is closest to the ray from `center`.
double ClosestOnLine(const Eigen::Vector3d& start, const Eigen::Vector3d& d, const Eigen::Vector3d& center,
                     const Eigen::Vector3d& ray);

class EdgeFitter {
 public:
  // All must outlive it.
  EdgeFitter(std::span<const View> views, std::span<const LineIndex> indices,
             const WorldLineOptions& options);

  const View& ViewOf(int view) const { return views_[std::size_t(view)]; }
  std::span<const ViewLine> LinesOf(int view) const { return indices_[std::size_t(view)].lines(); }
  const ViewLine& LineOf(const LineRef& r) const {
    return indices_[std::size_t(r.view)].lines()[std::size_t(r.line)];
  }
  const WorldLineOptions& options() const { return options_; }
  // The other views that may show some of what `view` may show, between the least and the largest height.
  std::span<const int> Together(int view) const { return together_[std::size_t(view)]; }

  // Adds lines of all pictures that lie on the infinite line through the candidate beside its (growing)
  // extent, and fits it to them.
  void Grow(EdgeCandidate& c) const;
  // Least squares of the line (offsets across it at both ends) to the planes of its lines, then its extent.
  void Refine(EdgeCandidate& c) const;
  // Counts the pictures and stops of the candidate's lines.
  void Count(EdgeCandidate& c) const;
  // See WorldLine::px2_per_mm2.
  Eigen::Matrix3d Sensitivity(const EdgeCandidate& c) const;
  // Of the distances of the candidate's lines, px.
  double Rms(const EdgeCandidate& c) const;
  // Appends the lines of a view that lie on the projection of start - end (world, mm).
  void Collinear(int view, const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                 std::vector<LineRef>& out) const;

 private:
  std::optional<std::pair<double, double>> Extent(const LineRef& r, const Eigen::Vector3d& start,
                                                  const Eigen::Vector3d& d) const;
  void SetExtent(EdgeCandidate& c) const;
  double DistancePx(const LineRef& r, const Eigen::Vector3d& start, const Eigen::Vector3d& end) const;
  bool GrowOnce(EdgeCandidate& c) const;
  bool Step(EdgeCandidate& c) const;

  std::span<const View> views_;
  std::span<const LineIndex> indices_;
  const WorldLineOptions& options_;
  std::vector<Eigen::AlignedBox3d> rooms_;  // by view
  std::vector<std::vector<int>> together_;  // by view
};

}  // namespace vss
