// Text files in and out.
#pragma once
#include <filesystem>
#include <string>
#include <string_view>

#include "vss/base/result.h"

namespace vss {

// The whole file; an error names it. Files above `max_bytes` are refused.
Result<std::string> ReadTextFile(const std::filesystem::path& path, std::size_t max_bytes = 64 << 20);

// Writes beside the target and renames: the file is there whole, with its old content, or not at all.
Status WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

// Makes the folder (and those above it), and checks that a file can be written there.
Status MakeOutputFolder(const std::filesystem::path& folder);

}  // namespace vss
