// Catalogues of standard sizes: reading them, and what measured dimensions tell.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <random>

#include "shipped_sizes.h"
#include "vss/knowledge/object_model.h"
#include "vss/knowledge/size_table.h"

namespace vss {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const char* const kSound = R"(# rolled bars
sizes bars "EN 1" {
  columns width thickness
  tolerance width: 1 mm up to 50 mm, -2 +3 mm below 100 mm, 4 mm
  tolerance thickness: 0.5 mm
  size "50x5"   50 5
  size "100x10" 100 10
})";

std::string ErrorOf(const std::string& text) {
  const auto table = ParseSizes(text, "s.sizes");
  return table ? "no error" : table.error().message;
}
std::string With(const std::string& lines) { return "sizes bars {\n  columns width\n" + lines + "\n}"; }

TEST(ParseSizes, ReadsColumnsTolerancesAndSizes) {
  const auto table = ParseSizes(kSound, "s.sizes");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->title, "EN 1");
  EXPECT_EQ(table->columns, (std::vector<std::string>{"width", "thickness"}));
  ASSERT_EQ(table->entries.size(), 2u);
  EXPECT_EQ(table->entries[1].designation, "100x10");
  EXPECT_EQ(table->entries[1].nominal_mm, (std::vector<double>{100, 10}));
  EXPECT_EQ(table->ToleranceOf(0, 50).below_mm, 1);  // up to 50 mm, it included
  EXPECT_EQ(table->ToleranceOf(0, 51).below_mm, 2);
  EXPECT_EQ(table->ToleranceOf(0, 51).above_mm, 3);
  EXPECT_EQ(table->ToleranceOf(0, 100).above_mm, 4);  // below 100 mm, it not included
}

TEST(ParseSizes, SaysInOneSentenceWhatIsWrongAndWhere) {
  const std::pair<std::string, std::string> cases[] = {
      {"", "s.sizes:1:1: expected 'sizes', found the end of the file; a catalogue begins with"},
      {"sizes bars {\n  size", "s.sizes:2:3: expected 'columns', found 'size'; a catalogue's columns read"},
      {"sizes bars {\n  columns\n}", "s.sizes:3:1: expected a column's name, found '}'"},
      {"sizes bars { columns a a", "s.sizes:1:24: the column 'a' is already there"},
      {With("  tolerance height: 1 mm"), "s.sizes:3:13: there is no column 'height'"},
      {With("  tolerance width 1 mm"), "s.sizes:3:19: expected ':', found '1'; a tolerance reads"},
      {With("  tolerance width: 1"), "s.sizes:4:1: expected 'mm', found '}'"},
      {With("  tolerance width: - 1 mm"), "s.sizes:3:24: expected '+', found 'mm'"},
      {With("  tolerance width: 1 mm up to 9 mm"),
       "s.sizes:4:1: expected ',' and the tolerance of larger sizes, found '}'; the last step has no 'up "
       "to'"},
      {With("  tolerance width: 1 mm up to 9 mm, 2 mm up to 8 mm, 3 mm"),
       "s.sizes:3:48: the steps must grow; put the smaller sizes first"},
      {With("  tolerance width: 1 mm, 2 mm"), "s.sizes:3:26: expected the end of the steps, found '2'"},
      {With("  tolerance width: 1 mm\n  tolerance width: 1 mm"),
       "s.sizes:4:13: the column 'width' has its tolerance already"},
      {With("  tolerance width: 1 mm\n  size 5"),
       "s.sizes:4:8: expected the designation in quotes, found '5'"},
      {With("  tolerance width: 1 mm\n  size \"5\""),
       "s.sizes:5:1: expected a number, found '}'; the column 'width' is missing"},
      {With("  tolerance width: 1 mm\n  size \"5\" 5 6"), "s.sizes:4:14: expected the next size, found '6'"},
      {With("  tolerance width: 1 mm\n  size \"5\" 0"), "s.sizes:4:12: a size must be above 0"},
      {With("  tolerance width: 1 mm\n  size \"5\" 5\n  size \"5\" 6"),
       "s.sizes:5:3: the size \"5\" stands already in line 4; leave one out"},
      {With("  size \"5\" 5"),
       "s.sizes:1:1: the column 'width' has no tolerance; write: tolerance width: 1 mm"},
      {With("  tolerance width: 1 mm"), "s.sizes:1:1: this catalogue has no size"},
      {std::string(kSound) + "\nsizes", "s.sizes:9:1: expected the end of the file, found 'sizes'"},
  };
  for (const auto& [text, error] : cases) {
    const std::string found = ErrorOf(text);
    EXPECT_THAT(found, StartsWith(error)) << text;
    EXPECT_EQ(found.find('\n'), std::string::npos);
  }
}

