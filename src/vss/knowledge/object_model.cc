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
#include "vss/knowledge/repair.h"

namespace vss {
namespace {

constexpr double kTolerance_mm = 1e-6;  // a constraint kept up to rounding is kept

class ParametricObject : public ObjectModel {
 public:
  explicit ParametricObject(Definition definition) : definition_(std::move(definition)) {}

  const std::string& kind() const override { return definition_.kind; }
  const std::string& title() const override { return definition_.title; }
  std::span<const DimensionDef> dimensions() const override { return definition_.dimensions; }
  std::span<const RestingPose> resting_poses() const override { return definition_.resting_poses; }

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
    for (const ConstraintGap& gap : ConstraintGaps(definition_, dimensions_mm))
      if (!(gap.distance_mm <= kTolerance_mm)) list.push_back(gap.distance_mm);
    return list;
  }

  std::vector<double> UsualDimensions(std::span<const std::optional<double>> known) const override {
    assert(known.size() == definition_.dimensions.size());
    return vss::UsualDimensions(definition_, known);
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

bool IsFile(const std::string& name) { return name.size() > 3 && name.ends_with(".kb"); }

Result<std::shared_ptr<const ObjectModel>> LoadShipped(const std::string& kind) {
  std::string known;
  for (const EmbeddedFile& file : shipped_knowledge()) {
    const std::string name(file.name.substr(0, file.name.size() - 3));
    if (name == kind) return ParseObject(std::string(file.text), std::string(file.name));
    known += (known.empty() ? "" : ", ") + name;
  }
  return InputError("no object '{}' is shipped; name one of {}, or a file that ends in .kb", kind, known);
}

}  // namespace

const ObjectModel* KnowledgeBase::Find(const std::string& kind) const {
  for (const auto& object : objects)
    if (object->kind() == kind) return object.get();
  return nullptr;
}

Result<std::shared_ptr<const ObjectModel>> ParseObject(const std::string& text,
                                                       const std::string& file_name) {
  VSS_ASSIGN(Definition definition, Define(text, file_name));
  return std::make_shared<const ParametricObject>(std::move(definition));
}

Result<KnowledgeBase> LoadKnowledge(std::span<const std::string> names, const std::filesystem::path& folder) {
  std::vector<std::string> wanted(names.begin(), names.end());
  if (wanted.empty())
    for (const EmbeddedFile& file : shipped_knowledge())
      wanted.emplace_back(file.name.substr(0, file.name.size() - 3));
  KnowledgeBase base;
  for (const std::string& name : wanted) {
    std::shared_ptr<const ObjectModel> object;
    if (IsFile(name)) {
      const std::filesystem::path path = folder / name;
      VSS_ASSIGN(const std::string text, ReadTextFile(path, kMaxKnowledgeBytes));
      VSS_ASSIGN(object, ParseObject(text, path.string()));
    } else {
      VSS_ASSIGN(object, LoadShipped(name));
    }
    if (base.Find(object->kind()))
      return InputError(
          "object '{}' is named twice in the knowledge base (the second time by '{}'); leave one out",
          object->kind(), name);
    base.objects.push_back(std::move(object));
  }
  return base;
}

}  // namespace vss
