#include "workspace.h"

#include <algorithm>

#include "reduced_views.h"
#include "snap.h"
#include "vss/base/parallel.h"

namespace vss::station {
namespace {

using Eigen::Vector2d;

RigidTransform TransformFromJson(const Json& j) {
  RigidTransform t;
  t.translation = VectorOf(j.at("translation"));
  for (int i = 0; i < 3; ++i) t.rotation.row(i) = VectorOf(j.at("rotation").at(std::size_t(i))).transpose();
  return t;
}

}  // namespace

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
  auto edited = std::make_shared<EditedLines>(
      WithEdits(*found, item ? *item->value : Json::object(), camera.intrinsics));
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
  if (run) ReduceViews(*run->value, views);
  std::lock_guard lock(mutex_);
  last_views_ = {revision, &survey, views};
  return views;
}

std::vector<LineImage> Workspace::FlatLinesOf(const std::vector<int>& images) {
  PrepareLines(images);
  std::vector<LineImage> out;
  for (int image : images) {
    const auto lines = Lines(image);
    out.push_back(lines ? FlatLines(**lines).lines : LineImage());
  }
  return out;
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
