// The lines of a part that a person need not click one by one.
#pragma once
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "manual_fit.h"

namespace vss::station {

// The visible contours of an object in a picture: by whether it is a rim, and its number.
using VisibleContours = std::map<std::pair<bool, int>, std::vector<ContourSample>>;
VisibleContours VisibleContoursOf(const WorldSolid& solid, const View& view, const Occluders* others);

// A contour on which a line may lie.
struct NearContour {
  double mean_px = 0;  // how far from it
  int contour = 0;
};
// Those no more than `tolerance_px` beside the line that cover most of it, the nearest first.
std::vector<NearContour> ContoursNear(const Pick& line, const VisibleContours& contours, double tolerance_px);

// The lines of all pictures that lie on the visible contour of the fitted object, no more than `tolerance_px`
// beside it: what a person would click next. `taken` keeps out lines that are picked already, and those of
// other parts; `lines_of` gives all lines of a picture.
std::vector<Pick> CollectPicks(const PlacedObject& object, const std::vector<View>& views,
                               const Occluders* others, double tolerance_px,
                               const std::function<bool(const Pick& line)>& taken,
                               const std::function<std::vector<Pick>(int image)>& lines_of);

}  // namespace vss::station
