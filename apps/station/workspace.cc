#include "workspace.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "snap.h"
#include "vss/base/parallel.h"
#include "vss/product/make_part.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

constexpr double kSamePlaceMm = 60;       // two findings of one object lie nearer than that, and less than
constexpr double kSamePlaceShare = 0.25;  // that share of its smaller extent

std::optional<std::string> BadDrawnLine(const LineSegment& s) {
  if (!s.start.allFinite() || !s.end.allFinite()) return "its ends are not numbers";
  if ((s.end - s.start).norm() < 2) return "it is shorter than 2 px";
  return std::nullopt;
}

LineSegment DrawnFromJson(const Json& j, const Intrinsics& lens) {
  LineSegment s;
  s.start = Vector2d(j.at("start").at(0).get<double>(), j.at("start").at(1).get<double>());
  s.end = Vector2d(j.at("end").at(0).get<double>(), j.at("end").at(1).get<double>());
  s.sigma_offset_px = j.value("sigma_px", 0.3);
  s.contrast = j.value("contrast", 0.0);
  s.sigma_angle_rad = std::sqrt(12.0) * s.sigma_offset_px / std::max(1.0, (s.end - s.start).norm());
  Straighten(lens, s);
  return s;
}

std::optional<EllipticalArc> DrawnArcFromJson(const Json& j, const Intrinsics& lens) {
  EllipticalArc arc;
  arc.center = Vector2d(j.at("center").at(0).get<double>(), j.at("center").at(1).get<double>());
  arc.axes = Vector2d(j.at("axes").at(0).get<double>(), j.at("axes").at(1).get<double>());
  arc.angle_rad = j.at("angle_rad").get<double>();
  arc.from_rad = j.at("from_rad").get<double>();
  arc.to_rad = j.at("to_rad").get<double>();
  arc.contrast = j.value("contrast", 0.0);
  arc.bright_inside = j.value("bright_inside", false);
  arc.rms_distance_px = j.value("rms_px", 1.0);
  arc.num_points = j.value("points", 1);
  if (!arc.center.allFinite() || !arc.axes.allFinite() || !(arc.axes.minCoeff() > 0) ||
      !StraightenArc(lens, arc))
    return std::nullopt;
  return arc;
}

EditedLines Edit(const LineImage& found, const Json& edits, const Intrinsics& lens) {
  EditedLines out;
  out.found = found;
  out.removed.assign(found.segments.size(), false);
  for (const auto& r : edits.value("removed", Json::array())) {
    const std::size_t i = r.at("line").get<std::size_t>();
    // The number holds only while the detector's parameters are the same: the place decides.
    if (i < found.segments.size() && (found.segments[i].start - Vector2d(r.at("start").at(0).get<double>(),
                                                                         r.at("start").at(1).get<double>()))
                                             .norm() < 0.5)
      out.removed[i] = true;
  }
  for (const auto& d : edits.value("drawn", Json::array())) {
    const LineSegment s = DrawnFromJson(d, lens);
    if (!BadDrawnLine(s)) out.drawn[d.at("line").get<int>()] = s;
  }
  for (const auto& d : edits.value("arcs", Json::array()))
    if (const auto arc = DrawnArcFromJson(d, lens)) out.drawn_arcs[d.at("line").get<int>()] = *arc;
  return out;
}

std::vector<Vector2d> ArcPoints(const EllipticalArc& a) {
  std::vector<Vector2d> points;
  constexpr int kPoints = 9;
  const Eigen::Rotation2Dd turn(a.ideal_angle_rad);
  for (int k = 0; k < kPoints; ++k) {
    const double t = a.ideal_from_rad + (a.ideal_to_rad - a.ideal_from_rad) * (k + 0.5) / kPoints;
    points.push_back(a.ideal_center +
                     turn * Vector2d(a.ideal_axes.x() * std::cos(t), a.ideal_axes.y() * std::sin(t)));
  }
  return points;
}

