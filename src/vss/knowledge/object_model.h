// An object of the knowledge base: parameters, a parameterised solid, how it may lie and on what it may
// stand.
//
// The `part` frame: base on z = 0, x along the length, origin at the centre of the footprint's bounding
// rectangle.
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
#include "vss/knowledge/dual.h"

namespace vss {

// Derivatives by the dimensions of an object, 3 x num_dimensions; kept in place, for solids are made by the
// million.
using DimensionColumns = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kMaxDimensions>;

// A vertex (or centre) in `part` (mm), and its derivative by the dimensions.
struct SolidPoint {
  Eigen::Vector3d point_in_part;
  DimensionColumns by_dimension;
};

// A plane face, or a piece of a cylinder. `triangles` (vertices in `part`, counter-clockwise seen from
// outside) are what visibility is computed with; a cylinder's are a faceted approximation.
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

// The part of a rim that a rounded corner makes: from vertex `start` to vertex `end`, tangent to the straight
// edges there. Counter-clockwise seen against `normal_in_part` (the plane face's outward normal) where the
// material is inside.
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

// A feature that an object may have (`optional`, `either`).
struct FeatureDef {
  std::string name, title;
  bool present = false;  // has this variant of the object got it?
};

// A dimension as it was measured.
struct MeasuredDimension {
  double value_mm = 0, sigma_mm = 0;
  bool observed = true;
};

// A standard size that measured dimensions fit.
struct SizeMatch {
  std::string designation, standard;              // "IPE 200", "EN 10365"
  std::vector<std::optional<double>> nominal_mm;  // of each dimension that the catalogue lists
  std::vector<double> tolerance_mm;               // of those, the larger of below and above
  double chi2 = 0;                                // of the observed dimensions' deviations
  int num_observed = 0;                           // of the catalogue's dimensions
  bool complete = true;                           // all of them
};

// The one size that `matches` (the best first) leave: the only one, or better than the next by three sigma.
// At least two of its dimensions must be observed, or all. Null: several sizes, or none.
const SizeMatch* DeterminedSize(std::span<const SizeMatch> matches);

// A way to lie: turned by `rested_from_part` before yaw; the lowest point then touches the support.
struct RestingPose {
  std::string name;
  Eigen::Matrix3d rested_from_part = Eigen::Matrix3d::Identity();
};

// What an object's author says of its place among other parts. What it means: relations.h.
struct ObjectRelation {
  enum class Force { kExpects, kPrefers, kAvoids } force = Force::kPrefers;
  enum class Kind { kTouching, kNear, kParallel, kPerpendicular, kBetween } kind = Kind::kTouching;
  std::vector<std::string> kinds;   // one of these
  std::vector<std::string> others;  // kBetween: and another part that is one of these
  double within_mm = 0;
  double weight = 2;  // natural logarithm of the odds
  std::string reason;
};

// One variant of an object: with optional features and alternatives there are several ObjectModels of one
// kind, each with its own solid and dimensions.
class ObjectModel {
 public:
  virtual ~ObjectModel() = default;
  virtual const std::string& kind() const = 0;
  virtual const std::string& title() const = 0;
  virtual std::span<const FeatureDef> features() const = 0;  // of all variants; empty: there is but this one
  virtual std::span<const DimensionDef> dimensions() const = 0;
  virtual std::span<const RestingPose> resting_poses() const = 0;  // at least one
  // May it stand on the ground, or on a part of that kind? ("ground" or a kind)
  virtual bool MayStandOn(const std::string& kind_or_ground) const = 0;
  virtual std::span<const ObjectRelation> relations() const = 0;
  // The solid at `dimensions_mm`. An error where a range or a `require` is broken, naming it with file and
  // line.
  virtual Result<Solid> Instantiate(std::span<const double> dimensions_mm) const = 0;
  // As Instantiate, with no look at ranges and constraints, for an optimiser's steps. Asserts that the size
  // fits.
  virtual Solid InstantiateUnchecked(std::span<const double> dimensions_mm) const = 0;
  // How far each broken constraint is from being kept, in mm; empty where all hold (ranges included).
  virtual std::vector<double> Violations(std::span<const double> dimensions_mm) const = 0;
  // Values in range that keep every constraint: a start, and what an unseen dimension gets. `known` overrides
  // by index.
  virtual std::vector<double> UsualDimensions(std::span<const std::optional<double>> known) const = 0;
  // The sizes of the object's catalogues that `measured` (one a dimension) fit: every observed dimension lies
  // within its tolerance and three sigma. The nearest first; empty where there is none.
  virtual std::vector<SizeMatch> MatchSizes(std::span<const MeasuredDimension> measured) const = 0;
};

// The features that it has, by name.
std::vector<std::string> FeaturesOf(const ObjectModel& object);

// All objects, the variants of one kind one after the other; shared and constant after loading.
struct KnowledgeBase {
  std::vector<std::shared_ptr<const ObjectModel>> objects;
  // The first of that kind; null where there is none.
  const ObjectModel* Find(const std::string& kind) const;
  // The variant with just these features; null where there is none.
  const ObjectModel* Find(const std::string& kind, const std::vector<std::string>& features) const;
};

// The shipped objects named in `names` (a kind such as "box") and files (a path ending in .kb, relative to
// `folder`); everything shipped where `names` has none. A path that ends in .sizes is a catalogue that takes
// the place of the shipped one of that file name. Errors: FILE:LINE:COLUMN: what was expected.
Result<KnowledgeBase> LoadKnowledge(std::span<const std::string> names, const std::filesystem::path& folder);
// The variants of the object in `text`, at least one. Catalogues are looked for beside `file_name`, then
// among the shipped ones.
Result<std::vector<std::shared_ptr<const ObjectModel>>> ParseObjects(const std::string& text,
                                                                     const std::string& file_name);
// The first of them.
Result<std::shared_ptr<const ObjectModel>> ParseObject(const std::string& text, const std::string& file_name);

}  // namespace vss
