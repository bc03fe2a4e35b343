// The main job on the sample, as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "program.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kSample = fs::path(VSS_SOURCE_DIR) / "examples" / "sample";

// Every file of a folder by its relative name; the report left out, which holds the times of the steps.
std::map<std::string, std::string> FilesOf(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().filename() != "report.html")
      files[fs::relative(entry.path(), folder).string()] = ReadAll(entry.path());
  return files;
}

// The sample is surveyed once with two threads; the tests look at what came of it.
class SampleSurvey : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = new Scratch;
    outcome_ = new Outcome(RunProgram(*scratch_, {"survey", kSample.string(), "-o", Out().string(),
                                                  "--threads", "2", "--progress", "plain"}));
  }
  static void TearDownTestSuite() {
    delete outcome_;
    delete scratch_;
  }
  static fs::path Out() { return *scratch_ / "out"; }
  static Scratch* scratch_;
  static Outcome* outcome_;
};
Scratch* SampleSurvey::scratch_ = nullptr;
Outcome* SampleSurvey::outcome_ = nullptr;

TEST_F(SampleSurvey, FindsEveryPartAndNothingElseWithinTwoMillimetres) {
  ASSERT_EQ(outcome_->exit_code, 0) << outcome_->err;
  const Outcome compared = RunProgram(
      *scratch_, {"compare", (kSample / "truth.json").string(), (Out() / "product.json").string(), "--json"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const auto score = nlohmann::json::parse(compared.out);
  EXPECT_EQ(score["parts"], 7);
  EXPECT_EQ(score["found"], 7) << compared.out;
  EXPECT_EQ(score["invented"], 0) << compared.out;
  EXPECT_LE(score["mean_mm"].get<double>(), 2.0);
}

TEST_F(SampleSurvey, WritesTheContractsProduct) {
  ASSERT_EQ(outcome_->exit_code, 0) << outcome_->err;
  const auto product = nlohmann::json::parse(ReadAll(Out() / "product.json"));
  EXPECT_EQ(product["format"], "vss-product/1");
  EXPECT_EQ(product["units"], "mm");
  EXPECT_EQ(product["survey"], "lab 1");
  std::set<std::string> ids;
  for (const auto& part : product["parts"]) {
    ids.insert(part["id"].get<std::string>());
    EXPECT_EQ(part["pose"]["rotation"].size(), 3u);
    EXPECT_EQ(part["vertices"].size(), part["vertex_sigma"].size());
    EXPECT_FALSE(part["images"].empty());
    for (const auto& [name, d] : part["dimensions"].items()) {
      EXPECT_TRUE(d["value"].is_number()) << name;
      EXPECT_TRUE(d["observable"].is_boolean()) << name;
      if (!d["observable"].get<bool>())
        EXPECT_TRUE(d.contains("origin")) << name;
      else
        EXPECT_GT(d["sigma"].get<double>(), 0) << name;
    }
  }
  EXPECT_EQ(ids.size(), product["parts"].size());
}

TEST_F(SampleSurvey, WritesWhatASurveyorChecksItBy) {
  const auto product = nlohmann::json::parse(ReadAll(Out() / "product.json"));
  const auto& checks = product["checks"];
  EXPECT_GT(checks["leave_one_out"].size(), 3u);
  EXPECT_GT(checks["cameras"].size(), 0u);
  EXPECT_EQ(checks["scale"]["from"], "gantry");
  for (const auto& part : product["parts"]) {
    EXPECT_GT(part["contours"].size(), 2u) << part["id"];
    for (const auto& contour : part["contours"])
      EXPECT_THAT(contour["lies"], testing::AnyOf("free", "contact", "round", "limb")) << part["id"];
    EXPECT_TRUE(part.contains("covariance")) << part["id"];
    EXPECT_TRUE(part["observability"]["observable"].contains("yaw")) << part["id"];
  }
  EXPECT_FALSE(product.contains("nominal"));
  EXPECT_THAT(ReadAll(Out() / "report.html"), HasSubstr("<h2>Checks</h2>"));
}

TEST_F(SampleSurvey, DoesNotDeviateFromItself) {
  const std::string product = (Out() / "product.json").string();
  const Outcome run = RunProgram(*scratch_, {"deviation", product, product, "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto comparison = nlohmann::json::parse(run.out);
  EXPECT_EQ(comparison["parts"].size(), 7u);
  EXPECT_TRUE(comparison["missing"].empty());
  for (const auto& part : comparison["parts"]) {
    EXPECT_EQ(part["designed"], part["part"]);
    for (const auto& [name, d] : part["deviations"].items()) EXPECT_EQ(d["significant"], false) << name;
  }
}

TEST_F(SampleSurvey, WritesAReportThatNeedsNothingElseAndAnOverlayOfEveryPicture) {
  ASSERT_EQ(outcome_->exit_code, 0) << outcome_->err;
  const std::string report = ReadAll(Out() / "report.html");
  EXPECT_THAT(report, HasSubstr("part-7"));
  EXPECT_THAT(report, HasSubstr("images/x06000_y02400_cam4.png"));
  EXPECT_THAT(report, HasSubstr("</html>"));
  EXPECT_EQ(report.find("src=\"http"), std::string::npos);
  EXPECT_EQ(report.find("href=\"http"), std::string::npos);
  EXPECT_LT(report.size(), 8u << 20);
  int overlays = 0;
  for (const auto& entry : fs::directory_iterator(Out() / "overlays"))
    overlays += entry.path().extension() == ".svg";
  EXPECT_EQ(overlays, 32);
}

TEST_F(SampleSurvey, TellsOfEveryStepAndOfWhatItWrote) {
  ASSERT_EQ(outcome_->exit_code, 0) << outcome_->err;
  EXPECT_THAT(outcome_->err, HasSubstr("lines: 32 of 32"));
  EXPECT_THAT(outcome_->out, HasSubstr("part-7"));
  EXPECT_THAT(outcome_->out, HasSubstr("identify"));
  EXPECT_THAT(outcome_->out, HasSubstr("report.html"));
}

TEST_F(SampleSurvey, GivesTheSameBytesWithOneThread) {
  ASSERT_EQ(outcome_->exit_code, 0) << outcome_->err;
  const fs::path one = *scratch_ / "one";
  const Outcome again = RunProgram(*scratch_, {"survey", kSample.string(), "-o", one.string(), "--threads",
                                               "1", "--json", "--progress", "none"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(again.err, "");
  EXPECT_EQ(nlohmann::json::parse(again.out)["parts"], 7);
  EXPECT_EQ(FilesOf(Out()), FilesOf(one));
}

TEST_F(SampleSurvey, LeavesNoHalfWrittenFileBehind) {
  for (const auto& entry : fs::recursive_directory_iterator(Out()))
    EXPECT_NE(entry.path().extension(), ".part") << entry.path();
}

TEST(Program, WritesLineImagesOfPicturesWithAndWithoutACamera) {
  const Scratch scratch;
  const std::string picture = (kSample / "images" / "x02000_y00600_cam1.png").string();
  const Outcome plain = RunProgram(scratch, {"lines", picture, "-o", (scratch / "plain").string()});
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  const auto lines = nlohmann::json::parse(ReadAll(scratch / "plain/x02000_y00600_cam1.lines.json"));
  EXPECT_EQ(lines["format"], "vss-lines/1");
  EXPECT_EQ(lines["image"], "x02000_y00600_cam1.png");
  EXPECT_EQ(lines["width"], 512);
  EXPECT_GT(lines["segments"].size(), 10u);
  EXPECT_FALSE(lines["segments"][0].contains("ideal_start"));
  EXPECT_THAT(ReadAll(scratch / "plain/x02000_y00600_cam1.svg"), HasSubstr("data:image/jpeg;base64,"));
  const Outcome known = RunProgram(scratch, {"lines", picture, "-o", (scratch / "known").string(), "--camera",
                                             (kSample / "cameras/cam1.toml").string()});
  ASSERT_EQ(known.exit_code, 0) << known.err;
  EXPECT_TRUE(
      nlohmann::json::parse(ReadAll(scratch / "known/x02000_y00600_cam1.lines.json"))["segments"][0].contains(
          "ideal_start"));
}

TEST(Program, TakesParametersFromTheCommandLine) {
  const Scratch scratch;
  const std::string picture = (kSample / "images" / "x02000_y00600_cam1.png").string();
  const auto count = [&](const std::string& setting) {
    const Outcome run =
        RunProgram(scratch, {"lines", picture, "-o", (scratch / "out").string(), "--json", "--set", setting});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return nlohmann::json::parse(run.out)[0]["segments"].get<int>();
  };
  EXPECT_GT(count("lines.min_length_px=10"), count("lines.min_length_px=80"));
}

TEST(Program, ListsEveryParameterWithDefaultRangeAndSentence) {
  const Scratch scratch;
  const Outcome run = RunProgram(scratch, {"parameters", "--json"});
  ASSERT_EQ(run.exit_code, 0);
  std::set<std::string> names;
  for (const auto& p : nlohmann::json::parse(run.out)) {
    EXPECT_TRUE(names.insert(p["name"].get<std::string>()).second) << p["name"] << " is declared twice";
    EXPECT_LE(p["min"].get<double>(), p["default"].get<double>()) << p["name"];
    EXPECT_LE(p["default"].get<double>(), p["max"].get<double>()) << p["name"];
    EXPECT_FALSE(p["help"].get<std::string>().empty()) << p["name"];
  }
  EXPECT_TRUE(names.count("lines.min_length_px"));
}

TEST(Program, HasHelpForEveryCommandAndAVersion) {
  const Scratch scratch;
  EXPECT_EQ(RunProgram(scratch, {"--version"}).exit_code, 0);
  EXPECT_EQ(RunProgram(scratch, {"--help"}).exit_code, 0);
  for (const std::string command : {"survey", "lines", "parameters", "compare", "deviation", "knowledge"}) {
    const Outcome help = RunProgram(scratch, {command, "--help"});
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_GT(help.out.size(), 100u) << command;
  }
}

TEST(Program, SaysTwoForWrongUsage) {
  const Scratch scratch;
  const std::string out = (scratch / "out").string();
  EXPECT_EQ(RunProgram(scratch, {}).exit_code, 2);
  EXPECT_EQ(RunProgram(scratch, {"surwey"}).exit_code, 2);
  EXPECT_EQ(RunProgram(scratch, {"survey", kSample.string()}).exit_code, 2);
  EXPECT_EQ(RunProgram(scratch, {"survey", kSample.string(), "-o", out, "--threads", "-1"}).exit_code, 2);
  const Outcome unknown =
      RunProgram(scratch, {"survey", kSample.string(), "-o", out, "--set", "lines.min_lenght_px=3"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean lines.min_length_px?"));
  EXPECT_EQ(RunProgram(scratch, {"survey", kSample.string(), "-o", out, "--set", "lines.min_length_px=long"})
                .exit_code,
            2);
  EXPECT_EQ(RunProgram(scratch, {"survey", kSample.string(), "-o", out, "--set", "lines.min_length_px=-5"})
                .exit_code,
            2);
  EXPECT_FALSE(fs::exists(out));
}

TEST(Identify, FindsABoxInASinglePicture) {
  const Scratch scratch;
  const Outcome outcome = RunProgram(
      scratch, {"identify", (kSample / "images" / "x04000_y02400_cam3.png").string(), "--camera",
                (kSample / "cameras" / "cam3.toml").string(), "--gantry", "4000", "2400", "0", "--knowledge", "box", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto product = nlohmann::json::parse(outcome.out);
  const auto truth = nlohmann::json::parse(ReadAll(kSample / "truth.json"))["parts"][1];  // the tall box
  bool found = false;
  for (const auto& part : product["parts"]) {
    if (part["kind"] != "box") continue;
    double worst = 0;
    for (const char* name : {"length", "width", "height"})
      worst = std::max(worst, std::abs(part["dimensions"][name]["value"].get<double>() -
                                       truth["dims"][name].get<double>()));
    found |= worst < 10 && std::hypot(part["pose"]["position"][0].get<double>() - truth["pose"]["x"].get<double>(),
                                      part["pose"]["position"][1].get<double>() - truth["pose"]["y"].get<double>()) < 10;
  }
  EXPECT_TRUE(found) << outcome.out;
}

}  // namespace
}  // namespace vss
