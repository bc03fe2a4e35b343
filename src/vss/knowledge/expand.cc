#include "vss/knowledge/expand.h"

#include <algorithm>

namespace vss {
namespace {

constexpr std::size_t kMaxVariants = 16;  // each is looked for on its own

class Expander {
 public:
  explicit Expander(const Syntax& syntax) : in_(syntax) {}

  Result<std::vector<Syntax>> Run() {
    VSS_RETURN_IF_ERROR(CheckNames());
    std::vector<std::vector<bool>> variants{std::vector<bool>(in_.features.size(), false)};
    for (std::size_t f = 0; f < in_.features.size();) {
      const std::size_t end = EndOfChoice(f);
      std::vector<std::vector<bool>> next;
      // The first of a choice before the second, without an optional feature before with it.
      for (std::size_t k = f; k < end; ++k)
        for (std::vector<bool> v : variants) {
          v[k] = true;
          next.push_back(std::move(v));
        }
      if (in_.features[f].choice < 0) next.insert(next.begin(), variants.begin(), variants.end());
      variants = std::move(next);
      if (variants.size() > kMaxVariants)
        return ErrorAt(
            in_.file, in_.features[f].name.at,
            fmt::format("the features give more than {} variants; split the object in two", kMaxVariants));
      f = end;
    }
    std::vector<Syntax> out;
    for (const std::vector<bool>& present : variants) out.push_back(VariantOf(present));
    return out;
  }

 private:
  Status CheckNames() const {
    for (std::size_t f = 0; f < in_.features.size(); ++f)
      for (std::size_t g = 0; g < f; ++g)
        if (in_.features[g].name.name == in_.features[f].name.name)
          return ErrorAt(in_.file, in_.features[f].name.at,
                         fmt::format("the feature '{}' is already declared in line {}; choose another name",
                                     in_.features[f].name.name, in_.features[g].name.at.line));
    for (const Presence& m : in_.mentions)
      if (IndexOf(m.feature.name) < 0)
        return ErrorAt(in_.file, m.feature.at,
                       fmt::format("there is no feature '{}'; declare it: optional {} {{ ... }}",
                                   m.feature.name, m.feature.name));
    return {};
  }

  int IndexOf(const std::string& feature) const {
    for (std::size_t f = 0; f < in_.features.size(); ++f)
      if (in_.features[f].name.name == feature) return static_cast<int>(f);
    return -1;
  }

  // One beyond the features of the choice that begins at `f`; an optional feature stands alone.
  std::size_t EndOfChoice(std::size_t f) const {
    std::size_t end = f + 1;
    while (in_.features[f].choice >= 0 && end < in_.features.size() &&
           in_.features[end].choice == in_.features[f].choice)
      ++end;
    return end;
  }

  bool Holds(const When& when, const std::vector<bool>& present) const {
    return std::all_of(when.begin(), when.end(), [&](const Presence& p) {
      return present[static_cast<std::size_t>(IndexOf(p.feature.name))] == p.present;
    });
  }

  Syntax VariantOf(const std::vector<bool>& present) const {
    Syntax out = in_;
    out.present = present;
    const auto absent = [&](const auto& item) { return !Holds(item.when, present); };
    for (const DimensionSyntax& d : out.dimensions)
      if (absent(d)) out.absent_names[d.name.name] = d.when.back().feature.name;
    for (const LetSyntax& l : out.lets)
      if (absent(l)) out.absent_names[l.name.name] = l.when.back().feature.name;
    std::erase_if(out.dimensions, absent);
    std::erase_if(out.lets, absent);
    std::erase_if(out.requires_, absent);
    std::erase_if(out.sizes, absent);
    for (ExtrudeSyntax& e : out.extrusions) {
      std::erase_if(e.loops, absent);
      std::erase_if(e.weights, absent);
      for (LoopSyntax& loop : e.loops) std::erase_if(loop.corners, absent);
    }
    return out;
  }

  const Syntax& in_;
};

}  // namespace

Result<std::vector<Syntax>> Expand(const Syntax& syntax) { return Expander(syntax).Run(); }

std::string VariantName(const Syntax& variant) {
  std::string name;
  for (std::size_t f = 0; f < variant.features.size(); ++f) {
    const bool present = variant.present[f];
    if (!present && variant.features[f].choice >= 0) continue;  // the one of its choice that is there says it
    name += fmt::format("{}{} {}", name.empty() ? "" : ", ", present ? "with" : "without",
                        variant.features[f].name.name);
  }
  return name;
}

}  // namespace vss
