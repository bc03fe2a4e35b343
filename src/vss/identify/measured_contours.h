// The contour of a solid held against the pictures, sample by sample, before it is decided what hides it and
// whose the lines are.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "vss/identify/contour.h"
#include "vss/identify/line_sharing.h"
#include "vss/identify/scene_index.h"

namespace vss {

// Directions of a predicted contour and its line may differ by this (cosine of 5 degrees).
inline constexpr double kMinCosine = 0.9962;
// A contour is above its support from this height on, in pixels' size.
inline constexpr double kElevatedPx = 1.5;

// A clear step of a round edge is this share of its brighter side: patches of rust are round too, but soft.
inline constexpr double kRingContrast = 0.25;

struct WeighOptions {
  double spacing_px = 6;
  int min_samples = 3, max_samples = 24;  // an edge
  bool keep_matches = false;
  bool grey = false;   // ask the grey values where there is no line
  bool rings = false;  // ask them of circles as a whole even so
  bool rough = false;  // for a start that is not yet fitted; without the comparison with paint
  double prior_log_odds = 0;
};

struct MeasuredContours {
  struct Contour {
    ContourSample::Source source = ContourSample::Source::kEdge;
    int index = 0;
    double weight = 1, detect = 1;  // how often it is found where it is
    bool elevated = false;          // above the support
  };
  struct Sample {
    int contour = 0;
    int line = -1;                      // of the picture's line index; -1: none
    int lost = 0;                       // the line is a nearer contour's: 1 unresolvable, 2 missed
    bool asked = false, empty = false;  // the grey values; they show no step
    Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
    double step_px = 0, chance = 0, distance_px = 0, along_px = 0;
    double ends = 0, step = 0;  // log-odds of where the line ends, of the grey values where there is no line
    // Of a circle: which way the grey values clearly step across it, 0: they do not; empty: not asked.
    std::optional<int> rises;
  };
  struct InView {
    int view = 0;
    std::vector<Sample> samples;     // those visible as far as was known
    std::vector<Neighbour> crowded;  // by contour
  };
  std::vector<Contour> contours;
  std::vector<InView> views;
  // Of each ledge (a level face below the top, as the lying leg of an angle) the contours across it.
  std::vector<std::vector<int>> ledge_ends;
};
MeasuredContours MeasureContours(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                                 const WeighOptions& options, const Occluders* others = nullptr);

}  // namespace vss
