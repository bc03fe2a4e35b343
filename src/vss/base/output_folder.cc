#include "vss/base/output_folder.h"

#include <unistd.h>

#include <algorithm>
#include <map>

#include "vss/base/files.h"

namespace vss {
namespace fs = std::filesystem;
namespace {

// The folders of `path` that do not exist, outermost first.
std::vector<fs::path> MissingFolders(fs::path path) {
  std::vector<fs::path> missing;
  std::error_code ec;
  path = fs::absolute(path, ec).lexically_normal();
  while (!path.empty() && !fs::exists(path, ec)) {
    if (path.has_filename()) missing.push_back(path);
    if (path == path.parent_path()) break;
    path = path.parent_path();
  }
  std::reverse(missing.begin(), missing.end());
  return missing;
}

void RemoveEmpty(std::vector<fs::path>& folders) {
  std::error_code ec;
  for (auto it = folders.rbegin(); it != folders.rend(); ++it)
    fs::remove(*it, ec);  // leaves what is not empty
  folders.clear();
}

// A path as one plain file name.
std::string Flattened(const fs::path& path) {
  std::string name;
  fs::path plain = path.lexically_normal();
  plain.replace_extension();
  for (const auto& piece : plain) {
    if (piece == ".." || piece == "." || piece == "/") continue;
    name += (name.empty() ? "" : "_") + piece.string();
  }
  return name;
}

}  // namespace

Result<OutputFolder> OutputFolder::Open(const fs::path& folder) {
  OutputFolder out;
  out.folder_ = folder;
  out.made_ = MissingFolders(folder);
  VSS_RETURN_IF_ERROR(MakeOutputFolder(folder));
  return out;
}

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : folder_(std::move(other.folder_)),
      made_(std::exchange(other.made_, {})),
      files_(std::move(other.files_)) {}

OutputFolder::~OutputFolder() { RemoveEmpty(made_); }

void OutputFolder::Add(const fs::path& name, std::string content) {
  files_.emplace_back(name, std::move(content));
}

Status OutputFolder::Commit() {
  const fs::path staging = folder_ / fmt::format(".vss-{}.part", ::getpid());
  std::error_code ec;
  const auto give_up = [&](const Error& error) {
    fs::remove_all(staging, ec);
    return tl::unexpected(error);
  };
  for (const auto& [name, content] : files_) {
    fs::create_directories((staging / name).parent_path(), ec);
    if (const Status written = WriteFileAtomically(staging / name, content); !written)
      return give_up(written.error());
  }
  for (const auto& [name, content] : files_) {
    fs::create_directories((folder_ / name).parent_path(), ec);
    fs::rename(staging / name, folder_ / name, ec);
    if (ec)
      return give_up(
          {ErrorCode::kInput, fmt::format("{}: cannot be written ({}); name another folder with -o",
                                          (folder_ / name).string(), ec.message())});
  }
  fs::remove_all(staging, ec);
  made_.clear();
  files_.clear();
  return {};
}

std::vector<std::string> OutputNames(const std::vector<std::string>& picture_files) {
  std::map<std::string, int> stems, flats;
  for (const auto& file : picture_files) {
    ++stems[fs::path(file).stem().string()];
    ++flats[Flattened(file)];
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < picture_files.size(); ++i) {
    std::string name = fs::path(picture_files[i]).stem().string();
    if (stems[name] > 1) name = Flattened(picture_files[i]);
    if (stems[fs::path(picture_files[i]).stem().string()] > 1 && flats[name] > 1)
      name += fmt::format("_{}", i + 1);
    names.push_back(name);
  }
  return names;
}

}  // namespace vss
