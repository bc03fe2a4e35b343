#include "http_server.h"

#include <algorithm>
#include <atomic>
#include <boost/asio.hpp>
#include <boost/beast.hpp>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

namespace vss::station {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using error_code = boost::system::error_code;

namespace {

constexpr std::size_t kMaxTargetBytes = 2048;
constexpr std::size_t kMaxQueuedMessages = 256;  // of one WebSocket that does not read

std::string_view View(beast::string_view s) { return {s.data(), s.size()}; }

Response Refusal(int status, std::string_view why) {
  return {status, "application/json", fmt::format("{{\"error\":\"{}\"}}", why), {}};
}

using HttpRequest = http::request<http::string_body>;
using HttpResponse = http::response<http::string_body>;

}  // namespace

bool IsLoopback(std::string_view address) {
  error_code ec;
  const auto ip = asio::ip::make_address(std::string(address), ec);
  return !ec && ip.is_loopback();
}

class LiveSession;

struct Server::Impl : std::enable_shared_from_this<Server::Impl> {
  ServerOptions options;
  Handler handler;
  asio::io_context io;
  tcp::acceptor acceptor{io};
  asio::thread_pool workers;
  std::vector<std::thread> threads;
  std::atomic<int> connections{0};
  std::uint16_t port = 0;
  mutable std::mutex mutex;
  std::vector<std::weak_ptr<LiveSession>> live;
  std::atomic<bool> stopped{false};

  Impl(ServerOptions o, Handler h)
      : options(std::move(o)), handler(std::move(h)), workers(std::size_t(options.worker_threads)) {}

  // Why this request is not answered; empty where it is.
  std::optional<Response> Refuse(const HttpRequest& request) const {
    const std::string_view host = View(request[http::field::host]);
    if (host.empty()) return Refusal(400, "a request needs one Host header");
    if (IsLoopback(options.address)) {
      const std::string name = HostWithoutPort(host);
      if (name != "localhost" && name != "127.0.0.1" && name != "[::1]" && name != options.address)
        return Refusal(421, "this server answers only to its own name");
    }
    const std::string_view origin = View(request[http::field::origin]);
    if (!origin.empty() && origin != "http://" + std::string(host))
      return Refusal(403, "another page may not ask this server");
    const std::string_view site = View(request["Sec-Fetch-Site"]);
    const bool navigates =
        View(request["Sec-Fetch-Mode"]) == "navigate" && request.method() == http::verb::get;
    if ((site == "cross-site" || site == "same-site") && !navigates)
      return Refusal(403, "another page may not ask this server");
    return std::nullopt;
  }

  bool HasToken(const HttpRequest& request) const {
    if (options.token.empty()) return true;
    const std::string_view bearer = View(request[http::field::authorization]);
    if (bearer.substr(0, 7) == "Bearer ") return SameSecret(options.token, bearer.substr(7));
    return SameSecret(options.token, CookieValue(View(request[http::field::cookie]), "vss_token"));
  }

  void Accept();
  void Add(const std::shared_ptr<LiveSession>& session) {
    std::lock_guard lock(mutex);
    live.push_back(session);
  }
};

// One WebSocket: it only listens; what the page says is limited and thrown away.
class LiveSession : public std::enable_shared_from_this<LiveSession> {
 public:
  LiveSession(beast::tcp_stream&& stream, std::shared_ptr<Server::Impl> server)
      : ws_(std::move(stream)), server_(std::move(server)) {}
  ~LiveSession() { --server_->connections; }

  void Run(HttpRequest request) {
    beast::get_lowest_layer(ws_).expires_never();
    ws_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    ws_.read_message_max(server_->options.max_message_bytes);
    request_ = std::move(request);
    ws_.async_accept(request_, [self = shared_from_this()](error_code ec) {
      if (ec) return;
      self->open_ = true;
      self->server_->Add(self);
      self->Read();
    });
  }

  void Send(std::shared_ptr<const std::string> text) {
    asio::post(ws_.get_executor(), [self = shared_from_this(), text] {
      if (!self->open_) return;
      if (self->queue_.size() >= kMaxQueuedMessages) return self->Close();
      self->queue_.push_back(text);
      if (self->queue_.size() == 1) self->Write();
    });
  }

  void Close() {
    open_ = false;
    beast::get_lowest_layer(ws_).close();
  }
  bool open() const { return open_; }

 private:
  void Read() {
    ws_.async_read(buffer_, [self = shared_from_this()](error_code ec, std::size_t) {
      if (ec) {
        self->open_ = false;
        return;
      }
      self->buffer_.consume(self->buffer_.size());
      self->Read();
    });
  }
  void Write() {
    ws_.text(true);
    ws_.async_write(asio::buffer(*queue_.front()), [self = shared_from_this()](error_code ec, std::size_t) {
      if (ec) {
        self->open_ = false;
        return;
      }
      self->queue_.pop_front();
      if (!self->queue_.empty()) self->Write();
    });
  }

