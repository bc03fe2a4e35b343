// The operator's edits of parts.
#include <algorithm>
#include <cmath>

#include "collect_picks.h"
#include "cut.h"
#include "edit.h"
#include "live_fit.h"
#include "part_of_fit.h"

namespace vss::station {
namespace {

std::string WithArticle(const std::string& kind) {
  return (kind.find_first_of("aeiou") == 0 ? "an " : "a ") + kind;
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

Eigen::Vector3d MiddleOf(const Part& part) {
  Eigen::AlignedBox3d box;
  for (const auto& v : part.vertices) box.extend(v);
  for (const auto& c : part.circles) box.extend(c.center);
  return box.center();
}

// The dimension along which two parts lie one behind the other.
Result<CutAxis> MergedSide(const PlacedObject& object, const Part& a, const Part& b) {
  const auto sides = CutAxesOf(*object.model, object.dimensions_mm);
  if (sides.empty()) return UsageError("a {} has no length along which it could be merged", a.kind);
  const Eigen::Vector3d between = a.world_from_part.rotation.transpose() * (MiddleOf(b) - MiddleOf(a));
  return *std::max_element(sides.begin(), sides.end(), [&](const CutAxis& p, const CutAxis& q) {
    return std::abs(between[p.axis]) / object.dimensions_mm[p.dimension] <
           std::abs(between[q.axis]) / object.dimensions_mm[q.dimension];
  });
}

// From the one part's end to the other's, along an axis of the part `a`.
Extent ReachOf(const Part& a, const Part& b, int axis) {
  const Eigen::Vector3d along = a.world_from_part.rotation.col(axis), origin = a.world_from_part.translation;
  Extent extent{INFINITY, -INFINITY};
  const auto see = [&](const Eigen::Vector3d& point) {
    extent.low_mm = std::min(extent.low_mm, along.dot(point - origin));
    extent.high_mm = std::max(extent.high_mm, along.dot(point - origin));
  };
  for (const Part* p : {&a, &b}) {
    for (const auto& v : p->vertices) see(v);
    if (p->vertices.empty())  // a pipe
      for (const auto& c : p->circles) see(c.center);
  }
  return extent;
}

}  // namespace

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
  VSS_ASSIGN(const CutAxis side, MergedSide(object, pa, pb));
  object = Stretched(object, side, ReachOf(pa, pb, side.axis), w.knowledge());
  Fitted f;
  f.question.model = object.model;
  f.question.resting_pose = object.resting_pose;
  f.question.support_height_mm = object.placement[2];
  f.answer.object = object;
  f.views = w.Views();
  // The lines of both are free for the one.
  const auto taken_by_others = [&] {
    auto used = LinesOfOthers(w, pa.id);
    for (const auto& m : pb.matches) used.erase({m.image, m.line, m.is_arc});
    return used;
  }();
  f.question.picks = CollectPicks(
      object, f.views, nullptr, 2 * kCollectPx,
      [&](const Pick& p) {
        return taken_by_others.contains({p.image, p.line, p.is_circle});
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
  part.part.stands_on = pa.stands_on == pb.id ? pb.stands_on : pa.stands_on;
  part.confirmed = true;
  Edit edit{fmt::format("merge {} and {}", pa.id, pb.id),
            {ChangeOf(w, part, c.version), {"part", pb.id, std::nullopt, b.second}}};
  for (auto& p : w.Parts())
    if (p.part.id != pa.id && p.part.stands_on == pb.id)
      p.part.stands_on = pa.id, edit.changes.push_back(ChangeOf(w, p, {}));
  return edit;
}

}  // namespace vss::station
