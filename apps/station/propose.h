// Which picked line is which contour, where nobody has said it: readings of the lines picked so far.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "manual_fit.h"

namespace vss::station {

// One way to read the picks: the contour of each, and the object that they then are.
struct Reading {
  std::vector<int> contours;
  PlacedObject object;
  double rms_px = 0;
  double score =
      0;  // the higher the better: contours that lines of the pictures show, against those they do not
};

struct Proposal {
  std::vector<Reading> readings;  // best first; each another body, no more than two
  bool decided = false;           // is the first clearly better?
};

// Hypothesise and test: a line and a level edge of the object give how the object is turned; with it every
// place is linear in position and dimensions, so that a beam search over the assignments solves a small
// linear system each time. The best are fitted, and weighed by how many of their visible contours the lines
// of all pictures show. The picks' contours are not looked at. `lines_of`: all lines of a picture. Errors: no
// pick, more than kMaxProposed, or no reading explains the picks.
inline constexpr std::size_t kMaxProposed = 16;
Result<Proposal> ProposeContours(const FitQuestion& question, const std::vector<View>& views,
                                 const std::function<std::vector<Pick>(int image)>& lines_of);

}  // namespace vss::station
