#include "http_server.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "raw_http.h"

namespace vss::station {
namespace asio = boost::asio;
namespace beast = boost::beast;
using tcp = asio::ip::tcp;
namespace {

Response Echo(const Request& request) {
  if (request.path == "/throw") throw std::runtime_error("x");
  return {200, "text/plain", request.method + " " + request.path + " " + request.body, {}};
}

std::unique_ptr<Server> StartEcho(ServerOptions options = {}) {
  return std::move(Server::Start(options, Echo).value());
}

TEST(Server, AnswersAGet) {
  auto server = StartEcho();
  std::string answer;
  EXPECT_EQ(StatusOf(server->port(), Get("/a%20b?x=1"), &answer), 200);
  EXPECT_NE(answer.find("GET /a b "), std::string::npos);
  EXPECT_NE(answer.find("Content-Security-Policy"), std::string::npos);
}

TEST(Server, RefusesEachKindOfBadRequestWithItsStatus) {
  ServerOptions options;
  options.max_body_bytes = 1000;
  auto server = StartEcho(options);
  const auto port = server->port();
  EXPECT_EQ(StatusOf(port, Get("/../etc/passwd")), 400);
  EXPECT_EQ(StatusOf(port, Get("/a/%2e%2e/b")), 400);
  EXPECT_EQ(StatusOf(port, Get("/a%5c..%5cb")), 400);
  EXPECT_EQ(StatusOf(port, Get("/a%00b")), 400);
  EXPECT_EQ(StatusOf(port, Get("/%zz")), 400);
  EXPECT_EQ(StatusOf(port, Get("//a")), 400);
  EXPECT_EQ(StatusOf(port, "rubbish\r\n\r\n"), 400);
  EXPECT_EQ(StatusOf(port, Get("/", "")), 400);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nHost: evil\r\n")), 400);
  EXPECT_EQ(StatusOf(port, Get("/" + std::string(3000, 'a'))), 414);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nX-A: " + std::string(20000, 'a') + "\r\n")), 431);
  EXPECT_EQ(StatusOf(port, Post("/", std::string(1001, ' '))), 413);
  EXPECT_EQ(StatusOf(port, Post("/", "{}", "Host: localhost\r\nContent-Type: text/plain\r\n")), 415);
  EXPECT_EQ(StatusOf(port, Post("/", "{}", "Host: localhost\r\n")), 415);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: evil.example\r\n")), 421);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nOrigin: http://evil.example\r\n")), 403);
  EXPECT_EQ(StatusOf(port, Post("/", "{}",
                                "Host: localhost\r\nOrigin: null\r\nContent-Type: application/json\r\n")),
            403);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nSec-Fetch-Site: cross-site\r\n")), 403);
  EXPECT_EQ(StatusOf(port, "DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n"), 405);
  EXPECT_EQ(StatusOf(port, "TRACE / HTTP/1.1\r\nHost: localhost\r\n\r\n"), 405);
  EXPECT_EQ(StatusOf(port, Get("/throw")), 500);
  EXPECT_EQ(StatusOf(port, Get("/fine")), 200);
}

TEST(Server, DemandsTheTokenOfEveryRequestAndTakesItFromHeaderCookieOrFirstAddress) {
  ServerOptions options;
  options.token = "0123456789abcdef";
  auto server = StartEcho(options);
  const auto port = server->port();
  EXPECT_EQ(StatusOf(port, Get("/")), 401);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nAuthorization: Bearer 0123456789abcdeX\r\n")), 401);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nAuthorization: Bearer \r\n")), 401);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nAuthorization: Bearer 0123456789abcdef\r\n")), 200);
  EXPECT_EQ(StatusOf(port, Get("/", "Host: localhost\r\nCookie: a=b; vss_token=0123456789abcdef\r\n")), 200);
  EXPECT_EQ(StatusOf(port, Get("/?token=wrong")), 401);
  std::string answer;
  EXPECT_EQ(StatusOf(port, Get("/?token=0123456789abcdef"), &answer), 303);
  EXPECT_NE(answer.find("HttpOnly; SameSite=Strict"), std::string::npos);
}

TEST(Server, DoesNotListenOnTheNetworkWithoutAToken) {
  ServerOptions options;
  options.address = "0.0.0.0";
  const auto server = Server::Start(options, Echo);
  ASSERT_FALSE(server);
  EXPECT_EQ(server.error().code, ErrorCode::kUsage);
  EXPECT_NE(server.error().message.find("--token-file"), std::string::npos);
}

TEST(Server, ReadsATokenOnlyFromAFileOfItsOwner) {
  const auto path = std::filesystem::temp_directory_path() / fmt::format("vss-token-{}", ::getpid());
  std::ofstream(path) << "0123456789abcdef\n";
  ::chmod(path.c_str(), 0644);
  EXPECT_FALSE(ReadToken(path.string()));
  ::chmod(path.c_str(), 0600);
  EXPECT_EQ(ReadToken(path.string()).value(), "0123456789abcdef");
  std::ofstream(path) << "short\n";
  EXPECT_FALSE(ReadToken(path.string()));
  std::filesystem::remove(path);
}

