#include "vss/knowledge/object_model.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <random>

#include "shipped_knowledge.h"
#include "vss/base/files.h"
#include "vss/knowledge/build_solid.h"
#include "vss/knowledge/define.h"
#include "vss/knowledge/lexer.h"
#include "vss/knowledge/match_sizes.h"
#include "vss/knowledge/repair.h"

namespace vss {
namespace {

constexpr double kTolerance_mm = 1e-6;  // a constraint kept up to rounding is kept

class ParametricObject : public ObjectModel {
 public:
  explicit ParametricObject(Definition definition) : definition_(std::move(definition)) {}

  const std::string& kind() const override { return definition_.kind; }
  const std::string& title() const override { return definition_.title; }
  std::span<const FeatureDef> features() const override { return definition_.features; }
  std::span<const DimensionDef> dimensions() const override { return definition_.dimensions; }
  std::span<const RestingPose> resting_poses() const override { return definition_.resting_poses; }

  std::span<const ObjectRelation> relations() const override { return definition_.relations; }

  bool MayStandOn(const std::string& kind_or_ground) const override {
    return std::find(definition_.stands_on.begin(), definition_.stands_on.end(), kind_or_ground) !=
           definition_.stands_on.end();
  }

  Result<Solid> Instantiate(std::span<const double> dimensions_mm) const override {
    VSS_RETURN_IF_ERROR(CheckDimensions(dimensions_mm));
    VSS_RETURN_IF_ERROR(CheckSolid(definition_, dimensions_mm));
    return BuildSolid(definition_, dimensions_mm);
  }

  Solid InstantiateUnchecked(std::span<const double> dimensions_mm) const override {
    assert(dimensions_mm.size() == definition_.dimensions.size());
    return BuildSolid(definition_, dimensions_mm);
  }

  std::vector<double> Violations(std::span<const double> dimensions_mm) const override {
    assert(dimensions_mm.size() == definition_.dimensions.size());
    std::vector<double> list;
    for (std::size_t i = 0; i < dimensions_mm.size(); ++i) {
      const DimensionDef& d = definition_.dimensions[i];
      const double off = std::max(d.min_mm - dimensions_mm[i], dimensions_mm[i] - d.max_mm);
      if (!(off <= kTolerance_mm)) list.push_back(off);
    }
    if (KeepsAllConstraints(definition_, dimensions_mm)) return list;
    for (const ConstraintGap& gap : ConstraintGaps(definition_, dimensions_mm))
      if (!(gap.distance_mm <= kTolerance_mm)) list.push_back(gap.distance_mm);
    return list;
  }

  std::vector<double> UsualDimensions(std::span<const std::optional<double>> known) const override {
    assert(known.size() == definition_.dimensions.size());
    return vss::UsualDimensions(definition_, known);
  }

  std::vector<SizeMatch> MatchSizes(std::span<const MeasuredDimension> measured) const override {
    assert(measured.size() == definition_.dimensions.size());
    return vss::MatchSizes(definition_, measured);
  }

 private:
  Status CheckDimensions(std::span<const double> dimensions_mm) const {
    if (dimensions_mm.size() != definition_.dimensions.size())
      return InputError("{}: object '{}' has {} dimensions, got {} values", definition_.file,
                        definition_.kind, definition_.dimensions.size(), dimensions_mm.size());
    for (std::size_t i = 0; i < dimensions_mm.size(); ++i) {
      const DimensionDef& d = definition_.dimensions[i];
      if (dimensions_mm[i] >= d.min_mm - kTolerance_mm && dimensions_mm[i] <= d.max_mm + kTolerance_mm)
        continue;
      return ErrorAt(definition_.file, definition_.dimension_at[i],
                     fmt::format("{} = {:g} mm lies outside its range {:g} mm .. {:g} mm", d.name,
                                 dimensions_mm[i], d.min_mm, d.max_mm));
    }
    for (const ConstraintGap& gap : ConstraintGaps(definition_, dimensions_mm)) {
      if (gap.distance_mm <= kTolerance_mm) continue;
      const Constraint& c = definition_.constraints[gap.constraint];
      return ErrorAt(definition_.file, c.at,
                     fmt::format("this constraint is broken by {:.3g} mm{}{}", gap.distance_mm,
                                 c.reason.empty() ? "" : ": ", c.reason));
    }
    return {};
  }

