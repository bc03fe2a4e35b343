// What a surveyor checks a result by: residuals contour by contour, straightness of edges, what single
// pictures decide, what the adjustment did to cameras and stops, where the scale comes from.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "vss/reconstruct/contour_pieces.h"

namespace vss {

// How well one contour of a part was met in one picture.
struct ContourResidual {
  std::string contour;  // "edge", "circle" or "limb"
  int index = 0;        // of it in the part
  int side = 0;         // of a limb
  std::string lies;     // "free", "contact", "round" or "limb"
  int image = 0;
  double mean_px = 0, rms_px = 0;  // measured less predicted, across the contour
  int num_points = 0;
  bool used = true;       // false: too far off
  bool shadowed = false;  // in this picture the part's shadow may lie behind it
};

struct Straightness {
  int edge = 0;
  double bow_mm = 0, sigma_mm = 0;  // of the middle, off the line through the ends
  int num_pictures = 0;
};

// Leaving out one picture: what would change most in its own sigmas, and the sigma of such a change.
struct PictureCheck {
  int image = 0, num_edges = 0;
  double rms_px = 0;
  std::string part, unknown;
  double change_mm = 0, sigma_mm = 0;
  bool outlying = false;
};

// A camera on the carriage, or one hand-held picture (`image`, else -1).
struct CameraCheck {
  std::string camera;
  int image = -1;
  Eigen::Vector3d rotation_mrad = Eigen::Vector3d::Zero(), rotation_sigma_mrad = Eigen::Vector3d::Zero();
  Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero(), shift_sigma_mm = Eigen::Vector3d::Zero();
  double significance = 0;  // chi-square per degree of freedom, against what was known beforehand
  bool moved = false;
};

struct ScaleCheck {
  std::string from;  // "known length", "gantry" or "places of the pictures"
  double correction_ppm = 0, sigma_ppm = 0;
};

// The plane that the workpiece stands on, where it is not z = 0.
struct GroundCheck {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // mm, world: the middle of what stands on it
  double height_mm = 0, sigma_mm = 0;            // there
  Eigen::Vector2d slope_mm_per_m = Eigen::Vector2d::Zero(), slope_sigma_mm_per_m = Eigen::Vector2d::Zero();
};

struct SurveyChecks {
  std::vector<PictureCheck> pictures;
  std::vector<CameraCheck> cameras;
  ScaleCheck scale;
  // Common error of an edge in a picture, by ContourClass.
  std::array<double, kNumContourClasses> systematic_px{};
  std::optional<GroundCheck> ground;
};

}  // namespace vss
