// A file whose bytes are linked into the program.
#pragma once
#include <string_view>

namespace vss {

struct EmbeddedFile {
  std::string_view name;
  std::string_view text;
};

}  // namespace vss
