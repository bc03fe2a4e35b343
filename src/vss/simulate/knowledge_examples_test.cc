// Objects that are described as text alone (examples/knowledge), and other ways to lie: simulated, surveyed,
// found.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <numeric>

#include "vss/product/compare.h"
#include "vss/simulate/scene_file.h"
#include "vss/simulate/simulate.h"
#include "vss/survey/run_survey.h"

namespace vss {
namespace {

namespace fs = std::filesystem;

// Two stops of four cameras, 512 x 512: one rig some 3 m above the floor, one lower and more tilted, which
// sees more of the sides.
const char* const kHighRig = R"([rig]
stops_x = [700, 1500]
stops_y = [800]
[[lamp]]
position = [900, 700, 3000]
radius = 150
power = 0.6
[[lamp]]
position = [-900, -500, 3000]
radius = 150
power = 0.5
)";
const char* const kLowRig = R"([rig]
height = 1900
out = 950
tilt = 30
stops_x = [900, 1500]
stops_y = [800]
[[lamp]]
position = [900, 700, 2500]
radius = 150
power = 0.4
[[lamp]]
position = [-900, -500, 2500]
radius = 150
power = 0.35
)";

struct Surveyed {
  std::vector<TruePart> truth;
  Product product;
  KnowledgeBase knowledge;
  Comparison comparison;

  const Part* PartOf(const std::string& true_id) const {
    for (std::size_t i = 0; i < truth.size(); ++i)
      if (truth[i].id == true_id && comparison.parts[i].part >= 0)
        return &product.parts[std::size_t(comparison.parts[i].part)];
    return nullptr;
  }
};

class Examples : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  // Renders the parts and surveys the pictures, as `vss simulate` and `vss survey` do. `known`: the objects
  // that the survey knows; left out: those of the scene.
  Result<Surveyed> Survey(const std::string& rig, const std::string& knowledge, const std::string& parts,
                          const std::vector<std::string>& known = {}) const {
    std::ofstream(folder_ / "scene.toml")
        << "format = \"vss-scene/1\"\nname = \"example\"\nseed = 4\nknowledge = " << knowledge << "\n"
        << rig << parts;
    VSS_ASSIGN(const LoadedScene loaded, ReadScene(folder_ / "scene.toml"));
    VSS_ASSIGN(OutputFolder out, OutputFolder::Open(folder_ / "survey"));
    const Progress quiet;
    VSS_ASSIGN(const auto seen_px, AddSimulatedSurvey(loaded.scene, 2, quiet, out));
    VSS_RETURN_IF_ERROR(out.Commit());
    VSS_ASSIGN(auto survey, ReadSurvey(folder_ / "survey"));
    if (!known.empty()) survey.knowledge = known;
    VSS_ASSIGN(SurveyOptions options, OptionsOf(survey));
    options.threads = 2;
    VSS_ASSIGN(SurveyOutcome outcome, RunSurvey(survey, options, quiet));
    Surveyed result{TruthOf(loaded.scene), std::move(outcome.product), std::move(outcome.knowledge), {}};
    result.comparison = CompareWithTruth(result.truth, result.product);
    return result;
  }

  // A part of the scene on the ground; `position` in mm, yaw in degrees. `more`: further lines.
  static std::string PartText(const std::string& id, const std::string& kind, const std::string& dimensions,
                              const std::string& position, double yaw_deg, const std::string& more = "") {
    return fmt::format(
        "[[part]]\nid = \"{}\"\nkind = \"{}\"\ndimensions = {{ {} }}\nposition = [{}]\nyaw = {}\n"
        "albedo = 0.5\n{}\n",
        id, kind, dimensions, position, yaw_deg, more);
  }

  static std::string Example(const std::string& name) {
    return "\"" + (fs::path(VSS_SOURCE_DIR) / "examples" / "knowledge" / name).string() + "\"";
  }

  // Every part found, each vertex and rim within 1 mm in the mean, and nothing else.
  static void ExpectAllFound(const Surveyed& s) {
    EXPECT_TRUE(s.comparison.invented.empty());
    for (const PartComparison& p : s.comparison.parts) {
      const TruePart& truth = s.truth[std::size_t(p.truth)];
      ASSERT_GE(p.part, 0) << truth.id << " (" << truth.kind << ") is not found";
      const double mean =
          std::accumulate(p.errors_mm.begin(), p.errors_mm.end(), 0.0) / double(p.errors_mm.size());
      EXPECT_LT(mean, 1) << truth.id;
      for (const auto& d : p.dimensions) EXPECT_LT(std::abs(d.error_mm), 1) << truth.id << " " << d.name;
      RecordProperty(truth.id + "_mean_mm", fmt::format("{:.3f}", mean));
    }
  }

  fs::path folder_ = fs::temp_directory_path() / fmt::format("vss_examples_{}", ::getpid());
};

