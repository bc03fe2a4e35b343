// What a knowledge base file says, word for word: the tree that the parser makes and the compiler reads.
#pragma once
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vss/knowledge/diagnostic.h"

namespace vss {

enum class Op { kConstant, kName, kAdd, kSubtract, kMultiply, kDivide, kNegate, kMin, kMax, kAbs, kSqrt };

// Powers of the units: a length has length 1, a product of two lengths 2, a plain number 0.
// A zero without a unit is `any`: it may stand for a length too.
struct Unit {
  int length = 0;
  bool angle = false;
  bool any = false;
};

struct Expression {
  Op op = Op::kConstant;
  int a = -1, b = -1;  // operands: indices into Syntax::expressions
  double value = 0;    // kConstant: mm, rad or a plain number
  Unit unit;           // kConstant
  std::string name;    // kName
  SourcePosition at;
  int depth = 1;
};

struct Named {
  std::string name;
  SourcePosition at;
};

// An item stands in an object only where these features are there, or are not.
struct Presence {
  Named feature;
  bool present = true;
};
using When = std::vector<Presence>;

// A feature that an object has or has not; of those of one `either`, it has just one.
struct FeatureSyntax {
  Named name;
  std::string title;
  int choice = -1;  // the index of its `either`; -1: optional
};

struct DimensionSyntax {
  Named name;
  int min = -1, max = -1;
  std::vector<int> usual;  // the first of which all dimensions are known is taken
  std::string help;
  When when;
};

struct LetSyntax {
  Named name;
  int value = -1;
  When when;
};

enum class Relation { kLessEqual, kGreaterEqual, kEqual };

struct RequireSyntax {
  int left = -1, right = -1;
  Relation relation = Relation::kLessEqual;
  std::string reason;
  SourcePosition at;
  When when;
};

// A catalogue of standard sizes: which column is which dimension, and where it applies.
struct SizesSyntax {
  std::string file;
  SourcePosition at;
  std::vector<std::pair<Named, Named>> columns;  // column, dimension; others by their name
  std::optional<RequireSyntax> condition;
  When when;
};

struct CornerSyntax {
  Named name;
  int u = -1, v = -1;
  int round = -1;  // radius; -1: sharp
  When when;
};

struct LoopSyntax {
  bool is_outline = false;
  bool is_circle = false;
  Named name;                       // a circle's; empty where not given
  int u = -1, v = -1, radius = -1;  // a circle's
  std::vector<CornerSyntax> corners;
  SourcePosition at;
  When when;
};

enum class End { kBoth, kFrom, kTo };

// `a`: the edge along the extrusion at corner a, or the rims of circle a. `a-b`: the rim between two corners.
struct EdgeSyntax {
  Named first, second;  // second empty: not given
  End end = End::kBoth;
};

struct WeightSyntax {
  double weight = 1;
  std::vector<EdgeSyntax> edges;
  When when;
};

struct ExtrudeSyntax {
  int axis = 0;  // 0 x, 1 y, 2 z
  int from = -1, to = -1;
  std::vector<LoopSyntax> loops;
  std::vector<WeightSyntax> weights;
  SourcePosition at;
};

struct TurnSyntax {
  int axis = 0;
  int angle = -1;
};

struct RestSyntax {
  Named name;
  std::vector<TurnSyntax> turns;
  bool propped = false;  // held by something that is not in the knowledge base: need not stand by itself
  std::string help;
};

// force and kind as in ObjectRelation.
struct RelationSyntax {
  int force = 0, kind = 0;
  std::vector<Named> kinds, others;
  int within = -1;
  double weight = 2;
  std::string reason;
  SourcePosition at;
};

struct Syntax {
  std::string file;
  Named kind;
  std::string title;
  std::vector<Expression> expressions;
  std::vector<DimensionSyntax> dimensions;
  std::vector<LetSyntax> lets;
  std::vector<RequireSyntax> requires_;
  std::vector<SizesSyntax> sizes;
  std::vector<ExtrudeSyntax> extrusions;
  std::vector<RestSyntax> rests;
  std::vector<Named> stands_on;
  std::vector<RelationSyntax> relations;
  std::vector<FeatureSyntax> features;
  std::vector<Presence> mentions;  // every `with` of the cross section
  // Of one variant (expand.h): which features it has, and the names that the others would bring.
  std::vector<bool> present;
  std::map<std::string, std::string> absent_names;  // name, its feature
};

}  // namespace vss
