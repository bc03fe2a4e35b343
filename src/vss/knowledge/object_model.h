// An object of the knowledge base: parameters, a parameterised solid, how it may lie and on what it may stand.
//
// The `part` frame: base on z = 0, x along the length, origin at the centre of the footprint's bounding rectangle.
#pragma once
#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "vss/base/result.h"

namespace vss {

// A vertex (or centre) in `part` (mm), and its derivative by the dimensions: 3 x num_dimensions.
struct SolidPoint {
  Eigen::Vector3d point_in_part;
  Eigen::Matrix3Xd by_dimension;
};

// A plane face, or a piece of a cylinder. `triangles` (vertices in `part`, counter-clockwise seen from outside) are
// what visibility is computed with; a cylinder's are a faceted approximation.
struct SolidFace {
  bool is_cylinder = false;
  Eigen::Vector3d normal_in_part = Eigen::Vector3d::UnitZ();  // outward; a plane face's
  Eigen::Vector3d axis_point, axis_direction;                 // a cylinder's axis
  double radius_mm = 0;                                       // a cylinder's
  bool is_hole = false;                                       // cylinder: the material is outside
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
};

// A straight contour edge from vertex `start` to vertex `end`, between two faces.
struct SolidEdge {
  int start = 0, end = 0;
  int left_face = 0, right_face = 0;
  bool convex = true;
  double weight = 1;  // the author's word on how strong this edge looks; 0: never expected
};

// A whole circle (a rim).
struct SolidCircle {
  SolidPoint center;
  Eigen::Vector3d normal_in_part = Eigen::Vector3d::UnitZ();
  double radius_mm = 0;
  Eigen::RowVectorXd radius_by_dimension;
  int plane_face = 0, cylinder_face = 0;
  bool is_hole = false;
  double weight = 1;
};

// The part of a rim that a rounded corner makes: from vertex `start` to vertex `end`, tangent to the straight edges
// there. Counter-clockwise seen against `normal_in_part` (the plane face's outward normal) where the material is inside.
struct SolidArc {
  SolidPoint center;
  Eigen::Vector3d normal_in_part = Eigen::Vector3d::UnitZ();
  double radius_mm = 0;
  Eigen::RowVectorXd radius_by_dimension;
  int start = 0, end = 0;
  int plane_face = 0, cylinder_face = 0;
  bool is_hole = false;  // a hollow: the material is outside
  double weight = 1;
};

// The solid at given dimensions. Its topology (indices) is the same at all dimensions.
struct Solid {
  std::vector<SolidPoint> vertices;
  std::vector<SolidEdge> edges;
  std::vector<SolidCircle> circles;
  std::vector<SolidArc> arcs;  // of rounded corners; none of the shipped objects has any
  std::vector<SolidFace> faces;
};

struct DimensionDef {
  std::string name;
  double min_mm = 0, max_mm = 0;
  std::optional<double> usual_mm;  // what to take where nothing is seen; left out: see UsualDimensions
  std::string help;
};

// A way to lie: turned by `rested_from_part` before yaw; the lowest point then touches the support.
struct RestingPose {
  std::string name;
  Eigen::Matrix3d rested_from_part = Eigen::Matrix3d::Identity();
};

class ObjectModel {
 public:
  virtual ~ObjectModel() = default;
  virtual const std::string& kind() const = 0;
  virtual const std::string& title() const = 0;
  virtual std::span<const DimensionDef> dimensions() const = 0;
  virtual std::span<const RestingPose> resting_poses() const = 0;   // at least one
  // May it stand on the ground, or on a part of that kind? ("ground" or a kind)
  virtual bool MayStandOn(const std::string& kind_or_ground) const = 0;
  // The solid at `dimensions_mm`. An error where a range or a `require` is broken, naming it with file and line.
  virtual Result<Solid> Instantiate(std::span<const double> dimensions_mm) const = 0;
  // As Instantiate, with no look at ranges and constraints, for an optimiser's steps. Asserts that the size fits.
  virtual Solid InstantiateUnchecked(std::span<const double> dimensions_mm) const = 0;
  // How far each broken constraint is from being kept, in mm; empty where all hold (ranges included).
  virtual std::vector<double> Violations(std::span<const double> dimensions_mm) const = 0;
  // Values in range that keep every constraint: a start, and what an unseen dimension gets. `known` overrides by index.
  virtual std::vector<double> UsualDimensions(std::span<const std::optional<double>> known) const = 0;
};

// All objects, by kind; shared and constant after loading.
struct KnowledgeBase {
  std::vector<std::shared_ptr<const ObjectModel>> objects;
  const ObjectModel* Find(const std::string& kind) const;
};

// The shipped objects named in `names` (a kind such as "box") and files (a path ending in .kb, relative to `folder`);
// everything shipped where `names` is empty. Errors: FILE:LINE:COLUMN: what was expected.
Result<KnowledgeBase> LoadKnowledge(std::span<const std::string> names, const std::filesystem::path& folder);
Result<std::shared_ptr<const ObjectModel>> ParseObject(const std::string& text, const std::string& file_name);

}  // namespace vss
