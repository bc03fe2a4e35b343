#include "routes.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include "raw_http.h"
#include "vss/base/files.h"

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
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).string()] = {entry.file_size(), entry.last_write_time()};
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
    server_ = Server::Start(options, [this](const Request& request) { return routes_->Answer(request); }).value();
  }
  ~RoutesTest() override {
    server_.reset();
    workspace_.reset();
    fs::remove_all(outside_);
  }

  int Ask(const std::string& bytes, std::string* answer = nullptr) { return StatusOf(server_->port(), bytes, answer); }
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

class HostileMaker {
 public:
  Hostile Make() {
    switch (Pick(12)) {
      case 0: return {Get(Traversal() + "secret.txt", kHeaders), {400}};
      case 1: return {Get(One({"/secret.txt", "/survey.toml", "/station.sqlite", "/cameras/cam1.toml", "/etc/passwd", "/api/secret.txt", "/index.html/secret.txt"}), kHeaders), {404}};
      case 2: return {Get("/api/pictures/" + One({"-1", "999", "4294967296", "99999999999999999999", "0x1", "1e0", "%2b1", "..%2fsecret.txt"}) + One({"/image", "/thumb", "/lines", "/projection"}), kHeaders), {400, 404}};
      case 3: return {Get("/api/measure?a=" + One({"part-1:0", "..%2f..%2fsecret:0", "part-1:-1", "x"}) + "&b=" + Noise(20), kHeaders), {400}};
      case 4: return {Json2("/api/command", Broken()), {400}};
      case 5: return {Json2(One({"/api/command", "/api/fit", "/api/drawing"}), Wrong().dump()), {400, 422}};
      case 6: return {Json2("/api/command", "{\"do\":\"" + std::string((1 << 20) + Pick(1000), 'x') + "\"}"), {413}};
      case 7: return {Get("/api/survey", "Host: localhost\r\nAuthorization: Bearer " + Noise(16) + "\r\n"), {401}};
      case 8: return {Get("/api/survey", kHeaders + "Origin: http://" + Noise(6) + ".example\r\n"), {403}};
      case 9: return {Get("/api/survey", "Host: " + Noise(6) + ".example\r\nAuthorization: Bearer " + kToken + "\r\n"), {421}};
      case 10: return {Post("/api/command", "{\"do\":\"run\"}", kHeaders + "Content-Type: text/plain\r\n"), {415}};
      default: return {One({"PUT", "DELETE", "PATCH", "TRACE"}) + " /api/command HTTP/1.1\r\n" + kHeaders + "\r\n", {405}};
    }
  }

 private:
  int Pick(int n) { return int(random_() % unsigned(n)); }
  std::string One(const std::vector<std::string>& of) { return of[std::size_t(Pick(int(of.size())))]; }
  std::string Noise(int n) {
    std::string s;
    for (int i = 0; i < n; ++i) s += char('a' + Pick(26));
    return s;
  }
  std::string Traversal() {
    std::string target;
    for (int i = 0, n = 1 + Pick(5); i < n; ++i) target += One({"/..", "/%2e%2e", "/.%2E", "/..%5c", "/api/pictures/../..", "/%00"});
    return target + "/";
  }
  static std::string Json2(const std::string& target, const std::string& body) { return Post(target, body, kHeaders + "Content-Type: application/json\r\n"); }
  // What is no JSON object.
  std::string Broken() {
    const std::string nested(std::size_t(1 + Pick(20000)), '[');
    return One({"", "{", "[]", "null", "7", "\"x\"", "{\"do\":}", "{\"do\":\"run\"", "{'do':'run'}", "{\"do\":\"run\"}}", "\xff\xfe", "{\"a\":1e999}", nested, "{\"a\":" + nested, Noise(50)});
  }
  Json Value() {
    switch (Pick(9)) {
      case 0: return -1;
      case 1: return 4294967296;  // 0, were it cut to 32 bits
      case 2: return 1e300;
      case 3: return "../../secret.txt";
      case 4: return nullptr;
      case 5: return Json::array({1e300, -1e300});
      case 6: return Json::object({{"line", -1}});
      case 7: return 0.5;
      default: return std::string(std::size_t(Pick(3000)), 'y');
    }
  }
  // Commands of known names whose every argument is wrong.
  Json Wrong() {
    Json body = {{"do", One({"save_part", "delete_part", "confirm_part", "drop_line", "refit_part", "change_kind", "split_part", "merge_parts", "draw_line", "remove_line",
                             "split_line", "merge_lines", "extend_line", "set_parameters", "no_such", "../run"})}};
    for (const char* name : {"part", "with", "kind", "image", "line", "start", "end", "at", "to", "share", "values", "product", "picks", "fixed", "dimensions"})
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
    ASSERT_TRUE(hostile.right.contains(status)) << "request " << i << " got " << status << ": " << hostile.bytes.substr(0, 400) << "\n" << answer.substr(0, 2000);
    ASSERT_EQ(answer.find(kSecret), answer.npos) << hostile.bytes.substr(0, 200);
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
  EXPECT_EQ(Ask(Get("/api/pictures/" + std::to_string(workspace_->image_files().size()) + "/image", kHeaders)), 404);
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

}  // namespace
}  // namespace vss::station