Pick PickOfArc(int image, int line, const EllipticalArc& arc) {
  Pick pick;
  pick.image = image;
  pick.line = line;
  pick.is_circle = true;
  pick.ideal_points = ArcPoints(arc);
  pick.sigma_offset_px = std::max(0.02, arc.rms_distance_px / std::sqrt(std::max(1, arc.num_points)));
  return pick;
}

Pick PickOfSegment(int image, int line, const LineSegment& s) {
  Pick pick;
  pick.image = image;
  pick.line = line;
  pick.ideal_start = s.ideal_start;
  pick.ideal_end = s.ideal_end;
  pick.sigma_offset_px = s.sigma_offset_px;
  pick.sigma_angle_rad = s.sigma_angle_rad;
  return pick;
}

Eigen::AlignedBox3d BoxOf(const Part& part) {
  Eigen::AlignedBox3d box;
  for (const auto& v : part.vertices) box.extend(v);
  for (const auto& c : part.circles) {
    box.extend(Eigen::Vector3d(c.center - Eigen::Vector3d::Constant(c.radius_mm)));
    box.extend(Eigen::Vector3d(c.center + Eigen::Vector3d::Constant(c.radius_mm)));
  }
  return box;
}

bool SamePlace(const Part& a, const Part& b) {
  const Eigen::AlignedBox3d x = BoxOf(a), y = BoxOf(b);
  if (x.isEmpty() || y.isEmpty()) return false;
  const double extent = std::min(x.sizes().head<2>().norm(), y.sizes().head<2>().norm());
  return (x.center() - y.center()).norm() < std::max(kSamePlaceMm, kSamePlaceShare * extent);
}

bool KeptByPerson(const StationPart& p) { return p.confirmed || p.part.source != "automatic"; }

Eigen::Vector3d VectorOf(const Json& j) {
  return {j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()};
}

RigidTransform TransformFromJson(const Json& j) {
  RigidTransform t;
  t.translation = VectorOf(j.at("translation"));
  for (int i = 0; i < 3; ++i) t.rotation.row(i) = VectorOf(j.at("rotation").at(std::size_t(i))).transpose();
  return t;
}

std::string PartsOf(const Product& product) {
  return fmt::format("{} part{}", product.parts.size(), product.parts.size() == 1 ? "" : "s");
}

Json JsonOfUnknown(const UnknownGroup& u) {
  return {{"center", JsonOf(u.center)}, {"extent", JsonOf(u.extent)}, {"num_lines", u.num_lines}};
}

}  // namespace

const LineSegment* EditedLines::Find(int line) const {
  if (const auto at = drawn.find(line); at != drawn.end()) return &at->second;
  if (line < 0 || std::size_t(line) >= found.segments.size() || removed[std::size_t(line)]) return nullptr;
  return &found.segments[std::size_t(line)];
}

const EllipticalArc* EditedLines::FindArc(int line) const {
  if (const auto at = drawn_arcs.find(line); at != drawn_arcs.end()) return &at->second;
  return line < 0 || std::size_t(line) >= found.arcs.size() ? nullptr : &found.arcs[std::size_t(line)];
}

void Straighten(const Intrinsics& lens, LineSegment& s) {
  auto ideal = [&](const Vector2d& img) {
    const auto n = lens.NormalizedFromImg(img);
    return n ? lens.IdealFromNormalized(*n) : img;
  };
  s.ideal_start = ideal(s.start);
  s.ideal_end = ideal(s.end);
}

FlatLineImage FlatLines(const EditedLines& lines) {
  FlatLineImage flat{lines.found, {}, {}};
  LineImage& out = flat.lines;
  out.segments.clear();
  std::vector<int>& number = flat.segment_numbers;
  for (std::size_t i = 0; i < lines.found.segments.size(); ++i) {
    if (lines.removed[i]) continue;
    number.push_back(int(i));
    out.segments.push_back(lines.found.segments[i]);
    out.segments.back().start_junction = out.segments.back().end_junction = -1;
  }
  for (const auto& [line, segment] : lines.drawn) {
    number.push_back(line);
    out.segments.push_back(segment);
  }
  for (std::size_t i = 0; i < out.arcs.size(); ++i) flat.arc_numbers.push_back(int(i));
  for (const auto& [line, arc] : lines.drawn_arcs) {
    flat.arc_numbers.push_back(line);
    out.arcs.push_back(arc);
  }
  return flat;
}

