// For tests: requests byte by byte, well-formed or not.
#pragma once
#include <fmt/format.h>

#include <boost/asio.hpp>
#include <cstdint>
#include <string>

namespace vss::station {

// Sends bytes as they are and reads until the server closes or an answer's head and body are there; the
// status, or 0 where the server closed without an answer.
inline int StatusOf(std::uint16_t port, const std::string& bytes, std::string* answer = nullptr) {
  namespace asio = boost::asio;
  using tcp = asio::ip::tcp;
  asio::io_context io;
  tcp::socket socket(io);
  socket.connect({asio::ip::make_address("127.0.0.1"), port});
  boost::system::error_code ec;
  asio::write(socket, asio::buffer(bytes), ec);
  socket.shutdown(tcp::socket::shutdown_send, ec);
  std::string text;
  asio::read(socket, asio::dynamic_buffer(text), ec);
  if (answer) *answer = text;
  if (text.size() < 12 || text.substr(0, 9) != "HTTP/1.1 ") return 0;
  return std::stoi(text.substr(9, 3));
}

inline std::string Get(const std::string& target, const std::string& headers = "Host: localhost\r\n") {
  return "GET " + target + " HTTP/1.1\r\n" + headers + "Connection: close\r\n\r\n";
}
inline std::string Post(
    const std::string& target, const std::string& body,
    const std::string& headers = "Host: localhost\r\nContent-Type: application/json\r\n") {
  return "POST " + target + " HTTP/1.1\r\n" + headers +
         fmt::format("Content-Length: {}\r\nConnection: close\r\n\r\n", body.size()) + body;
}

}  // namespace vss::station
