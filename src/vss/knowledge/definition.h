// An object as the program computes with it: names resolved, units checked, dimensions with ranges.
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vss/knowledge/object_model.h"
#include "vss/knowledge/program.h"
#include "vss/knowledge/size_table.h"
#include "vss/knowledge/syntax.h"

namespace vss {

// left <= right (or left == right), as places in the program.
struct Constraint {
  int left = -1, right = -1;
  bool equal = false;
  int power = 1;  // of the length that both sides are: 0 plain number, 1 length, 2 area, ...
  std::string reason;
  SourcePosition at;
};

struct Corner {
  std::string name;
  int u = -1, v = -1, round = -1;
  std::array<double, 2> rim_weight{1, 1};  // of the edge to the next corner, at the low and the high end
  std::array<double, 2> arc_weight{1, 1};  // of the rounding's rims
  double length_weight = 1;                // of the edge along the extrusion
  SourcePosition at;
};

// A closed contour of the cross section, material on its left.
struct ProfileLoop {
  bool is_outline = false, is_circle = false;
  std::string name;
  int u = -1, v = -1, radius = -1;
  std::array<double, 2> rim_weight{1, 1};
  std::vector<Corner> corners;
  SourcePosition at;
};

// The cross section's coordinates (u, v) and the axis w with u x v = w in `part`: extruded along x they are
// y, z, x; along y: x, z, -y; along z: x, y, z.
struct Extrusion {
  int axis = 0;
  int from = -1, to = -1;          // along the part's axis
  std::vector<ProfileLoop> loops;  // the outline first
  SourcePosition at;

  // Which end is low in w: for y, whose w is -y, the far one.
  int low() const { return axis == 1 ? to : from; }
  int high() const { return axis == 1 ? from : to; }
};

struct Usual {
  int value = -1;          // place in the program
  std::vector<int> needs;  // the dimensions that it is computed from
};

// A catalogue as an object uses it.
struct SizesUse {
  std::string file;
  SourcePosition at;
  std::vector<std::pair<std::string, int>> named;  // column, dimension: as the object says
  std::optional<Constraint> condition;
  std::shared_ptr<const SizeTable> table;  // null until it is read (define.h)
  std::vector<int> dimension_of_column;
};

struct Definition {
  std::string file, kind, title;
  SourcePosition at;
  std::vector<FeatureDef> features;
  std::string variant;  // "with snipe, without hole"; empty where there are no features
  std::vector<DimensionDef> dimensions;
  std::vector<std::vector<Usual>> usual;  // of each dimension; the first whose needs are known counts
  std::vector<SourcePosition> dimension_at;
  Program program;
  std::vector<Constraint> constraints;
  std::vector<SizesUse> sizes;
  Extrusion extrusion;
  std::vector<RestingPose> resting_poses;
  std::vector<bool> propped;
  std::vector<SourcePosition> rest_at;
  std::vector<std::string> stands_on;
  std::vector<ObjectRelation> relations;
};

}  // namespace vss