TEST(ParseSizes, NeverCrashesOnDamagedFiles) {
  std::mt19937 random(3);
  const auto pick = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  int sound = 0, broken = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const auto files = shipped_sizes();
    std::string text(files[pick(files.size())].text.substr(0, 1500));
    text += "\n}";
    for (std::size_t k = pick(3) + 1; k > 0; --k) {
      const std::size_t at = pick(text.size());
      switch (pick(4)) {
        case 0:
          text[at] = static_cast<char>(random() % 256);
          break;
        case 1:
          text.erase(at, pick(30) + 1);
          break;
        case 2:
          text.insert(at, text.substr(pick(text.size()), pick(40)));
          break;
        case 3:
          text.insert(at, 1, "{}+-,:\"#0 9m"[pick(12)]);
          break;
      }
    }
    const auto table = ParseSizes(text, "fuzz.sizes");
    (table ? sound : broken) += 1;
    if (!table) {
      EXPECT_THAT(table.error().message, StartsWith("fuzz.sizes:"));
    }
  }
  EXPECT_GT(sound, 30);
  EXPECT_GT(broken, 300);
}

TEST(ShippedSizes, AreSoundAndEverySizeIsADimensionThatItsObjectMayHave) {
  for (const EmbeddedFile& file : shipped_sizes()) {
    const auto table = ParseSizes(std::string(file.text), std::string(file.name));
    EXPECT_TRUE(table) << table.error().message;
  }
  const KnowledgeBase base = *LoadKnowledge({}, ".");
  // Each nominal size of a beam is found again by its own dimensions, and nothing else fits as well.
  const auto beams = ParseSizes(
      std::string(std::find_if(shipped_sizes().begin(), shipped_sizes().end(),
                               [](const EmbeddedFile& f) { return f.name == "en10365_beams.sizes"; })
                      ->text),
      "en10365_beams.sizes");
  ASSERT_TRUE(beams);
  EXPECT_EQ(beams->entries.size(), 18u + 24u + 24u);
  const ObjectModel& beam = *base.Find("i_beam");
  for (const auto& entry : beams->entries) {
    const auto& n = entry.nominal_mm;  // height width web flange
    const std::vector<double> x{2000, n[1], n[0], n[2], n[3]};
    EXPECT_TRUE(beam.Violations(x).empty()) << entry.designation;
    const std::vector<MeasuredDimension> measured{
        {2000, 0.2}, {n[1], 0.2}, {n[0], 0.2}, {n[2], 0.2}, {n[3], 0.2}};
    const auto matches = beam.MatchSizes(measured);
    ASSERT_FALSE(matches.empty()) << entry.designation;
    EXPECT_EQ(matches[0].designation, entry.designation);
    EXPECT_EQ(DeterminedSize(matches), &matches[0]) << entry.designation;
  }
}

std::vector<MeasuredDimension> Angle(double width, double height, double thickness, double sigma,
                                     bool thickness_seen = true) {
  return {{1000, sigma}, {width, sigma}, {height, sigma}, {thickness, sigma, thickness_seen}};
}