std::string DoubtOf(const Part& part) {
  if (part.doubtful && part.runner_up && !part.runner_up->kind.empty())
    return fmt::format("It could also be a {}: {:.0f} speaks for it, {:.0f} for this.", part.runner_up->kind,
                       part.runner_up->log_odds, part.log_odds);
  if (part.doubtful) return fmt::format("Little speaks for it (log-odds {:.0f}).", part.log_odds);
  std::string hidden;
  for (const auto& d : part.dimensions)
    if (!d.observable) hidden += (hidden.empty() ? "" : ", ") + d.name;
  return hidden.empty() ? "" : fmt::format("No picture shows its {}.", hidden);
}

Result<std::unique_ptr<Workspace>> Workspace::Open(const std::filesystem::path& folder,
                                                   const WorkspaceOptions& options) {
  std::unique_ptr<Workspace> w(new Workspace);
  w->options_ = options;
  VSS_ASSIGN(w->own_survey_, ReadSurvey(folder));
  w->survey_ = &w->own_survey_;
  VSS_ASSIGN(w->knowledge_, LoadKnowledge(w->survey().knowledge, w->survey().folder));
  w->image_files_ = ImageFiles(w->survey());
  w->found_.resize(w->survey().images.size());
  VSS_ASSIGN(w->store_, Store::Open(w->survey().folder));
  w->UseCameras();
  VSS_ASSIGN([[maybe_unused]] auto checked, w->Options());
  return w;
}

Workspace::~Workspace() {
  cancel_ = true;
  if (runner_.joinable()) runner_.join();
}

Result<SurveyOptions> Workspace::Options() const {
  VSS_ASSIGN(auto options, OptionsOf(survey()));
  if (const auto item = store_->Get("settings", "parameters"))
    for (const auto& [name, value] : item->value->items())
      VSS_RETURN_IF_ERROR(SetSurveyParameter(name, value.get<double>(), options));
  options.threads = options_.threads;
  return options;
}

SurveyOptions Workspace::OptionsOfLastRun(std::int64_t* version) const {
  *version = store_->Version("settings", "run");
  {
    std::lock_guard lock(mutex_);
    if (last_options_.first == *version) return last_options_.second;
  }
  SurveyOptions options = OptionsOf(survey()).value_or(SurveyOptions{});
  if (const auto item = store_->Get("settings", "run")) {
    const Json parameters = item->value->value("parameters", Json::object());
    for (const auto& [name, value] : parameters.items())
      (void)SetSurveyParameter(name, value.get<double>(),
                               options);  // a parameter that this program no longer has changes nothing
  }
  std::lock_guard lock(mutex_);
  last_options_ = {*version, options};
  return options;
}

Result<std::shared_ptr<const LineImage>> Workspace::FoundLines(int image) {
  const Survey& survey = this->survey();
  std::int64_t version = 0;
  SurveyOptions options = OptionsOfLastRun(&version);
  {
    std::lock_guard lock(mutex_);
    const Found& found = found_[std::size_t(image)];
    if (found.lines && found.run_version == version && found.survey == &survey) return found.lines;
  }
  Survey one = survey;
  one.images = {survey.images[std::size_t(image)]};
  options.threads = 1;
  VSS_ASSIGN(const auto pictures, ReadSurveyPictures(one, 1, Progress{}));
  VSS_ASSIGN(auto lines, DetectSurveyLines(one, pictures, options, Progress{}));
  auto shared = std::make_shared<const LineImage>(std::move(lines.front()));
  std::lock_guard lock(mutex_);
  found_[std::size_t(image)] = {version, &survey, shared, -1, nullptr};
  return shared;
}

