#include "vss/base/files.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

namespace vss {
namespace fs = std::filesystem;

Result<std::string> ReadTextFile(const fs::path& path, std::size_t max_bytes) {
  std::error_code ec;
  if (!fs::exists(path, ec)) return InputError("{}: there is no such file; check the name", path.string());
  if (fs::is_directory(path, ec)) return InputError("{}: this is a folder, a file is needed", path.string());
  const auto size = fs::file_size(path, ec);
  if (!ec && size > max_bytes) return InputError("{}: {} bytes are more than the {} that such a file may have", path.string(), size, max_bytes);
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) return InputError("{}: cannot be read ({}); check its permissions", path.string(), std::strerror(errno));
  return std::move(text).str();
}

Status WriteFileAtomically(const fs::path& path, std::string_view content) {
  const fs::path part = path.string() + fmt::format(".{}.part", ::getpid());
  std::error_code ec;
  {
    std::ofstream out(part, std::ios::binary | std::ios::trunc);
    out.write(content.data(), static_cast<std::streamsize>(content.size()));
    out.flush();
    if (!out) {
      const std::string why = std::strerror(errno);
      out.close();
      fs::remove(part, ec);
      return InputError("{}: cannot be written ({}); name a folder that you may write to", path.string(), why);
    }
  }
  fs::rename(part, path, ec);
  if (ec) {
    const std::string why = ec.message();
    fs::remove(part, ec);
    return InputError("{}: cannot be written ({})", path.string(), why);
  }
  return {};
}

Status MakeOutputFolder(const fs::path& folder) {
  std::error_code ec;
  fs::create_directories(folder, ec);
  if (ec || !fs::is_directory(folder)) return InputError("{}: this output folder cannot be made ({}); name another with -o", folder.string(), ec ? ec.message() : "a file of that name exists");
  const fs::path probe = folder / fmt::format(".vss-{}.part", ::getpid());
  {
    std::ofstream out(probe);
    out << "x";
    if (!out.flush()) return InputError("{}: this output folder cannot be written to ({}); name another with -o", folder.string(), std::strerror(errno));
  }
  fs::remove(probe, ec);
  return {};
}

}  // namespace vss