TEST(MatchSizes, FindsAnAngleOnEitherLeg) {
  const KnowledgeBase base = *LoadKnowledge(std::vector<std::string>{"angle"}, ".");
  const ObjectModel& angle = *base.Find("angle");
  for (const auto& measured : {Angle(150.4, 99.2, 10.3, 0.1), Angle(99.2, 150.4, 10.3, 0.1)}) {
    const auto matches = angle.MatchSizes(measured);
    ASSERT_TRUE(DeterminedSize(matches));
    EXPECT_EQ(DeterminedSize(matches)->designation, "L 150x100x10");
    EXPECT_EQ(DeterminedSize(matches)->standard, "EN 10056-1");
    EXPECT_TRUE(DeterminedSize(matches)->complete);
  }
  EXPECT_EQ(*angle.MatchSizes(Angle(150.4, 99.2, 10.3, 0.1))[0].nominal_mm[1], 150);
  EXPECT_EQ(*angle.MatchSizes(Angle(99.2, 150.4, 10.3, 0.1))[0].nominal_mm[1], 100);
  EXPECT_FALSE(
      angle.MatchSizes(Angle(99.2, 150.4, 10.3, 0.1))[0].nominal_mm[0]);  // the length is in no catalogue
}

TEST(MatchSizes, ChoosesNoneWhereADimensionIsOutOfItsTolerance) {
  const KnowledgeBase base = *LoadKnowledge(std::vector<std::string>{"angle"}, ".");
  const ObjectModel& angle = *base.Find("angle");
  EXPECT_FALSE(angle.MatchSizes(Angle(100, 102.2, 10, 0.1)).empty());  // 2 mm and three sigma
  EXPECT_TRUE(angle.MatchSizes(Angle(100, 102.4, 10, 0.1)).empty());
}

TEST(MatchSizes, DoesNotDecideBetweenSizesThatTheMeasurementDoesNotTellApart) {
  const KnowledgeBase base = *LoadKnowledge(std::vector<std::string>{"angle"}, ".");
  const ObjectModel& angle = *base.Find("angle");
  const auto between = angle.MatchSizes(Angle(100, 100, 11, 0.3));
  EXPECT_EQ(between.size(), 2u);  // 10 and 12 mm
  EXPECT_EQ(DeterminedSize(between), nullptr);
  const auto unseen = angle.MatchSizes(Angle(100, 100, 11, 0.3, false));
  EXPECT_EQ(unseen.size(), 3u);  // 8, 10 and 12 mm
  EXPECT_EQ(DeterminedSize(unseen), nullptr);
  const auto only = angle.MatchSizes(Angle(160, 160, 11, 0.3, false));
  ASSERT_TRUE(DeterminedSize(only));
  EXPECT_EQ(DeterminedSize(only)->designation, "L 160x160x15");
  // One leg alone fits by chance.
  std::vector<MeasuredDimension> one = Angle(160, 160, 11, 0.3, false);
  one[2].observed = false;
  EXPECT_EQ(DeterminedSize(angle.MatchSizes(one)), nullptr);
}

TEST(MatchSizes, AsksACatalogueOnlyWhereItsConditionHolds) {
  const KnowledgeBase base = *LoadKnowledge(std::vector<std::string>{"box"}, ".");
  const ObjectModel& box = *base.Find("box");
  const auto of = [&](double length, double width, double height) {
    const auto matches =
        box.MatchSizes(std::vector<MeasuredDimension>{{length, 0.1}, {width, 0.1}, {height, 0.1}});
    return matches.empty() ? "" : matches[0].designation;
  };
  EXPECT_EQ(of(800, 300, 20.3), "plate 20");
  EXPECT_EQ(of(800, 20.3, 300), "plate 20");  // on edge
  EXPECT_EQ(of(800, 100, 100), "");           // a block
}

class SizesFiles : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_ / "own"); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  static std::string Bar(const std::string& sizes) {
    return "object bar {\n  dimension width: 10 mm .. 200 mm\n  dimension thickness: 3 mm .. 20 mm\n  " +
           sizes +
           "\n  extrude x from -50 mm to 50 mm { outline { a (-width/2, 0 mm) b (width/2, 0 mm) c (width/2, "
           "thickness) d (-width/2, thickness) } }\n}";
  }
  std::string ErrorOf(const std::string& sizes) const {
    const auto object = ParseObject(Bar(sizes), (folder_ / "bar.kb").string());
    return object ? "no error" : object.error().message.substr(folder_.string().size() + 1);
  }
  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / fmt::format("vss_sizes_test_{}", ::getpid());
};

