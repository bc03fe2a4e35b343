// What the texts of a request mean: its target, its host, its cookies, who asks.
#pragma once
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "vss/base/result.h"

namespace vss::station {

// Path and query of a request's target, percent signs decoded. False where it is malformed or the path leaves
// the root.
bool ParseTarget(std::string_view target, std::string* path, std::map<std::string, std::string>* query);

// The token in that file. Errors: others can read it, it is short, it has other characters than letters,
// digits, - and _.
Result<std::string> ReadToken(const std::string& path);

// Takes the same time wherever the first difference lies.
bool SameSecret(std::string_view a, std::string_view b);

// The value of that cookie; empty where there is none.
std::string_view CookieValue(std::string_view cookies, std::string_view name);

std::string HostWithoutPort(std::string_view host);

// Who asks, as it is kept: decoded, and no longer than a line; empty where it is malformed.
std::string CleanName(std::string_view name);

}  // namespace vss::station
