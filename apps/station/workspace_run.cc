// Runs of the survey and calibrations in the background, and what a run does to the parts.
#include <algorithm>
#include <set>

#include "checks_json.h"
#include "reduced_views.h"
#include "workspace.h"

namespace vss::station {
namespace {

constexpr double kSamePlaceMm = 60;       // two findings of one object lie nearer than that, and less than
constexpr double kSamePlaceShare = 0.25;  // that share of its smaller extent

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

std::string PartsOf(const Product& product) {
  return fmt::format("{} part{}", product.parts.size(), product.parts.size() == 1 ? "" : "s");
}

Json JsonOfUnknown(const UnknownGroup& u) {
  return {{"center", JsonOf(u.center)}, {"extent", JsonOf(u.extent)}, {"num_lines", u.num_lines}};
}

// With the parts' ids as the station calls them.
Json ChecksWithIds(SurveyChecks checks, const std::map<std::string, std::string>& new_id,
                   const std::vector<std::string>& image_files) {
  for (auto& p : checks.pictures)
    if (const auto at = new_id.find(p.part); at != new_id.end()) p.part = at->second;
  return JsonOf(checks, image_files);
}

}  // namespace

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

std::vector<Change> Workspace::ChangesOfProduct(const Product& product,
                                                std::map<std::string, std::string>* new_ids) const {
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
  if (new_ids) *new_ids = std::move(new_id);
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
  std::map<std::string, std::string> new_id;
  std::vector<Change> changes = ChangesOfProduct(product, &new_id);
  if (product.checks) run["checks"] = ChecksWithIds(*product.checks, new_id, image_files_);
  if (product.temperature)
    run["temperature"] = {{"workpiece_c", product.temperature->workpiece_c},
                          {"expansion_ppm_per_k", product.temperature->expansion_ppm_per_k},
                          {"factor", product.temperature->factor},
                          {"middle", JsonOf(MiddleOfReduction(product.parts))}};
  changes.push_back({"settings", "run", run, {}});
  const auto revision = store_->Apply(who, "survey: " + PartsOf(product), changes);
  if (!revision) return tl::unexpected<Error>({ErrorCode::kInternal, revision.error().message});
  KeepLines(survey, std::move(outcome.lines), *revision);
  return Json{{"message", PartsOf(product) + " found"}, {"revision", *revision}};
}

}  // namespace vss::station