TEST_F(SizesFiles, LieBesideTheObject) {
  Write("own/bars.sizes", kSound);
  Write("bar.kb", Bar("sizes \"own/bars.sizes\""));
  const auto base = LoadKnowledge(std::vector<std::string>{"bar.kb"}, folder_);
  ASSERT_TRUE(base) << base.error().message;
  const auto matches = base->objects[0]->MatchSizes(std::vector<MeasuredDimension>{{50.5, 0.1}, {5.2, 0.1}});
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].designation, "50x5");
  EXPECT_NEAR(*matches[0].nominal_mm[1], 5, 0);
  EXPECT_NEAR(matches[0].tolerance_mm[1], 0.5, 0);
}

TEST_F(SizesFiles, TakeThePlaceOfShippedOnesWhereTheSurveyNamesThem) {
  Write("plates.sizes", "sizes mine { columns thickness tolerance thickness: 1 mm size \"mine\" 17 }");
  const auto base = LoadKnowledge(std::vector<std::string>{"box", "plates.sizes"}, folder_);
  ASSERT_TRUE(base) << base.error().message;
  const auto matches =
      base->Find("box")->MatchSizes(std::vector<MeasuredDimension>{{800, 0.1}, {300, 0.1}, {17, 0.1}});
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].designation, "mine");
  const auto all = LoadKnowledge(std::vector<std::string>{"plates.sizes"}, folder_);
  ASSERT_TRUE(all);
  EXPECT_EQ(all->objects.size(), 8u);  // no object named: all shipped
  Write("plates.sizes", "sizes mine {");
  EXPECT_FALSE(LoadKnowledge(std::vector<std::string>{"box", "plates.sizes"}, folder_));
}

TEST_F(SizesFiles, SayWhereAnObjectAndItsCatalogueDoNotFit) {
  Write("bars.sizes", kSound);
  Write("other.sizes", "sizes o { columns depth tolerance depth: 1 mm size \"1\" 1 }");
  Write("broken.sizes", "sizes o {");
  EXPECT_EQ(ErrorOf("sizes \"bars.sizes\""), "no error");
  EXPECT_THAT(ErrorOf("sizes bars"),
              StartsWith("bar.kb:4:9: expected the catalogue's file in quotes, found 'bars'"));
  EXPECT_THAT(ErrorOf("sizes \"bars.kb\""),
              StartsWith("bar.kb:4:3: the file \"bars.kb\" does not end in .sizes"));
  EXPECT_THAT(
      ErrorOf("sizes \"none.sizes\""),
      StartsWith(
          "bar.kb:4:3: the catalogue \"none.sizes\" does not lie beside this file and is not shipped"));
  EXPECT_THAT(
      ErrorOf("sizes \"other.sizes\""),
      StartsWith("bar.kb:4:3: the catalogue \"other.sizes\" has the column 'depth', which is no dimension"));
  EXPECT_THAT(
      ErrorOf("sizes \"other.sizes\" with dept = width"),
      StartsWith("bar.kb:4:3: the catalogue \"other.sizes\" has no column 'dept'; its columns are depth"));
  EXPECT_THAT(ErrorOf("sizes \"other.sizes\" with depth = widht"),
              StartsWith("bar.kb:4:36: 'widht' is no dimension of this object; did you mean 'width'?"));
  EXPECT_EQ(ErrorOf("sizes \"other.sizes\" with depth = width if width >= 3*thickness"), "no error");
  EXPECT_THAT(ErrorOf("sizes \"other.sizes\" with depth = width if width"),
              StartsWith("bar.kb:5:3: expected <=, >= or ==, found 'extrude'; a catalogue reads"));
  EXPECT_THAT(
      ErrorOf("sizes \"bars.sizes\" with width = thickness"),
      StartsWith("bar.kb:4:3: two columns of the catalogue \"bars.sizes\" are the dimension 'thickness'"));
  EXPECT_THAT(ErrorOf("sizes \"broken.sizes\""), StartsWith("broken.sizes:1:10: expected 'columns'"));
}

}  // namespace
}  // namespace vss
