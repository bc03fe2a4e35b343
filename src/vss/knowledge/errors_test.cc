// Every error of the language: one sentence with file, line and column, what was expected and the remedy.
#include <gtest/gtest.h>

#include <random>

#include "shipped_knowledge.h"
#include "vss/knowledge/object_model.h"

namespace vss {
namespace {

std::string ErrorOf(const std::string& text) {
  const auto object = ParseObject(text, "o.kb");
  return object ? "no error" : object.error().message;
}

// An object with `items` in place of the dimensions, `outline` in the cross section.
std::string WithItems(const std::string& items) {
  return "object o {\n" + items +
         "\nextrude x from -50 mm to 50 mm { outline { a (-w/2, 0 mm) b (w/2, 0 mm) c (w/2, 9 mm) d (-w/2, 9 "
         "mm) } }\n}";
}
std::string WithProfile(const std::string& profile) {
  return "object o { dimension w: 10 mm .. 100 mm usual 40 mm\nextrude x from -50 mm to 50 mm {\n" + profile +
         "\n} }";
}

// Every word of the language once.
const char* const kEverything = R"(object everything "All of it" {
  dimension length: 200 mm .. 1 m usual 400 mm
  dimension height: 10 mm .. 5 cm usual length/20 or 20 mm "thickness"
  let half = length/2
  optional hole "a round hole" {
    dimension diameter: 20 mm .. 150 mm
    let radius_of_hole = diameter/2
    require diameter <= half "it stays inside"
  }
  either straight {} or sniped "one corner cut off" { dimension snipe: 10 mm .. 90 mm }
  sizes "plates.sizes" with thickness = height if height <= length/5
  extrude z from 0 mm to height {
    outline {
      a (-half, -100 mm) b (half, -100 mm) round 5 mm
      with sniped { c (half, 100 mm - snipe) d (half - snipe, 100 mm) } else { c (half, max(100 mm, 2*height)) }
      e (-half, 100 mm)
    }
    with hole { cutout circle bore at (0 mm, 0 mm) radius radius_of_hole weak bore }
    strong a-b at from
    weight 0.7 e
  }
  rests base propped "held"
  rests over turn x 180 deg
  stands on ground, box
  expects touching box or tee
  prefers near pipe within 1 m weight 0.5 "drains"
  avoids between box and tee within 5 mm
  prefers perpendicular to tee within 20 mm
  prefers parallel to i_beam
})";

struct Case {
  const char* name;
  std::string text, error;
};

void PrintTo(const Case& c, std::ostream* os) { *os << c.name; }

class KnowledgeErrors : public testing::TestWithParam<Case> {};

TEST_P(KnowledgeErrors, AreOneSentenceWithTheirPlace) {
  const std::string error = ErrorOf(GetParam().text);
  EXPECT_EQ(error.substr(0, GetParam().error.size()), GetParam().error);
  EXPECT_EQ(error.find('\n'), std::string::npos);
  EXPECT_EQ(error.rfind("o.kb:", 0), 0u);
  EXPECT_LT(error.size(), 400u);
}

const char* const kW = "dimension w: 10 mm .. 100 mm";