Result<std::shared_ptr<const EditedLines>> Workspace::Lines(int image) {
  if (image < 0 || std::size_t(image) >= survey().images.size())
    return UsageError("there is no picture number {}", image);
  VSS_ASSIGN(const auto found, FoundLines(image));
  const std::int64_t version = store_->Version("lines", image_files_[std::size_t(image)]);
  {
    std::lock_guard lock(mutex_);
    const Found& known = found_[std::size_t(image)];
    if (known.lines == found && known.edited && known.edit_version == version) return known.edited;
  }
  const auto item = store_->Get("lines", image_files_[std::size_t(image)]);
  const Camera& camera = survey().cameras[std::size_t(survey().images[std::size_t(image)].camera)];
  auto edited =
      std::make_shared<EditedLines>(Edit(*found, item ? *item->value : Json::object(), camera.intrinsics));
  edited->version = version;
  std::lock_guard lock(mutex_);
  Found& known = found_[std::size_t(image)];
  if (known.lines == found) known.edited = edited, known.edit_version = version;
  return std::shared_ptr<const EditedLines>(edited);
}

void Workspace::PrepareLines(const std::vector<int>& images) {
  std::int64_t version = 0;
  (void)OptionsOfLastRun(&version);
  std::vector<int> missing;
  {
    std::lock_guard lock(mutex_);
    for (int i : images)
      if (i >= 0 && std::size_t(i) < found_.size() &&
          !(found_[std::size_t(i)].lines && found_[std::size_t(i)].run_version == version &&
            found_[std::size_t(i)].survey == &survey()))
        missing.push_back(i);
  }
  if (missing.empty())
    return;  // waking the other threads for nothing takes longer than a fit where the machine is busy
  ParallelFor(missing.size(), options_.threads,
              [&](std::size_t i) { (void)Lines(missing[i]); });  // who asks for them hears why not
}

std::vector<StationPart> Workspace::Parts() const {
  const std::int64_t revision =
      store_->Revision();  // before the parts: what came since then is read anew by the next
  {
    std::lock_guard lock(mutex_);
    if (last_parts_.first == revision) return last_parts_.second;
  }
  std::vector<StationPart> parts;
  for (const auto& item : store_->List("part"))
    if (auto part = PartFromJson(*item.value, image_files_)) parts.push_back(std::move(*part));
  std::lock_guard lock(mutex_);
  last_parts_ = {revision, parts};
  return parts;
}

Result<std::pair<StationPart, std::int64_t>> Workspace::FindPart(const std::string& id) const {
  const auto item = store_->Get("part", id);
  if (!item) return UsageError("there is no part {}; somebody may have deleted it", id);
  VSS_ASSIGN(auto part, PartFromJson(*item->value, image_files_));
  return std::pair(std::move(part), item->version);
}

std::vector<View> Workspace::Views() const {
  const std::int64_t revision = store_->Revision();
  const Survey& survey = this->survey();
  {
    std::lock_guard lock(mutex_);
    if (last_views_.revision == revision && last_views_.survey == &survey) return last_views_.views;
  }
  std::vector<View> views = MakeViews(survey, std::vector<LineImage>(survey.images.size()));
  const auto run = store_->Get("settings", "run");
  // Places that a run found hold for the cameras that it was made with.
  const Json places =
      run && !RunIsOfOtherCameras() ? run->value->value("cam_from_world", Json::array()) : Json::array();
  for (auto& view : views) {
    const bool known = places.size() == views.size();
    const RigidTransform cam_from_world =
        known ? TransformFromJson(places[std::size_t(view.image)]) : view.cam_from_world;
    view = MakeView(view.image, *view.camera, cam_from_world, view.stop, nullptr);
  }
  std::lock_guard lock(mutex_);
  last_views_ = {revision, &survey, views};
  return views;
}