TEST_F(Examples, AnUShapedTroughIsFoundFromItsTextAlone) {
  const auto s =
      Survey(kLowRig, "[\"box\", " + Example("trough.kb") + "]",
             PartText("trough", "trough", "length = 700, bottom = 220, top = 380, height = 160, wall = 25",
                      "1050, 950", 20) +
                 PartText("plate", "box", "length = 400, width = 250, height = 40", "1400, 500", -35));
  ASSERT_TRUE(s) << s.error().message;
  ExpectAllFound(*s);
}

TEST_F(Examples, ABulbFlatIsFoundFromItsTextAloneAndHasItsSize) {
  const auto s =
      Survey(kLowRig, "[\"box\", " + Example("bulb_flat.kb") + "]",
             PartText("bulb", "bulb_flat", "length = 900, height = 430, thickness = 20, bulb = 62, nose = 40",
                      "1200, 850", 65) +
                 PartText("block", "box", "length = 400, width = 300, height = 60", "800, 500", 15));
  ASSERT_TRUE(s) << s.error().message;
  ExpectAllFound(*s);
  ASSERT_TRUE(s->PartOf("bulb"));
  EXPECT_EQ(s->PartOf("bulb")->designation, "HP 430x20");
  EXPECT_EQ(s->PartOf("bulb")->standard, "EN 10067");
  EXPECT_EQ(s->PartOf("block")->designation, "plate 60");
}

TEST_F(Examples, APlateWithANotchIsFoundFromItsTextAlone) {
  const auto s = Survey(
      kHighRig, "[\"box\", " + Example("notched_plate.kb") + "]",
      PartText(
          "notched", "notched_plate",
          "length = 1000, width = 600, height = 40, notch_length = 260, notch_depth = 160, notch_x = -120",
          "1000, 850", 12) +
          PartText("plain", "box", "length = 500, width = 350, height = 30", "1850, 700", 70));
  ASSERT_TRUE(s) << s.error().message;
  ExpectAllFound(*s);
}

TEST_F(Examples, ThePiecesOfASlantedCutAreFoundFromTheirTextAloneWhicheverWayTheyAreCut) {
  const auto s =
      Survey(kHighRig, "[\"box\", " + Example("slanted_plate.kb") + "]",
             PartText("left", "slanted_plate", "length = 900, width = 450, height = 60, slant = 260",
                      "800, 850", 12) +
                 PartText("right", "slanted_plate", "length = 700, width = 350, height = 50, slant = 180",
                          "1700, 800", 70, R"(features = ["mirrored"])"));
  ASSERT_TRUE(s) << s.error().message;
  ExpectAllFound(*s);
}

TEST_F(Examples, StiffenersWithAndWithoutSnipesAreToldApart) {
  const auto s = Survey(
      kLowRig, "[" + Example("stiffener.kb") + "]",
      PartText("sniped", "stiffener", "length = 800, height = 240, thickness = 40, snipe = 110", "1100, 1050",
               10, R"(features = ["sniped"])") +
          PartText("plain", "stiffener", "length = 700, height = 180, thickness = 40", "1300, 550", -15));
  ASSERT_TRUE(s) << s.error().message;
  ExpectAllFound(*s);
  EXPECT_THAT(s->PartOf("sniped")->features, testing::ElementsAre("sniped"));
  EXPECT_THAT(s->PartOf("plain")->features, testing::ElementsAre());
}

TEST_F(Examples, APartOfAKindThatIsNotKnownIsReportedUnknown) {
  const auto s =
      Survey(kHighRig, "[\"box\", \"tee\"]",
             PartText("tee", "tee", "length = 800, width = 220, height = 300, web = 20, flange = 20",
                      "1000, 950", 20) +
                 PartText("plate", "box", "length = 400, width = 250, height = 40", "1500, 500", -35),
             {"box"});
  ASSERT_TRUE(s) << s.error().message;
  ASSERT_EQ(s->product.parts.size(), 1u);
  EXPECT_NE(s->PartOf("plate"), nullptr);
  ASSERT_FALSE(s->product.unknown.empty());
  EXPECT_LT((s->product.unknown[0].center.head<2>() - Eigen::Vector2d(1000, 950)).norm(), 200);
}

}  // namespace
}  // namespace vss
