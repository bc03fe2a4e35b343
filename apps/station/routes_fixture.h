// A station on a copy of the sample, as the tests of its routes and commands ask it.
#pragma once
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>

#include "raw_http.h"
#include "routes.h"
#include "vss/base/files.h"

namespace vss::station {
namespace fs = std::filesystem;

inline const std::string kToken = "0123456789abcdef";
inline const std::string kSecret = "what-stands-outside";
inline const std::string kHeaders = "Host: localhost\r\nAuthorization: Bearer " + kToken + "\r\n";

// Every file below `folder`, with its size and when it was written.
inline std::map<std::string, std::pair<std::uintmax_t, fs::file_time_type>> FilesOf(const fs::path& folder) {
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

}  // namespace vss::station
