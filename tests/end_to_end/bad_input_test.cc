// Every kind of bad input: one sentence with the place and a remedy, exit code 1, nothing half-written.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "program.h"
#include "vss/image/grey_image.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kSample = fs::path(VSS_SOURCE_DIR) / "examples" / "sample";

// A survey of two of the sample's pictures.
void MakeSmallSurvey(const fs::path& folder) {
  fs::create_directories(folder / "images");
  fs::copy_file(kSample / "cameras/cam1.toml", folder / "cam1.toml");
  for (const std::string name : {"x02000_y00600_cam1.png", "x04000_y00600_cam1.png"})
    fs::copy_file(kSample / "images" / name, folder / "images" / name);
  WriteAll(folder / "survey.toml",
           "format = \"vss-survey/1\"\n"                 // 1
           "name = \"small\"\n"                          // 2
           "cameras = [\"cam1.toml\"]\n"                 // 3
           "knowledge = [\"box\", \"my.kb\"]\n"          // 4
           "\n"                                          // 5
           "[[image]]\n"                                 // 6
           "file = \"images/x02000_y00600_cam1.png\"\n"  // 7
           "camera = \"cam1\"\n"                         // 8
           "gantry = [2000.0, 600.0, 0.0]\n"             // 9
           "\n"                                          // 10
           "[[image]]\n"                                 // 11
           "file = \"images/x04000_y00600_cam1.png\"\n"  // 12
           "camera = \"cam1\"\n"                         // 13
           "gantry = [4000.0, 600.0, 0.0]\n");           // 14
  WriteAll(folder / "my.kb",
           "object slab {\n  dimension w: 10 mm .. 1 m usual 40 mm\n  extrude x from -50 mm to 50 mm {\n    "
           "outline { a (-w/2, 0 mm) b (w/2, 0 mm) c (w/2, 9 mm) d (-w/2, 9 mm) }\n  }\n  rests base\n  "
           "stands on ground\n}\n");
}

void Replace(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = ReadAll(file);
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  WriteAll(file, text);
}

struct BadInput {
  const char* name;
  std::function<void(const fs::path& survey)> spoil;
  const char* place;   // file, and line where there is one
  const char* remedy;  // words of the sentence
};
void PrintTo(const BadInput& bad, std::ostream* os) { *os << bad.name; }

std::function<void(const fs::path&)> InSurvey(const std::string& from, const std::string& to) {
  return [=](const fs::path& survey) { Replace(survey / "survey.toml", from, to); };
}
std::function<void(const fs::path&)> InKnowledge(const std::string& from, const std::string& to) {
  return [=](const fs::path& survey) { Replace(survey / "my.kb", from, to); };
}

constexpr char kFirst[] = "images/x02000_y00600_cam1.png";

class BadInputTest : public testing::TestWithParam<BadInput> {};

TEST_P(BadInputTest, IsOneSentenceAndNothingIsWritten) {
  const Scratch scratch;
  MakeSmallSurvey(scratch / "survey");
  GetParam().spoil(scratch / "survey");
  const Outcome run = RunProgram(scratch, {"survey", (scratch / "survey").string(), "-o",
                                           (scratch / "out/deeper").string(), "--progress", "none"});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_THAT(run.err, HasSubstr(GetParam().place));
  EXPECT_THAT(run.err, HasSubstr(GetParam().remedy));
  EXPECT_EQ(run.out, "");
  EXPECT_FALSE(fs::exists(scratch / "out"));
}

