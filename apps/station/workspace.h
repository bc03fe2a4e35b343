// A survey as the station works on it: the pictures and their lines, the parts, and what the operator changed.
#pragma once
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "manual_fit.h"
#include "part_json.h"
#include "projection.h"
#include "store.h"
#include "vss/base/parameters.h"
#include "vss/product/report.h"
#include "vss/survey/run_survey.h"

namespace vss::station {

// The lines of one picture as the operator left them.
struct EditedLines {
  LineImage found;                 // by VSS; a line's number is its index
  std::vector<bool> removed;       // of the segments of `found`
  std::map<int, LineSegment> drawn;  // by number, from kFirstDrawnLine
  std::int64_t version = 0;        // of the item with the operator's edits

  const LineSegment* Find(int line) const;  // null where there is none, or it was removed
};

struct WorkspaceOptions {
  int threads = 0;
};

class Workspace {
 public:
  static Result<std::unique_ptr<Workspace>> Open(const std::filesystem::path& folder, const WorkspaceOptions& options);
  ~Workspace();

  const Survey& survey() const { return survey_; }
  const KnowledgeBase& knowledge() const { return knowledge_; }
  const std::vector<std::string>& image_files() const { return image_files_; }
  Store& store() { return *store_; }

  Result<std::shared_ptr<const EditedLines>> Lines(int image);
  std::vector<StationPart> Parts() const;
  // The part of that id, with the version of its item.
  Result<std::pair<StationPart, std::int64_t>> FindPart(const std::string& id) const;
  // All pictures without their line images, at the places that the last run found, or that the survey says.
  std::vector<View> Views() const;

  // The values that the next run takes: defaults, then the survey file, then what the operator set.
  Result<SurveyOptions> Options() const;

  Result<Pick> MakePick(int image, int line, int contour, bool is_circle);
  std::vector<Pick> PicksOf(int image);  // every line of the picture, contours unassigned
  // Whether `img` lies in the picture.
  bool Inside(int image, const Eigen::Vector2d& img) const;
  // A straight line near start -> end (img), moved onto the sub-pixel edge where there is one.
  Result<LineSegment> Snap(int image, const Eigen::Vector2d& start, const Eigen::Vector2d& end);

  // The product as it stands, with its seams, for files and exports.
  Product ProductNow() const;
  // The part measured in the grey values of all pictures, jointly with the other parts and the cameras, as the survey's
  // last step does; its kind, support and matches stay.
  Result<Part> Measured(const Part& part) const;
  // The report and the overlays of the product as it stands.
  Result<ReportFiles> Report();

  // A run of the whole survey in the background; `tell` gets its progress as JSON. Parts that a person made, corrected
  // or confirmed stay as they are. The outcome is one edit, which can be undone.
  Status StartRun(const std::string& who, std::function<void(const Json&)> tell);
  void CancelRun() { cancel_ = true; }
  // {"state": "none", "running", "done", "failed" or "cancelled", "message", "step", "done", "total"}
  Json RunState() const;
  // The changes that put `product` in the place of the automatic parts.
  std::vector<Change> ChangesOfProduct(const Product& product) const;

 private:
  Workspace() = default;
  void Run(const std::string& who, const SurveyOptions& options, const std::function<void(const Json&)>& tell);
  void KeepLines(std::vector<LineImage> lines, std::int64_t run_version);
  void Tell(const std::function<void(const Json&)>& tell, Json state);
  SurveyOptions OptionsOfLastRun(std::int64_t* version) const;
  Result<std::shared_ptr<const LineImage>> FoundLines(int image);
  std::string FreePartId(const std::vector<std::string>& also_taken) const;
  friend class Commands;

  WorkspaceOptions options_;
  Survey survey_;
  KnowledgeBase knowledge_;
  std::vector<std::string> image_files_;
  std::unique_ptr<Store> store_;
  mutable std::mutex mutex_;
  struct Found {
    std::int64_t run_version = -1;
    std::shared_ptr<const LineImage> lines;
    std::int64_t edit_version = -1;
    std::shared_ptr<const EditedLines> edited;
  };
  std::vector<Found> found_;  // by image
  std::thread runner_;
  std::atomic<bool> cancel_{false};
  Json run_state_ = {{"state", "none"}};
};

// The segments and arcs of a picture as Views gives them to identification: what was removed is left out, what was
// drawn is at the end. `numbers[i]`: the station's number of segment i.
LineImage FlatLines(const EditedLines& lines, std::vector<int>* numbers = nullptr);

// The ideal ends of a drawn line.
void Straighten(const Intrinsics& lens, LineSegment& segment);

// Why a person should look at this part; empty where there is no reason.
std::string DoubtOf(const Part& part);

}  // namespace vss::station
