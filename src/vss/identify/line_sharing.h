// Contours that contend for one line, and contours that run so close together that only one comes out as a
// line.
#pragma once
#include <span>
#include <vector>

#include "vss/identify/contour.h"
#include "vss/identify/line_index.h"
#include "vss/identify/placed_object.h"

namespace vss {

// Two contours nearer than this in the picture may come out as one line.
inline constexpr double kResolvePx = 2.5;

// Contours in one numbering: edges, then circles, then faces (limbs of those that are cylinders).
struct Numbering {
  int edges, circles, total;
  explicit Numbering(const WorldSolid& s)
      : edges(int(s.edges.size())),
        circles(int(s.circles.size())),
        total(edges + circles + int(s.faces.size())) {}
  int Of(const ContourSample& c) const {
    return c.index + (c.source == ContourSample::Source::kEdge     ? 0
                      : c.source == ContourSample::Source::kCircle ? edges
                                                                   : edges + circles);
  }
  ContourSample::Source SourceOf(int k) const {
    return k < edges             ? ContourSample::Source::kEdge
           : k < edges + circles ? ContourSample::Source::kCircle
                                 : ContourSample::Source::kLimb;
  }
  int IndexOf(int k) const { return k < edges ? k : k < edges + circles ? k - edges : k - edges - circles; }
};

// A sample of a contour and the line found there.
struct Hit {
  int contour, line, sample;  // line: where an arc was hit all of it, see HitOf()
  double distance, along;     // px
};

// All chords of an arc are one line, along which one goes by the circle's own angle.
Hit HitOf(const LineHit& hit, const ContourSample& s, int contour, int sample, const LineIndex& index);

// A line that lies on two predicted contours speaks for the nearer one only. The other is marked in `lost`,
// by sample: 1, neither found nor missed (the two are too close to be told apart in the picture), or 2,
// missed.
void ShareLines(std::span<const Hit> hits, std::span<const ContourSample> samples, std::vector<int>& lost);

// The nearest other contour that runs beside one.
struct Neighbour {
  double distance_px = 1e9;
  int contour = -1;
};
// For each contour the nearest other visible contour that runs beside it (to within a direction whose cosine
// is `min_cosine`); of circles, other circles.
std::vector<Neighbour> NearestParallel(std::span<const ContourSample> samples, const Numbering& numbering,
                                       double min_cosine);

}  // namespace vss
