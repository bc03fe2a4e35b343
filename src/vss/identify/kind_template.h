// Objects of the knowledge base prepared for seeding: which of their contours a pair of world lines or a
// world circle may be.
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "vss/identify/placed_object.h"

namespace vss {

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

// An object at the world's origin, its dimensions as usual.
PlacedObject UsualObject(const ObjectModel& model, int resting_pose);
// From the edge's start to its end, mm.
Eigen::Vector3d EdgeDirection(const WorldSolid& solid, const SolidEdge& edge);

}  // namespace vss
