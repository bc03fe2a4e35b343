// Hypotheses: an object of the knowledge base laid on edges of the world, and what a search for them knows of
// the scene.
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/weigh.h"
#include "vss/identify/world_circle.h"
#include "vss/identify/world_line.h"

namespace vss {

struct Hypothesis {
  PlacedObject object;
  double log_odds = 0;
  std::vector<int> views;
  std::vector<bool> determined;  // per dimension
  Eigen::MatrixXd
      open_direction;  // column d: how the state moves with an open dimension d so that the seed's edges stay
  int first_line = -1, second_line = -1;  // of the context's lines, from which it was seeded; -1: a circle
  int support = -1;  // index of the hypothesis' support in a list that the caller keeps; -1: ground
};

struct SeedContext {
  const SceneIndex& scene;
  std::span<const WorldLine> lines;
  std::span<const WorldCircle> circles;
  double mm_per_px = 1;               // typical size of a pixel in the scene
  int max_views = 14;                 // per weighing
  const Occluders* others = nullptr;  // parts that are known already
  const Claims* claims = nullptr;     // and the lines that they explain
  bool contact = true;                // may a dimension end where the object touches them?
};

// Was it seeded from a slanted line? From above such an edge and the level one that goes on from it are one
// line: where it ends is not told.
bool IsSlanted(const Hypothesis& hypothesis, const SeedContext& context);

// Are the dimensions within their ranges, to within `slack_mm`?
bool InRange(const PlacedObject& object, double slack_mm);
// Does the object keep the rules of its knowledge base, to within what lines are unsure by?
bool Allowed(const PlacedObject& object);
// Objects of one kind that are equal to within `near_mm`, vertex by vertex in any order, circle by circle?
bool SamePlace(const PlacedObject& a, const PlacedObject& b, double near_mm);

// How well an object that is not yet fitted agrees with the lines of some views (log-odds): to choose among
// candidates. `claims`: null where it does not matter who explains the lines.
double RoughLogOdds(const PlacedObject& object, std::span<const int> views, const SeedContext& context,
                    const Claims* claims = nullptr);
// How much the views speak for an object (log-odds, with the grey values).
double FullLogOdds(const PlacedObject& object, std::span<const int> views, const SeedContext& context);

}  // namespace vss
