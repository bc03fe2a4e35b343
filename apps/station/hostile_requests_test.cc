#include <random>
#include <set>
#include <thread>

#include "commands.h"
#include "routes_fixture.h"

namespace vss::station {
namespace {

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

}  // namespace
}  // namespace vss::station