INSTANTIATE_TEST_SUITE_P(
    Language, KnowledgeErrors,
    testing::Values(
        Case{"Empty", "",
             "o.kb:1:1: expected 'object', found the end of the file; a file begins with: object NAME"},
        Case{"NoName", "object {", "o.kb:1:8: expected the object's name, found '{'"},
        Case{"WordAsName", "object from {",
             "o.kb:1:8: expected the object's name, found 'from'; 'from' is a word of the language"},
        Case{"NoBrace", "object o dimension", "o.kb:1:10: expected '{', found 'dimension'"},
        Case{"UnknownItem", "object o {\n  dimensions a",
             "o.kb:2:3: expected dimension, let, require, extrude, rests, stands, sizes, optional, either, "
             "expects, prefers, avoids or '}', found 'dimensions'"},
        Case{"EndsEarly", "object o {\n",
             "o.kb:2:1: expected dimension, let, require, extrude, rests, stands, sizes, optional, either, "
             "expects, prefers, avoids or '}', found the end of "
             "the file"},
        Case{"TwoObjects", WithItems(kW) + "\nobject p {",
             "o.kb:5:1: expected the end of the file, found 'object'; a file holds one object"},
        Case{"NotAscii", "object o { # \xc3\xa4", "o.kb:1:14: byte 0xc3 is not printable ASCII"},
        Case{"NullByte", std::string("object o\0{", 10), "o.kb:1:9: byte 0x00 is not printable ASCII"},
        Case{"StrangeSign", "object o { ;", "o.kb:1:12: the sign ';' has no meaning here"},
        Case{"OpenText", "object o \"what\n{", "o.kb:1:10: this text has no end; close it with \""},
        Case{"HugeNumber", WithItems("dimension w: 1 mm .. 99999999999 mm"),
             "o.kb:2:22: the number 99999999999 is larger than 1e+09"},
        Case{"LongName", "object " + std::string(70, 'a') + " {",
             "o.kb:1:8: this name has 70 letters; at most 64"},
        Case{"NoColon", WithItems("dimension w 10 mm .. 100 mm"),
             "o.kb:2:13: expected ':', found '10'; a dimension reads"},
        Case{"NoRange", WithItems("dimension w: 10 mm"),
             "o.kb:3:1: expected '..', found 'extrude'; a range reads: 10 mm .. 2 m"},
        Case{"EmptyRange", WithItems("dimension w: 100 mm .. 10 mm"),
             "o.kb:2:11: the range of 'w' is empty: 100 mm .. 10 mm; write the smaller end first"},
        Case{"RangeWithoutUnit", WithItems("dimension w: 10 .. 100 mm"),
             "o.kb:2:14: the lower end of the range must be a length, but this is a plain number"},
        Case{"RangeOfDimension", WithItems(std::string(kW) + "\ndimension v: 10 mm .. w"),
             "o.kb:3:23: 'w' is a dimension, and a range must not depend on one"},
        Case{"RangeDividesByZero", WithItems("dimension w: 10 mm .. 1 mm/(1 - 1)"),
             "o.kb:2:27: the upper end of the range has no finite value"},
        Case{"UsualOutside", WithItems("dimension w: 10 mm .. 100 mm usual 1 m"),
             "o.kb:2:36: the usual w of 1000 mm lies outside its range"},
        Case{"UsualIsNoLength", WithItems("dimension w: 10 mm .. 100 mm usual 7"),
             "o.kb:2:36: the usual value must be a length, but this is a plain number"},
        Case{"DoubleDimension", WithItems(std::string(kW) + "\n" + kW),
             "o.kb:3:11: the name 'w' is already used in line 2; choose another"},
        Case{"DimensionAndLet", WithItems(std::string(kW) + "\nlet w = 1 mm"),
             "o.kb:3:5: the name 'w' is already used in line 2"},
        Case{"NoDimension", "object o { }", "o.kb:1:8: object 'o' has no dimension"},
        Case{"UnknownName", WithItems("dimension width: 10 mm .. 100 mm\nrequire widht >= 1 mm"),
             "o.kb:3:9: the name 'widht' is not known; did you mean 'width'?"},
        Case{"UnknownNameFarOff", WithItems("dimension w: 10 mm .. 100 mm\nrequire something >= 1 mm"),
             "o.kb:3:9: the name 'something' is not known; known are: w"},
        Case{"Circle", WithItems(std::string(kW) + "\nlet p = q\nlet q = 2*r\nlet r = p + w"),
             "o.kb:5:9: the definitions run in a circle: p -> q -> r -> p; define one of them without the "
             "others"},
        Case{"SelfReference", WithItems(std::string(kW) + "\nlet p = p + w"),
             "o.kb:3:9: the definitions run in a circle: p -> p"},
        Case{"LengthPlusNumber", WithItems(std::string(kW) + "\nlet p = w + 3"),
             "o.kb:3:11: a length and a plain number do not go together here; give the number its unit, such "
             "as 3 mm"},
        Case{"AngleTimes", WithItems(std::string(kW) + "\nlet p = w * 3 deg"),
             "o.kb:3:11: an angle cannot be multiplied"},
        Case{"AngleDivided", WithItems(std::string(kW) + "\nlet p = 30 deg / 2"),
             "o.kb:3:16: an angle cannot be divided"},
        Case{"RootOfLength", WithItems(std::string(kW) + "\nlet p = sqrt(w)"),
             "o.kb:3:9: sqrt needs an area or a plain number, not a length"},
        Case{"DividesByZero", WithItems(std::string(kW) + "\nlet p = w / 0"),
             "o.kb:3:11: this divides by zero"},
        Case{"HighPower", WithItems(std::string(kW) + "\nlet p = w*w*w*w*w*w*w*w*w"),
             "o.kb:3:24: a length to a power beyond 8"},
        Case{"OpenParenthesis", WithItems(std::string(kW) + "\nlet p = (w + w"),
             "o.kb:4:1: expected ')', found 'extrude'; close the parenthesis"},
        Case{"NoTerm", WithItems(std::string(kW) + "\nlet p = w +"),
             "o.kb:4:1: expected a number, a name, '(' or '-', found 'extrude'"},
        Case{"MinOfOne", WithItems(std::string(kW) + "\nlet p = min(w)"),
             "o.kb:3:14: expected ',', found ')'; it reads: min(a, b)"},
        Case{"NoRelation", WithItems(std::string(kW) + "\nrequire w + 1 mm"),
             "o.kb:4:1: expected <=, >= or ==, found 'extrude'; a constraint compares"},
        Case{"UnitsCompared", WithItems(std::string(kW) + "\nrequire w*w >= 3 mm"),
             "o.kb:3:1: this compares an area with a length"},
        Case{"ConstraintOnNothing", WithItems(std::string(kW) + "\nrequire 1 mm <= 2 mm"),
             "o.kb:3:1: this constraint has no dimension in it"},
        Case{"ContradictsRange", WithItems(std::string(kW) + "\nrequire w >= 150 mm \"wide\""),
             "o.kb:3:1: this constraint (wide) contradicts the ranges: at best it misses by 50 mm"},
        Case{"Contradiction",
             WithItems(std::string(kW) +
                       "\ndimension v: 10 mm .. 100 mm\nrequire w >= v + 20 mm\nrequire v >= w"),
             "o.kb:"},
        Case{"NoSolid", "object o { dimension w: 1 mm .. 2 mm }",
             "o.kb:1:8: object 'o' has no solid; write: extrude"},
        Case{"TwoSolids",
             "object o { dimension w: 1 mm .. 2 mm extrude x from 0 to 1 mm {} extrude y from 0 to 1 mm {} }",
             "o.kb:1:66: an object has one extrusion"},
        Case{"NoAxis", "object o { extrude w",
             "o.kb:1:20: expected x, y or z, found 'w'; an extrusion reads"},
        Case{"NoOutline", WithProfile(""), "o.kb:2:1: this extrusion has no outline"},
        Case{"TwoOutlines",
             WithProfile("outline circle at (0, 0) radius w outline circle at (0, 0) radius w"),
             "o.kb:3:35: a cross section has one outline"},
        Case{"ProfileWord", WithProfile("inline"),
             "o.kb:3:1: expected outline, cutout, weak, strong, weight, with or '}', found 'inline'"},
        Case{"TwoCorners", WithProfile("outline { a (0, 0) b (w, 0) }"),
             "o.kb:3:1: a loop needs 3 corners and more, this one has 2"},
        Case{"PointWithoutComma", WithProfile("outline { a (0 0)"),
             "o.kb:3:16: expected ',', found '0'; a point reads"},
        Case{"CornerIsNoLength", WithProfile("outline { a (3, 0) b (w, 0) c (w, w) }"),
             "o.kb:3:14: a coordinate must be a length, but this is a plain number; write a unit"},
        Case{"DoubleCorner", WithProfile("outline { a (0, 0) a (w, 0) c (w, w) }"),
             "o.kb:3:20: the name 'a' is already used in line 3"},
        Case{"CrossesItself", WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (-w/2, w) d (w/2, 2*w) }"),
             "o.kb:3:1: at w 40 mm: this outline crosses itself"},
        Case{"CornersTogether", WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, 0) d (0, w) }"),
             "o.kb:3:34: at w 40 mm: corners 'b' and 'c' fall together"},
        Case{"CutoutOutside",
             WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, w) d (-w/2, w) }\ncutout circle at (3*w, "
                         "w/2) radius 1 mm"),
             "o.kb:4:1: at w 40 mm: this cutout lies outside the outline"},
        Case{"CutoutMeetsOutline",
             WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, w) d (-w/2, w) }\ncutout circle at (0, 0) "
                         "radius 5 mm"),
             "o.kb:4:1: at w 40 mm: this cutout meets the outline of line 3"},
        Case{"CutoutInCutout",
             WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, w) d (-w/2, w) }\ncutout circle at (0, "
                         "w/2) radius 9 mm cutout circle at (0, w/2) radius 5 mm"),
             "o.kb:4:39: at w 40 mm: this cutout lies inside or around the cutout of line 4"},
        Case{"NoRadius", WithProfile("outline circle at (0, 0)"),
             "o.kb:4:1: expected 'radius', found '}'; a circle reads"},
        Case{"RadiusNegative", WithProfile("outline circle at (0, 0) radius w - 100 mm"),
             "o.kb:3:1: at w 40 mm: the circle's radius is -60 mm"},
        Case{"RoundingsOverlap",
             WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, w) round 30 mm d (-w/2, w) round 30 mm }"),
             "o.kb:3:57: at w 40 mm: the roundings at 'c' and 'd' need 60 mm and the edge has 40 mm"},
        Case{"RoundingNegative",
             WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, w) round -3 mm d (-w/2, w) }"),
             "o.kb:3:34: at w 40 mm: the rounding at 'c' has radius -3 mm"},
        Case{"BaseNotOnGround", WithProfile("outline { a (-w/2, 1 mm) b (w/2, 1 mm) c (0, w) }"),
             "o.kb:2:1: at w 40 mm: the lowest point is at z = 1 mm; the base must lie on z = 0"},
        Case{"NotCentred", WithProfile("outline { a (0, 0) b (w, 0) c (0, w) }"),
             "o.kb:2:1: at w 40 mm: the footprint's middle is at y = 20 mm; shift it to 0"},
        Case{"EmptyExtrusion",
             "object o { dimension w: 10 mm .. 100 mm usual 40 mm extrude z from w to 0 { outline circle at "
             "(0, 0) radius w } }",
             "o.kb:1:53: at w 40 mm: the extrusion from 40 mm to 0 mm is empty"},
        Case{"UnknownCorner", WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (0, w) } weak q"),
             "o.kb:3:50: no corner or circle is called 'q'; known are: a, b, c"},
        Case{"NoSuchEdge", WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (w/2, w) d (-w/2, w) } weak a-c"),
             "o.kb:3:64: there is no edge from 'a' to 'c'; name two corners that follow each other"},
        Case{"WeightTooLarge", WithProfile("weight 11 a"),
             "o.kb:3:8: expected a number from 0 to 10, found '11'"},
        Case{"LengthwiseAtEnd", WithProfile("outline { a (-w/2, 0) b (w/2, 0) c (0, w) } weak a at from"),
             "o.kb:3:50: the edge at corner 'a' runs from end to end"},
        Case{"RimOfCircleWithCorner", WithProfile("outline circle o at (0, w) radius w weak o-o"),
             "o.kb:3:44: 'o' is a circle"},
        Case{"NeitherEnd", WithProfile("outline circle c at (0, w) radius w weak c at x"),
             "o.kb:3:47: expected from or to, found 'x'"},
        Case{"FirstPoseTurned", WithItems(std::string(kW) + "\nrests side turn x 90 deg"),
             "o.kb:3:7: the first resting pose is the base and has no turn"},
        Case{"TurnWithoutUnit", WithItems(std::string(kW) + "\nrests base rests side turn x 90"),
             "o.kb:3:30: a turn must be an angle, but this is a plain number; write it with its unit, such "
             "as 90 deg"},
        Case{"DoublePose", WithItems(std::string(kW) + "\nrests base rests base"),
             "o.kb:3:18: the name 'base' is already used in line 3"},
        Case{"StandsOnNothing", WithItems(std::string(kW) + "\nstands on 3"),
             "o.kb:3:11: expected ground or the name of an object, found '3'"},
        Case{"StandsTwice", WithItems(std::string(kW) + "\nstands on ground, ground"),
             "o.kb:3:19: the name 'ground' is already used in line 3"},
        Case{
            "TooDeep",
            WithItems(std::string(kW) + "\nlet p = " + std::string(5000, '(') + "w" + std::string(5000, ')')),
            "o.kb:3:109: this expression is nested more than 100 deep; name its parts with let"},
        Case{"TooManySigns", WithItems(std::string(kW) + "\nlet p = " + std::string(5000, '-') + "w"),
             "o.kb:3:109: this expression is nested more than 100 deep"}),
    [](const auto& info) { return info.param.name; });