INSTANTIATE_TEST_SUITE_P(
    All, BadInputTest,
    testing::Values(
        BadInput{"PictureMissing", [](const fs::path& s) { fs::remove(s / kFirst); }, "survey.toml:7",
                 "check the name"},
        BadInput{"PictureTruncated",
                 [](const fs::path& s) { fs::resize_file(s / kFirst, fs::file_size(s / kFirst) / 2); },
                 kFirst, "copy the file again"},
        BadInput{"PictureEmpty", [](const fs::path& s) { WriteAll(s / kFirst, ""); }, kFirst,
                 "the file is empty"},
        BadInput{"PictureOfAnotherSize",
                 [](const fs::path& s) { ASSERT_TRUE(WritePng(s / kFirst, GreyImage(512, 511, 8).view())); },
                 "survey.toml:7", "name the camera that took it"},
        BadInput{"PictureAllBlack",
                 [](const fs::path& s) { ASSERT_TRUE(WritePng(s / kFirst, GreyImage(512, 512, 8).view())); },
                 kFirst, "all black"},
        BadInput{"NotAPicture", [](const fs::path& s) { WriteAll(s / kFirst, "# a text\n"); }, kFirst,
                 "not a picture"},
        BadInput{"PictureDamaged", [](const fs::path& s) { Replace(s / kFirst, "IDAT", "IDXX"); }, kFirst,
                 "copy the file again"},
        BadInput{"NoCameras", InSurvey("cameras = [\"cam1.toml\"]", "cameras = []"), "survey.toml:3",
                 "empty list"},
        BadInput{"CameraFileMissing", InSurvey("[\"cam1.toml\"]", "[\"cam9.toml\"]"), "survey.toml:3",
                 "correct the name"},
        BadInput{"UnknownCameraId", InSurvey("camera = \"cam1\"", "camera = \"cam7\""), "survey.toml:8",
                 "the cameras are: cam1"},
        BadInput{
            "RotationThatIsNone",
            [](const fs::path& s) { Replace(s / "cam1.toml", "rotation = [[-0.037", "rotation = [[-0.537"); },
            "cam1.toml:", "off orthonormal"},
        BadInput{"NotANumber", InSurvey("[2000.0, 600.0, 0.0]", "[2000.0, nan, 0.0]"), "survey.toml:9",
                 "not a finite number"},
        BadInput{"DuplicateId", InSurvey("[\"cam1.toml\"]", "[\"cam1.toml\", \"cam1.toml\"]"),
                 "survey.toml:3", "id of its own"},
        BadInput{"PictureTwice", InSurvey("x04000_y00600", "x02000_y00600"), "survey.toml:12", "twice"},
        BadInput{"WrongFormat", InSurvey("vss-survey/1", "vss-survey/2"), "survey.toml:1",
                 "\"vss-survey/1\" is needed"},
        BadInput{"NotToml",
                 InSurvey("name = ",
                          "name ="
                          " = "),
                 "survey.toml:2", "not valid TOML"},
        BadInput{"UnknownParameter", InSurvey("[[image]]", "[parameters]\n\"lines.length\" = 3\n[[image]]"),
                 "survey.toml:7", "did you mean"},
        BadInput{"KnowledgeMissing", InSurvey("my.kb", "your.kb"), "your.kb", ""},
        BadInput{"KnowledgeUnknownObject", InSurvey("\"box\"", "\"bax\""), "bax", ""},
        BadInput{"KnowledgeSyntax", InKnowledge("extrude x from", "extrude x form"), "my.kb:3:", "expected"},
        BadInput{"KnowledgeCycle", InKnowledge("  extrude", "  let a = b\n  let b = a\n  extrude"),
                 "my.kb:", ""},
        BadInput{"KnowledgeUnknownName", InKnowledge("c (w/2", "c (q/2"), "my.kb:4:", "q"},
        BadInput{"KnowledgeEmptyRange", InKnowledge("10 mm .. 1 m", "1 m .. 10 mm"), "my.kb:2:", "empty"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(BadInput, OutputFolderThatCannotBeWritten) {
  const Scratch scratch;
  MakeSmallSurvey(scratch / "survey");
  WriteAll(scratch / "file", "in the way");
  for (const std::string out : {"file", "file/below"}) {
    const Outcome run = RunProgram(scratch, {"survey", (scratch / "survey").string(), "-o",
                                             (scratch / out).string(), "--progress", "none"});
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.err, HasSubstr("name another with -o"));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
  EXPECT_EQ(ReadAll(scratch / "file"), "in the way");
}

TEST(BadInput, SmallSurveyIsSoundBeforeItIsSpoilt) {
  const Scratch scratch;
  MakeSmallSurvey(scratch / "survey");
  const Outcome run = RunProgram(scratch, {"survey", (scratch / "survey").string(), "-o",
                                           (scratch / "out").string(), "--progress", "none"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(scratch / "out/product.json"));
}

TEST(BadInput, ABadDesignOrKnownLengthIsOneSentenceAndNothingIsWritten) {
  const Scratch scratch;
  MakeSmallSurvey(scratch / "survey");
  const std::string design = (scratch / "design.toml").string();
  WriteAll(design, "format = \"vss-nominal/1\"\n[[part]]\nid = \"a\"\nkind = \"gear\"\n");
  const auto refused = [&](const std::vector<std::string>& more, int code, const std::string& said) {
    std::vector<std::string> arguments = {
        "survey", (scratch / "survey").string(), "-o", (scratch / "out").string(), "--progress", "none"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome run = RunProgram(scratch, arguments);
    EXPECT_EQ(run.exit_code, code) << run.err;
    EXPECT_THAT(run.err, HasSubstr(said));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_FALSE(fs::exists(scratch / "out"));
  };
  refused({"--nominal", design}, 1, design + ":4: ");
  refused({"--nominal", (scratch / "none.toml").string()}, 1, "none.toml");
  refused({"--known-length", "part-1.length"}, 2, "write PART.DIMENSION=MM");
  refused({"--known-length", "part-99.length=1200"}, 1, "there is no part-99");
}

TEST(BadInput, CtrlCStopsWithNothingWritten) {
  const Scratch scratch;
  const Outcome run = RunProgram(
      scratch, {"survey", kSample.string(), "-o", (scratch / "out").string(), "--progress", "plain"},
      "lines:");
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_THAT(run.err, HasSubstr("stopped before the end; nothing was written"));
  EXPECT_FALSE(fs::exists(scratch / "out"));
}

TEST(BadInput, LinesOfBadPicturesAreOneSentenceAndNothingIsWritten) {
  const Scratch scratch;
  const std::string good = (kSample / kFirst).string(), camera = (kSample / "cameras/cam1.toml").string();
  WriteAll(scratch / "empty.png", "");
  WriteAll(scratch / "text.png", "# a text\n");
  WriteAll(scratch / "cut.png", ReadAll(good).substr(0, 3000));
  WriteAll(scratch / "file", "in the way");
  ASSERT_TRUE(WritePng(scratch / "small.png", GreyImage(100, 100, 8).view()));
  ASSERT_TRUE(WritePng(scratch / "black.png", GreyImage(512, 512, 8).view()));
  fs::create_directories(scratch / "no-survey");
  struct Case {
    std::vector<std::string> arguments;
    const char *place, *remedy;
  };
  const auto file = [&](const char* name) { return (scratch / name).string(); };
  const Case cases[] = {
      {{file("none.png")}, "none.png", "check the name"},
      {{file("empty.png")}, "empty.png", "is needed"},
      {{file("text.png")}, "text.png", "not a picture"},
      {{good, file("cut.png")}, "cut.png", "copy the file again"},
      {{file("black.png")}, "black.png", "take it again"},
      {{file("small.png"), "--camera", camera}, "small.png", "name the camera that took it"},
      {{good, "--camera", file("none.toml")}, "none.toml", "check the name"},
      {{file("no-survey")}, "no-survey", "name the folder of a survey"}};
  for (const Case& c : cases) {
    std::vector<std::string> arguments{"lines", "-o", file("out"), "--progress", "none"};
    arguments.insert(arguments.end(), c.arguments.begin(), c.arguments.end());
    const Outcome run = RunProgram(scratch, arguments);
    EXPECT_EQ(run.exit_code, 1) << c.place;
    EXPECT_THAT(run.err, HasSubstr(c.place));
    EXPECT_THAT(run.err, HasSubstr(c.remedy));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_FALSE(fs::exists(scratch / "out")) << c.place;
  }
  const Outcome blocked = RunProgram(scratch, {"lines", good, "-o", file("file"), "--progress", "none"});
  EXPECT_EQ(blocked.exit_code, 1);
  EXPECT_THAT(blocked.err, HasSubstr("name another with -o"));
  EXPECT_EQ(ReadAll(scratch / "file"), "in the way");
}

TEST(BadInput, KnowledgeCheckNamesFileLineAndRemedy) {
  const Scratch scratch;
  MakeSmallSurvey(scratch / "survey");
  const std::string kb = (scratch / "survey/my.kb").string(), good = ReadAll(kb);
  EXPECT_EQ(RunProgram(scratch, {"knowledge", "check", kb}).exit_code, 0);
  struct Case {
    const char *from, *to, *place, *remedy;
  };
  const Case cases[] = {{"extrude x from", "extrude x form", "my.kb:3:", "expected 'from'"},
                        {"  extrude", "  let a = b\n  let b = a\n  extrude", "my.kb:", "run in a circle"},
                        {"c (w/2", "c (q/2", "my.kb:4:", "'q' is not known"},
                        {"10 mm .. 1 m", "1 m .. 10 mm", "my.kb:2:", "write the smaller end first"},
                        {"object slab", "\xc3\xa9 slab", "my.kb:1:", "plain ASCII"}};
  for (const Case& c : cases) {
    WriteAll(kb, good);
    Replace(kb, c.from, c.to);
    const Outcome run = RunProgram(scratch, {"knowledge", "check", kb});
    EXPECT_EQ(run.exit_code, 1) << c.place;
    EXPECT_THAT(run.err, HasSubstr(c.place));
    EXPECT_THAT(run.err, HasSubstr(c.remedy));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
  WriteAll(kb, "");
  EXPECT_THAT(RunProgram(scratch, {"knowledge", "check", kb}).err, HasSubstr("my.kb:1:"));
  fs::remove(kb);
  EXPECT_THAT(RunProgram(scratch, {"knowledge", "check", kb}).err, HasSubstr("check the name"));
}

TEST(BadInput, MachinesReadTheErrorToo) {
  const Scratch scratch;
  const Outcome run = RunProgram(
      scratch, {"survey", (scratch / "none").string(), "-o", (scratch / "out").string(), "--json"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, HasSubstr("\"exit_code\":1"));
  EXPECT_THAT(run.err, HasSubstr("there is no such survey"));
}

}  // namespace
}  // namespace vss
