// The station's HTTP and WebSocket server: who may ask, how much, and how answers go out. What is answered is
// the business of the handler.
//
// Rules, in this order: a request is small and well-formed (400, 413, 414, 431), its Host is this server
// (421), its Origin is this page (403), its token is right where one is demanded (401), its method is GET,
// HEAD or POST (405), and what it posts is JSON (415). A WebSocket opens on /api/live alone.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "request_text.h"
#include "vss/base/result.h"

namespace vss::station {

struct Request {
  std::string method;  // "GET" (HEAD arrives as GET) or "POST"
  std::string path;    // decoded; starts with '/', has no "..", no control character and no backslash
  std::map<std::string, std::string> query;
  std::string body;
  std::string who;  // the name that the page gives itself; "" where it gives none
  std::string if_none_match;
};

struct Response {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
};

struct ServerOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;  // 0: a free one
  std::string token;       // demanded of every request where not empty
  std::size_t max_body_bytes = 1 << 20;
  std::size_t max_header_bytes = 16 << 10;
  std::size_t max_message_bytes = 64 << 10;  // of a WebSocket
  int max_connections = 512;
  int timeout_s = 30;      // for a request to arrive and for an answer to leave
  int worker_threads = 2;  // that run the handler
};

using Handler = std::function<Response(const Request&)>;

// Is this an address that only this machine reaches?
bool IsLoopback(std::string_view address);

class Server {
 public:
  // Listens at once; an error says why not. Anywhere but on loopback a token is demanded.
  static Result<std::unique_ptr<Server>> Start(const ServerOptions& options, Handler handler);
  ~Server();
  std::uint16_t port() const;
  std::string url() const;
  // Sends `text` to every open WebSocket; one that does not keep up is closed.
  void Broadcast(const std::string& text);
  int num_listeners() const;  // open WebSockets
  void Stop();
  struct Impl;

 private:
  explicit Server(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<Impl> impl_;
};

}  // namespace vss::station
