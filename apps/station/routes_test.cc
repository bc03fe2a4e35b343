#include "routes.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <thread>

#include "commands.h"
#include "raw_http.h"
#include "vss/base/files.h"
#include "vss/export/export.h"
#include "vss/product/make_part.h"

namespace vss::station {
namespace fs = std::filesystem;
namespace {

const std::string kToken = "0123456789abcdef";
const std::string kSecret = "what-stands-outside";
const std::string kHeaders = "Host: localhost\r\nAuthorization: Bearer " + kToken + "\r\n";

// Every file below `folder`, with its size and when it was written.
std::map<std::string, std::pair<std::uintmax_t, fs::file_time_type>> FilesOf(const fs::path& folder) {
  std::map<std::string, std::pair<std::uintmax_t, fs::file_time_type>> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = {entry.file_size(), entry.last_write_time()};
  return files;
}

// The sample as a station has it, with something secret beside it.
class RoutesTest : public testing::Test {
 protected:
  RoutesTest() : outside_(fs::temp_directory_path() / fmt::format("vss-routes-{}", ::getpid())) {
    fs::remove_all(outside_);
    fs::create_directories(outside_);
    fs::copy(fs::path(VSS_SOURCE_DIR) / "examples/sample", outside_ / "survey", fs::copy_options::recursive);
    std::ofstream(outside_ / "secret.txt") << kSecret;
    std::ofstream(outside_ / "survey" / "secret.txt") << kSecret;  // inside, but no part of the survey
    workspace_ = Workspace::Open(outside_ / "survey", {1}).value();
    routes_ = std::make_unique<Routes>(*workspace_, nullptr);
    ServerOptions options;
    options.token = kToken;
    server_ =
        Server::Start(options, [this](const Request& request) { return routes_->Answer(request); }).value();
  }
  ~RoutesTest() override {
    server_.reset();
    workspace_.reset();
    fs::remove_all(outside_);
  }

  int Ask(const std::string& bytes, std::string* answer = nullptr) {
    return StatusOf(server_->port(), bytes, answer);
  }
  int Command(const Json& body, std::string* answer = nullptr) {
    return Ask(Post("/api/command", body.dump(), kHeaders + "Content-Type: application/json\r\n"), answer);
  }

  fs::path outside_;
  std::unique_ptr<Workspace> workspace_;
  std::unique_ptr<Routes> routes_;
  std::unique_ptr<Server> server_;
};

struct Hostile {
  std::string bytes;
  std::set<int> right;
};

// Requests against every route and every command that there is: taken from the tables, so that none is
// forgotten.
class HostileMaker {
 public:
  std::map<std::string, int> asked;  // how often each route and command was tried
  Hostile Make() {
    switch (Pick(18)) {
      case 12:
        return {Get(ARoute("GET"), "Host: localhost\r\nAuthorization: Bearer " + Noise(16) + "\r\n"), {401}};
      case 13:
        return {
            Post(ARoute("POST"), "{}",
                 kHeaders + "Content-Type: application/json\r\nOrigin: http://" + Noise(6) + ".example\r\n"),
            {403}};
      case 14:
        return {Get(ARoute("GET") + One({"/..", "/%2e%2e/", "/..%5c", "%00"}) + "/secret.txt", kHeaders),
                {400}};
      case 15:
        return {Get(ARoute("GET") + "/" + Noise(5), kHeaders), {404}};
      case 16:
        return {Post(ARoute("GET"), "{}", kHeaders + "Content-Type: application/json\r\n"), {404}};
      case 17:
        return {Json2(ARoute("POST"), Broken()), {400}};
      case 0:
        return {Get(Traversal() + "secret.txt", kHeaders), {400}};
      case 1:
        return {Get(One({"/secret.txt", "/survey.toml", "/station.sqlite", "/cameras/cam1.toml",
                         "/etc/passwd", "/api/secret.txt", "/api/export/secret.txt",
                         "/api/calibration/secret.txt", "/index.html/secret.txt"}),
                    kHeaders),
                {404}};
      case 2:
        return {Get(APicture(One({"-1", "999", "4294967296", "99999999999999999999", "0x1", "1e0", "%2b1",
                                  "..%2fsecret.txt"})),
                    kHeaders),
                {400, 404}};
      case 3:
        return {Get("/api/measure?a=" + One({"part-1:0", "..%2f..%2fsecret:0", "part-1:-1", "x"}) +
                        "&b=" + Noise(20),
                    kHeaders),
                {400}};
      case 4:
        return {Json2("/api/command", Broken()), {400}};
      case 5:
        return {Json2(ARoute("POST"), Wrong().dump()), {400, 422}};
      case 6:
        return {Json2("/api/command", "{\"do\":\"" + std::string((1 << 20) + Pick(1000), 'x') + "\"}"),
                {413}};
      case 7:
        return {Get("/api/survey", "Host: localhost\r\nAuthorization: Bearer " + Noise(16) + "\r\n"), {401}};
      case 8:
        return {Get("/api/survey", kHeaders + "Origin: http://" + Noise(6) + ".example\r\n"), {403}};
      case 9:
        return {
            Get("/api/survey", "Host: " + Noise(6) + ".example\r\nAuthorization: Bearer " + kToken + "\r\n"),
            {421}};
      case 10:
        return {Post("/api/command", "{\"do\":\"run\"}", kHeaders + "Content-Type: text/plain\r\n"), {415}};
      default:
        return {One({"PUT", "DELETE", "PATCH", "TRACE"}) + " /api/command HTTP/1.1\r\n" + kHeaders + "\r\n",
                {405}};
    }
  }

