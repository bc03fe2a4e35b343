// Where edges of a few pixels are all that tells of a part: the grey values choose its place along the
// directions that its long edges leave open.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "vss/reconstruct/adjustment.h"
#include "vss/reconstruct/measure_view.h"
#include "vss/reconstruct/short_edge.h"

namespace vss {

// A short edge that a view shows.
struct SeenShortEdge {
  std::size_t view = 0;
  ContourPiece piece;
};

struct SeenPictures {
  std::span<const View> views;
  std::span<const GreyView> pictures;
  std::span<const PictureState> states;
  double mm_per_px = 1;
  int threads = 1;
};

// Directions of a part's state that nothing determines (see AnalyseObservability) and its short edges tell
// of, each as the step that moves no vertex by more than a pixel. `adjustment`: with its covariance, without
// what short edges observed; `known`: of each unknown, beforehand.
std::vector<Eigen::VectorXd> OpenDirections(const Adjustment& adjustment, std::size_t part,
                                            std::span<const SeenShortEdge> edges,
                                            const Eigen::VectorXd& known, double gain,
                                            const SeenPictures& pictures);

// The state up to five steps either way at which the faces of all parts, each of one grey, explain the
// pictures around `edges` of the part best; empty where none does so clearly better than the one it has.
std::optional<Eigen::VectorXd> BestAlong(std::vector<AdjustedPart> parts, std::size_t part,
                                         const Eigen::VectorXd& step, std::span<const SeenShortEdge> edges,
                                         const SeenPictures& pictures);

}  // namespace vss
