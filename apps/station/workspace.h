// A survey as the station works on it: the pictures and their lines, the parts, and what the operator
// changed.
#pragma once
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "calibration.h"
#include "edited_lines.h"
#include "manual_fit.h"
#include "part_json.h"
#include "projection.h"
#include "store.h"
#include "vss/base/parameters.h"
#include "vss/product/report.h"
#include "vss/survey/run_survey.h"

namespace vss::station {

struct WorkspaceOptions {
  int threads = 0;
};

class Workspace {
 public:
  static Result<std::unique_ptr<Workspace>> Open(const std::filesystem::path& folder,
                                                 const WorkspaceOptions& options);
  ~Workspace();

  // With the cameras that are in use; what it refers to stays as long as the workspace.
  const Survey& survey() const { return *survey_.load(); }
  const KnowledgeBase& knowledge() const { return knowledge_; }
  const std::vector<std::string>& image_files() const { return image_files_; }
  Store& store() { return *store_; }

  Result<std::shared_ptr<const EditedLines>> Lines(int image);
  // Finds the lines of those pictures side by side, where they are not known yet.
  void PrepareLines(const std::vector<int>& images);
  std::vector<StationPart> Parts() const;
  // The part of that id, with the version of its item.
  Result<std::pair<StationPart, std::int64_t>> FindPart(const std::string& id) const;
  // All pictures without their line images, at the places that the last run found, or that the survey says.
  std::vector<View> Views() const;

  // The values that the next run takes: defaults, then the survey file, then what the operator set.
  Result<SurveyOptions> Options() const;

  // The lines of pictures as identification takes them, with the operator's edits; none where a picture
  // cannot be read.
  std::vector<LineImage> FlatLinesOf(const std::vector<int>& images);
  int threads() const { return options_.threads; }
  std::vector<Pick> PicksOf(int image);  // every line of the picture, contours unassigned
  // Whether `img` lies in the picture.
  bool Inside(int image, const Eigen::Vector2d& img) const;
  // A straight line near start -> end (img), moved onto the sub-pixel edge where there is one.
  Result<LineSegment> Snap(int image, const Eigen::Vector2d& start, const Eigen::Vector2d& end);
  // The rim near three points (img), likewise.
  Result<EllipticalArc> SnapArc(int image, const std::array<Eigen::Vector2d, 3>& clicked);

  // The product as it stands, with its seams, for files and exports.
  Product ProductNow() const;
  // The part measured in the grey values of all pictures, jointly with the other parts and the cameras, as
  // the survey's last step does; its kind, support and matches stay.
  Result<Part> Measured(const Part& part) const;
  // The report and the overlays of the product as it stands.
  Result<ReportFiles> Report();

  // A run of the whole survey in the background; `tell` gets its progress as JSON. Parts that a person made,
  // corrected or confirmed stay as they are. The outcome is one edit, which can be undone.
  Status StartRun(const std::string& who, std::function<void(const Json&)> tell);
  // A calibration in the background, of a job that FindCalibrationJobs names; its outcome is one edit.
  // `model`: "weng" or "opencv"; `values`: of CalibrationParameters, by name.
  Status StartCalibration(const std::string& who, const std::string& job, const std::string& model,
                          const Json& values, std::function<void(const Json&)> tell);
  // Puts the cameras that the store names ("settings", "cameras") into use: after each edit. Where they do
  // not fit the survey any more its own stay, and its warnings say so.
  void UseCameras();
  void CancelRun() { cancel_ = true; }
  // {"job": "survey" or "calibration", "state": "none", "running", "done", "failed" or "cancelled",
  // "message", "step", "done", "total"}
  Json RunState() const;
  // Was the last run made with other cameras than those in use?
  bool RunIsOfOtherCameras() const;
  // The changes that put `product` in the place of the automatic parts.
  // `new_ids`: how the product's parts are called here.
  std::vector<Change> ChangesOfProduct(const Product& product,
                                       std::map<std::string, std::string>* new_ids = nullptr) const;

 private:
  Workspace() = default;
  using Work = std::function<Result<Json>(const Progress& progress)>;  // the answer: what else to tell
  Status Start(const char* job, Work work, std::function<void(const Json&)> tell);
  Result<Json> Run(const std::string& who, const SurveyOptions& options, const Progress& progress);
  std::string CamerasInUse() const;  // the camera files that the operator took over; empty: the survey's own
  void KeepLines(const Survey& survey, std::vector<LineImage> lines, std::int64_t run_version);
  void Tell(const std::function<void(const Json&)>& tell, Json state);
  SurveyOptions OptionsOfLastRun(std::int64_t* version) const;
  mutable std::pair<std::int64_t, SurveyOptions> last_options_{-1, {}};  // by the version of the run
  // What every live fit asks for, as it was at a revision.
  mutable std::pair<std::int64_t, std::vector<StationPart>> last_parts_{-1, {}};
  struct LastViews {
    std::int64_t revision = -1;
    const Survey* survey = nullptr;
    std::vector<View> views;
  };
  mutable LastViews last_views_;
  Result<GreyImage> Picture(int image) const;  // grey values proportional to light
  Result<std::shared_ptr<const LineImage>> FoundLines(int image);
  std::string FreePartId(const std::vector<std::string>& also_taken) const;
  friend class Commands;

  WorkspaceOptions options_;
  Survey own_survey_;                                                  // as its folder has it
  std::atomic<const Survey*> survey_;                                  // that, or one of with_cameras_
  std::map<std::string, std::unique_ptr<const Survey>> with_cameras_;  // by the camera files; few, and kept
  KnowledgeBase knowledge_;
  std::vector<std::string> image_files_;
  std::unique_ptr<Store> store_;
  mutable std::mutex mutex_;
  struct Found {
    std::int64_t run_version = -1;
    const Survey* survey = nullptr;  // whose cameras straightened them
    std::shared_ptr<const LineImage> lines;
    std::int64_t edit_version = -1;
    std::shared_ptr<const EditedLines> edited;
  };
  std::vector<Found> found_;  // by image
  std::thread runner_;
  std::atomic<bool> cancel_{false};
  Json run_state_ = {{"state", "none"}};
};

// Why a person should look at this part; empty where there is no reason.
std::string DoubtOf(const Part& part);

}  // namespace vss::station
