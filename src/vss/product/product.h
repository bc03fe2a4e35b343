// Product definition data: the parts of a workpiece, where they lie, how large they are, how sure we are.
#pragma once
#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "vss/geometry/rigid_transform.h"
#include "vss/identify/evidence.h"
#include "vss/product/checks.h"
#include "vss/product/nominal.h"

namespace vss {

struct DimensionValue {
  std::string name;
  double value_mm = 0;
  double sigma_mm = 0;  // NaN where it is not known
  bool observable = true;
  std::string origin;                     // where a value that was not observed comes from: a sentence
  std::optional<double> nominal_mm = {};  // of the part's standard size
};

struct ProductCircle {
  Eigen::Vector3d center, normal;  // world
  double radius_mm = 0;
};

// How well the part's contour was met in one picture: root mean square over the edges measured there.
struct PictureResidual {
  int image = 0;
  double rms_px = 0;
  int num_edges = 0;
};

struct Part {
  std::string id, kind;
  std::string source = "automatic";  // "automatic", "corrected" or "manual"
  std::string resting_pose;
  std::vector<std::string> features;  // of those that its kind may have, those that it has
  bool has_features = false;          // may its kind have some?
  std::string designation, standard;  // its standard size, "IPE 200" of "EN 10365"; empty: none is sure
  std::vector<std::string> designation_candidates;  // where several fit, the nearest first
  RigidTransform world_from_part;
  double yaw_rad = 0;
  std::vector<DimensionValue> dimensions;
  std::vector<Eigen::Vector3d> vertices, vertex_sigma;  // world, mm
  std::vector<std::array<int, 2>> edges;                // pairs of vertices
  std::vector<ProductCircle> circles;
  std::string stands_on = "ground";  // "ground" or a part's id
  std::vector<int> images;           // indices of the pictures that were used
  std::vector<ContourMatch> matches;
  std::vector<PictureResidual> picture_residuals;
  std::vector<ContourResidual> contour_residuals;
  std::vector<Straightness> straightness;
  std::vector<bool> observable;                    // of x, y, z, yaw, tilt_x, tilt_y, dimensions
  Eigen::VectorXd singular_values;                 // of the scaled Jacobian, descending
  std::vector<std::string> remarks;                // sentences about this part
  std::vector<Eigen::Matrix3d> vertex_covariance;  // mm^2, where asked for
  Eigen::MatrixXd covariance;  // of (x, y, z mm, rotation vector rad in world, dimensions mm)
  double residual_px = 0;
  bool doubtful = false;
  double log_odds = 0;
  std::optional<RunnerUp> runner_up;
};

// A place where two parts touch along a line, to be welded. Normals (unit, world) of the two faces that meet.
struct Seam {
  std::string part_a, part_b;
  Eigen::Vector3d start = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal_a = Eigen::Vector3d::Zero(), normal_b = Eigen::Vector3d::Zero();
  double gap_mm = 0;  // how far part_b's edge stands off part_a's face where it is farthest; negative: in it
};

// The unit vector (world) from the seam to where a torch comes from: halfway between the two faces' normals.
// Zero where the normals are not known.
Eigen::Vector3d ApproachOf(const Seam& seam);

// Lengths are given as at 20 degrees: what was measured at `workpiece_c`, times `factor`.
struct ReducedTemperature {
  double workpiece_c = 20, expansion_ppm_per_k = 0, factor = 1;
};

struct Product {
  std::string survey;
  std::vector<Part> parts;
  std::vector<Seam> seams;
  std::vector<UnknownGroup> unknown;
  std::vector<std::string> warnings;
  std::optional<SurveyChecks> checks;
  std::optional<ReducedTemperature> temperature;
  std::optional<NominalComparison> nominal;  // as built against as designed, where that was asked for
};

// Format vss-product/1, one object with its fields in the order of the contract, the same bytes for the same
// product. `image_files`: the pictures' names as in the survey file, by index.
std::string ProductToJson(const Product& product, const std::vector<std::string>& image_files);
Result<Product> ReadProduct(const std::filesystem::path& path, const std::vector<std::string>& image_files);

}  // namespace vss
