// A part fitted to picked lines, as the page asks for it after every click and the commands before they save
// it.
#pragma once
#include <set>
#include <vector>

#include "manual_fit.h"
#include "workspace.h"

namespace vss::station {

inline constexpr double kCollectPx = 2.5;       // lines so near to the fitted contour are taken along
inline constexpr double kCollectAgainPx = 1.2;  // and, after the fit with them, so near

struct Fitted {
  FitQuestion question;
  FitAnswer answer;
  std::vector<View> views;
};

// What a question means: {"kind", "features"?, "resting_pose"?, "stands_on"?, "picks": [{"image", "line",
// "contour", "circle"?}], "fixed"?: {name: mm}, "part"?: id to start from}. Errors say what is wrong with it.
Result<FitQuestion> QuestionOf(Workspace& workspace, const Json& body);
// The fit of it; with "collect", to all lines that lie on the part.
Result<Fitted> Fit(Workspace& workspace, const Json& body);
// The same for the page: part, picks with residuals, projections into all pictures, hints.
Result<Json> LiveFit(Workspace& workspace, const Json& body);
// Which contours the picks are, where the operator has not said it; those of the question are not looked at:
// {"readings": [{"contours", "rms_px"}], "decided", "ms"}.
Result<Json> ProposedContours(Workspace& workspace, const Json& body);

// Takes the lines that lie on the part and fits it to them too. `part_id`: the part's own lines are free for
// it.
Status CollectAndRefit(Workspace& workspace, Fitted& fitted, const std::string& part_id);

// The contract calls the longer horizontal side of a box its length: where a fit has it the other way round,
// the part is turned by a quarter and its contours are renamed.
void PutLengthFirst(FitQuestion& question, FitAnswer& answer, const std::vector<View>& views);

// Lines and arcs that other parts use.
using UsedLines = std::set<std::tuple<int, int, bool>>;  // picture, line, is it an arc?
UsedLines LinesOfOthers(const Workspace& workspace, const std::string& but);

}  // namespace vss::station
