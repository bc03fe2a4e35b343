// The operator's station: one page on a survey, served until it is stopped.
#pragma once
#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "vss/base/result.h"

namespace vss::station {

struct StationOptions {
  std::filesystem::path folder;
  std::string listen = "127.0.0.1";
  int port = 0;                   // 0: a free one
  std::string token_file;         // demanded where `listen` is not loopback
  std::filesystem::path product;  // a product.json to begin with, where the survey has no parts yet
  int threads = 0;
};

// Serves until `stop`. `opened` is called once with the address of the page.
Status RunStation(const StationOptions& options, const std::function<void(const std::string& url)>& opened,
                  const std::atomic<bool>& stop);

}  // namespace vss::station
