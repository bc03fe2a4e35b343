// What a knowledge base file says, word for word: the tree that the parser makes and the compiler reads.
#pragma once
#include <optional>
#include <string>
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

struct DimensionSyntax {
  Named name;
  int min = -1, max = -1;
  std::vector<int> usual;  // the first of which all dimensions are known is taken
  std::string help;
};

struct LetSyntax {
  Named name;
  int value = -1;
};

enum class Relation { kLessEqual, kGreaterEqual, kEqual };

struct RequireSyntax {
  int left = -1, right = -1;
  Relation relation = Relation::kLessEqual;
  std::string reason;
  SourcePosition at;
};

struct CornerSyntax {
  Named name;
  int u = -1, v = -1;
  int round = -1;  // radius; -1: sharp
};

struct LoopSyntax {
  bool is_outline = false;
  bool is_circle = false;
  Named name;                       // a circle's; empty where not given
  int u = -1, v = -1, radius = -1;  // a circle's
  std::vector<CornerSyntax> corners;
  SourcePosition at;
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

struct Syntax {
  std::string file;
  Named kind;
  std::string title;
  std::vector<Expression> expressions;
  std::vector<DimensionSyntax> dimensions;
  std::vector<LetSyntax> lets;
  std::vector<RequireSyntax> requires_;
  std::vector<ExtrudeSyntax> extrusions;
  std::vector<RestSyntax> rests;
  std::vector<Named> stands_on;
};

}  // namespace vss
