// The joint least-squares adjustment: parts, cameras and gantry stops against measured contour points.
//
// An observation says how far, along the contour's normal, a measured edge point lies from the projected
// contour. Observations of one edge in one picture form a group: beside its own noise each carries the
// group's common error (shading, chamfer, shadow), a random effect of variance systematic^2 of its edge
// class, which is integrated out: the group's weight matrix is D - c D 1 1^T D, c = s^2 / (1 + s^2 sum w)
// (Woodbury). Those variances are estimated from the scatter between groups (variance components; Foerstner
// 1979), so that the covariance is honest where systematic errors, not noise, are the limit. Edges that lie
// on something have a bias of their own in all pictures. Everything that was measured beforehand, the
// cameras' places and lenses and where the carriage stood, is an unknown with its prior; a part's height is
// tied to what it stands on.
#pragma once
#include <Eigen/Core>
#include <cmath>
#include <map>
#include <span>
#include <vector>

#include "vss/reconstruct/contour_pieces.h"
#include "vss/reconstruct/known_length.h"

namespace vss {

struct Observation {
  ContourSample sample;
  Eigen::Vector2d measured = Eigen::Vector2d::Zero();  // img
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();   // img, unit
  double sigma_px = 0.1;
  double contrast = 0;
  bool shadowed = false;       // a shadow may lie behind it: ContourClass::kShadowed
  bool bright_behind = false;  // the background is brighter than the face
  bool saturated = false;      // beside what is brighter than the sensor can say
  bool is_short = false;       // the edge as a whole, measured with what is around it: short_edge.h
  double weight = 1;           // robust, within its group
  double residual_px = 0;
  double half_length_px = 4;          // of the strip
  double neighbour_blurs = INFINITY;  // to the nearest other contour, measured in the same fit; of the blur
};

// The observations of one edge, rim or limb of one part in one view.
struct ObservationGroup {
  int part = 0, view = 0;
  int contour = 0;  // ContourKey
  ContourClass edge_class = ContourClass::kFree;
  std::vector<Observation> observations;
  double systematic_px = 0;  // common error of its observations, one sigma
  double weight = 1;         // robust
  double mean_px = 0;        // weighted mean residual
  double sigma_mean_px = 0;  // of the mean, from the observations' own noise

  // Is it an edge of a few pixels?
  bool IsShort() const { return !observations.empty() && observations.front().is_short; }
  // What pulls this contour in pictures of this kind: with a shadow behind it it is another pull than
  // without.
  int BiasKey() const { return 2 * contour + (edge_class == ContourClass::kShadowed); }
};

// One number for an edge, rim or limb of a solid.
inline int ContourKey(const ContourSample& s) {
  return (s.index * 3 + static_cast<int>(s.source)) * 3 + s.limb_side + 1;
}

struct AdjustedPart {
  PlacedObject object;
  int stands_on = -1;      // index of a part, -1: the ground, kLoose: nothing known
  bool leans = false;      // against the ground's slope
  std::vector<bool> free;  // of the state
  // Of what is held, not free: how well its value is known (zero or empty: it is certain). It does not move,
  // but what hangs on it is off as it is, and the covariance says so: considered parameters (Schmidt 1966).
  Eigen::MatrixXd held_covariance;           // of the state
  Eigen::VectorXd prior_value, prior_sigma;  // of the state: weak, so that the system always has one solution
  // What pulls a contour the same way in all pictures (chamfer, contact shadow), along the observations'
  // normal; it cannot be told from the part's shape, so that its prior sigma bounds how well the shape is
  // known. By ObservationGroup::BiasKey.
  std::map<int, double> bias_px, bias_prior_px, bias_sigma_px;
  // Of rims: there a pull is one of the radius, so that the oblique view of a circle does not seem to tell
  // the two apart. mm of radius for a px of bias.
  std::map<int, double> rim_mm_per_px;
};
inline constexpr int kLoose = -2;

inline constexpr int kCameraPlaceSize = 6;  // rotation and centre of a camera

// A camera that hangs on the carriage or stands still, or one hand-held picture. Unknowns: rotation (rad,
// cam, exp(w) R), shift of the centre (mm, world), then intrinsics fx fy cx cy and distortion where
// `num_intrinsics` > 0.
struct AdjustedCamera {
  const Camera* camera = nullptr;
  std::vector<int> views;
  int num_intrinsics = 0;
  Eigen::MatrixXd prior_covariance;
  bool prior_from_calibration = false;  // else its scale is estimated
  Eigen::VectorXd value;
  bool loosened = false;  // found moved: the prior no longer counts
};

struct AdjustedStop {
  int stop = 0;
  std::vector<int> views;
  Eigen::Vector3d value = Eigen::Vector3d::Zero();  // mm, world
};

// The plane that the workpiece stands on: z = height + slope . (x, y). Fixed at z = 0 until it is freed; then
// all parts that do not lean share its slope.
inline constexpr int kGroundSize = 3;
struct AdjustedGround {
  bool free = false;
  Eigen::Vector3d value = Eigen::Vector3d::Zero();  // height (mm) at the world's origin, slopes along x and y
  // What pulls all contours that lie on something alike: it looks as if the ground were higher or lower, and
  // is an unknown, too, where the ground is one or may be.
  bool pull_free = false;
  double pull_px = 0;