Result<Pick> MakePick(const EditedLines& lines, const std::string& file, int image, int line, int contour,
                      bool is_circle) {
  Pick pick;
  if (is_circle) {
    const EllipticalArc* arc = lines.FindArc(line);
    if (!arc) return UsageError("picture {} has no arc number {}; it may have been removed", file, line);
    pick = PickOfArc(image, line, *arc);
  } else {
    const LineSegment* segment = lines.Find(line);
    if (!segment) return UsageError("picture {} has no line number {}; it may have been removed", file, line);
    pick = PickOfSegment(image, line, *segment);
  }
  pick.contour = contour;
  return pick;
}

std::vector<Pick> Workspace::PicksOf(int image) {
  std::vector<Pick> picks;
  const auto lines = Lines(image);
  if (!lines) return picks;
  const auto [flat, segments, arcs] = FlatLines(**lines);
  for (std::size_t i = 0; i < flat.segments.size(); ++i)
    picks.push_back(PickOfSegment(image, segments[i], flat.segments[i]));
  for (std::size_t i = 0; i < flat.arcs.size(); ++i) picks.push_back(PickOfArc(image, arcs[i], flat.arcs[i]));
  return picks;
}

Product Workspace::ProductNow() const {
  Product product;
  product.survey = survey().name;
  product.warnings = survey().warnings;
  for (auto& p : Parts()) product.parts.push_back(std::move(p.part));
  std::int64_t version = 0;
  product.seams = FindSeams(product, knowledge_, OptionsOfLastRun(&version).seams);
  if (const auto run = store_->Get("settings", "run")) {
    product.warnings = run->value->value("warnings", product.warnings);
    for (const auto& u : run->value->value("unknown", Json::array()))
      product.unknown.push_back({VectorOf(u["center"]), VectorOf(u["extent"]), u.value("num_lines", 0)});
  }
  return product;
}

Result<Part> Workspace::Measured(const Part& part) const {
  std::int64_t version = 0;
  const SurveyOptions options = OptionsOfLastRun(&version);
  const std::vector<LineImage> no_lines(survey().images.size());
  const std::vector<View> views = MakeViews(survey(), no_lines);
  std::vector<IdentifiedPart> found;
  std::map<std::string, int> index;
  std::vector<StationPart> parts = Parts();
  std::erase_if(parts, [&](const auto& p) { return !knowledge_.Find(p.part.kind); });
  for (const auto& p : parts) {
    index[p.part.id] = int(found.size());
    IdentifiedPart one;
    one.object = PlacedObjectOf(p.part, knowledge_);
    one.matches = p.part.matches;
    one.views = p.part.images;  // the pictures are the views, in their order
    one.log_odds = p.part.log_odds;
    found.push_back(std::move(one));
  }
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (const auto at = index.find(parts[i].part.stands_on); at != index.end())
      found[i].stands_on = at->second;
  const auto mine = index.find(part.id);
  if (mine == index.end())
    return UsageError("the knowledge base has no kind \"{}\"; it cannot be measured", part.kind);
  VSS_ASSIGN(const auto pictures, ReadSurveyPictures(survey(), options_.threads, Progress{}));
  std::vector<GreyView> grey;
  for (const auto& picture : pictures) grey.push_back(picture.view());
  VSS_ASSIGN(const Reconstruction all,
             ReconstructScene(views, grey, found, options.reconstruct, options_.threads, Progress{}));
  const ReconstructedPart& measured = all.parts[std::size_t(mine->second)];
  if (measured.views.empty())
    return UsageError("no picture shows edges of {} where it is; correct its lines first", part.id);
  Part out = part;
  SetReconstruction(measured, views, out);
  for (const auto& m : out.matches)  // a picture with a line of the part stays one of its pictures
    if (std::find(out.images.begin(), out.images.end(), m.image) == out.images.end())
      out.images.push_back(m.image);
  std::sort(out.images.begin(), out.images.end());
  return out;
}

