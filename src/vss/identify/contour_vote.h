// What one picture says of the contours that it should show.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "vss/identify/measured_contours.h"

namespace vss {

struct ContourVote {
  struct Contour {
    int contour = 0;
    double visible_px = 0, open_px = 0, supported_px = 0, empty_px = 0;
    double squared = 0;    // px^2, sum over the supported px
    double per_piece = 0;  // log-odds of an independent piece, in the mean
    double ends = 0;
  };
  std::vector<Contour> contours;
};
// `visible(i)`, `taken(i)`: of the view's samples; empty: all are visible, no line is another part's.
ContourVote VoteOf(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                   const std::function<bool(std::size_t)>& visible,
                   const std::function<bool(std::size_t)>& taken, const SceneIndex& scene, bool rough);
// As how many independent pieces a contour of this length in a picture counts.
double IndependentPieces(double px);

// What it costs that the ends of a ledge are rather not there than there: two long edges alone may be shadows
// of one. `log_odds`: by contour.
double OpenLedges(const MeasuredContours& measured, std::span<const double> log_odds);

}  // namespace vss
