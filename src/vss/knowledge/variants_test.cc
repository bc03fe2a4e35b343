// Objects with optional features and alternatives: one ObjectModel a variant.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "vss/knowledge/check.h"
#include "vss/knowledge/drawing.h"
#include "vss/knowledge/object_model.h"

namespace vss {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

const char* const kPlate = R"(object plate "Plate" {
  dimension length: 200 mm .. 1 m usual 400 mm
  dimension height: 10 mm .. 50 mm
  optional hole "a round hole" {
    dimension diameter: 20 mm .. 150 mm
    require diameter <= length/2
  }
  either straight or sniped "one corner cut off" {
    dimension snipe: 10 mm .. 90 mm
  }
  extrude z from 0 mm to height {
    outline {
      a (-length/2, -100 mm) b (length/2, -100 mm)
      with sniped { c (length/2, 100 mm - snipe) d (length/2 - snipe, 100 mm) } else { c (length/2, 100 mm) }
      e (-length/2, 100 mm)
    }
    with hole { cutout circle bore at (0 mm, 0 mm) radius diameter/2  weak bore }
  }
})";

std::string Text(std::string replace = "", const std::string& by = "") {
  std::string text = kPlate;
  text.replace(text.find("straight or"), 8, "straight {}");
  if (!replace.empty()) text.replace(text.find(replace), replace.size(), by);
  return text;
}
std::vector<std::string> DimensionNames(const ObjectModel& object) {
  std::vector<std::string> names;
  for (const DimensionDef& d : object.dimensions()) names.push_back(d.name);
  return names;
}
std::string ErrorOf(const std::string& text) {
  const auto objects = ParseObjects(text, "o.kb");
  return objects ? "no error" : objects.error().message;
}

TEST(Variants, AreObjectsOfOneKindWithTheDimensionsOfTheirFeatures) {
  const auto objects = ParseObjects(Text(), "o.kb");
  ASSERT_TRUE(objects) << objects.error().message;
  ASSERT_EQ(objects->size(), 4u);
  for (const auto& o : *objects) EXPECT_EQ(o->kind(), "plate");
  EXPECT_THAT(FeaturesOf(*(*objects)[0]), ElementsAre("straight"));
  EXPECT_THAT(FeaturesOf(*(*objects)[1]), ElementsAre("hole", "straight"));
  EXPECT_THAT(FeaturesOf(*(*objects)[2]), ElementsAre("sniped"));
  EXPECT_THAT(FeaturesOf(*(*objects)[3]), ElementsAre("hole", "sniped"));
  EXPECT_THAT(DimensionNames(*(*objects)[0]), ElementsAre("length", "height"));
  EXPECT_THAT(DimensionNames(*(*objects)[3]), ElementsAre("length", "height", "diameter", "snipe"));
  EXPECT_EQ((*objects)[0]->features()[0].title, "a round hole");
  const Solid plain = (*objects)[0]->InstantiateUnchecked(std::vector<double>{400, 20});
  EXPECT_EQ(plain.vertices.size(), 8u);
  EXPECT_TRUE(plain.circles.empty());
  const auto full = (*objects)[3]->Instantiate(std::vector<double>{400, 20, 100, 50});
  ASSERT_TRUE(full) << full.error().message;
  EXPECT_EQ(full->vertices.size(), 10u);
  ASSERT_EQ(full->circles.size(), 2u);
  EXPECT_EQ(full->circles[0].weight, 0.5);
  EXPECT_FALSE(
      (*objects)[1]->Instantiate(std::vector<double>{200, 20, 120}));  // the feature's own constraint
}

TEST(Variants, AreFoundByTheirFeatures) {
  const auto objects = ParseObjects(Text(), "o.kb");
  ASSERT_TRUE(objects);
  const KnowledgeBase base{*objects};
  EXPECT_EQ(base.Find("plate"), (*objects)[0].get());
  EXPECT_EQ(base.Find("plate", {"sniped", "hole"}), (*objects)[3].get());
  EXPECT_EQ(base.Find("plate", {"sniped", "straight"}), nullptr);
  EXPECT_EQ(base.Find("box", {}), nullptr);
}

