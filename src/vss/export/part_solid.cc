#include "vss/export/part_solid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vss {
namespace {

Result<std::vector<double>> DimensionsOf(const Part& part, const ObjectModel& model) {
  std::vector<double> values;
  for (const auto& wanted : model.dimensions()) {
    const auto found = std::find_if(part.dimensions.begin(), part.dimensions.end(),
                                    [&](const auto& d) { return d.name == wanted.name; });
    if (found == part.dimensions.end())
      return InputError(
          "{} has no dimension `{}`, which the knowledge base gives a {}; export with the knowledge base "
          "that "
          "the survey was made with (--knowledge)",
          part.id, wanted.name, part.kind);
    if (!std::isfinite(found->value_mm))
      return InputError("dimension `{}` of {} is not a number; correct it in product.json, or survey again",
                        wanted.name, part.id);
    values.push_back(found->value_mm);
  }
  return values;
}

}  // namespace

Result<std::vector<PartSolid>> SolidsOfProduct(const Product& product, const KnowledgeBase& knowledge) {
  std::vector<PartSolid> solids;
  for (const auto& part : product.parts) {
    const ObjectModel* model = knowledge.Find(part.kind, part.features);
    if (model == nullptr) model = knowledge.Find(part.kind);
    if (model == nullptr)
      return InputError(
          "{} is a {}, which the knowledge base does not describe; name its file with --knowledge, or export "
          "csv alone",
          part.id, part.kind);
    VSS_ASSIGN(const auto dimensions_mm, DimensionsOf(part, *model));
    // Measured dimensions may break a `require` by their error (a square plate's length >= width); what they
    // make is a solid all the same.
    Solid solid = model->InstantiateUnchecked(dimensions_mm);
    if (!(FacetedVolume(solid) > 0))
      return InputError("the dimensions of {} make no {}; correct them in product.json, or survey again",
                        part.id, part.kind);
    solids.push_back({&part, std::move(solid)});
  }
  return solids;
}

double FacetedVolume(const Solid& solid) {
  double six_volumes = 0;  // tetrahedra from the origin to each triangle
  for (const auto& face : solid.faces)
    for (const auto& [a, b, c] : face.triangles) six_volumes += a.dot(b.cross(c));
  return six_volumes / 6;
}

}  // namespace vss
