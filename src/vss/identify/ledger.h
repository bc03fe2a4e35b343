// The evidence of all pictures shared out among a set of parts: what hides what, whose a line is, and what
// the whole set explains. Each candidate is held against the pictures once; sets are then weighed without
// looking again.
#pragma once
#include <cstdint>
#include <map>
#include <span>
#include <unordered_map>
#include <vector>

#include "vss/identify/overlap.h"
#include "vss/identify/weigh.h"

namespace vss {

class Ledger {
 public:
  explicit Ledger(const SceneIndex& scene) : scene_(scene) {}

  // Holds candidates against the pictures; their numbers follow those added before.
  void Add(std::span<const PlacedObject> objects, int threads);
  int size() const { return int(candidates_.size()); }

  // Of one candidate among a set.
  struct Share {
    double log_odds = 0;           // its contours' evidence and its prior, less what paint would explain
    double elevated_log_odds = 0;  // the same of what stands above its support
    // What the contours that speak for it add up to, and those against it (log-odds, neither below 0).
    double shown = 0, missed = 0;
    double missed_share =
        0;  // of the weighted length (in the world) of the contours that show, those clearly missed
    int missing_ends = 0;  // see MissingEnds()
  };
  // Of every candidate of `set`, in its order: samples that another of the set hides do not count; a line
  // that contours of several lie on speaks for the nearest; one contour that several continue counts as one.
  // Where faces of two go on in one plane the edge between them is a line on a face, as shadows and paint
  // make them: that it is seen speaks for nothing.
  std::vector<Share> Weigh(std::span<const int> set);
  Share Alone(int candidate) { return Weigh({&candidate, 1})[0]; }

  // The candidates that `candidate` has to do with: one may hide the other, both lie on one line of a
  // picture, or they come nearer to each other than `near_mm` or than seams and shadows reach. What a
  // candidate explains depends on no others but through these. `near_mm` must stay the same.
  const std::vector<int>& Linked(int candidate, double near_mm);

 private:
  struct Candidate {
    MeasuredContours measured;
    Occluders body;
    double prior = 0;
    PaintedEvidence painted;
    struct InView {
      int view, slot;              // index into measured.views, -1: none of its contour is seen
      Eigen::AlignedBox2d screen;  // what its solid covers
    };
    std::vector<InView> in_views;  // the views that may show it, ascending
    WorldSolid solid;
    Volume volume;

    const InView* In(int view) const;
  };
  std::vector<Candidate::InView> PlacesOf(const Candidate& c) const;
  // The views in which some contour of the set is seen, ascending.
  std::vector<int> ViewsOf(std::span<const int> set) const;
  void Link(int candidate, double near_mm);
  // Samples of candidate i in its slot that candidate k hides; empty: none.
  const std::vector<bool>& Hidden(int i, int slot, int k);

  // Of each contour of candidate i the share that is no edge but a seam in a plane beside candidate k; empty:
  // of none.
  const std::vector<double>& Seams(int i, int k);

  const SceneIndex& scene_;
  std::vector<Candidate> candidates_;
  std::map<std::pair<int, int>, std::vector<std::vector<bool>>> hidden_;  // of (i, k): by slot
  std::map<std::pair<int, int>, std::vector<double>> seams_;              // of (i, k): by contour
  std::vector<std::vector<int>> links_;                                   // of the candidates linked so far
  std::vector<std::vector<int>> shown_in_;                      // by view: those of them that it may show
  std::unordered_map<std::int64_t, std::vector<int>> on_line_;  // by view and line: those of them on it
};

}  // namespace vss
