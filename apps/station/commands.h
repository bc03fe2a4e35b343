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

// A live fit: {"kind", "resting_pose"?, "stands_on"?, "picks": [{"image", "line", "contour", "circle"?}],
// "fixed"?: {name: mm}, "part"?: id to start from, "collect"?: bool} -> part, picks with residuals,
// projections into all pictures, hints.
Result<Json> LiveFit(Workspace& workspace, const Json& body);

// What a question of that form means. Errors say what is wrong with it.
Result<FitQuestion> QuestionOf(Workspace& workspace, const Json& body);

}  // namespace vss::station
