// Manual mode: pose and dimensions of one object from lines that a person picked and assigned to its
// contours. It starts from nothing, answers within a click, and says what the lines picked so far do not
// determine yet.
#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "part_json.h"
#include "vss/identify/contour.h"
#include "vss/identify/view.h"

namespace vss::station {

// A picked line of a picture and the contour it was assigned to: an edge of the solid, or a rim where
// `is_circle`.
struct Pick {
  int image = 0;
  int line = 0;  // as the station numbers it
  int contour = 0;
  bool is_circle = false;
  Eigen::Vector2d ideal_start, ideal_end;     // a straight line: its ends, px without distortion
  std::vector<Eigen::Vector2d> ideal_points;  // an arc: points along it
  double sigma_offset_px = 0, sigma_angle_rad = 0;
};

struct FitQuestion {
  const ObjectModel* model = nullptr;
  int resting_pose = 0;
  double support_height_mm = 0;  // of what the part stands on
  std::vector<Pick> picks;
  std::map<std::string, double> fixed_mm;  // dimensions that the operator gave
  int present_image = -1;                  // that the operator looks at; hints prefer it
  std::optional<PlacedObject> start;       // where it was before; left out: found from the picks
};

// A contour that, if it were picked, would determine a dimension best.
struct Hint {
  std::string dimension;
  int image = 0, contour = 0;
  bool is_circle = false;
};

struct FitAnswer {
  PlacedObject object;
  Eigen::MatrixXd covariance;       // of the object's state
  std::vector<double> residual_px;  // of each pick: RMS distance from its contour
  double rms_px = 0;
  std::vector<double> sigma_mm;  // of each dimension
  std::vector<bool> observable;  // of each dimension
  bool placed = false;           // do the picks determine where it stands?
  std::vector<Hint> hints;
};

// `views`: all pictures, by index. Errors: no pick yet; picks that no placement of the object explains.
Result<FitAnswer> FitPicks(const FitQuestion& question, const std::vector<View>& views);

// The question's object on its support at the world's origin, what is not fixed as usual.
PlacedObject UsualObject(const FitQuestion& question);

// Where the picks' middles lie on the support, in the mean: world, mm.
Eigen::Vector2d FootOfPicks(const FitQuestion& question, const std::vector<View>& views);

// `object` fitted to the picks from where it is, without a word on quality; returns the cost.
double RefinePicks(const FitQuestion& question, const std::vector<View>& views, PlacedObject& object);

}  // namespace vss::station
