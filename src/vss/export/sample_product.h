// For tests of this room: a workpiece with every kind of part, places at random, and two seams.
#pragma once
#include <gtest/gtest.h>

#include <numbers>

#include "vss/identify/placed_object.h"
#include "vss/product/make_part.h"
#include "vss/product/seams.h"

namespace vss {

inline KnowledgeBase Shipped() {
  auto base = LoadKnowledge({}, {});
  EXPECT_TRUE(base) << (base ? "" : base.error().message);
  return base ? *base : KnowledgeBase{};
}

inline Part PartAt(const ObjectModel& model, const std::string& id, std::vector<double> dimensions_mm,
                   const Eigen::Vector3d& place, double yaw_rad, double tilt_rad = 0) {
  PlacedObject object;
  object.model = &model;
  object.dimensions_mm = dimensions_mm;
  object.placement << place, yaw_rad, tilt_rad, 0;
  Part part;
  part.id = id;
  part.kind = model.kind();
  part.yaw_rad = yaw_rad;
  for (std::size_t i = 0; i < dimensions_mm.size(); ++i)
    part.dimensions.push_back({model.dimensions()[i].name, dimensions_mm[i], 0.25, true, ""});
  SetGeometry(object, part);
  return part;
}

// One of each kind at its usual dimensions, standing about and leaning a little.
inline Product EveryKind(const KnowledgeBase& knowledge) {
  Product product;
  product.survey = "every kind";
  for (const auto& model : knowledge.objects) {
    const double n = static_cast<double>(product.parts.size());
    const auto usual = model->UsualDimensions(std::vector<std::optional<double>>(model->dimensions().size()));
    product.parts.push_back(
        PartAt(*model, fmt::format("part-{}", n + 1), usual, {1500 * n, -300 * n, 10}, 0.4 * n, 0.01 * n));
  }
  return product;
}

// A plate and an upright on it, which are joined by two seams.
inline Product PlateWithUpright(const KnowledgeBase& knowledge) {
  Product product;
  product.survey = "plate, with \"upright\"";
  product.parts.push_back(PartAt(*knowledge.Find("box"), "part-1", {1000, 800, 20}, {2000, 1000, 0}, 0.3));
  product.parts.push_back(PartAt(*knowledge.Find("box"), "part-2", {600, 12, 150}, {2000, 1000, 20.5}, 0.3));
  product.seams = FindSeams(product, knowledge, {});
  EXPECT_EQ(product.seams.size(), 2u);
  return product;
}

inline std::vector<std::string> Fields(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      fields.emplace_back();
    else
      fields.back() += c;
  }
  return fields;
}

}  // namespace vss