Result<ReportFiles> Workspace::Report() {
  Product product = ProductNow();
  std::vector<LineImage> lines;
  std::vector<FlatLineImage> numbers;
  for (std::size_t i = 0; i < survey().images.size(); ++i) {
    VSS_ASSIGN(const auto edited, Lines(int(i)));
    numbers.push_back(FlatLines(*edited));
    lines.push_back(std::move(numbers.back().lines));
  }
  // The station's numbers of lines to places in `lines`; a line that was removed is left out.
  for (auto& part : product.parts)
    std::erase_if(part.matches, [&](ContourMatch& m) {
      const auto& of = m.is_arc ? numbers[std::size_t(m.image)].arc_numbers
                                : numbers[std::size_t(m.image)].segment_numbers;
      const auto at = std::find(of.begin(), of.end(), m.line);
      m.line = int(at - of.begin());
      return at == of.end();
    });
  std::vector<View> views = Views();
  for (auto& view : views) view.lines = &lines[std::size_t(view.image)];
  std::int64_t version = 0;
  ReportInput input;
  input.product = &product;
  input.knowledge = &knowledge_;
  input.views = views;
  input.lines = lines;
  input.image_files = image_files_;
  if (const auto run = store_->Get("settings", "run"))
    for (const auto& s : run->value->value("steps", Json::array()))
      input.step_seconds.emplace_back(s.value("step", ""), s.value("seconds", 0.0));
  input.parameters = SurveyParameters(OptionsOfLastRun(&version));
  input.picture = [this](int image) { return ReadSurveyPicture(survey(), image); };
  input.num_cameras = int(survey().cameras.size());
  return MakeReport(input, options_.threads);
}

std::string Workspace::FreePartId(const std::vector<std::string>& also_taken) const {
  int highest = 0;
  auto see = [&](const std::string& id) {
    if (id.rfind("part-", 0) == 0) highest = std::max(highest, std::atoi(id.c_str() + 5));
  };
  for (const auto& item : store_->Since(0))  // deleted ones included: an id never means two things
    if (item.kind == "part") see(item.id);
  for (const auto& id : also_taken) see(id);
  return fmt::format("part-{}", highest + 1);
}

std::vector<Change> Workspace::ChangesOfProduct(const Product& product) const {
  std::vector<Change> changes;
  std::vector<StationPart> old = Parts(), kept;
  for (const auto& p : old)
    if (KeptByPerson(p)) kept.push_back(p);
  std::vector<std::string> used;
  std::map<std::string, std::string> new_id;
  std::vector<StationPart> fresh;
  for (const auto& part : product.parts) {
    const auto same =
        std::find_if(kept.begin(), kept.end(), [&](const auto& k) { return SamePlace(k.part, part); });
    if (same != kept.end()) {
      new_id[part.id] = same->part.id;
      continue;
    }
    const auto before = std::find_if(old.begin(), old.end(), [&](const auto& o) {
      return !KeptByPerson(o) && SamePlace(o.part, part) &&
             std::find(used.begin(), used.end(), o.part.id) == used.end();
    });
    StationPart p{part, false, DoubtOf(part)};
    p.part.id = before != old.end() ? before->part.id : FreePartId(used);
    new_id[part.id] = p.part.id;
    used.push_back(p.part.id);
    fresh.push_back(std::move(p));
  }
  for (auto& p : fresh) {
    if (const auto at = new_id.find(p.part.stands_on); at != new_id.end()) p.part.stands_on = at->second;
    changes.push_back({"part", p.part.id, PartToJson(p, image_files_), {}});
  }
  for (const auto& o : old)
    if (!KeptByPerson(o) && std::find(used.begin(), used.end(), o.part.id) == used.end())
      changes.push_back({"part", o.part.id, std::nullopt, {}});
  return changes;
}

Json Workspace::RunState() const {
  std::lock_guard lock(mutex_);
  return run_state_;
}

void Workspace::Tell(const std::function<void(const Json&)>& tell, Json state) {
  {
    std::lock_guard lock(mutex_);
    run_state_ = state;
  }
  if (tell) tell(state);
}