  double HeightAt(double x_mm, double y_mm) const { return value[0] + value[1] * x_mm + value[2] * y_mm; }
  Eigen::Vector3d Normal() const { return Eigen::Vector3d(-value[1], -value[2], 1).normalized(); }
};

// An upright face of a part that lies against one of another part: fitted up, or welded.
struct WallTie {
  int part = 0, face = 0, other = 0, other_face = 0;
};
// Those faces of parts as they stand that lie within `reach_mm` of each other, antiparallel, the middle of
// the one on the other.
std::vector<WallTie> FindWallTies(std::span<const AdjustedPart> parts, double reach_mm);

struct AdjustmentOptions {
  bool adjust_cameras = true;
  double ground_sigma_mm = 0.1;
  double contact_sigma_mm = 0.1;
  double wall_sigma_mm = 1;
  double common_pull_px = 0.2;
  double ground_height_sigma_mm = 50, ground_slope_sigma = 0.05;  // where it is free: weak
  // What may pull a contour in all pictures alike, by class; and an edge of short pieces, px * px^2.
  std::array<double, kNumContourClasses> bias_px{0.02, 0.2, 0.05, 0.5, 0.35};
  // The same of an outline whose background is brighter than its face, however high: now and then a shadow's
  // border runs along it (accuracy_pulls: three quarters of them are pulled by less than .04 px in rendered
  // pictures, .07 in simulated ones).
  double bright_behind_bias_px = 0.05;
  // That many times as much where another contour lies nearer than so many blurs: their steps run into each
  // other (accuracy_pulls).
  double near_factor = 2.5, near_blurs = 3;
  double short_edge_bias = 0.15;
  // Beside a side that the sensor's limit hides: how bright it is, and how blurred, is known beforehand only,
  // so that such edges lie alike too far out or in.
  double saturated_bias_px = 0.2;
  double single_view_bias_px = 0.2;  // a contour that one picture alone measured: nothing checks it
  double stop_sigma_mm = 0.15;
  double free_systematic_px = 0.03, contact_systematic_px = 0.15, round_systematic_px = 0.05,
         limb_systematic_px = 0.15, shadowed_systematic_px = 0.2;  // to start with
  // Where lengths are known, the places of all cameras, about the world's origin, share an unknown scale.
  std::vector<KnownLength> known_lengths;
  double scale_sigma = 0.01;  // what is known of it beforehand
};

class Adjustment {
 public:
  Adjustment(std::span<const View> views, std::vector<AdjustedPart> parts,
             std::vector<AdjustedCamera> cameras, std::vector<AdjustedStop> stops,
             const AdjustmentOptions& options);

  std::vector<AdjustedPart> parts;
  std::vector<AdjustedCamera> cameras;
  std::vector<AdjustedStop> stops;
  AdjustedGround ground;
  std::vector<ObservationGroup> groups;
  std::vector<WallTie> walls;
  std::array<double, kNumContourClasses> systematic_px;
  double camera_scale = 1, stop_scale = 1;  // of the priors' sigmas, estimated
  double scale = 0;                         // of the cameras' places, less one
  AdjustmentOptions options;

