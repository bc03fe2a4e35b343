#include "commands.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "edit.h"
#include "routes.h"

namespace vss::station {
namespace {

constexpr double kCollectPx = 2.5;       // lines so near to the fitted contour are taken along
constexpr double kCollectAgainPx = 1.2;  // and, after the fit with them, so near
constexpr std::size_t kMaxPicks = 4000;

std::string WithArticle(const std::string& kind) {
  return (kind.find_first_of("aeiou") == 0 ? "an " : "a ") + kind;
}

// The same contour of the same solid with other names: by the places of its ends in the world.
int SameEdge(const WorldSolid& from, int edge, const WorldSolid& to) {
  const auto& e = from.edges[std::size_t(edge)];
  const Eigen::Vector3d a = from.vertices[std::size_t(e.start)].point,
                        b = from.vertices[std::size_t(e.end)].point;
  int best = 0;
  double least = INFINITY;
  for (std::size_t i = 0; i < to.edges.size(); ++i) {
    const Eigen::Vector3d c = to.vertices[std::size_t(to.edges[i].start)].point,
                          d = to.vertices[std::size_t(to.edges[i].end)].point;
    const double distance = std::min((a - c).norm() + (b - d).norm(), (a - d).norm() + (b - c).norm());
    if (distance < least) least = distance, best = int(i);
  }
  return best;
}

// The contract calls the longer horizontal side of a box its length: where a fit has it the other way round,
// the part is turned by a quarter and its contours are renamed.
void PutLengthFirst(FitQuestion& q, FitAnswer& answer, const std::vector<View>& views) {
  if (q.model->kind() != "box") return;
  const auto defs = q.model->dimensions();
  const auto find = [&](const char* name) {
    return std::find_if(defs.begin(), defs.end(), [&](const auto& d) { return d.name == name; }) -
           defs.begin();
  };
  const auto length = std::size_t(find("length")), width = std::size_t(find("width"));
  if (length >= defs.size() || width >= defs.size() ||
      answer.object.dimensions_mm[length] >= answer.object.dimensions_mm[width])
    return;
  PlacedObject turned = answer.object;
  std::swap(turned.dimensions_mm[length], turned.dimensions_mm[width]);
  turned.placement[3] += kPi / 2;
  FitQuestion renamed = q;
  const WorldSolid from = PlaceSolid(answer.object, false), to = PlaceSolid(turned, false);
  for (auto& pick : renamed.picks)
    if (!pick.is_circle) pick.contour = SameEdge(from, pick.contour, to);
  if (const auto l = q.fixed_mm.find("length"), w = q.fixed_mm.find("width");
      l != q.fixed_mm.end() || w != q.fixed_mm.end()) {
    renamed.fixed_mm.erase("length");
    renamed.fixed_mm.erase("width");
    if (l != q.fixed_mm.end()) renamed.fixed_mm["width"] = l->second;
    if (w != q.fixed_mm.end()) renamed.fixed_mm["length"] = w->second;
  }
  renamed.start = turned;
  if (auto again = FitPicks(renamed, views)) {
    answer = std::move(*again);
    q = std::move(renamed);
  }
}

// Height of the top of what the part stands on.
double SupportHeight(const Part& support) {
  double top = 0;
  for (const auto& v : support.vertices) top = std::max(top, v.z());
  for (const auto& c : support.circles) top = std::max(top, c.center.z());
  return top;
}

// Lines that other parts use.
std::set<std::pair<int, int>> LinesOfOthers(const Workspace& w, const std::string& but) {
  std::set<std::pair<int, int>> used;
  for (const auto& p : w.Parts())
    if (p.part.id != but)
      for (const auto& m : p.part.matches)
        if (!m.is_arc) used.emplace(m.image, m.line);
  return used;
}

struct Fitted {
  FitQuestion question;
  FitAnswer answer;
  std::vector<View> views;
};

Status CollectAndRefit(Workspace& w, Fitted& f, const std::string& part_id) {
  const auto used = LinesOfOthers(w, part_id);
  Occluders others;
  int owner = 0;
  for (const auto& p : w.Parts())
    if (p.part.id != part_id)
      if (const PlacedObject object = PlacedObjectOf(p.part, w.knowledge()); object.model)
        others.Add(PlaceSolid(object, false), owner++);
  for (double tolerance : {kCollectPx, kCollectAgainPx}) {
    auto taken = [&](int image, int line) {
      return used.contains({image, line}) ||
             std::any_of(f.question.picks.begin(), f.question.picks.end(),
                         [&](const Pick& p) { return p.image == image && p.line == line; });
    };
    auto found = CollectPicks(f.answer.object, f.views, &others, tolerance, taken,
                              [&](int image) { return w.PicksOf(image); });
    if (f.question.picks.size() + found.size() > kMaxPicks) found.resize(kMaxPicks - f.question.picks.size());
    f.question.picks.insert(f.question.picks.end(), found.begin(), found.end());
    f.question.start = f.answer.object;
    VSS_ASSIGN(f.answer, FitPicks(f.question, f.views));
  }
  return {};
}

Result<Fitted> Fit(Workspace& w, const Json& body) {
  Fitted f;
  VSS_ASSIGN(f.question, QuestionOf(w, body));
  f.views = w.Views();
  VSS_ASSIGN(f.answer, FitPicks(f.question, f.views));
  if (body.value("collect", false)) VSS_RETURN_IF_ERROR(CollectAndRefit(w, f, body.value("part", "")));
  return f;
}

Json PicksToJson(const Fitted& f) {
  Json picks = Json::array();
  for (std::size_t i = 0; i < f.question.picks.size(); ++i) {
    const Pick& p = f.question.picks[i];
    const double residual = f.answer.residual_px[i];
    picks.push_back({{"image", p.image},
                     {"line", p.line},
                     {"contour", p.contour},
                     {"circle", p.is_circle},
                     {"residual_px", std::isfinite(residual) ? Json(residual) : Json()}});
  }
  return picks;
}

// ---- the commands; each makes one Edit ----

Result<Edit> SavePart(const Context& c) {
  Workspace& w = c.workspace;
  const std::string old_id = c.body.value("part", "");
  VSS_ASSIGN(auto f, Fit(w, c.body));
  if (!f.answer.placed)
    return UsageError("these lines do not yet say where the object stands; pick more of its edges");
  PutLengthFirst(f.question, f.answer, f.views);
  StationPart part;
  part.part = PartOfFit(f.answer, f.question);
  part.confirmed = true;
  part.part.stands_on = c.body.value("stands_on", "ground");
  part.part.id = old_id;
  part.part.source = "manual";
  std::optional<std::int64_t> version = 0;
  if (old_id.empty()) {
    part.part.id = FreeId(w);
  } else {
    VSS_ASSIGN(const auto old, w.FindPart(old_id));
    part.part.source = old.first.part.source == "manual" ? "manual" : "corrected";
    part.part.log_odds = old.first.part.log_odds;
    version = c.version;
  }
  const std::string label = old_id.empty() ? fmt::format("add {} {}", part.part.kind, part.part.id)
                                           : fmt::format("correct {} {}", part.part.kind, part.part.id);
  return Edit{label, {ChangeOf(w, part, version)}, {{"part", part.part.id}}};
}

Result<Edit> DeletePart(const Context& c) {
  VSS_ASSIGN(const auto old, c.workspace.FindPart(PartId(c.body)));
  std::vector<Change> changes = {{"part", old.first.part.id, std::nullopt, c.version}};
  for (auto& p : c.workspace.Parts()) {
    if (p.part.stands_on != old.first.part.id) continue;
    p.part.stands_on = "ground";
    changes.push_back(ChangeOf(c.workspace, p, {}));
  }
  return Edit{fmt::format("delete {} {}", old.first.part.kind, old.first.part.id), std::move(changes)};
}

Result<Edit> ConfirmPart(const Context& c) {
  VSS_ASSIGN(auto old, c.workspace.FindPart(PartId(c.body)));
  old.first.confirmed = c.body.value("confirmed", true);
  const char* what = old.first.confirmed ? "confirm" : "take back the confirmation of";
  return Edit{fmt::format("{} {} {}", what, old.first.part.kind, old.first.part.id),
              {ChangeOf(c.workspace, old.first, c.version)}};
}

// The fit of a part anew after its matches changed.
Result<Edit> Refit(const Context& c, const StationPart& old, const std::vector<ContourMatch>& matches,
                   const std::string& label, bool collect = false) {
  Json question = {{"kind", old.part.kind}, {"part", old.part.id},    {"stands_on", old.part.stands_on},
                   {"collect", collect},    {"picks", Json::array()}, {"fixed", Json::object()}};
  for (const auto& m : matches)
    question["picks"].push_back(
        {{"image", m.image}, {"line", m.line}, {"contour", m.edge}, {"circle", m.is_arc}});
  for (const auto& d : old.part.dimensions)
    if (d.origin == "given by the operator") question["fixed"][d.name] = d.value_mm;
  VSS_ASSIGN(auto edit, SavePart({c.workspace, question, c.version}));
  edit.label = label;
  return edit;
}

Result<Edit> DropLine(const Context& c) {
  VSS_ASSIGN(const auto old, c.workspace.FindPart(PartId(c.body)));
  VSS_ASSIGN(const int image, IntOf(c.body, "image"));
  VSS_ASSIGN(const int line, IntOf(c.body, "line"));
  const bool arc = c.body.value("circle", false);
  auto matches = old.first.part.matches;
  const auto removed = std::erase_if(
      matches, [&](const auto& m) { return m.image == image && m.line == line && m.is_arc == arc; });
  if (removed == 0) return UsageError("{} does not use that line", old.first.part.id);
  if (matches.empty())
    return UsageError("this is the only line of {}; delete the part in its place", old.first.part.id);
  return Refit(c, old.first, matches, fmt::format("drop a line of {}", old.first.part.id));
}

// Where a dimension was given by hand the lines alone are fitted: measuring takes nothing as given.
Result<Edit> MeasurePart(const Context& c) {
  VSS_ASSIGN(auto old, c.workspace.FindPart(PartId(c.body)));
  StationPart& p = old.first;
  if (std::any_of(p.part.dimensions.begin(), p.part.dimensions.end(),
                  [](const auto& d) { return d.origin == "given by the operator"; }))
    return UsageError("a dimension of {} was given by hand; fit its lines in place of measuring it",
                      p.part.id);
  VSS_ASSIGN(p.part, c.workspace.Measured(p.part));
  if (p.part.source == "automatic") p.part.source = "corrected";
  p.doubt = DoubtOf(p.part);
  return Edit{fmt::format("measure {} {}", p.part.kind, p.part.id), {ChangeOf(c.workspace, p, c.version)}};
}

Result<Edit> RefitPart(const Context& c) {
  VSS_ASSIGN(const auto old, c.workspace.FindPart(PartId(c.body)));
  return Refit(c, old.first, old.first.part.matches, fmt::format("fit {} again", old.first.part.id), true);
}

// Another kind at the same place: its start is the old footprint, its lines are those that lie on its contour
// there.
Result<Edit> ChangeKind(const Context& c) {
  Workspace& w = c.workspace;
  VSS_ASSIGN(const auto old, w.FindPart(PartId(c.body)));
  const std::string kind = c.body.at("kind");
  const ObjectModel* model = w.knowledge().Find(kind);
  if (!model) return UsageError("the knowledge base has no kind \"{}\"", kind.substr(0, 40));
  Fitted f;
  f.question.model = model;
  PlacedObject start;
  start.model = model;
  std::vector<std::optional<double>> known;
  for (const auto& def : model->dimensions()) {
    const auto at = std::find_if(old.first.part.dimensions.begin(), old.first.part.dimensions.end(),
                                 [&](const auto& d) { return d.name == def.name; });
    known.push_back(at == old.first.part.dimensions.end()
                        ? std::nullopt
                        : std::optional(std::clamp(at->value_mm, def.min_mm, def.max_mm)));
  }
  start.dimensions_mm = model->UsualDimensions(known);
  const PlacedObject before = PlacedObjectOf(old.first.part, w.knowledge());
  start.placement = before.model ? before.placement : start.placement;
  f.question.support_height_mm = start.placement[2];
  f.views = w.Views();
  f.answer.object = start;
  VSS_RETURN_IF_ERROR(CollectAndRefit(w, f, old.first.part.id));
  if (!f.answer.placed)
    return UsageError("too few lines lie on a {} at this place; pick its lines by hand", kind);
  PutLengthFirst(f.question, f.answer, f.views);
  StationPart part = old.first;
  const Part fitted = PartOfFit(f.answer, f.question);
  part.part = fitted;
  part.part.id = old.first.part.id;
  part.part.stands_on = old.first.part.stands_on;
  part.part.source = old.first.part.source == "manual" ? "manual" : "corrected";
  part.confirmed = true;
  part.doubt = "";
  return Edit{
      fmt::format("{} is {}, not {}", part.part.id, WithArticle(kind), WithArticle(old.first.part.kind)),
      {ChangeOf(w, part, c.version)}};
}

// Two parts of one kind become one that reaches from the one's end to the other's, fitted to the lines of
// both.
Result<Edit> MergeParts(const Context& c) {
  Workspace& w = c.workspace;
  VSS_ASSIGN(const auto a, w.FindPart(PartId(c.body)));
  VSS_ASSIGN(const auto b, w.FindPart(c.body.at("with").get<std::string>()));
  const Part &pa = a.first.part, &pb = b.first.part;
  if (pa.id == pb.id) return UsageError("a part is merged with another one, not with itself");
  if (pa.kind != pb.kind)
    return UsageError("{} is a {} and {} a {}: only parts of one kind can be merged", pa.id, pa.kind, pb.id,
                      pb.kind);
  PlacedObject object = PlacedObjectOf(pa, w.knowledge());
  if (!object.model) return UsageError("the knowledge base has no kind \"{}\"; it cannot be merged", pa.kind);
  const auto defs = object.model->dimensions();
  const auto length =
      std::size_t(std::find_if(defs.begin(), defs.end(), [](const auto& d) { return d.name == "length"; }) -
                  defs.begin());
  if (length >= defs.size()) return UsageError("a {} has no length along which it could be merged", pa.kind);
  const Eigen::Vector3d x = pa.world_from_part.rotation.col(0), origin = pa.world_from_part.translation;
  double from = INFINITY, to = -INFINITY;
  for (const Part* p : {&pa, &pb})
    for (const auto& v : p->vertices)
      from = std::min(from, x.dot(v - origin)), to = std::max(to, x.dot(v - origin));
  object.dimensions_mm[length] = std::clamp(to - from, defs[length].min_mm, defs[length].max_mm);
  object.placement.head<3>() += x * ((from + to) / 2);
  Fitted f;
  f.question.model = object.model;
  f.question.resting_pose = object.resting_pose;
  f.question.support_height_mm = object.placement[2];
  f.answer.object = object;
  f.views = w.Views();
  // The lines of both are free for the one.
  const auto taken_by_others = [&] {
    auto used = LinesOfOthers(w, pa.id);
    for (const auto& m : pb.matches) used.erase({m.image, m.line});
    return used;
  }();
  f.question.picks = CollectPicks(
      object, f.views, nullptr, 2 * kCollectPx,
      [&](int i, int l) {
        return taken_by_others.contains({i, l});
      },
      [&](int i) { return w.PicksOf(i); });
  if (f.question.picks.empty())
    return UsageError("no line lies on the merged part; these two are hardly one");
  f.question.start = object;
  VSS_ASSIGN(f.answer, FitPicks(f.question, f.views));
  StationPart part;
  part.part = PartOfFit(f.answer, f.question);
  part.part.id = pa.id;
  part.part.source = pa.source == "manual" && pb.source == "manual" ? "manual" : "corrected";
  part.part.stands_on = pa.stands_on;
  part.confirmed = true;
  return Edit{fmt::format("merge {} and {}", pa.id, pb.id),
              {ChangeOf(w, part, c.version), {"part", pb.id, std::nullopt, b.second}}};
}

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

Result<FitQuestion> QuestionOf(Workspace& w, const Json& body) {
  FitQuestion q;
  const std::string kind = body.at("kind");
  q.model = w.knowledge().Find(kind);
  if (body.contains("features"))
    q.model = w.knowledge().Find(kind, body.at("features").get<std::vector<std::string>>());
  if (!q.model) return UsageError("the knowledge base has no kind \"{}\"", kind.substr(0, 40));
  const auto poses = q.model->resting_poses();
  if (const std::string pose = body.value("resting_pose", ""); !pose.empty()) {
    const auto at = std::find_if(poses.begin(), poses.end(), [&](const auto& p) { return p.name == pose; });
    if (at == poses.end()) return UsageError("a {} has no resting pose \"{}\"", kind, pose.substr(0, 40));
    q.resting_pose = int(at - poses.begin());
  }
  if (const std::string on = body.value("stands_on", "ground"); on != "ground") {
    VSS_ASSIGN(const auto support, w.FindPart(on));
    q.support_height_mm = SupportHeight(support.first.part);
  }
  const Json& picks = body.at("picks");
  if (picks.size() > kMaxPicks)
    return UsageError("{} picked lines are more than the {} that a fit takes", picks.size(), kMaxPicks);
  std::set<int> images;
  for (const auto& p : picks)
    if (const auto image = IntOf(p, "image")) images.insert(*image);
  w.PrepareLines({images.begin(), images.end()});
  std::map<int, std::shared_ptr<const EditedLines>> lines;  // of the pictures with picks
  for (const auto& p : picks) {
    VSS_ASSIGN(const int image, IntOf(p, "image"));
    VSS_ASSIGN(const int line, IntOf(p, "line"));
    VSS_ASSIGN(const int contour, IntOf(p, "contour"));
    if (!lines.contains(image)) {
      VSS_ASSIGN(lines[image], w.Lines(image));
    }
    VSS_ASSIGN(auto pick, MakePick(*lines[image], w.image_files()[std::size_t(image)], image, line, contour,
                                   p.value("circle", false)));
    q.picks.push_back(std::move(pick));
  }
  if (body.contains("image")) {
    VSS_ASSIGN(q.present_image, IntOf(body, "image"));
  }
  const Json fixed = body.value("fixed", Json::object());
  for (const auto& [name, value] : fixed.items()) q.fixed_mm[name] = value.get<double>();
  if (const std::string id = body.value("part", ""); !id.empty() && body.value("keep_start", true)) {
    VSS_ASSIGN(const auto part, w.FindPart(id));
    if (part.first.part.kind == kind &&
        (!body.contains("features") || part.first.part.features == FeaturesOf(*q.model))) {
      q.start = PlacedObjectOf(part.first.part, w.knowledge());
      q.model = q.start->model;  // with the features that it has
      q.resting_pose = q.start->resting_pose;
    }
  }
  return q;
}

Result<Json> LiveFit(Workspace& w, const Json& body) {
  const auto begin = std::chrono::steady_clock::now();
  VSS_ASSIGN(const auto f, Fit(w, body));
  const WorldSolid solid = PlaceSolid(f.answer.object, false);
  Occluders occluders;
  occluders.Add(solid, 0);
  int owner = 1;
  for (const auto& p : w.Parts())
    if (p.part.id != body.value("part", ""))
      if (const PlacedObject other = PlacedObjectOf(p.part, w.knowledge()); other.model)
        occluders.Add(PlaceSolid(other, false), owner++);
  Json projections = Json::object();
  for (const auto& view : f.views)
    if (const auto pieces = ProjectContour(solid, view, occluders); !pieces.empty())
      projections[std::to_string(view.image)] = PiecesToJson(pieces);
  StationPart part;
  part.part = PartOfFit(f.answer, f.question);
  part.part.id = body.value("part", "");
  part.part.source = "manual";
  Json hints = Json::array();
  for (const auto& h : f.answer.hints)
    hints.push_back(
        {{"dimension", h.dimension}, {"image", h.image}, {"contour", h.contour}, {"circle", h.is_circle}});
  const double ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return Json{{"part", PartToJson(part, w.image_files())},
              {"picks", PicksToJson(f)},
              {"projections", projections},
              {"hints", hints},
              {"placed", f.answer.placed},
              {"rms_px", f.answer.rms_px},
              {"ms", ms}};
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