TEST(KnowledgeErrors, AreNoneInAFileThatUsesEveryWord) { EXPECT_EQ(ErrorOf(kEverything), "no error"); }

TEST(KnowledgeErrors, NameTheConstraintsThatContradictEachOther) {
  const std::string error = ErrorOf(
      WithItems(std::string(kW) +
                "\ndimension v: 10 mm .. 100 mm\nrequire w >= v + 20 mm\nrequire v >= w \"v is wider\""));
  EXPECT_NE(error.find("cannot be kept together with the others: at best it misses by"), std::string::npos)
      << error;
  EXPECT_TRUE(error.rfind("o.kb:4:1:", 0) == 0 || error.rfind("o.kb:5:1:", 0) == 0) << error;
}

TEST(KnowledgeErrors, RefuseWhatIsTooLong) {
  EXPECT_NE(
      ErrorOf(std::string(2 << 20, ' ')).find("are more than the 1048576 a knowledge base file may have"),
      std::string::npos);
  std::string sum = "w";
  for (int i = 0; i < 30000; ++i) sum += " + w";
  EXPECT_NE(ErrorOf(WithItems(std::string(kW) + "\nlet p = " + sum)).find("nested more than 100 deep"),
            std::string::npos);
  std::string many = kW;
  for (int i = 0; i < 2000; ++i) many += fmt::format("\nlet p{} = w", i);
  EXPECT_NE(ErrorOf(WithItems(many)).find("more than 1000 definitions"), std::string::npos);
  std::string chain = std::string(kW) + "\nlet p0 = w";  // the last first: each opens the one before it
  for (int i = 1; i < 900; ++i) chain = fmt::format("let p{} = p{} + 1 mm + 1 mm + 1 mm\n", i, i - 1) + chain;
  EXPECT_NE(ErrorOf(WithItems(chain)).find("build on each other more than 1000 deep"), std::string::npos);
  std::string corners = "outline {";
  for (int i = 0; i < 300; ++i) corners += fmt::format(" c{} (w, {} mm)", i, i);
  EXPECT_NE(ErrorOf(WithProfile(corners + "}")).find("a loop has at most 256 corners"), std::string::npos);
  std::string dimensions;
  for (int i = 0; i < 20; ++i) dimensions += fmt::format("dimension d{}: 1 mm .. 2 mm\n", i);
  EXPECT_NE(ErrorOf(WithItems(dimensions + kW)).find("an object has at most 16 dimensions"),
            std::string::npos);
}