  Definition definition_;
};

using Variants = std::vector<std::shared_ptr<const ObjectModel>>;

bool EndsWith(const std::string& name, std::string_view ending) {
  return name.size() > ending.size() && name.ends_with(ending);
}

Result<Variants> MakeObject(const std::string& text, const std::string& file, const Catalogues& catalogues) {
  VSS_ASSIGN(std::vector<Definition> definitions, Define(text, file, catalogues));
  Variants variants;
  for (Definition& d : definitions)
    variants.push_back(std::make_shared<const ParametricObject>(std::move(d)));
  return variants;
}

Result<Variants> LoadShipped(const std::string& kind, const Catalogues& catalogues) {
  std::string known;
  for (const EmbeddedFile& file : shipped_knowledge()) {
    const std::string name(file.name.substr(0, file.name.size() - 3));
    if (name == kind) return MakeObject(std::string(file.text), std::string(file.name), catalogues);
    known += (known.empty() ? "" : ", ") + name;
  }
  return InputError("no object '{}' is shipped; name one of {}, or a file that ends in .kb", kind, known);
}

Result<Variants> LoadFile(const std::filesystem::path& path, Catalogues catalogues) {
  VSS_ASSIGN(const std::string text, ReadTextFile(path, kMaxKnowledgeBytes));
  catalogues.folder = path.parent_path();
  return MakeObject(text, path.string(), catalogues);
}

// The catalogues among `names`, each checked, and taken out of them.
Result<Catalogues> TakeCatalogues(std::vector<std::string>& names, const std::filesystem::path& folder) {
  Catalogues catalogues;
  for (const std::string& name : names) {
    if (!EndsWith(name, ".sizes")) continue;
    const std::filesystem::path path = folder / name;
    VSS_ASSIGN(std::string text, ReadTextFile(path, kMaxKnowledgeBytes));
    if (const auto sound = ParseSizes(text, path.string()); !sound) return tl::unexpected(sound.error());
    catalogues.in_place[path.filename().string()] = {path.string(), std::move(text)};
  }
  std::erase_if(names, [](const std::string& name) { return EndsWith(name, ".sizes"); });
  return catalogues;
}

}  // namespace

const ObjectModel* KnowledgeBase::Find(const std::string& kind) const {
  for (const auto& object : objects)
    if (object->kind() == kind) return object.get();
  return nullptr;
}

const ObjectModel* KnowledgeBase::Find(const std::string& kind,
                                       const std::vector<std::string>& features) const {
  for (const auto& object : objects)
    if (object->kind() == kind && std::ranges::is_permutation(FeaturesOf(*object), features))
      return object.get();
  return nullptr;
}

std::vector<std::string> FeaturesOf(const ObjectModel& object) {
  std::vector<std::string> names;
  for (const FeatureDef& f : object.features())
    if (f.present) names.push_back(f.name);
  return names;
}

Result<std::vector<std::shared_ptr<const ObjectModel>>> ParseObjects(const std::string& text,
                                                                     const std::string& file_name) {
  return MakeObject(text, file_name, {std::filesystem::path(file_name).parent_path(), {}});
}

Result<std::shared_ptr<const ObjectModel>> ParseObject(const std::string& text,
                                                       const std::string& file_name) {
  VSS_ASSIGN(const Variants variants, ParseObjects(text, file_name));
  return variants[0];
}

Result<KnowledgeBase> LoadKnowledge(std::span<const std::string> names, const std::filesystem::path& folder) {
  std::vector<std::string> wanted(names.begin(), names.end());
  VSS_ASSIGN(const Catalogues catalogues, TakeCatalogues(wanted, folder));
  if (wanted.empty())
    for (const EmbeddedFile& file : shipped_knowledge())
      wanted.emplace_back(file.name.substr(0, file.name.size() - 3));
  KnowledgeBase base;
  for (const std::string& name : wanted) {
    VSS_ASSIGN(const Variants variants,
               EndsWith(name, ".kb") ? LoadFile(folder / name, catalogues) : LoadShipped(name, catalogues));
    if (base.Find(variants[0]->kind()))
      return InputError(
          "object '{}' is named twice in the knowledge base (the second time by '{}'); leave one out",
          variants[0]->kind(), name);
    base.objects.insert(base.objects.end(), variants.begin(), variants.end());
  }
  return base;
}

}  // namespace vss
