// The one error type. A function that can fail on bad data returns Result<T>; a bug asserts.
#pragma once
#include <fmt/format.h>

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace vss {

enum class ErrorCode {
  kInput,      // the input's fault; exit code 1
  kUsage,      // how the program was called; exit code 2
  kInternal,   // our fault; exit code 3
  kCancelled,  // the user stopped it; exit code 1
};

// One sentence that names the file, the line where there is one, and the remedy.
struct Error {
  ErrorCode code = ErrorCode::kInput;
  std::string message;
};

template <class T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

template <class... Args>
tl::unexpected<Error> InputError(fmt::format_string<Args...> text, Args&&... args) {
  return tl::unexpected<Error>({ErrorCode::kInput, fmt::format(text, std::forward<Args>(args)...)});
}
template <class... Args>
tl::unexpected<Error> UsageError(fmt::format_string<Args...> text, Args&&... args) {
  return tl::unexpected<Error>({ErrorCode::kUsage, fmt::format(text, std::forward<Args>(args)...)});
}
inline tl::unexpected<Error> Cancelled() {
  return tl::unexpected<Error>({ErrorCode::kCancelled, "stopped before the end; nothing was written"});
}

#define VSS_CONCAT_INNER(a, b) a##b
#define VSS_CONCAT(a, b) VSS_CONCAT_INNER(a, b)
// VSS_ASSIGN(auto image, ReadImage(path)): declares `image`, or returns the error.
#define VSS_ASSIGN(declaration, expression) VSS_ASSIGN_INNER(VSS_CONCAT(vss_result_, __LINE__), declaration, expression)
#define VSS_ASSIGN_INNER(result, declaration, expression) \
  auto result = (expression);                             \
  if (!result) return tl::unexpected(result.error());     \
  declaration = std::move(*result)
#define VSS_RETURN_IF_ERROR(expression) \
  if (auto status_ = (expression); !status_) return tl::unexpected(status_.error())

}  // namespace vss
