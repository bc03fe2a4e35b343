// Which picked line is which contour, where nobody has said it: readings of the lines picked so far.
#pragma once
#include <functional>
#include <vector>

#include "manual_fit.h"

namespace vss::station {

inline constexpr int kNoContour = -1;

// One way to read the picks: the contour of each, and the object that they then are.
struct Reading {
  std::vector<int> contours;  // kNoContour: the pick is not the object's
  PlacedObject object;
  double rms_px = 0;    // of the picks
  double log_odds = 0;  // what the lines of the pictures around say of the object as the picks have it
};

struct Proposal {
  std::vector<Reading> readings;  // best first; each another body, no more than two
  bool decided = false;           // is the first clearly better?
};

// Identification asked for one kind: of the hypotheses that start from a picked line in the pictures that
// show the place, those on whose visible contours all picks lie, fitted to the picks, and what they are where
// a pick lies on two contours at once and is the other; by how much the lines speak for them. Where several
// pictures find none, the pictures with picks are asked one by one. The picks' contours are not looked at.
// `some`: picks that are not the object's are left out, as long as most are its own (a box about it holds
// shadows, too). `lines_of`: the lines of pictures, by index into `views`. Errors: no pick, more than
// kMaxProposed, or no reading explains the picks.
inline constexpr std::size_t kMaxProposed = 16;
Result<Proposal> ProposeContours(
    const FitQuestion& question, const std::vector<View>& views,
    const std::function<std::vector<LineImage>(const std::vector<int>& images)>& lines_of, int threads,
    bool some = false);

}  // namespace vss::station
