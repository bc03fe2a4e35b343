// Hypotheses: an object of the knowledge base laid on edges of the world.
//
// A seed is a pair of parallel world lines taken for a pair of parallel contour edges of one face that is
// seen from above, a slanted and a vertical one taken for edges of an upright face (of a thin plate often
// only one of the parallel ones is found), or a world circle taken for a rim. It fixes place and most
// dimensions by least squares (the vertices of an extruded solid are linear in them); dimensions that it
// leaves open are voted for by all lines of all pictures.
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/identify/weigh.h"
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

// An object in one resting pose, prepared for seeding.
struct KindTemplate {
  const ObjectModel* model = nullptr;
  int resting_pose = 0;
  struct Pair {
    int first, second;  // edges, parallel, of one face seen from above
    bool same_extent;   // their ends lie side by side whatever the dimensions
    bool level;         // and at one height
    // What the dimensions' ranges allow, mm: how far the second lies from the first, to its left and above,
    // and the first above the support. Unbounded where that is not linear in the dimensions.
    Eigen::AlignedBox1d left, above, height;
  };
  std::vector<Pair> pairs;
  struct Slant {
    int slanted, upright;  // edges of one upright face
  };
  std::vector<Slant> slants;
  std::vector<int> rims;  // circles of a face seen from above
};
std::vector<KindTemplate> MakeTemplates(const KnowledgeBase& knowledge);

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

// Seeds of one template on a support at height `support_z_mm`: placed, with the dimensions that the seed
// tells.
std::vector<Hypothesis> Seeds(const KindTemplate& kind, const SeedContext& context, double support_z_mm);

// How well a seed with its open dimensions as usual fits the lines: to choose which to complete.
double RoughScore(const Hypothesis& seed, const SeedContext& context);

// A seed with its open dimensions picked.
struct Completion {
  Hypothesis h;             // log_odds: roughly
  std::vector<bool> known;  // dimensions told by the seed or picked
};
// The best few ways to complete a seed.
std::vector<Completion> Complete(const KindTemplate& kind, const SeedContext& context,
                                 const Hypothesis& seed);
// Many seeds complete to one object: of those that agree to within half a pixel in every corner, and in what
// is known of them, the best.
std::vector<Completion> Distinct(std::vector<Completion> completions, double mm_per_px);
// Fits and weighs a completion.
Hypothesis Finish(const KindTemplate& kind, const SeedContext& context, const Completion& completion);

// The object lifted from its support onto one at `support_z_mm`, its contours above that staying where they
// are as far as its dimensions allow; empty where the dimensions' ranges forbid it.
std::optional<Hypothesis> Reseat(const Hypothesis& hypothesis, const SeedContext& context,
                                 double support_z_mm);

// Fits the object to the lines (z and tilt held) where that explains more, and weighs it.
void RefineAndWeigh(Hypothesis& hypothesis, const SeedContext& context);

// What a hypothesis becomes where it slides along its own lines, as they allow without moving off them (an
// end that is not where it was thought to be), to where further contours meet lines: those that explain more.
std::vector<Hypothesis> Slides(const Hypothesis& hypothesis, const SeedContext& context);

}  // namespace vss