  websocket::stream<beast::tcp_stream> ws_;
  std::shared_ptr<Server::Impl> server_;
  HttpRequest request_;
  beast::flat_buffer buffer_;
  std::deque<std::shared_ptr<const std::string>> queue_;
  std::atomic<bool> open_{false};
};

namespace {

// One connection: requests one after the other, each answered before the next is read.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(tcp::socket&& socket, std::shared_ptr<Server::Impl> server)
      : stream_(std::move(socket)), server_(std::move(server)) {}
  ~HttpSession() {
    if (!handed_over_) --server_->connections;
  }

  void Read() {
    parser_.emplace();
    parser_->header_limit(std::uint32_t(server_->options.max_header_bytes));
    parser_->body_limit(server_->options.max_body_bytes);
    stream_.expires_after(std::chrono::seconds(server_->options.timeout_s));
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](error_code ec, std::size_t) { self->OnRead(ec); });
  }

 private:
  void OnRead(error_code ec) {
    if (ec == http::error::end_of_stream || ec == asio::error::operation_aborted ||
        ec == asio::error::connection_reset || ec == asio::error::eof || ec == beast::error::timeout)
      return Shut();
    if (ec == http::error::body_limit) return Send(Refusal(413, "the request is too large"), true);
    if (ec == http::error::header_limit) return Send(Refusal(431, "the request's header is too large"), true);
    if (ec == http::error::partial_message) return Shut();
    if (ec) return Send(Refusal(400, "the request is malformed"), true);
    request_ = parser_->release();
    head_ = request_.method() == http::verb::head;
    Check();
  }

  void Check() {
    Request asked;
    const std::string_view target = View(request_.target());
    if (request_.count(http::field::host) != 1)
      return Send(Refusal(400, "a request needs one Host header"), true);
    if (target.size() > kMaxTargetBytes) return Send(Refusal(414, "the address is too long"), true);
    if (!ParseTarget(target, &asked.path, &asked.query))
      return Send(Refusal(400, "the address is malformed"), true);
    if (auto refusal = server_->Refuse(request_)) return Send(std::move(*refusal), true);
    if (TakesTokenFromAddress(asked)) return;
    if (!server_->HasToken(request_))
      return Send(Refusal(401, "the right token is needed; open the address that the station printed"), true);
    if (websocket::is_upgrade(request_)) return Upgrade(asked.path);
    const auto method = request_.method();
    if (method != http::verb::get && method != http::verb::head && method != http::verb::post) {
      Response no = Refusal(405, "only GET, HEAD and POST are answered");
      no.headers.emplace_back("Allow", "GET, HEAD, POST");
      return Send(std::move(no), true);
    }
    if (method == http::verb::post) {
      std::string type(View(request_[http::field::content_type]));
      if (type.substr(0, type.find(';')) != "application/json")
        return Send(Refusal(415, "what is posted must be application/json"), true);
    }
    asked.method = method == http::verb::post ? "POST" : "GET";
    asked.who = CleanName(View(request_["X-VSS-Who"]));
    asked.if_none_match = std::string(View(request_[http::field::if_none_match]));
    asked.body = std::move(request_.body());
    Answer(std::move(asked));
  }

  // The address with ?token= is opened once: the token moves into a cookie and out of the address.
  bool TakesTokenFromAddress(const Request& asked) {
    const auto& token = server_->options.token;
    const auto given = asked.query.find("token");
    if (token.empty() || asked.path != "/" || given == asked.query.end()) return false;
    if (!SameSecret(token, given->second)) {
      Send(Refusal(401, "the token is wrong"), true);
      return true;
    }
    Response go{
        303,
        "text/plain",
        "",
        {{"Location", "/"}, {"Set-Cookie", "vss_token=" + token + "; HttpOnly; SameSite=Strict; Path=/"}}};
    Send(std::move(go), false);
    return true;
  }

  void Upgrade(const std::string& path) {
    if (path != "/api/live") return Send(Refusal(404, "live messages come from /api/live"), true);
    handed_over_ = true;
    auto session = std::make_shared<LiveSession>(std::move(stream_), server_);
    session->Run(std::move(request_));
  }

  void Answer(Request asked) {
    stream_.expires_never();
    asio::post(server_->workers, [self = shared_from_this(), asked = std::move(asked)] {
      Response answer;
      try {
        answer = self->server_->handler(asked);
      } catch (const std::exception&) {
        answer = Refusal(500, "the station failed to answer; its terminal says more");
      }
      asio::post(self->stream_.get_executor(),
                 [self, answer = std::move(answer)]() mutable { self->Send(std::move(answer), false); });
    });
  }

  void Send(Response answer, bool close) {
    out_.emplace();
    out_->result(unsigned(answer.status));
    out_->version(11);
    out_->set(http::field::content_type, answer.type);
    out_->set("X-Content-Type-Options", "nosniff");
    out_->set("X-Frame-Options", "DENY");
    out_->set("Referrer-Policy", "no-referrer");
    out_->set("Cross-Origin-Resource-Policy", "same-origin");
    out_->set("Content-Security-Policy",
              "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; connect-src "
              "'self' ws: wss:; "
              "frame-ancestors 'none'; base-uri 'none'; form-action 'none'");
    bool cached = false;
    for (auto& [name, value] : answer.headers) {
      out_->set(name, value);
      cached = cached || name == "Cache-Control";
    }
    if (!cached) out_->set(http::field::cache_control, "no-store");
    out_->keep_alive(!close && request_.keep_alive());
    const std::size_t length = answer.body.size();
    if (!head_) out_->body() = std::move(answer.body);
    if (answer.status != 304) out_->content_length(length);
    stream_.expires_after(std::chrono::seconds(server_->options.timeout_s));
    auto done = [self = shared_from_this()](error_code ec, std::size_t) {
      if (ec || !self->out_->keep_alive()) return self->Drain(ec);
      self->Read();
    };
    if (!head_) return http::async_write(stream_, *out_, std::move(done));
    serializer_.emplace(*out_);
    http::async_write_header(stream_, *serializer_, std::move(done));
  }

  // Closing with unread bytes would reset the connection and lose the answer: read a little first, for a
  // short time.
  void Drain(error_code ec) {
    error_code ignored;
    if (ec) return Shut();
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    stream_.expires_after(std::chrono::milliseconds(500));
    DrainMore();
  }
  void DrainMore() {
    constexpr std::size_t kMaxDrainedBytes = 8 << 20;
    if (drained_ > kMaxDrainedBytes) return Shut();
    stream_.async_read_some(asio::buffer(waste_), [self = shared_from_this()](error_code ec, std::size_t n) {
      self->drained_ += n;
      if (ec) return self->Shut();
      self->DrainMore();
    });
  }
  void Shut() {
    error_code ignored;
    stream_.socket().close(ignored);
  }

  beast::tcp_stream stream_;
  std::shared_ptr<Server::Impl> server_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  HttpRequest request_;
  std::optional<HttpResponse> out_;
  std::optional<http::response_serializer<http::string_body>> serializer_;
  std::array<char, 4096> waste_{};
  std::size_t drained_ = 0;
  bool head_ = false;
  bool handed_over_ = false;
};

}  // namespace

