#include "request_text.h"

#include <sys/stat.h>

#include <algorithm>
#include <cctype>

#include "vss/base/files.h"

namespace vss::station {
namespace {

constexpr std::size_t kMinTokenBytes = 16;
constexpr std::size_t kMaxWhoBytes = 60;

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::optional<std::string> PercentDecode(std::string_view text, bool plus_is_space) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      if (i + 2 >= text.size() || HexDigit(text[i + 1]) < 0 || HexDigit(text[i + 2]) < 0) return std::nullopt;
      c = static_cast<char>(HexDigit(text[i + 1]) * 16 + HexDigit(text[i + 2]));
      i += 2;
    } else if (c == '+' && plus_is_space) {
      c = ' ';
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    out += c;
  }
  return out;
}

bool IsSafePath(std::string_view path) {
  if (path.empty() || path[0] != '/' || path.find('\\') != path.npos) return false;
  for (std::size_t at = 0; at < path.size();) {
    const std::size_t end = std::min(path.find('/', at + 1), path.size());
    const std::string_view segment = path.substr(at + 1, end - at - 1);
    if (segment == ".." || segment == ".") return false;
    if (segment.empty() && end != path.size()) return false;
    at = end;
  }
  return true;
}

}  // namespace

bool SameSecret(std::string_view a, std::string_view b) {
  unsigned char difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<unsigned char>(a[i] ^ (b.empty() ? 0 : b[i % b.size()]));
  return difference == 0;
}

std::string_view CookieValue(std::string_view cookies, std::string_view name) {
  while (!cookies.empty()) {
    const std::size_t end = std::min(cookies.find(';'), cookies.size());
    std::string_view one = cookies.substr(0, end);
    while (!one.empty() && one.front() == ' ') one.remove_prefix(1);
    if (one.size() > name.size() && one.substr(0, name.size()) == name && one[name.size()] == '=')
      return one.substr(name.size() + 1);
    cookies.remove_prefix(std::min(end + 1, cookies.size()));
  }
  return {};
}

std::string HostWithoutPort(std::string_view host) {
  if (!host.empty() && host[0] == '[') return std::string(host.substr(0, host.find(']') + 1));
  return std::string(host.substr(0, host.find(':')));
}

std::string CleanName(std::string_view name) {
  std::string out = PercentDecode(name, false).value_or("");
  if (out.size() > kMaxWhoBytes) out.resize(kMaxWhoBytes);
  return out;
}

bool ParseTarget(std::string_view target, std::string* path, std::map<std::string, std::string>* query) {
  const std::size_t mark = std::min(target.find('?'), target.size());
  const auto decoded = PercentDecode(target.substr(0, mark), false);
  if (!decoded || !IsSafePath(*decoded)) return false;
  *path = *decoded;
  std::string_view rest = target.substr(std::min(mark + 1, target.size()));
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('&'), rest.size());
    const std::string_view one = rest.substr(0, end);
    const std::size_t equal = std::min(one.find('='), one.size());
    const auto name = PercentDecode(one.substr(0, equal), true);
    const auto value = PercentDecode(one.substr(std::min(equal + 1, one.size())), true);
    if (!name || !value) return false;
    if (!name->empty()) (*query)[*name] = *value;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return true;
}

Result<std::string> ReadToken(const std::string& path) {
  VSS_ASSIGN(auto text, ReadTextFile(path, 4096));
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && (info.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    return InputError("{}: others can read this token file; run chmod 600 on it", path);
  text.erase(std::min(text.find_first_of("\r\n"), text.size()));
  if (text.size() < kMinTokenBytes)
    return InputError("{}: the token has {} characters, at least {} are needed", path, text.size(),
                      kMinTokenBytes);
  if (!std::all_of(text.begin(), text.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_';
      }))
    return InputError("{}: a token consists of letters, digits, '-' and '_' only", path);
  return text;
}

}  // namespace vss::station