  // Gives every contour that was measured its bias and prior. To be called when `groups` are new.
  void PrepareBiases();
  // The views with all corrections, for measuring again.
  std::vector<View> AdjustedViews() const;
  // Gauss-Newton steps with robust weights and, after each, the systematic variances. Returns the largest
  // move of a part's vertex in the last step, mm.
  double Solve(int max_steps, bool shared_free);
  // Scales of priors that no calibration gave (Foerstner's estimate), then the covariance of everything.
  void EstimatePriorScales();
  void ComputeCovariance();
  // Decrease of the weighted sum of squares, linearised, if more unknowns were free.
  struct Gain {
    double chi_square = 0;
    Eigen::VectorXd step;  // of the part's state, of the ground
  };
  Eigen::VectorXd StepOf(int part);  // of its state, to the linearised solution
  Gain GainOfLeaning(int part, double tilt_sigma_rad);
  Gain GainOfFreeingGround();
  void Lean(int part, double tilt_sigma_rad);
  void FreeGround();
  // Gives up those wall ties that the pictures contradict by more than so many sigmas (Baarda 1968). To be
  // called after ComputeCovariance.
  void DropBrokenWalls(double most_sigmas);

  // Blocks of the covariance; unknowns that are not free have zero rows, but what is held and known so and so
  // well (AdjustedPart::held_covariance) has its variance there, and its covariance with all that hangs on
  // it.
  Eigen::MatrixXd PartCovariance(int part) const;
  Eigen::MatrixXd CameraCovariance(int camera) const;
  Eigen::Matrix3d StopCovariance(int stop) const;
  Eigen::Matrix3d GroundCovariance() const;  // zero where it is not free
  double ScaleSigma() const;                 // 0 where the scale is not an unknown
  // How the parts' states would change without the observations of `view`, linearised at the solution, and
  // the standard deviation that such a change has. To be called after ComputeCovariance.
  struct Change {
    Eigen::VectorXd step, sigma;
  };
  std::vector<Change> ChangesWithout(int view) const;
  // Information on part i's state from the pictures alone (all other unknowns eliminated), without its weak
  // prior.
  Eigen::MatrixXd DataInformation(int part) const;

 private:
  struct Layout {
    std::vector<int> part, camera, stop;   // offsets
    std::vector<std::map<int, int>> bias;  // per part: BiasKey -> offset
    int ground = 0, pull = 0;
    int scale = -1;
    int size = 0;
  };
  // What a group adds to the normal equations, of the unknowns `at`.
  struct Term {
    std::vector<int> at;
    Eigen::MatrixXd h;  // lower triangle
    Eigen::VectorXd g;
  };
  Layout MakeLayout() const;
  void UpdateResiduals();
  void UpdateWeights();
  void UpdateSystematics();
  void Build(bool shared_free);
  void BuildUnpinned(bool shared_free);
  Eigen::MatrixXd CovarianceOfFree(int part) const;  // with what is held taken for certain
  Term TermOf(const ObservationGroup& group, const WorldSolid& solid, const std::vector<View>& views) const;
  void AddPriors(bool shared_free);
  void AddTies();
  void AddTie(const Eigen::RowVectorXd& by_unknowns, double residual, double sigma);
  // Of a wall tie: the gap, mm, and its derivative by all unknowns.
  std::pair<double, Eigen::RowVectorXd> GapOf(const WallTie& wall) const;
  void AddGroundPrior();
  void AddSlopeTies(std::size_t part);
  std::pair<double, Eigen::VectorXd> LinearisedStep();
  std::vector<bool> Pinned(bool shared_free) const;
  void Pin(bool shared_free);
  void Apply(const Eigen::VectorXd& step);
  double PriorScale(const AdjustedCamera& camera) const;
  int CameraOfView(int view) const { return camera_of_view_[static_cast<std::size_t>(view)]; }

  std::vector<View> views_;
  std::vector<int> camera_of_view_, stop_of_view_;
  Layout layout_;
  Eigen::MatrixXd h_, covariance_;  // the latter with what is held taken for certain
  Eigen::MatrixXd by_held_;         // times its transpose: what errors of the held ones add to it
  Eigen::VectorXd g_;
  // Intrinsics of cameras whose lens is adjusted, changed by their corrections (AdjustedViews points into
  // it).
  mutable std::vector<Camera> changed_;
};

// Camera blocks and stops of `views` with priors: from the calibration where it says how good it is, else the
// given sigmas.
struct PriorOptions {
  double camera_rotation_sigma_rad = 1e-4, camera_position_sigma_mm = 0.2;
  double picture_rotation_sigma_rad = 5e-4, picture_position_sigma_mm = 0.5;  // of hand-held pictures
};
std::vector<AdjustedCamera> MakeCameras(std::span<const View> views, const PriorOptions& options);
std::vector<AdjustedStop> MakeStops(std::span<const View> views);

}  // namespace vss