 private:
  // A route of that method, a picture's number or a name filled in.
  std::string ARoute(const std::string& method) {
    static const auto table = Routes::Table();
    std::string path;
    do {
      const auto& route = table[std::size_t(Pick(int(table.size())))];
      if (route.first == method) path = route.second;
    } while (path.empty());
    ++asked[path];
    return "/api/" + Filled(path, "0");
  }
  std::string APicture(const std::string& number) {
    static const auto table = Routes::Table();
    std::string path;
    do path = table[std::size_t(Pick(int(table.size())))].second;
    while (path.find('#') == path.npos);
    return "/api/" + Filled(path, number);
  }
  std::string Filled(std::string path, const std::string& number) {
    if (const auto at = path.find('#'); at != path.npos) path.replace(at, 1, number);
    if (const auto at = path.find('*'); at != path.npos) path.replace(at, 1, Noise(6));
    return path;
  }
  int Pick(int n) { return int(random_() % unsigned(n)); }
  std::string One(const std::vector<std::string>& of) { return of[std::size_t(Pick(int(of.size())))]; }
  std::string Noise(int n) {
    std::string s;
    for (int i = 0; i < n; ++i) s += char('a' + Pick(26));
    return s;
  }
  std::string Traversal() {
    std::string target;
    for (int i = 0, n = 1 + Pick(5); i < n; ++i)
      target += One({"/..", "/%2e%2e", "/.%2E", "/..%5c", "/api/pictures/../..", "/%00"});
    return target + "/";
  }
  static std::string Json2(const std::string& target, const std::string& body) {
    return Post(target, body, kHeaders + "Content-Type: application/json\r\n");
  }
  // What is no JSON object.
  std::string Broken() {
    const std::string nested(std::size_t(1 + Pick(20000)), '[');
    return One({"", "{", "[]", "null", "7", "\"x\"", "{\"do\":}", "{\"do\":\"run\"", "{'do':'run'}",
                "{\"do\":\"run\"}}", "\xff\xfe", "{\"a\":1e999}", nested, "{\"a\":" + nested, Noise(50)});
  }
  Json Value() {
    switch (Pick(9)) {
      case 0:
        return -1;
      case 1:
        return 4294967296;  // 0, were it cut to 32 bits
      case 2:
        return 1e300;
      case 3:
        return "../../secret.txt";
      case 4:
        return nullptr;
      case 5:
        return Json::array({1e300, -1e300});
      case 6:
        return Json::object({{"line", -1}});
      case 7:
        return 0.5;
      default:
        return std::string(std::size_t(Pick(3000)), 'y');
    }
  }
  // Commands of known names whose every argument is wrong.
  Json Wrong() {
    static const std::vector<std::string> harmless = {"run", "cancel", "undo",
                                                      "redo"};  // that take no argument
    std::vector<std::string> names = CommandNames();
    std::erase_if(names, [&](const auto& name) {
      return std::find(harmless.begin(), harmless.end(), name) != harmless.end();
    });
    names.insert(names.end(), {"no_such", "../run"});
    const std::string command = One(names);
    ++asked[command];
    Json body = {{"do", command}};
    for (const char* name : {"part",       "with", "kind",  "image",  "line",    "start",   "end",
                             "at",         "to",   "share", "values", "product", "picks",   "fixed",
                             "dimensions", "job",  "model", "points", "circle",  "features"})
      if (Pick(4) > 0) body[name] = Value();
    return body;
  }
  std::mt19937 random_{11};
};

TEST_F(RoutesTest, RefusesTenThousandHostileRequestsAndNothingOutsideIsReadOrWritten) {
  ASSERT_EQ(Ask(Get("/api/pictures/0/lines", kHeaders)), 200);
  const auto before = FilesOf(outside_);
  const auto revision = workspace_->store().State().revision;
  HostileMaker maker;
  std::map<int, int> statuses;
  for (int i = 0; i < 10000; ++i) {
    const Hostile hostile = maker.Make();
    std::string answer;
    const int status = Ask(hostile.bytes, &answer);
    ++statuses[status];
    ASSERT_TRUE(hostile.right.contains(status))
        << "request " << i << " got " << status << ": " << hostile.bytes.substr(0, 400) << "\n"
        << answer.substr(0, 2000);
    ASSERT_EQ(answer.find(kSecret), answer.npos) << hostile.bytes.substr(0, 200);
  }
  for (const auto& [method, path] : Routes::Table())
    EXPECT_GT(maker.asked[path], 20) << method << " " << path;
  for (const auto& name : CommandNames()) {
    if (name != "run" && name != "cancel" && name != "undo" && name != "redo") {
      EXPECT_GT(maker.asked[name], 10) << name;
    }
  }
  for (const auto& [status, count] : statuses) std::printf("        %d: %d\n", status, count);
  EXPECT_EQ(FilesOf(outside_), before);
  EXPECT_EQ(workspace_->store().State().revision, revision) << "a hostile request changed the survey";
  EXPECT_EQ(Ask(Get("/api/survey", kHeaders)), 200);
}

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

TEST_F(RoutesTest, DoesNotCutWhatIsNotTheSameAllAlong) {
  PlacedObject plate;
  plate.model = workspace_->knowledge().Find("holed_plate");
  plate.dimensions_mm = {600, 400, 20, 120, 50, 0};
  ASSERT_TRUE(workspace_->store().Apply(
      "test", "add",
      {{"part", "part-1", PartToJson(PartAt(plate, "part-1"), workspace_->image_files()), {}}}));
  std::string answer;
  EXPECT_EQ(Command({{"do", "split_part"}, {"part", "part-1"}, {"share", 0.5}}, &answer), 400);
  EXPECT_NE(answer.find("not the same all along its length"), answer.npos) << answer;
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

const fs::path kRig = fs::path(VSS_SOURCE_DIR) / "../shared/calibration/rig-1";

// The sample with a calibration job of one of its cameras, cam4, beside it.
class CalibrationRoutesTest : public RoutesTest {
 protected:
  void SetUp() override {
    if (!fs::exists(kRig / "calibration.toml")) GTEST_SKIP() << "NOT TESTED: " << kRig << " is not there";
    fs::create_directories(outside_ / "rig");
    fs::copy(kRig / "board_cam4", outside_ / "rig/board_cam4");
    fs::copy(kRig / "cube", outside_ / "rig/cube");
    WriteJob("cam4");
  }
  void WriteJob(const std::string& camera) {
    std::ofstream(outside_ / "rig/calibration.toml")
        << "format = \"vss-calibration/1\"\nname = \"one camera\"\n[[intrinsic]]\ncamera = \"" << camera
        << "\"\npixel_pitch = [0.0160, 0.0160]\n"
        << "target = { pattern = \"checkerboard\", columns = 12, rows = 9, pitch = 70.0 }\nimages = "
           "[\"board_cam4/*.png\"]\n"
        << "[[extrinsic]]\ncamera = \"" << camera
        << "\"\ncube = { size = 800.0, position = [3000.0, 1500.0, 0.0], yaw = 18.0 }\n"
        << "images = [ { file = \"cube/cam4_cube0.png\", gantry = [2700.0, 1400.0, 0.0] }, { file = "
           "\"cube/cam4_cube1.png\", gantry = [3300.0, 1250.0, 0.0] },"
        << " { file = \"cube/cam4_cube2.png\", gantry = [2950.0, 1800.0, 0.0] } ]\n";
  }
  Json GetJson(const std::string& path) {
    std::string answer;
    EXPECT_EQ(Ask(Get(path, kHeaders), &answer), 200) << answer.substr(0, 500);
    return Json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  }
  Json Calibrated() {
    EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}}), 202);
    while (workspace_->RunState()["state"] == "running")
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return workspace_->RunState();
  }
  Json ResidualOf(const std::string& id) {
    const Json survey = GetJson("/api/survey");
    for (const auto& camera : survey["cameras"])
      if (camera["id"] == id) return camera["residual_px"];
    return "none";
  }
};

