#include "live_fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "collect_picks.h"
#include "part_of_fit.h"
#include "propose.h"

namespace vss::station {
namespace {

constexpr std::size_t kMaxPicks = 4000;

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

// Height of the top of what the part stands on.
double SupportHeight(const Part& support) {
  double top = 0;
  for (const auto& v : support.vertices) top = std::max(top, v.z());
  for (const auto& c : support.circles) top = std::max(top, c.center.z());
  return top;
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

Result<std::vector<Pick>> PickedLines(Workspace& w, const Json& picks) {
  std::vector<Pick> out;
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
    out.push_back(std::move(pick));
  }
  return out;
}

}  // namespace

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

// Lines that other parts use.
UsedLines LinesOfOthers(const Workspace& w, const std::string& but) {
  UsedLines used;
  for (const auto& p : w.Parts())
    if (p.part.id != but)
      for (const auto& m : p.part.matches) used.emplace(m.image, m.line, m.is_arc);
  return used;
}

Status CollectAndRefit(Workspace& w, Fitted& f, const std::string& part_id) {
  const auto used = LinesOfOthers(w, part_id);
  Occluders others;
  int owner = 0;
  for (const auto& p : w.Parts())
    if (p.part.id != part_id)
      if (const PlacedObject object = PlacedObjectOf(p.part, w.knowledge()); object.model)
        others.Add(PlaceSolid(object, false), owner++);
  for (double tolerance : {kCollectPx, kCollectAgainPx}) {
    const auto taken = [&](const Pick& line) {
      return used.contains({line.image, line.line, line.is_circle}) ||
             std::any_of(f.question.picks.begin(), f.question.picks.end(), [&](const Pick& p) {
               return p.image == line.image && p.line == line.line && p.is_circle == line.is_circle;
             });
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
  VSS_ASSIGN(q.picks, PickedLines(w, body.at("picks")));
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

Result<Json> ProposedContours(Workspace& w, const Json& body) {
  const auto begin = std::chrono::steady_clock::now();
  VSS_ASSIGN(const FitQuestion question, QuestionOf(w, body));
  VSS_ASSIGN(const Proposal proposal,
             ProposeContours(
                 question, w.Views(), [&](const std::vector<int>& images) { return w.FlatLinesOf(images); },
                 w.threads(), body.value("some", false)));
  Json readings = Json::array();
  for (const auto& r : proposal.readings)
    readings.push_back({{"contours", r.contours}, {"rms_px", r.rms_px}, {"log_odds", r.log_odds}});
  const double ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return Json{{"readings", readings}, {"decided", proposal.decided}, {"ms", ms}};
}

}  // namespace vss::station
