#include "routes.h"

#include <algorithm>
#include <thread>

#include "commands.h"
#include "live_fit.h"
#include "routes_fixture.h"
#include "vss/export/export.h"
#include "vss/product/make_part.h"

namespace vss::station {
namespace {

TEST_F(RoutesTest, ShowsPicturesByNumberOnly) {
  std::string answer;
  EXPECT_EQ(Ask(Get("/api/pictures/0/image", kHeaders), &answer), 200);
  EXPECT_NE(answer.find("image/png"), answer.npos);
  EXPECT_EQ(Ask(Get("/api/pictures/0/thumb", kHeaders), &answer), 200);
  EXPECT_NE(answer.find("image/jpeg"), answer.npos);
  EXPECT_EQ(
      Ask(Get("/api/pictures/" + std::to_string(workspace_->image_files().size()) + "/image", kHeaders)),
      404);
}

TEST_F(RoutesTest, SaysWhichFieldOfACommandIsWrong) {
  std::string answer;
  EXPECT_EQ(Command({{"do", "remove_line"}, {"image", 4294967296}, {"line", 0}}, &answer), 400);
  EXPECT_NE(answer.find("image is out of range"), answer.npos) << answer;
  EXPECT_EQ(Command({{"do", "remove_line"}, {"image", 0}, {"line", 0.5}}, &answer), 400);
  EXPECT_NE(answer.find("line must be a whole number"), answer.npos) << answer;
}

TEST_F(RoutesTest, RefusesALineThatLeavesItsPicture) {
  EXPECT_EQ(Command({{"do", "draw_line"}, {"image", 0}, {"start", {10, 10}}, {"end", {1e5, 10}}}), 400);
  EXPECT_EQ(Command({{"do", "extend_line"}, {"image", 0}, {"line", 0}, {"to", {1e300, 1e300}}}), 400);
}

TEST_F(RoutesTest, ExportsAsTheCommandLineDoes) {
  PlacedObject object;
  object.model = workspace_->knowledge().Find("holed_plate");
  object.dimensions_mm = {600, 400, 20, 120, 50, 0};
  object.placement.head<3>() = Eigen::Vector3d(2000, 1000, 0);
  StationPart plate;
  plate.part.id = "part-1";
  plate.part.kind = "holed_plate";
  for (std::size_t i = 0; i < object.dimensions_mm.size(); ++i)
    plate.part.dimensions.push_back(
        {object.model->dimensions()[i].name, object.dimensions_mm[i], 0.2, true, ""});
  SetGeometry(object, plate.part);
  ASSERT_TRUE(workspace_->store().Apply(
      "test", "add", {{"part", "part-1", PartToJson(plate, workspace_->image_files()), {}}}));
  const Product product = workspace_->ProductNow();
  std::vector<std::string> formats = {"glb", "csv"};
  if (CanWriteStep()) formats.push_back("step");
  const auto files = ExportProduct(product, workspace_->knowledge(), formats);
  ASSERT_TRUE(files) << files.error().message;
  std::string answer;
  for (const auto& file : *files) {
    EXPECT_EQ(Ask(Get("/api/export/" + file.name, kHeaders), &answer), 200) << file.name;
    EXPECT_NE(answer.find("filename=\"" + file.name + "\""), answer.npos);
    EXPECT_NE(answer.find(file.content), answer.npos) << file.name;
  }
  if (!CanWriteStep()) {
    EXPECT_EQ(Ask(Get("/api/export/workpiece.step", kHeaders), &answer), 400);
    EXPECT_NE(answer.find("not part of this build"), answer.npos);
  }
  EXPECT_EQ(Ask(Get("/api/export/workpiece.dxf", kHeaders)), 404);
}

// A part as the survey would have left it, at the place of `object`.
StationPart PartAt(const PlacedObject& object, const std::string& id) {
  StationPart part;
  part.part.id = id;
  part.part.kind = object.model->kind();
  for (std::size_t i = 0; i < object.dimensions_mm.size(); ++i)
    part.part.dimensions.push_back(
        {object.model->dimensions()[i].name, object.dimensions_mm[i], 0.2, true, ""});
  SetGeometry(object, part.part);
  return part;
}

TEST_F(RoutesTest, CutsAPartWhereTheOperatorPointsAndKeepsItsSize) {
  const View view = workspace_->Views()[0];
  PlacedObject beam;
  beam.model = workspace_->knowledge().Find("i_beam");
  beam.dimensions_mm =
      beam.model->UsualDimensions(std::vector<std::optional<double>>(beam.model->dimensions().size()));
  beam.dimensions_mm[0] = 1000;
  const Eigen::Vector3d down = view.RayOfIdeal({256, 256});
  beam.placement.head<3>() = view.center_in_world - view.center_in_world.z() / down.z() * down;
  beam.placement[3] = 0.4;
  StationPart part = PartAt(beam, "part-1");
  part.part.designation = "IPE 200";
  part.part.standard = "EN 10365";
  ASSERT_TRUE(workspace_->store().Apply(
      "test", "add", {{"part", "part-1", PartToJson(part, workspace_->image_files()), {}}}));
  // 300 mm from its beginning, on its top.
  const double top = std::max_element(part.part.vertices.begin(), part.part.vertices.end(),
                                      [](const auto& a, const auto& b) { return a.z() < b.z(); })
                         ->z();
  const Eigen::Vector3d at = part.part.world_from_part * Eigen::Vector3d(-200, 0, top);
  const auto img = view.ProjectInside(at);
  ASSERT_TRUE(img);
  std::string answer;
  const Json question = {{"part", "part-1"}, {"image", 0}, {"at", {img->x(), img->y()}}};
  ASSERT_EQ(Ask(Post("/api/cut", question.dump(), kHeaders + "Content-Type: application/json\r\n"), &answer),
            200)
      << answer;
  const Json cut = Json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  EXPECT_NEAR(cut["share"].get<double>(), 0.3, 1e-3);
  EXPECT_GE(cut["pieces"].size(), 4u) << "the outline of the section is shown";
  ASSERT_EQ(Command({{"do", "split_part"}, {"part", "part-1"}, {"share", cut["share"]}}, &answer), 200)
      << answer;
  const auto parts = workspace_->Parts();
  ASSERT_EQ(parts.size(), 2u);
  std::vector<double> lengths;
  for (const auto& p : parts) {
    const auto length = std::find_if(p.part.dimensions.begin(), p.part.dimensions.end(),
                                     [](const auto& d) { return d.name == "length"; });
    ASSERT_NE(length, p.part.dimensions.end());
    lengths.push_back(length->value_mm);
    EXPECT_FALSE(length->observable);
    EXPECT_EQ(p.part.designation, "IPE 200");
    EXPECT_EQ(p.part.standard, "EN 10365");
  }
  EXPECT_NEAR(lengths[0], 300, 1);
  EXPECT_NEAR(lengths[1], 700, 1);
  EXPECT_NEAR((parts[0].part.world_from_part.translation - parts[1].part.world_from_part.translation).norm(),
              500, 1e-6);
  const Product product = workspace_->ProductNow();
  EXPECT_NE(ProductToJson(product, workspace_->image_files()).find("IPE 200"), std::string::npos)
      << "it is exported";
  EXPECT_EQ(Command({{"do", "split_part"}, {"part", "part-1"}}, &answer), 400) << "where?";
}

TEST_F(RoutesTest, CutsAHoledPlateBesideItsHole) {
  PlacedObject plate;
  plate.model = workspace_->knowledge().Find("holed_plate");
  plate.dimensions_mm = {900, 400, 20, 120, 150, 0};
  ASSERT_TRUE(workspace_->store().Apply(
      "test", "add",
      {{"part", "part-1", PartToJson(PartAt(plate, "part-1"), workspace_->image_files()), {}},
       {"part",
        "part-2",
        PartToJson(
            [&] {
              StationPart above = PartAt(plate, "part-2");
              above.part.stands_on = "part-1";
              return above;
            }(),
            workspace_->image_files()),
        {}}}));
  std::string answer;
  EXPECT_EQ(Command({{"do", "split_part"}, {"part", "part-1"}, {"share", 0.65}}, &answer), 400);
  EXPECT_NE(answer.find("through a hole"), answer.npos) << answer;
  ASSERT_EQ(Command({{"do", "split_part"}, {"part", "part-1"}, {"share", 0.4}}, &answer), 200) << answer;
  const auto kind = [&](const std::string& id) { return workspace_->FindPart(id).value().first.part.kind; };
  EXPECT_EQ(kind("part-1"), "box");
  EXPECT_EQ(kind("part-3"), "holed_plate");
  EXPECT_EQ(Command({{"do", "split_part"}, {"part", "part-3"}, {"along", "web"}, {"share", 0.4}}, &answer),
            400);
  EXPECT_NE(answer.find("cannot be cut along its web"), answer.npos) << answer;
  ASSERT_EQ(Command({{"do", "split_part"}, {"part", "part-1"}, {"along", "height"}, {"share", 0.5}}, &answer),
            200)
      << answer;
  EXPECT_EQ(workspace_->FindPart("part-4").value().first.part.stands_on, "part-1");
  EXPECT_EQ(workspace_->FindPart("part-2").value().first.part.stands_on, "part-4")
      << "what stood on it stands on its upper half";
}

TEST_F(RoutesTest, RemovesACurveThatVssFoundAndBringsItBack) {
  int image = 0;
  for (; image < int(workspace_->survey().images.size()); ++image)
    if (!workspace_->Lines(image).value()->found.arcs.empty()) break;
  if (image == int(workspace_->survey().images.size()))
    GTEST_SKIP() << "NOT TESTED: the sample shows no curve";
  const auto arcs = [&] { return FlatLines(*workspace_->Lines(image).value()).lines.arcs.size(); };
  const std::size_t before = arcs();
  std::string answer;
  const Json remove = {{"do", "remove_line"}, {"image", image}, {"line", 0}, {"circle", true}};
  ASSERT_EQ(Command(remove, &answer), 200) << answer;
  EXPECT_EQ(arcs(), before - 1);
  EXPECT_EQ(workspace_->Lines(image).value()->FindArc(0), nullptr);
  EXPECT_EQ(Command(remove, &answer), 400) << "it is gone";
  ASSERT_EQ(Command({{"do", "undo"}}, &answer), 200) << answer;
  EXPECT_EQ(arcs(), before);
}

TEST_F(RoutesTest, KeepsTheFeaturesOfAPartThatIsCorrected) {
  server_.reset();
  routes_.reset();
  workspace_.reset();
  fs::copy(fs::path(VSS_SOURCE_DIR) / "examples/knowledge/stiffener.kb", outside_ / "survey/stiffener.kb");
  const fs::path file = outside_ / "survey/survey.toml";
  const std::string text = ReadTextFile(file, 1 << 20).value();
  ASSERT_EQ(text.find("knowledge ="), text.npos);
  const std::size_t line = text.find('\n', text.find("format =")) + 1;
  std::ofstream(file) << text.substr(0, line) << "knowledge = [\"box\", \"stiffener.kb\"]\n"
                      << text.substr(line);
  workspace_ = Workspace::Open(outside_ / "survey", {1}).value();
  PlacedObject object;
  object.model = workspace_->knowledge().Find("stiffener", {"sniped"});
  ASSERT_TRUE(object.model);
  object.dimensions_mm =
      object.model->UsualDimensions(std::vector<std::optional<double>>(object.model->dimensions().size()));
  ASSERT_TRUE(workspace_->store().Apply(
      "test", "add",
      {{"part", "part-1", PartToJson(PartAt(object, "part-1"), workspace_->image_files()), {}}}));
  EXPECT_EQ(workspace_->ProductNow().parts.at(0).features, std::vector<std::string>{"sniped"});
  const Json body = {{"kind", "stiffener"}, {"part", "part-1"}, {"picks", Json::array()}};
  const auto corrected = QuestionOf(*workspace_, body);
  ASSERT_TRUE(corrected) << corrected.error().message;
  EXPECT_EQ(FeaturesOf(*corrected->model), std::vector<std::string>{"sniped"});
  const auto fresh =
      QuestionOf(*workspace_, {{"kind", "stiffener"}, {"features", {"hole"}}, {"picks", Json::array()}});
  ASSERT_TRUE(fresh) << fresh.error().message;
  EXPECT_EQ(FeaturesOf(*fresh->model), std::vector<std::string>{"hole"});
  EXPECT_FALSE(
      QuestionOf(*workspace_, {{"kind", "stiffener"}, {"features", {"wings"}}, {"picks", Json::array()}}));
}

TEST_F(RoutesTest, DrawsACurveAsAnEditThatIsKeptAndUndone) {
  std::string answer;
  const auto arcs = [&] {
    Ask(Get("/api/pictures/0/lines", kHeaders), &answer);
    return Json::parse(answer.substr(answer.find("\r\n\r\n") + 4))["arcs"];
  };
  const std::size_t before = arcs().size();
  const Json draw = {{"do", "draw_arc"}, {"image", 0}, {"points", {{200, 200}, {230, 180}, {260, 205}}}};
  ASSERT_EQ(Command(draw, &answer), 200) << answer;
  const Json drawn = arcs();
  ASSERT_EQ(drawn.size(), before + 1);
  const int number = drawn.back()[0];
  EXPECT_GE(number, kFirstDrawnLine);
  EXPECT_TRUE(MakePick(**workspace_->Lines(0), "x", 0, number, 0, true)) << "it can be picked";
  EXPECT_EQ(Command({{"do", "remove_line"}, {"image", 0}, {"line", number}, {"circle", true}}), 200);
  EXPECT_EQ(arcs().size(), before);
  EXPECT_EQ(Command({{"do", "undo"}}), 200);
  EXPECT_EQ(arcs(), drawn);
  EXPECT_EQ(
      Command({{"do", "draw_arc"}, {"image", 0}, {"points", {{200, 200}, {230, 200}, {260, 200}}}}, &answer),
      400);
  EXPECT_NE(answer.find("straight line"), answer.npos) << answer;
}

}  // namespace
}  // namespace vss::station
