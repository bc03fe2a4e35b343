#include "vss/simulate/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vss/base/files.h"
#include "vss/simulate/random_scene.h"
#include "vss/simulate/simulate.h"

namespace vss {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class SceneFile : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  Result<LoadedScene> Read(const std::string& text) const {
    EXPECT_TRUE(WriteFileAtomically(folder_ / "scene.toml", "format = \"vss-scene/1\"\n" + text));
    return ReadScene(folder_ / "scene.toml");
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / "vss_scene_file_test";
};

std::vector<std::vector<std::uint8_t>> Pngs(const SimulatedScene& scene) {
  std::vector<std::vector<std::uint8_t>> pngs(scene.pictures.size());
  EXPECT_TRUE(RenderPictures(scene, 1, {}, [&](int i, const RenderedPicture& p) {
    pngs[std::size_t(i)] = EncodePng(p.image.view());
  }));
  return pngs;
}

TEST_F(SceneFile, WithPartsAloneHasARigAndLight) {
  const auto loaded = Read(R"(
[[part]]
kind = "box"
dimensions = { length = 1200, width = 800, height = 30 }
position = [2000, 1000]
yaw = 30

[[part]]
id = "knee"
kind = "bracket"
on = "p1"
position = [2000, 1000]
rests = "flat"
)");
  ASSERT_TRUE(loaded) << loaded.error().message;
  const SimulatedScene& scene = loaded->scene;
  ASSERT_EQ(scene.parts.size(), 2U);
  EXPECT_EQ(scene.parts[1].id, "knee");
  EXPECT_EQ(scene.parts[1].stands_on, "p1");
  EXPECT_NEAR(scene.parts[1].object.placement[2], 30, 1e-9);
  EXPECT_EQ(
      scene.parts[1].object.model->resting_poses()[std::size_t(scene.parts[1].object.resting_pose)].name,
      "flat");
  EXPECT_EQ(scene.cameras.size(), 4U);
  EXPECT_EQ(scene.pictures.size(), 32U);
  EXPECT_FALSE(scene.lamps.empty());
}

TEST_F(SceneFile, WrittenReadsBackToTheSameBytes) {
  const auto drawn = Read("[random]\nseed = 4\nparts = 6\nclutter = true\nstops = [1, 1]\nsize = 96\n");
  ASSERT_TRUE(drawn) << drawn.error().message;
  auto out = OutputFolder::Open(folder_ / "survey");
  ASSERT_TRUE(out);
  ASSERT_TRUE(AddSimulatedSurvey(drawn->scene, 1, {}, *out));
  ASSERT_TRUE(out->Commit());
  const auto again = ReadScene(folder_ / "survey" / "scene.toml");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(SceneToToml(again->scene), SceneToToml(drawn->scene));
  EXPECT_EQ(Pngs(again->scene), Pngs(drawn->scene));
}

TEST_F(SceneFile, MakesPicturesOfAnObjectThatTheUserWrote) {
  ASSERT_TRUE(WriteFileAtomically(folder_ / "wedge.kb", R"(object wedge "Wedge" {
  dimension length: 50 mm .. 2 m
  dimension width: 50 mm .. 2 m
  dimension height: 20 mm .. 1 m
  extrude y from -width/2 to width/2 {
    outline {
      a (-length/2, 0 mm)
      b ( length/2, 0 mm)
      c (-length/2, height)
    }
  }
  rests base
  stands on ground
}
)"));
  const auto loaded = Read(R"(knowledge = ["box", "wedge.kb"]
[rig]
stops_x = [0]
stops_y = [0]
size = [64, 64]
focal_length = 60
[[part]]
kind = "wedge"
dimensions = { length = 700, width = 300, height = 200 }
position = [0, 0]
)");
  ASSERT_TRUE(loaded) << loaded.error().message;
  auto out = OutputFolder::Open(folder_ / "survey");
  ASSERT_TRUE(AddSimulatedSurvey(loaded->scene, 1, {}, *out));
  ASSERT_TRUE(out->Commit());
  const auto survey = ReadSurvey(folder_ / "survey");
  ASSERT_TRUE(survey) << survey.error().message;
  const auto knowledge = LoadKnowledge(survey->knowledge, survey->folder);
  ASSERT_TRUE(knowledge) << knowledge.error().message;
  EXPECT_NE(knowledge->Find("wedge"), nullptr);
  EXPECT_EQ(knowledge->objects.size(), 2U);
}

TEST_F(SceneFile, KeepsThatThereAreNoShadows) {
  const auto with = Read("[[part]]\nkind = \"box\"\nposition = [0, 0]\n");
  ASSERT_TRUE(with) << with.error().message;
  EXPECT_TRUE(with->scene.shadows);
  const auto without = Read("[light]\nshadows = false\n[[part]]\nkind = \"box\"\nposition = [0, 0]\n");
  ASSERT_TRUE(without) << without.error().message;
  EXPECT_FALSE(without->scene.shadows);
  EXPECT_THAT(SceneToToml(without->scene), HasSubstr("shadows = false"));
}

struct Mistake {
  const char* text;
  const char* says;
};
class SceneFileMistake : public SceneFile, public testing::WithParamInterface<Mistake> {};

TEST_P(SceneFileMistake, IsSaidWithItsLineAndTheRemedy) {
  const auto loaded = Read(GetParam().text);
  ASSERT_FALSE(loaded);
  EXPECT_THAT(loaded.error().message, HasSubstr(GetParam().says));
}

INSTANTIATE_TEST_SUITE_P(
    All, SceneFileMistake,
    testing::Values(
        Mistake{"parts = 3\n",
                "scene.toml:2: `parts` is no entry of a scene file at this place; there are: format"},
        Mistake{
            "\n[[part]]\nkind = \"bix\"\n",
            "scene.toml:4: `part[1].kind` is \"bix\", which the knowledge base lacks; it has: angle, box"},
        Mistake{"[[part]]\nkind = \"box\"\n",
                "`position` is missing in part[1]; add a line like: position = [1000.0, 500.0]"},
        Mistake{"[[part]]\nkind = \"box\"\ndimensions = { depth = 3 }\nposition = [0, 0]\n",
                "is no dimension of a box; there are: length, width, height"},
        Mistake{"[[part]]\nkind = \"box\"\ndimensions = { length = 100, width = 300, height = 1 }\nposition "
                "= [0, 0]\n",
                "scene.toml:2: `part[1]` is impossible"},
        Mistake{"[[part]]\nkind = \"box\"\nposition = [0, 0]\nrests = \"head\"\n",
                "no way for a box to rest; there are: base"},
        Mistake{"[[part]]\nkind = \"box\"\nposition = [0, 0]\non = \"p7\"\n",
                "which no part before this one is called"},
        Mistake{"[rig]\nheight = -3\n", "scene.toml:3: `rig.height` must be a number from 10 to 100000"},
        Mistake{"[[picture]]\ncamera = \"cam1\"\n", "needs a camera"},
        Mistake{"[[camera]]\nfile = \"nowhere.toml\"\n", "nowhere.toml"},
        Mistake{"[random]\nlayout = \"mixed\"\n", "`seed` is missing"},
        Mistake{"[random]\nseed = 1\nlayout = \"full\"\n", "there is no layout \"full\""},
        Mistake{"[[line]]\nfrom = [0, 0]\nto = [0, 0]\n", "a line without length"},
        Mistake{"[[cable]]\npoints = [[0, 0]]\n", "needs at least 2 points"},
        Mistake{"[[offcut]]\noutline = [[0, 0], [0, 90], [90, 0]]\n", "counter-clockwise"}));

}  // namespace
}  // namespace vss
