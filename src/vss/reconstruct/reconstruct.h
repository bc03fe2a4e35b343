// Reconstruction at the limit of the pictures: every identified part's place and dimensions from the grey
// values of all pictures that see it, jointly with cameras and gantry stops, with an honest sigma on every
// number.
//
// Steps: the contour is drawn to the line images (coarse_fit.h); edges are measured in the grey values along
// the normals of the predicted visible contour (contour_pieces.h, edge_profile.h); everything is adjusted
// jointly (adjustment.h); measured and adjusted again until it stands; then leaning parts, moved cameras and
// unobservable dimensions are decided on, and the covariance is propagated to every vertex.
#pragma once
#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/base/progress.h"
#include "vss/identify/scene.h"
#include "vss/image/grey_image.h"
#include "vss/reconstruct/contour_pieces.h"
#include "vss/reconstruct/known_length.h"

namespace vss {

struct ReconstructOptions {
  bool draw_to_lines = true;  // false: the parts lie within `search_px` already
  double search_px = 3;
  double piece_length_px = 8;
  bool adjust_cameras = true;
  double camera_rotation_sigma_mrad = 0.1, camera_position_sigma_mm = 0.2;
  double picture_rotation_sigma_mrad = 0.5, picture_position_sigma_mm = 0.5;
  double stop_sigma_mm = 0.15;
  double ground_sigma_mm = 0.1, contact_sigma_mm = 0.1;
  double wall_sigma_mm = 1;  // of upright faces that lie against each other; 0: none is taken to
  // What may pull an edge alike in all pictures: chamfers, contact shadows, a cylinder's shading, a shadow.
  double free_bias_px = 0.02, contact_bias_px = 0.2, round_bias_px = 0.05, limb_bias_px = 0.5,
         shadowed_bias_px = 0.35;
  double tilt_sigma_deg = 1;
  bool allow_tilt = true, allow_ground = true;
  bool full_covariance = false;
  std::vector<KnownLength> known_lengths;  // where there are some, the cameras' places share an unknown scale
};
std::span<const ParameterOf<ReconstructOptions>> ReconstructParameters();

// How well one edge, rim or limb of a part was met in one picture.
struct EdgeResidual {
  ContourSample::Source source = ContourSample::Source::kEdge;
  int index = 0;  // of the solid's edge, circle or cylinder face
  int limb_side = 0;
  int view = 0;
  ContourClass edge_class = ContourClass::kFree;
  double mean_px = 0, rms_px = 0;  // measured less predicted, along the contour's normal
  int num_points = 0;
  bool used = true;  // false: too far off to be that edge
};

// How far the middle of a straight edge lies off the line through its ends.
struct EdgeStraightness {
  int edge = 0;
  double bow_mm = 0, sigma_mm = 0;
  double chi_square = 0;  // of no bow, two degrees of freedom
  int num_views = 0;
};

struct ReconstructedDimension {
  std::string name;
  double value_mm = 0, sigma_mm = 0;
  bool observable = true;
  std::string origin;  // where a value that was not observed comes from: a sentence
};

struct ReconstructedPart {
  PlacedObject object;
  int stands_on = -1;          // as given
  bool leans = false;          // tilts were needed and are estimated
  Eigen::MatrixXd covariance;  // of the state (mm, rad), calibration and systematic errors included
  std::vector<ReconstructedDimension> dimensions;
  std::vector<bool> observable;                    // of the state
  std::vector<Eigen::Vector3d> vertex_sigma;       // mm, world
  std::vector<Eigen::Matrix3d> vertex_covariance;  // mm^2, where asked for
  double residual_px = 0;  // rms of the edges' mean residuals in their pictures, those in use
  std::vector<EdgeResidual> edges;
  std::vector<EdgeStraightness> straightness;
  Eigen::VectorXd singular_values;  // of the scaled Jacobian, descending: see AnalyseObservability
  std::vector<int> views;           // that measured it
  std::vector<std::string> remarks;
};

// What the adjustment says of a camera on the carriage, or of one hand-held picture.
struct CameraCorrection {
  std::string camera;
  std::vector<int> views;
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero(), rotation_sigma_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero(), shift_sigma_mm = Eigen::Vector3d::Zero();
  double significance = 0;  // chi-square of the correction per degree of freedom, against its prior
  bool moved = false;
};

struct StopCorrection {
  int stop = 0;
  Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero(), sigma_mm = Eigen::Vector3d::Zero();
};

// What one view decides: without it, this unknown of this part would change most, in its own sigmas.
struct ViewInfluence {
  int view = 0;
  int num_edges = 0;  // measured in it
  double rms_px = 0;  // of their means
  int part = 0;
  std::string unknown;    // "x", "y", "z" or a dimension
  double change_mm = 0;   // what it would be without the view, less what it is
  double sigma_mm = 0;    // that such a change has
  bool outlying = false;  // the view contradicts the others
};

// Where the scale comes from: 1 + correction was found for the places of all cameras.
struct ScaleFinding {
  enum class From { kKnownLength, kGantry, kPictures };
  From from = From::kPictures;
  double correction = 0, sigma = 0;
};

// The plane that the workpiece stands on, where it is not z = 0.
struct GroundFinding {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // mm, world: the middle of what stands on it
  double height_mm = 0, sigma_mm = 0;            // there
  Eigen::Vector2d slope = Eigen::Vector2d::Zero(),
                  slope_sigma = Eigen::Vector2d::Zero();  // along x, y: mm/mm
};

struct Reconstruction {
  std::vector<ReconstructedPart> parts;  // in the order given
  std::vector<CameraCorrection> cameras;
  std::vector<StopCorrection> stops;
  std::vector<RigidTransform> cam_from_world;              // of each view, adjusted
  std::array<double, kNumContourClasses> systematic_px{};  // common error of an edge in a picture, by class
  double camera_scale = 1, stop_scale = 1;  // estimated, of the priors where no calibration gave them
  std::vector<ViewInfluence> influences;    // of the views that measured something
  ScaleFinding scale;
  std::optional<GroundFinding> ground;  // empty: z = 0, as the survey has it
  int num_observations = 0;
  std::vector<std::string> warnings;
};

// `pictures[i]` belongs to `views[i]`; grey values proportional to light (LinearFromSrgb first where need
// be). Deterministic for any number of threads. An error where the numbers of views and pictures differ, a
// picture has not its camera's size, or on cancel.
Result<Reconstruction> ReconstructScene(std::span<const View> views, std::span<const GreyView> pictures,
                                        std::span<const IdentifiedPart> parts,
                                        const ReconstructOptions& options, int threads,
                                        const Progress& progress);

}  // namespace vss
