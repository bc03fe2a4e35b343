// How well the lines of the pictures speak for a placed object: predicted contours against lines found.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "vss/identify/contour.h"
#include "vss/identify/evidence.h"
#include "vss/identify/line_index.h"
#include "vss/identify/world_line.h"

namespace vss {

// All pictures prepared for look-ups.
struct SceneIndex {
  std::span<const View> views;
  std::vector<LineIndex> lines;
  std::vector<std::vector<double>>
      density;  // per view and direction bin: chance that some line lies within 1 px of a point, per px
  std::vector<double>
      typical_step;  // per view: of the grey values where nothing is predicted (TypicalResponse)
  double tolerance_px = 1.5;
  double sigma_px = 0.5;  // standard deviation of a line's distance from the contour that it shows
  double mm_per_px = 1;   // typical size of a pixel in the scene

  // Lines that are known to be one edge of the world speak only for contours at that place. By view and line:
  // index into `world_lines`, -1, or kShadow: an edge of a shadow, which speaks for nothing.
  static constexpr int kShadow = -2;
  std::vector<std::vector<int>> world_of_line;
  std::vector<WorldLine> world_lines;
  void SetWorldLines(std::span<const WorldLine> lines);
  // The nearest line that may be the contour sample's image.
  LineHit Match(int view, const ContourSample& sample, double reach_px, double min_cosine) const;

  static constexpr int kDirectionBins = 18;
  double ChanceHit(int view, const Eigen::Vector2d& tangent) const;
};
SceneIndex MakeSceneIndex(std::span<const View> views, double tolerance_px, int threads);
// An edge that is seen from one place of the carriage only, though from others one looks at it too: the edge
// of a shadow or a reflection, which moves with the carriage's lamps.
bool MovesWithLamps(const WorldLine& line, std::span<const View> views);
// Median over the pictures of a pixel's size where the optical axis meets the ground.
double TypicalMmPerPx(std::span<const View> views);

// Which lines accepted parts have explained already: claimed[view][line].
using Claims = std::vector<std::vector<bool>>;

struct EdgeEvidence {
  ContourSample::Source source = ContourSample::Source::kEdge;
  int index = 0;
  int views = 0;                                          // that should see it
  double visible_px = 0, supported_px = 0, empty_px = 0;  // empty: not even the grey values show a step
  double rms_px = 0;                                      // distance of what supports it
  double log_odds = 0;
};

struct Evidence {
  // Of contours above the support, less what they would explain if they were painted on it.
  double elevated_log_odds = 0;
  double log_odds = 0;  // natural logarithm, for "there is this object" against "chance"
  double visible_px = 0, supported_px = 0;
  int views = 0;  // that see part of its contour
  // The score of the whole: what paint and shadows could explain as well counts for nothing.
  double Score() const { return std::min(log_odds, elevated_log_odds); }
  std::vector<EdgeEvidence> edges;
  std::vector<ContourMatch> matches;  // only where asked for
};

struct WeighOptions {
  double spacing_px = 6;
  int min_samples = 3, max_samples = 24;  // an edge
  bool keep_matches = false;
  bool grey = false;   // ask the grey values where there is no line
  bool rings = false;  // ask them of circles as a whole even so
  bool rough = false;  // for a start that is not yet fitted; without the comparison with paint
  double prior_log_odds = 0;
};

// Does the solid itself roof over the point, as a flange the web below it? Little light gets there.
bool IsCovered(const WorldSolid& solid, const Eigen::Vector3d& point_in_world);

// The contour of a solid held against the pictures, sample by sample, before it is decided what hides it and
// whose the lines are.
struct MeasuredContours {
  struct Contour {
    ContourSample::Source source = ContourSample::Source::kEdge;
    int index = 0;
    double weight = 1, detect = 1;  // how often it is found where it is
    bool elevated = false;          // above the support
  };
  struct Sample {
    int contour = 0;
    int line = -1;                      // of the picture's line index; -1: none
    int lost = 0;                       // the line is a nearer contour's: 1 unresolvable, 2 missed
    bool asked = false, empty = false;  // the grey values; they show no step
    Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
    double step_px = 0, chance = 0, distance_px = 0, along_px = 0;
    double ends = 0, step = 0;  // log-odds of where the line ends, of the grey values where there is no line
    // Of a circle: which way the grey values clearly step across it, 0: they do not; empty: not asked.
    std::optional<int> rises;
  };
  // The nearest other contour that runs beside one.
  struct Neighbour {
    double distance_px = 1e9;
    int contour = -1;
  };
  struct InView {
    int view = 0;
    std::vector<Sample> samples;     // those visible as far as was known
    std::vector<Neighbour> crowded;  // by contour
  };
  std::vector<Contour> contours;
  std::vector<InView> views;
  // Of each ledge (a level face below the top, as the lying leg of an angle) the contours across it.
  std::vector<std::vector<int>> ledge_ends;
};
// What it costs that the ends of a ledge are rather not there than there: two long edges alone may be shadows
// of one. `log_odds`: by contour.
double OpenLedges(const MeasuredContours& measured, std::span<const double> log_odds);
MeasuredContours MeasureContours(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                                 const WeighOptions& options, const Occluders* others = nullptr);

// What one picture says of the contours that it should show.
struct ContourVote {
  struct Contour {
    int contour = 0;
    double visible_px = 0, open_px = 0, supported_px = 0, empty_px = 0;
    double squared = 0;    // px^2, sum over the supported px
    double per_piece = 0;  // log-odds of an independent piece, in the mean
    double ends = 0;
  };
  std::vector<Contour> contours;
};
// `visible(i)`, `taken(i)`: of the view's samples; empty: all are visible, no line is another part's.
ContourVote VoteOf(const MeasuredContours& measured, const MeasuredContours::InView& in_view,
                   const std::function<bool(std::size_t)>& visible,
                   const std::function<bool(std::size_t)>& taken, const SceneIndex& scene, bool rough);
// As how many independent pieces a contour of this length in a picture counts.
double IndependentPieces(double px);

// The views that see the object, those that show it largest first, at most `most`.
std::vector<int> ViewsThatSee(const WorldSolid& solid, std::span<const View> views, int most);

// What an object must overcome before any line is looked at: every dimension pays for itself, more so one too
// small to be seen in the pictures, and a resting pose that is not the first.
double PriorLogOdds(const PlacedObject& object, double mm_per_px);

Evidence Weigh(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
               const WeighOptions& options, const Occluders* others = nullptr,
               const Claims* claims = nullptr);

// What the contours that stand above the support would explain if they were painted on it; 0 for what is too
// high to be taken for paint.
double PaintedLogOdds(const WorldSolid& solid, std::span<const int> views, const SceneIndex& scene,
                      const WeighOptions& options, const Occluders* others = nullptr,
                      const Claims* claims = nullptr);
// Paint must be where an object's foot would be, which is this share of what the prior asks for.
inline constexpr double kElevatedPrior = 0.5;

// Gauss-Newton of the state to the lines nearest to the predicted contour. `free`: which state entries may
// move. `reach_px`: lines further away are not looked at, from the first to the last iteration. Returns the
// rms in px of the samples used, or a negative number where there were too few.
struct FitToLinesResult {
  double rms_px = -1;
  int samples = 0;
  Eigen::MatrixXd information;  // of the state, before the prior, for 1 px noise a sample
};
FitToLinesResult FitToLines(PlacedObject& object, std::span<const int> views, const SceneIndex& scene,
                            const std::vector<bool>& free, double first_reach_px, double last_reach_px,
                            int iterations, const Occluders* others = nullptr);

}  // namespace vss