TEST_F(CalibrationRoutesTest, CalibratesAndTakesTheCamerasOverAsAStepThatIsUndone) {
  EXPECT_EQ(GetJson("/api/calibration")["jobs"], Json::array({"../rig/calibration.toml"}));
  EXPECT_EQ(Ask(Get("/api/calibration/report.html", kHeaders)), 404);
  const Json run = Calibrated();
  ASSERT_EQ(run["state"], "done") << run.dump();
  EXPECT_EQ(run["job"], "calibration");
  std::string answer;
  EXPECT_EQ(Ask(Get("/api/calibration/report.html", kHeaders), &answer), 200);
  EXPECT_NE(answer.find("<h1>Calibration one camera</h1>"), answer.npos);
  EXPECT_EQ(Ask(Get("/api/calibration/cameras/cam4.toml", kHeaders), &answer), 200);
  EXPECT_NE(answer.find("vss-camera/1"), answer.npos);
  const Json state = GetJson("/api/state?since=0");
  for (const auto& item : state["items"])
    if (item["kind"] == "calibration") {
      EXPECT_FALSE(item["value"].contains("report"));
      EXPECT_EQ(item["value"]["cameras"][0]["id"], "cam4");
    }

  EXPECT_TRUE(ResidualOf("cam4").is_null());
  const auto center_of = [&] {
    for (const auto& image : workspace_->survey().images)
      if (workspace_->survey().cameras[std::size_t(image.camera)].id == "cam4")
        return image.cam_from_world.Inverse().translation;
    return Eigen::Vector3d(0, 0, 0);
  };
  const Eigen::Vector3d own = center_of();
  EXPECT_EQ(Command({{"do", "take_cameras"}, {"version", 0}}, &answer), 200) << answer;
  EXPECT_LT(ResidualOf("cam4").get<double>(), 0.2);
  EXPECT_TRUE(ResidualOf("cam1").is_null());
  const double moved = (center_of() - own).norm();
  EXPECT_GT(moved, 0);
  EXPECT_LT(moved, 1);  // the rig is that of the survey
  EXPECT_EQ(Ask(Get("/api/pictures/0/lines", kHeaders)), 200);
  EXPECT_EQ(Command({{"do", "undo"}}), 200);
  EXPECT_TRUE(ResidualOf("cam4").is_null());
  EXPECT_EQ(center_of(), own);
  EXPECT_EQ(Command({{"do", "redo"}}), 200);
  EXPECT_FALSE(ResidualOf("cam4").is_null());

  // Another station on the folder begins where this one was.
  server_.reset();
  routes_.reset();
  workspace_.reset();
  workspace_ = Workspace::Open(outside_ / "survey", {1}).value();
  EXPECT_NE(center_of(), own);
}