using Ws = beast::websocket::stream<tcp::socket>;
boost::system::error_code Open(Ws& ws, std::uint16_t port, const std::string& target,
                               const std::string& origin) {
  ws.next_layer().connect({asio::ip::make_address("127.0.0.1"), port});
  ws.set_option(beast::websocket::stream_base::decorator([origin](beast::websocket::request_type& r) {
    if (!origin.empty()) r.set(beast::http::field::origin, origin);
  }));
  boost::system::error_code ec;
  ws.handshake("localhost", target, ec);
  return ec;
}

TEST(Server, SendsToEveryOpenWebSocketAndRefusesThoseOfOtherPages) {
  auto server = StartEcho();
  asio::io_context io;
  Ws good(io), evil(io), elsewhere(io);
  EXPECT_FALSE(Open(good, server->port(), "/api/live", "http://localhost"));
  EXPECT_TRUE(Open(evil, server->port(), "/api/live", "http://evil.example"));
  EXPECT_TRUE(Open(elsewhere, server->port(), "/other", ""));
  for (int i = 0; i < 100 && server->num_listeners() < 1; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  server->Broadcast("{\"hello\":1}");
  beast::flat_buffer buffer;
  good.read(buffer);
  EXPECT_EQ(beast::buffers_to_string(buffer.data()), "{\"hello\":1}");
}

TEST(Server, ClosesAWebSocketThatSaysTooMuch) {
  auto server = StartEcho();
  asio::io_context io;
  Ws ws(io);
  ASSERT_FALSE(Open(ws, server->port(), "/api/live", ""));
  boost::system::error_code ec;
  ws.write(asio::buffer(std::string(1 << 20, 'x')), ec);
  beast::flat_buffer buffer;
  if (!ec) ws.read(buffer, ec);
  EXPECT_TRUE(ec);
  EXPECT_EQ(StatusOf(server->port(), Get("/fine")), 200);
}

// One hostile request of a random kind, and the statuses that are right for it (0: closed without an answer).
struct Hostile {
  std::string bytes;
  std::vector<int> right;
};
Hostile MakeHostile(std::mt19937& random) {
  auto pick = [&](int n) { return int(random() % unsigned(n)); };
  auto noise = [&](int n) {
    std::string s;
    for (int i = 0; i < n; ++i) s += char('a' + pick(26));
    return s;
  };
  switch (pick(9)) {
    case 0: {
      const char* ways[] = {"/..", "/%2e%2e", "/.%2E", "/..%5c", "/%2e./", "/a/../..", "/%c0%ae/.."};
      std::string target;
      for (int i = 0, n = 1 + pick(6); i < n; ++i) target += ways[pick(7)];
      return {Get(target + "/etc/passwd"), {400}};
    }
    case 1:
      return {Post("/api/x", std::string(std::size_t(70000 + pick(50000)), 'z')), {413}};
    case 2:
      return {Get("/", "Host: localhost\r\nAuthorization: Bearer " + noise(16) + "\r\n"), {401}};
    case 3:
      return {Get("/api/survey", "Host: localhost\r\nOrigin: http://" + noise(5) + ".example\r\n"), {403}};
    case 4:
      return {Get("/", "Host: " + noise(6) + ".example\r\n"), {421}};
    case 5: {
      std::string bytes;
      for (int i = 0, n = 4 + pick(300); i < n; ++i) bytes += char(1 + pick(255));
      return {bytes + "\r\n\r\n", {400, 0}};
    }
    case 6:
      return {Get("/" + noise(2100 + pick(3000))), {414}};
    case 7:
      return {Get("/", "Host: localhost\r\nX-N: " + noise(17000) + "\r\n"), {431}};
    default: {
      const char* methods[] = {"PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"};
      return {std::string(methods[pick(5)]) +
                  " / HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer 0123456789abcdef\r\n\r\n",
              {405}};
    }
  }
}

TEST(Server, RefusesTenThousandHostileRequestsAndLives) {
  ServerOptions options;
  options.token = "0123456789abcdef";
  options.max_body_bytes = 64 << 10;
  std::atomic<int> handled{0};
  auto server = std::move(Server::Start(options, [&](const Request& r) {
                            ++handled;
                            return Echo(r);
                          }).value());
  std::mt19937 random(7);
  for (int i = 0; i < 10000; ++i) {
    const Hostile hostile = MakeHostile(random);
    const int status = StatusOf(server->port(), hostile.bytes);
    ASSERT_NE(std::find(hostile.right.begin(), hostile.right.end(), status), hostile.right.end())
        << "request " << i << " got " << status << ": " << hostile.bytes.substr(0, 80);
  }
  EXPECT_EQ(handled, 0) << "a hostile request reached the handler";
  EXPECT_EQ(
      StatusOf(server->port(), Get("/", "Host: localhost\r\nAuthorization: Bearer 0123456789abcdef\r\n")),
      200);
}

}  // namespace
}  // namespace vss::station