// Bytes, words and lines of sound files put out of place: an error or an object, never a crash or a hang.
TEST(KnowledgeErrors, NeverCrashOnDamagedFiles) {
  std::mt19937 random(7);
  const auto pick = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  std::vector<std::string> texts;
  for (const EmbeddedFile& file : shipped_knowledge()) texts.emplace_back(file.text);
  texts.emplace_back(kEverything);
  texts.emplace_back(kEverything);
  int sound = 0, broken = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    std::string text = texts[pick(texts.size())];
    const std::string& other = texts[pick(texts.size())];
    for (std::size_t k = pick(4) + 1; k > 0; --k) {
      const std::size_t at = pick(text.size());
      switch (pick(6)) {
        case 0:
          text[at] = static_cast<char>(random() % 256);
          break;
        case 1:
          text.erase(at, pick(30) + 1);
          break;
        case 2:
          text.insert(at, other.substr(pick(other.size()), pick(40)));
          break;
        case 3:
          text.insert(at, 1, "(){}+-*/.,:=<>\"#0 9m"[pick(20)]);
          break;
        case 4:
          std::swap(text[at], text[pick(text.size())]);
          break;
        case 5:
          text.resize(at + 1);
          break;
      }
    }
    const auto objects = ParseObjects(text, "fuzz.kb");
    if (!objects) {
      ++broken;
      EXPECT_EQ(objects.error().message.rfind("fuzz.kb:", 0), 0u) << objects.error().message;
      EXPECT_EQ(objects.error().message.find('\n'), std::string::npos);
      continue;
    }
    ++sound;
    for (const auto& object : *objects) {
      std::vector<double> x;
      for (const DimensionDef& d : object->dimensions()) x.push_back(d.min_mm + (d.max_mm - d.min_mm) * 0.3);
      (void)object->InstantiateUnchecked(x);
      (void)object->Violations(x);
      (void)object->MatchSizes(std::vector<MeasuredDimension>(x.size(), {20, 1}));
    }
  }
  EXPECT_GT(sound, 100);
  EXPECT_GT(broken, 100);
}

}  // namespace
}  // namespace vss
