// How long work tells of itself, and how it is stopped.
#pragma once
#include <atomic>
#include <functional>
#include <string_view>

namespace vss {

// `report(step, done, total)` may be called from any thread; calls are serialised by the callee where it matters.
struct Progress {
  std::function<void(std::string_view step, int done, int total)> report;
  const std::atomic<bool>* cancel = nullptr;

  void Report(std::string_view step, int done, int total) const {
    if (report) report(step, done, total);
  }
  bool Cancelled() const { return cancel != nullptr && cancel->load(std::memory_order_relaxed); }
};

}  // namespace vss