Status Workspace::Start(const char* job, Work work, std::function<void(const Json&)> tell) {
  {
    std::lock_guard lock(mutex_);
    if (run_state_["state"] == "running")
      return UsageError("a {} is under way; wait for it or cancel it", run_state_.value("job", "run"));
    run_state_ = {{"job", job}, {"state", "running"}, {"step", "start"}, {"done", 0}, {"total", 1}};
  }
  if (runner_.joinable()) runner_.join();
  cancel_ = false;
  runner_ = std::thread([this, job = std::string(job), work = std::move(work), tell = std::move(tell)] {
    const auto say = [&](Json state) {
      state["job"] = job;
      Tell(tell, std::move(state));
    };
    Progress progress;
    progress.cancel = &cancel_;
    progress.report = [&](std::string_view step, int done, int total) {
      say({{"state", "running"}, {"step", step}, {"done", done}, {"total", total}});
    };
    const auto outcome = [&]() -> Result<Json> {
      try {
        return work(progress);
      } catch (const std::exception& e) {
        return tl::unexpected<Error>({ErrorCode::kInternal, e.what()});
      }
    }();
    if (!outcome)
      return say({{"state", outcome.error().code == ErrorCode::kCancelled ? "cancelled" : "failed"},
                  {"message", outcome.error().message}});
    Json done = *outcome;
    done["state"] = "done";
    say(std::move(done));
  });
  return {};
}

Status Workspace::StartRun(const std::string& who, std::function<void(const Json&)> tell) {
  VSS_ASSIGN(const SurveyOptions options, Options());
  return Start(
      "survey", [this, who, options](const Progress& progress) { return Run(who, options, progress); },
      std::move(tell));
}

Status Workspace::StartCalibration(const std::string& who, const std::string& name, const std::string& model,
                                   const Json& values, std::function<void(const Json&)> tell) {
  const auto jobs = FindCalibrationJobs(survey().folder);
  const auto file = std::find_if(jobs.begin(), jobs.end(), [&](const auto& j) { return j.name == name; });
  if (file == jobs.end())
    return UsageError("there is no calibration job \"{}\" in the survey's folder or beside it",
                      name.substr(0, 200));
  if (model != "weng" && model != "opencv")
    return UsageError("there is no lens model \"{}\"; choose weng or opencv", model.substr(0, 40));
  CalibrationOptions options;
  options.opencv = model == "opencv";
  for (const auto& [parameter, value] : values.items()) {
    VSS_ASSIGN(const bool known,
               SetParameter(CalibrationParameters(), parameter, value.get<double>(), options));
    if (!known) return UsageError("calibration has no parameter {}", parameter.substr(0, 60));
  }
  VSS_ASSIGN(const CalibrationJob job, ReadCalibrationJob(file->path));
  return Start(
      "calibration",
      [this, who, name, model, options, job](const Progress& progress) -> Result<Json> {
        VSS_ASSIGN(const Calibration calibration, Calibrate(job, options, options_.threads, progress));
        std::string ids;
        for (const auto& c : calibration.cameras) ids += (ids.empty() ? "" : ", ") + c.camera.id;
        const auto revision = store_->Apply(who, fmt::format("calibrate {} ({})", ids, name),
                                            {{"calibration", "last", JsonOf(calibration, name, model), {}}});
        if (!revision) return tl::unexpected<Error>({ErrorCode::kInternal, revision.error().message});
        return Json{{"message", ids}, {"revision", *revision}};
      },
      std::move(tell));
}

std::string Workspace::CamerasInUse() const {
  const auto item = store_->Get("settings", "cameras");
  return item ? item->value->at("files").dump() : std::string();
}

bool Workspace::RunIsOfOtherCameras() const {
  const auto run = store_->Get("settings", "run");
  return run && run->value->value("cameras", "") != CamerasInUse();
}