void Server::Impl::Accept() {
  acceptor.async_accept(asio::make_strand(io),
                        [self = shared_from_this()](error_code ec, tcp::socket socket) {
                          if (self->stopped || ec == asio::error::operation_aborted) return;
                          if (!ec && self->connections < self->options.max_connections) {
                            ++self->connections;
                            socket.set_option(tcp::no_delay(true), ec);
                            std::make_shared<HttpSession>(std::move(socket), self)->Read();
                          }
                          self->Accept();
                        });
}

Result<std::unique_ptr<Server>> Server::Start(const ServerOptions& options, Handler handler) {
  error_code ec;
  const auto address = asio::ip::make_address(options.address, ec);
  if (ec)
    return UsageError("--listen {}: not an address; give a number such as 192.168.0.7", options.address);
  if (!address.is_loopback() && options.token.empty())
    return UsageError(
        "--listen {}: anybody on the network could open this survey; name a token with --token-file",
        options.address);
  auto impl = std::make_shared<Impl>(options, std::move(handler));
  const tcp::endpoint endpoint(address, options.port);
  impl->acceptor.open(endpoint.protocol(), ec);
  if (!ec) impl->acceptor.set_option(asio::socket_base::reuse_address(true), ec);
  if (!ec) impl->acceptor.bind(endpoint, ec);
  if (!ec) impl->acceptor.listen(asio::socket_base::max_listen_connections, ec);
  if (ec)
    return UsageError("cannot listen on {} port {} ({}); choose another with --port", options.address,
                      options.port, ec.message());
  impl->port = impl->acceptor.local_endpoint().port();
  impl->Accept();
  impl->threads.emplace_back([raw = impl.get()] { raw->io.run(); });
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::~Server() { Stop(); }
std::uint16_t Server::port() const { return impl_->port; }

std::string Server::url() const {
  const std::string host = impl_->options.address.find(':') != std::string::npos
                               ? "[" + impl_->options.address + "]"
                               : impl_->options.address;
  return fmt::format("http://{}:{}/", host, impl_->port);
}

void Server::Broadcast(const std::string& text) {
  auto shared = std::make_shared<const std::string>(text);
  std::lock_guard lock(impl_->mutex);
  std::erase_if(impl_->live, [](const auto& weak) {
    const auto session = weak.lock();
    return !session || !session->open();
  });
  for (const auto& weak : impl_->live)
    if (const auto session = weak.lock()) session->Send(shared);
}

int Server::num_listeners() const {
  std::lock_guard lock(impl_->mutex);
  return static_cast<int>(std::count_if(impl_->live.begin(), impl_->live.end(), [](const auto& weak) {
    const auto session = weak.lock();
    return session && session->open();
  }));
}

void Server::Stop() {
  if (impl_->stopped.exchange(true)) return;
  impl_->workers.join();
  impl_->io.stop();
  for (auto& thread : impl_->threads) thread.join();
}

}  // namespace vss::station
