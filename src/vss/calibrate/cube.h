// Extrinsic calibration: where a camera hangs, from a cube of known size and place, by its edges, at one or
// more stops of the gantry. Edges do not lie where the geometry says: chamfers and light move them, each
// class of edge by its own amount, which is estimated with them; edges on the floor, where the contact shadow
// pulls, count least.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "vss/base/progress.h"
#include "vss/camera/camera.h"
#include "vss/image/grey_image.h"

namespace vss {

struct CubeSpec {
  double size_mm = 0;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();  // world: the centre of its base
  double yaw_rad = 0;
};

struct CubePicture {
  std::string file;
  GreyImage image;
  Eigen::Vector3d gantry_mm = Eigen::Vector3d::Zero();
};

enum class CubeEdgeClass { kTopOuter, kTopInner, kUprightOuter, kUprightInner, kFloor };
inline constexpr int kNumCubeEdgeClasses = 5;
const char* NameOf(CubeEdgeClass c);

struct EdgeQuality {
  std::string file;
  CubeEdgeClass edge_class = CubeEdgeClass::kTopOuter;
  int num_points = 0, num_used = 0;
  double mean_px = 0, rms_px = 0;  // along the outward normal, the class's bias taken out
};

// The move between a stop and the first, as the cube shows it against what the gantry says (world, mm).
struct MoveCheck {
  std::string file;
  Eigen::Vector3d seen_mm, said_mm, sigma_mm;
};

struct CubeResult {
  RigidTransform cam_from_world;  // at gantry displacement zero
  // Rotation (rad, R <- exp(w) R) and translation (mm) of cam_from_world; of the edges alone, the lens taken
  // as known.
  Eigen::Matrix<double, 6, 6> covariance;
  Eigen::MatrixXd
      by_lens;  // d pose / d (fx, fy, cx, cy, distortion): 6 x n, how an error of the lens gets in
  double bias_px[kNumCubeEdgeClasses] = {};
  double bias_sigma_px[kNumCubeEdgeClasses] = {};
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();  // of the stops' displacements
  double rms_px = 0;
  int num_points = 0;
  double cube_scale = 1,
         cube_scale_sigma =
             0;  // the cube's size as the gantry's moves measure it, over the given; sigma 0: one stop
  std::vector<EdgeQuality> edges;
  std::vector<MoveCheck> moves;
  std::vector<std::string> warnings, findings;
};

// `near_mm`: roughly where the camera is at gantry displacement zero (world). `check_moves`: refuse or warn
// where the cube contradicts the gantry's moves; false while its axes are still to be calibrated. Errors name
// the camera, the cause and the remedy.
Result<CubeResult> CalibrateFromCube(const std::string& camera, const Intrinsics& lens, const CubeSpec& cube,
                                     const std::vector<CubePicture>& pictures,
                                     const std::optional<Eigen::Vector3d>& near_mm, const Gantry& gantry,
                                     bool check_moves = true);

// Joint covariance of lens and place, in the order of CalibrationQuality.
Eigen::MatrixXd JointCovariance(const Eigen::MatrixXd& lens_covariance, const CubeResult& cube);

// The gantry's axes from several cameras' cube pictures: what each given direction of travel really is.
struct CubeJob {
  std::string camera;
  Intrinsics lens;
  CubeSpec cube;
  const std::vector<CubePicture>* pictures = nullptr;
  RigidTransform cam_from_world;  // start
};
struct GantryAxes {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d sigma = Eigen::Matrix3d::Zero();
  bool moved[3] = {false, false, false};  // directions in which the stops differ; the others stay as they are
  std::vector<std::string> findings;      // scale, direction and skew in words
};
Result<GantryAxes> CalibrateGantryAxes(const std::vector<CubeJob>& jobs);

// How well the cube's edges in `pictures` fit the camera as it is: to tell that a camera has moved.
struct CubeCheck {
  double rms_px = 0;       // of the edges against the camera as it is
  double turned_mrad = 0;  // how far the camera would have to turn and move to fit
  double moved_mm = 0;
  double sigma_mrad = 0, sigma_mm = 0;
};
Result<CubeCheck> CheckAgainstCube(const Camera& camera, const CubeSpec& cube,
                                   const std::vector<CubePicture>& pictures, const Gantry& gantry);

// The edge of a blurred step along n through p (img, px): offset from p along n. Exposed for tests.
struct EdgeOffset {
  double offset_px = 0, sigma_px = 0, contrast = 0;
};
std::optional<EdgeOffset> MeasureEdge(const GreyView& image, const Eigen::Vector2d& p,
                                      const Eigen::Vector2d& normal, double reach_px, double half_length_px);

}  // namespace vss
