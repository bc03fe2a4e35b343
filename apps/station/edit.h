// What the commands have in common: each makes one Edit out of what the page asked for. Only for commands.cc
// and its kin.
#pragma once
#include "workspace.h"

namespace vss::station {

// One edit about to be made.
struct Edit {
  std::string label;
  std::vector<Change> changes;
  Json answer = Json::object();
};

struct Context {
  Workspace& workspace;
  const Json& body;
  std::optional<std::int64_t> version;  // of the item that the page saw
};

inline std::string PartId(const Json& body) { return body.at("part").get<std::string>(); }
inline Eigen::Vector2d PointOf(const Json& j) { return {j.at(0).get<double>(), j.at(1).get<double>()}; }
Change ChangeOf(const Workspace& workspace, const StationPart& part, std::optional<std::int64_t> version);
std::string FreeId(Workspace& workspace);

// part_commands.cc
Result<Edit> SavePart(const Context& context);
Result<Edit> DeletePart(const Context& context);
Result<Edit> ConfirmPart(const Context& context);
Result<Edit> DropLine(const Context& context);
Result<Edit> RefitPart(const Context& context);
Result<Edit> MeasurePart(const Context& context);
Result<Edit> ChangeKind(const Context& context);
Result<Edit> MergeParts(const Context& context);
// split_part.cc
Result<Edit> SplitPart(const Context& context);
// line_commands.cc
Result<Edit> DrawLine(const Context& context);
Result<Edit> DrawArc(const Context& context);
Result<Edit> RemoveLine(const Context& context);
Result<Edit> SplitLine(const Context& context);
Result<Edit> MergeLines(const Context& context);
Result<Edit> ExtendLine(const Context& context);

}  // namespace vss::station
