#include "vss/knowledge/relations.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vss {
namespace {

constexpr double kSquareRad = 5 * std::numbers::pi / 180;  // as square as an eye takes for square

bool IsOneOf(const std::string& kind, const std::vector<std::string>& kinds) {
  return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

bool WithinReach(const RelatedSolid& a, const RelatedSolid& b, double reach_mm) {
  const double beyond = reach_mm + 1;
  return DistanceOf(a.triangles, b.triangles, beyond) <= reach_mm;
}

bool DirectionsFit(ObjectRelation::Kind kind, const RelatedSolid& a, const RelatedSolid& b) {
  const double cosine = std::abs(a.along.normalized().dot(b.along.normalized()));
  if (kind == ObjectRelation::Kind::kParallel) return cosine >= std::cos(kSquareRad);
  if (kind == ObjectRelation::Kind::kPerpendicular) return cosine <= std::sin(kSquareRad);
  return true;
}

std::string Joined(const std::vector<std::string>& kinds) {
  return fmt::format("{}", fmt::join(kinds, " or "));
}

}  // namespace

bool Holds(const ObjectRelation& relation, const RelatedSolid& part, std::span<const RelatedSolid> others,
           double slack_mm) {
  const double reach_mm = relation.within_mm + slack_mm;
  std::vector<bool> near(others.size());
  for (std::size_t i = 0; i < others.size(); ++i)
    near[i] = (IsOneOf(others[i].kind, relation.kinds) || IsOneOf(others[i].kind, relation.others)) &&
              DirectionsFit(relation.kind, part, others[i]) && WithinReach(part, others[i], reach_mm);
  for (std::size_t i = 0; i < others.size(); ++i) {
    if (!near[i] || !IsOneOf(others[i].kind, relation.kinds)) continue;
    if (relation.kind != ObjectRelation::Kind::kBetween) return true;
    for (std::size_t k = 0; k < others.size(); ++k)
      if (k != i && near[k] && IsOneOf(others[k].kind, relation.others)) return true;
  }
  return false;
}

double RelationLogOdds(std::span<const ObjectRelation> relations, const RelatedSolid& part,
                       std::span<const RelatedSolid> others, double slack_mm) {
  double sum = 0;
  for (const ObjectRelation& r : relations) {
    const bool holds = Holds(r, part, others, slack_mm);
    if (holds)
      sum += r.force == ObjectRelation::Force::kAvoids ? -r.weight : r.weight;
    else if (r.force == ObjectRelation::Force::kExpects)
      sum -= r.weight;
  }
  return sum;
}

std::string Describe(const ObjectRelation& relation) {
  constexpr const char* kForces[] = {"expects", "prefers", "avoids"};
  constexpr const char* kKinds[] = {"touching", "near", "parallel to", "perpendicular to", "between"};
  std::string out = fmt::format("{} {} {}", kForces[static_cast<int>(relation.force)],
                                kKinds[static_cast<int>(relation.kind)], Joined(relation.kinds));
  if (!relation.others.empty()) out += " and " + Joined(relation.others);
  if (relation.within_mm > 0) out += fmt::format(" within {:g} mm", relation.within_mm);
  return out;
}

}  // namespace vss