TEST(Variants, SayInWhichOfThemSomethingIsWrong) {
  EXPECT_THAT(
      ErrorOf(Text("e (-length/2", "e (-diameter")),
      StartsWith(
          "o.kb:15:11: in the variant without hole, with straight: 'diameter' belongs to the feature "
          "'hole', which is not there in every variant; use it in that feature, or inside: with hole"));
  EXPECT_THAT(
      ErrorOf(Text("d (length/2 - snipe", "c (length/2 - snipe")),
      StartsWith("o.kb:14:50: in the variant without hole, with sniped: the name 'c' is already used"));
  EXPECT_THAT(ErrorOf(Text("with hole {", "with holes {")),
              StartsWith("o.kb:17:10: there is no feature 'holes'; declare it: optional holes { ... }"));
  EXPECT_THAT(
      ErrorOf(Text("optional hole", "optional sniped")),
      StartsWith("o.kb:8:25: the feature 'sniped' is already declared in line 4; choose another name"));
  EXPECT_THAT(ErrorOf(Text("straight {} or", "straight {}")), HasSubstr("expected 'or', found 'sniped'"));
  EXPECT_THAT(
      ErrorOf(Text("    dimension snipe", "    rests base dimension snipe")),
      HasSubstr("expected dimension, let, require, sizes or '}', found 'rests'; a feature holds these"));
  std::string many;
  for (int i = 0; i < 5; ++i) many += fmt::format("optional f{} {{ }}\n", i);
  EXPECT_THAT(ErrorOf(Text("  either", many + "  either")),
              HasSubstr("the features give more than 16 variants; split the object in two"));
  std::string deep, end;
  for (int i = 0; i < 20; ++i) deep += "with hole { ", end += " }";
  EXPECT_THAT(ErrorOf(Text("with hole { cutout circle bore at (0 mm, 0 mm) radius diameter/2  weak bore }",
                           deep + end)),
              HasSubstr("expected no further with, found 'hole'; 16 in each other are the most"));
}

TEST(Variants, MayNestAndShareNames) {
  const auto objects = ParseObjects(
      Text("with hole {",
           "with hole { with sniped { cutout circle second at (0 mm, 80 mm) radius 5 mm } else { "
           "cutout circle second at (0 mm, -80 mm) radius 6 mm }"),
      "o.kb");
  ASSERT_TRUE(objects) << objects.error().message;
  EXPECT_EQ((*objects)[0]->InstantiateUnchecked(std::vector<double>{400, 20}).circles.size(), 0u);
  EXPECT_EQ((*objects)[1]->InstantiateUnchecked(std::vector<double>{400, 20, 30}).circles[0].radius_mm, 6);
  EXPECT_EQ((*objects)[3]->InstantiateUnchecked(std::vector<double>{400, 20, 30, 50}).circles[0].radius_mm,
            5);
}

TEST(Variants, AreCheckedAndDrawnEach) {
  EXPECT_TRUE(CheckKnowledge(Text(), "o.kb").empty());
  // A hole that the snipe may reach: only that variant is wrong.
  const auto findings = CheckKnowledge(Text("at (0 mm, 0 mm)", "at (length/2 - 90 mm, 20 mm)"), "o.kb");
  ASSERT_FALSE(findings.empty());
  for (const auto& f : findings) EXPECT_THAT(f.message, HasSubstr("in the variant with hole, with "));
  const auto svg = DrawKnowledge(Text(), "o.kb");
  ASSERT_TRUE(svg) << svg.error().message;
  EXPECT_THAT(*svg, HasSubstr("plate: Plate, with hole, with sniped"));
  EXPECT_THAT(*svg, HasSubstr("plate: Plate, without hole, with straight"));
  EXPECT_EQ(svg->find("nan"), std::string::npos);
}

TEST(Examples, AreSoundAllOverTheirRanges) {
  int seen = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(VSS_SOURCE_DIR) /
                                                               "examples" / "knowledge")) {
    if (entry.path().extension() != ".kb") continue;
    ++seen;
    std::ostringstream text;
    text << std::ifstream(entry.path()).rdbuf();
    for (const auto& f : CheckKnowledge(text.str(), entry.path().string())) ADD_FAILURE() << f.message;
    EXPECT_TRUE(DrawKnowledge(text.str(), entry.path().string()));
  }
  EXPECT_GE(seen, 4);
}

}  // namespace
}  // namespace vss