TEST_F(CalibrationRoutesTest, SaysWhyItCannot) {
  std::string answer;
  EXPECT_EQ(Command({{"do", "take_cameras"}}, &answer), 400);
  EXPECT_NE(answer.find("nothing was calibrated yet"), answer.npos);
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../../etc/calibration.toml"}}, &answer), 400);
  EXPECT_NE(answer.find("there is no calibration job"), answer.npos);
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}, {"model", "fisheye"}}, &answer),
            400);
  EXPECT_NE(answer.find("choose weng or opencv"), answer.npos);
  EXPECT_EQ(Command({{"do", "calibrate"},
                     {"job", "../rig/calibration.toml"},
                     {"values", {{"calibrate.outlier_sigmas", -1}}}},
                    &answer),
            400);
  EXPECT_NE(answer.find("outside its range"), answer.npos);
  fs::remove(outside_ / "rig/cube/cam4_cube1.png");
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}}, &answer), 422);
  EXPECT_NE(answer.find("cam4_cube1.png"), answer.npos) << answer;
}

TEST_F(CalibrationRoutesTest, RefusesCamerasThatTheSurveyDoesNotHave) {
  WriteJob("overhead");
  ASSERT_EQ(Calibrated()["state"], "done");
  std::string answer;
  EXPECT_EQ(Command({{"do", "take_cameras"}}, &answer), 422);
  EXPECT_NE(answer.find("the calibration is of overhead, and the survey's cameras are cam1"), answer.npos)
      << answer;
}

