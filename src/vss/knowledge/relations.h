// What the declared relations of an object (`expects`, `prefers`, `avoids`) say of a part among others.
//
// Each statement is a yes-or-no question about the part. Its weight w is the natural logarithm of how much
// oftener the answer is yes for a real part of the kind than for one that is there by chance:
//
//   expects   +w where it holds, -w where it does not
//   prefers   +w where it holds, 0 where it does not
//   avoids    -w where it holds, 0 where it does not
//
// The contributions of an object's statements add up, as if they were independent: weights of a few units at
// most.
#pragma once
#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "vss/knowledge/object_model.h"
#include "vss/knowledge/solid_distance.h"

namespace vss {

// A part in the world, as far as relations ask about it.
struct RelatedSolid {
  std::string kind;
  std::vector<Triangle3> triangles;                  // of its faces, mm
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();  // its x axis
};

// Does the relation hold for `part`? `slack_mm`: what places are unsure by; parts that far apart still touch.
bool Holds(const ObjectRelation& relation, const RelatedSolid& part, std::span<const RelatedSolid> others,
           double slack_mm);

double RelationLogOdds(std::span<const ObjectRelation> relations, const RelatedSolid& part,
                       std::span<const RelatedSolid> others, double slack_mm);

// The statement as it is written: "prefers touching box or tee".
std::string Describe(const ObjectRelation& relation);

}  // namespace vss
