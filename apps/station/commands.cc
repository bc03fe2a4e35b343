#include "commands.h"

#include <algorithm>

#include "edit.h"
#include "routes.h"

namespace vss::station {
namespace {

Result<Edit> SetParameters(const Context& c) {
  const auto item = c.workspace.store().Get("settings", "parameters");
  Json values = item ? *item->value : Json::object();
  std::string label;
  for (const auto& [name, value] : c.body.at("values").items()) {
    SurveyOptions probe;
    if (value.is_null()) {
      values.erase(name);
    } else {
      VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value.get<double>(), probe));
      values[name] = value.get<double>();
    }
    label += (label.empty() ? "set " : ", ") + name.substr(0, 60);
  }
  if (label.empty()) return UsageError("no parameter is named");
  return Edit{label, {{"settings", "parameters", values, c.version}}};
}

// The cameras of the last calibration become those of the survey.
Result<Edit> TakeCameras(const Context& c) {
  const auto last = c.workspace.store().Get("calibration", "last");
  if (!last) return UsageError("nothing was calibrated yet");
  const auto before = c.workspace.store().Get("settings", "cameras");
  Json files =
      before ? before->value->at("files") : Json::object();  // a calibration of other cameras stays in use
  files.update(last->value->at("files"));
  VSS_ASSIGN([[maybe_unused]] const Survey checked, SurveyWithCameras(c.workspace.survey(), files));
  const std::string job = last->value->at("job");
  return Edit{fmt::format("take over the cameras of {}", job),
              {{"settings", "cameras", Json{{"job", job}, {"calibration", last->version}, {"files", files}},
                c.version}}};
}

Result<Edit> OwnCameras(const Context& c) {
  if (!c.workspace.store().Get("settings", "cameras"))
    return UsageError("the survey's own cameras are in use");
  return Edit{"use the survey's own cameras", {{"settings", "cameras", std::nullopt, c.version}}};
}

struct Command {
  const char* name;
  Result<Edit> (*run)(const Context&);
};
constexpr Command kCommands[] = {
    {"save_part", SavePart},           {"delete_part", DeletePart},   {"confirm_part", ConfirmPart},
    {"drop_line", DropLine},           {"refit_part", RefitPart},     {"measure_part", MeasurePart},
    {"change_kind", ChangeKind},       {"split_part", SplitPart},     {"merge_parts", MergeParts},
    {"draw_line", DrawLine},           {"draw_arc", DrawArc},         {"remove_line", RemoveLine},
    {"split_line", SplitLine},         {"merge_lines", MergeLines},   {"extend_line", ExtendLine},
    {"set_parameters", SetParameters}, {"take_cameras", TakeCameras}, {"own_cameras", OwnCameras},
};

std::string Who(const Request& request) { return request.who.empty() ? "operator" : request.who; }

Response Told(Workspace& w, const StoreResult<std::int64_t>& revision, const Request& request, Json answer,
              const std::function<void(const Json&)>& tell) {
  if (!revision) return AnswerOf(revision.error());
  w.UseCameras();
  answer["revision"] = *revision;
  if (tell) tell({{"type", "edit"}, {"revision", *revision}, {"who", Who(request)}});
  return AnswerOf(answer);
}

std::optional<std::int64_t> OptionalNumber(const Json& body, const char* name) {
  const auto at = body.find(name);
  if (at == body.end() || at->is_null()) return std::nullopt;
  return at->get<std::int64_t>();
}

}  // namespace

Change ChangeOf(const Workspace& w, const StationPart& part, std::optional<std::int64_t> version) {
  return {"part", part.part.id, PartToJson(part, w.image_files()), version};
}

std::string FreeId(Workspace& w) {
  int highest = 0;
  for (const auto& item : w.store().Since(0))  // deleted ones included: an id never means two things
    if (item.kind == "part" && item.id.rfind("part-", 0) == 0)
      highest = std::max(highest, std::atoi(item.id.c_str() + 5));
  return fmt::format("part-{}", highest + 1);
}

std::vector<std::string> CommandNames() {
  std::vector<std::string> names = {"undo", "redo", "run", "calibrate", "cancel"};
  for (const auto& command : kCommands) names.emplace_back(command.name);
  return names;
}

Response RunCommand(Workspace& w, const Request& request, const Json& body,
                    const std::function<void(const Json&)>& tell) {
  const std::string name = body.value("do", "");
  if (name == "undo")
    return Told(w, w.store().Undo(Who(request), OptionalNumber(body, "edit")), request, Json::object(), tell);
  if (name == "redo")
    return Told(w, w.store().Redo(Who(request), OptionalNumber(body, "edit")), request, Json::object(), tell);
  if (name == "run" || name == "calibrate") {
    const auto say = [tell](const Json& run) {
      if (tell) tell({{"type", "run"}, {"run", run}});
    };
    const auto started = name == "run" ? w.StartRun(Who(request), say)
                                       : w.StartCalibration(Who(request), body.at("job").get<std::string>(),
                                                            body.value("model", "weng"),
                                                            body.value("values", Json::object()), say);
    if (!started) return AnswerOf(started.error());
    return {202, "application/json", "{}", {}};
  }
  if (name == "cancel") {
    w.CancelRun();
    return AnswerOf(Json::object());
  }
  for (const auto& command : kCommands) {
    if (name != command.name) continue;
    const auto edit = command.run({w, body, OptionalNumber(body, "version")});
    if (!edit) return AnswerOf(edit.error());
    return Told(w, w.store().Apply(Who(request), edit->label, edit->changes), request, edit->answer, tell);
  }
  return AnswerOf(Error{ErrorCode::kUsage, fmt::format("there is no command \"{}\"", name.substr(0, 40))});
}

}  // namespace vss::station