TEST_F(CalibrationRoutesTest, CancelsAndNothingChanged) {
  const auto revision = workspace_->store().State().revision;
  EXPECT_EQ(Command({{"do", "calibrate"}, {"job", "../rig/calibration.toml"}}), 202);
  EXPECT_EQ(Command({{"do", "run"}}), 400);  // one at a time
  EXPECT_EQ(Command({{"do", "cancel"}}), 200);
  while (workspace_->RunState()["state"] == "running")
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(workspace_->RunState()["state"], "cancelled");
  EXPECT_EQ(workspace_->store().State().revision, revision);
}

TEST_F(RoutesTest, FindsCalibrationJobsInTheSurveyAndBesideItAndNowhereElse) {
  fs::create_directories(outside_ / "survey/boards");
  fs::create_directories(outside_ / "rig/deeper");
  fs::create_directories(outside_ / "empty");
  const fs::path elsewhere = fs::temp_directory_path() / fmt::format("vss-elsewhere-{}", ::getpid());
  fs::create_directories(elsewhere);
  for (const fs::path& folder : {outside_ / "survey", outside_ / "survey/boards", outside_ / "rig",
                                 outside_ / "rig/deeper", elsewhere})
    std::ofstream(folder / "calibration.toml") << "format = \"vss-calibration/1\"\n";
  fs::create_directory_symlink(elsewhere, outside_ / "link");
  std::vector<std::string> names;
  for (const auto& job : FindCalibrationJobs(outside_ / "survey")) names.push_back(job.name);
  EXPECT_EQ(names, (std::vector<std::string>{"boards/calibration.toml", "calibration.toml",
                                             "../rig/calibration.toml"}));
  fs::remove_all(elsewhere);
}

}  // namespace
}  // namespace vss::station
