// What an operator can do to a survey. Every command is one edit: saved before it is answered, undone in one
// step.
#pragma once
#include "http_server.h"
#include "workspace.h"

namespace vss::station {

// {"do": NAME, ...}: see the table in commands.cc.
Response RunCommand(Workspace& workspace, const Request& request, const Json& body,
                    const std::function<void(const Json&)>& tell);

// The names of all commands.
std::vector<std::string> CommandNames();

}  // namespace vss::station
