#include "vss/knowledge/check.h"

#include <gtest/gtest.h>

#include "shipped_knowledge.h"
#include "vss/knowledge/drawing.h"

namespace vss {
namespace {

std::string Plate(const std::string& items, const std::string& profile = "") {
  return "object o {\n  dimension w: 10 mm .. 100 mm\n  dimension t: 5 mm .. 20 mm\n" + items +
         "\n  extrude x from -50 mm to 50 mm {\n    outline { a (-w/2, 0 mm) b (w/2, 0 mm) c (w/2, t) d "
         "(-w/2, t) }\n" +
         profile + "\n  }\n}";
}

TEST(CheckKnowledge, FindsNothingInTheShippedObjects) {
  for (const EmbeddedFile& file : shipped_knowledge()) {
    const auto findings = CheckKnowledge(std::string(file.text), std::string(file.name));
    EXPECT_TRUE(findings.empty()) << findings[0].message;
  }
}

TEST(CheckKnowledge, PassesOnWhatIsWrongWithTheText) {
  const auto findings = CheckKnowledge("object o {", "o.kb");
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_TRUE(findings[0].is_error);
  EXPECT_EQ(findings[0].message.rfind("o.kb:1:11: expected", 0), 0u);
}

TEST(CheckKnowledge, FindsTheCornerOfTheRangesThatGivesNoSolid) {
  const auto findings = CheckKnowledge(Plate("", "cutout circle at (0 mm, t/2) radius 4 mm"), "o.kb");
  ASSERT_EQ(findings.size(), 1u);  // said once, however many corners show it
  EXPECT_TRUE(findings[0].is_error);
  EXPECT_NE(findings[0].message.find("o.kb:7:1: at w"), std::string::npos) << findings[0].message;
  EXPECT_NE(findings[0].message.find("t 5 mm: this cutout meets the outline of line 6"), std::string::npos)
      << findings[0].message;
  EXPECT_FALSE(
      CheckKnowledge(Plate("  require t >= 10 mm", "cutout circle at (0 mm, t/2) radius 4 mm"), "o.kb")[0]
          .is_error);
}

TEST(CheckKnowledge, FindsAnEndOfARangeThatCannotBeReached) {
  const auto findings = CheckKnowledge(Plate("  require t <= w/8 \"thin\""), "o.kb");
  ASSERT_EQ(findings.size(), 2u);
  EXPECT_FALSE(findings[0].is_error);
  EXPECT_EQ(findings[0].message,
            "o.kb:2:13: w = 10 mm is in the range but cannot be reached: the constraint of line 4 forbids "
            "it; narrow the range");
  EXPECT_EQ(findings[1].message,
            "o.kb:3:13: t = 20 mm is in the range but cannot be reached: the constraint of line 4 forbids "
            "it; narrow the range");
}

TEST(CheckKnowledge, FindsAPoseInWhichItTipsOver) {
  const std::string tee =
      "object o {\n  dimension w: 40 mm .. 100 mm\n  extrude x from -50 mm to 50 mm {\n"
      "    outline { a (-4 mm, 0 mm) b (4 mm, 0 mm) c (4 mm, 50 mm) d (w/2, 50 mm) e (w/2, 60 mm) f (-w/2, "
      "60 mm) g (-w/2, 50 mm) h (-4 mm, 50 mm) }\n  }\n"
      "  rests base\n  rests side turn x 90 deg";
  const auto findings = CheckKnowledge(tee + "\n}", "o.kb");
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_FALSE(findings[0].is_error);
  EXPECT_EQ(findings[0].message.rfind("o.kb:7:9: at w ", 0), 0u) << findings[0].message;
  EXPECT_NE(findings[0].message.find("tips over in the pose 'side'"), std::string::npos);
  EXPECT_TRUE(CheckKnowledge(tee + " propped\n}", "o.kb").empty());
}

TEST(DrawKnowledge, ShowsCornersDimensionsAndPoses) {
  for (const EmbeddedFile& file : shipped_knowledge()) {
    const auto svg = DrawKnowledge(std::string(file.text), std::string(file.name));
    ASSERT_TRUE(svg) << svg.error().message;
    EXPECT_EQ(svg->rfind("<svg", 0), 0u);
    EXPECT_NE(svg->find("pose base"), std::string::npos);
    EXPECT_NE(svg->find("class=\"seen\""), std::string::npos);
    EXPECT_EQ(svg->find("nan"), std::string::npos);
  }
  const auto box = DrawKnowledge(Plate(""), "o.kb");
  ASSERT_TRUE(box) << box.error().message;
  // A box seen from a corner: nine edges are seen, three hidden behind it.
  const auto count = [&](const std::string& word) {
    int n = 0;
    for (std::size_t i = box->find(word); i != std::string::npos; i = box->find(word, i + 1)) ++n;
    return n;
  };
  EXPECT_EQ(count("class=\"seen\""), 9);
  EXPECT_EQ(count("class=\"hidden\""), 3);
  EXPECT_EQ(count("class=\"dimension\""), 2);  // w and t
}

}  // namespace
}  // namespace vss