void Workspace::UseCameras() {
  const std::string files = CamerasInUse();
  std::lock_guard lock(mutex_);
  if (files.empty()) {
    survey_ = &own_survey_;
    return;
  }
  auto& survey = with_cameras_[files];
  if (!survey) {
    auto read = SurveyWithCameras(own_survey_, Json::parse(files));
    if (!read) {
      read = own_survey_;
      read->warnings.push_back(
          "the cameras that were taken over do not fit the survey, and its own are used; calibrate again");
    }
    survey = std::make_unique<const Survey>(std::move(*read));
  }
  survey_ = survey.get();
}

void Workspace::KeepLines(const Survey& survey, std::vector<LineImage> lines, std::int64_t run_version) {
  std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < lines.size(); ++i)
    found_[i] = {run_version, &survey, std::make_shared<const LineImage>(std::move(lines[i])), -1, nullptr};
}

Result<Json> Workspace::Run(const std::string& who, const SurveyOptions& options, const Progress& progress) {
  const Survey& survey = this->survey();
  const std::string cameras = CamerasInUse();
  VSS_ASSIGN(auto outcome, RunSurvey(survey, options, progress));
  const Product& product = outcome.product;
  Json run = {{"parameters", Json::object()},
              {"unknown", Json::array()},
              {"steps", Json::array()},
              {"warnings", product.warnings},
              {"cameras", cameras}};
  for (const auto& p : SurveyParameters(options)) run["parameters"][p.name] = p.value;
  for (const auto& u : product.unknown) run["unknown"].push_back(JsonOfUnknown(u));
  for (const auto& t : outcome.cam_from_world)
    run["cam_from_world"].push_back(
        {{"rotation", JsonOf(t.rotation)}, {"translation", JsonOf(t.translation)}});
  for (const auto& s : outcome.steps) run["steps"].push_back({{"step", s.step}, {"seconds", s.seconds}});
  std::vector<Change> changes = ChangesOfProduct(product);
  changes.push_back({"settings", "run", run, {}});
  const auto revision = store_->Apply(who, "survey: " + PartsOf(product), changes);
  if (!revision) return tl::unexpected<Error>({ErrorCode::kInternal, revision.error().message});
  KeepLines(survey, std::move(outcome.lines), *revision);
  return Json{{"message", PartsOf(product) + " found"}, {"revision", *revision}};
}

bool Workspace::Inside(int image, const Vector2d& img) const {
  const Camera& camera = survey().cameras[std::size_t(survey().images[std::size_t(image)].camera)];
  return img.x() >= -0.5 && img.y() >= -0.5 && img.x() <= camera.width_px - 0.5 &&
         img.y() <= camera.height_px - 0.5;
}

Result<GreyImage> Workspace::Picture(int image) const {
  Survey one = survey();
  one.images = {survey().images[std::size_t(image)]};
  VSS_ASSIGN(auto pictures, ReadSurveyPictures(one, 1, Progress{}));
  return std::move(pictures.front());
}

Result<LineSegment> Workspace::Snap(int image, const Vector2d& start, const Vector2d& end) {
  VSS_ASSIGN(const auto lines, Lines(image));
  const Camera& camera = survey().cameras[std::size_t(survey().images[std::size_t(image)].camera)];
  LineSegment drawn;
  drawn.start = start;
  drawn.end = end;
  if (const auto bad = BadDrawnLine(drawn))
    return UsageError("this line cannot be taken: {}; draw it again", *bad);
  if (!Inside(image, start) || !Inside(image, end))
    return UsageError("this line leaves the picture; draw it inside");
  VSS_ASSIGN(const auto picture, Picture(image));
  return SnapToEdge(picture.view(), camera.intrinsics, drawn);
}

Result<EllipticalArc> Workspace::SnapArc(int image, const std::array<Vector2d, 3>& clicked) {
  if (image < 0 || std::size_t(image) >= survey().images.size())
    return UsageError("there is no picture number {}", image);
  for (const auto& p : clicked)
    if (!Inside(image, p)) return UsageError("this curve leaves the picture; click inside it");
  VSS_ASSIGN(const auto picture, Picture(image));
  return SnapToRim(picture.view(), Views()[std::size_t(image)], clicked);
}

}  // namespace vss::station
