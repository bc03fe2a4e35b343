#include "vss/knowledge/compile.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "vss/knowledge/expand.h"

namespace vss {
namespace {

constexpr int kMaxCompileDepth = 1000;  // through definitions that use definitions

std::string NameOf(Unit unit) {
  if (unit.angle) return "an angle";
  if (unit.length == 0) return "a plain number";
  if (unit.length == 1) return "a length";
  if (unit.length == 2) return "an area";
  return fmt::format("a length to the power {}", unit.length);
}

bool Same(Unit a, Unit b) { return a.any || b.any || (a.length == b.length && a.angle == b.angle); }

// How far apart two names are: insertions, deletions and changes (Levenshtein).
std::size_t NameDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, change});
    }
  }
  return row[b.size()];
}

std::string DidYouMean(const std::string& name, const std::vector<std::string>& known) {
  const std::string* best = nullptr;
  std::size_t best_distance = std::min<std::size_t>(3, name.size());  // more than two slips are no slip
  for (const std::string& k : known)
    if (const std::size_t d = NameDistance(name, k); d < best_distance) best_distance = d, best = &k;
  if (best) return fmt::format("did you mean '{}'?", *best);
  std::string list;
  for (std::size_t i = 0; i < std::min<std::size_t>(known.size(), 12); ++i)
    list += (i ? ", " : "") + known[i];
  return known.empty() ? "declare it first" : "known are: " + list;
}

struct Value {
  int place = -1;
  Unit unit;
};

class Compiler {
 public:
  explicit Compiler(const Syntax& syntax) : in_(syntax) {}

  Result<Definition> Run() {
    out_.file = in_.file;
    out_.kind = in_.kind.name;
    out_.title = in_.title.empty() ? in_.kind.name : in_.title;
    out_.at = in_.kind.at;
    out_.variant = VariantName(in_);
    for (std::size_t f = 0; f < in_.features.size(); ++f)
      out_.features.push_back({in_.features[f].name.name, in_.features[f].title, in_.present[f]});
    VSS_RETURN_IF_ERROR(DeclareNames());
    VSS_RETURN_IF_ERROR(Dimensions());
    VSS_RETURN_IF_ERROR(Lets());
    VSS_RETURN_IF_ERROR(UsualValues());
    VSS_RETURN_IF_ERROR(Requires());
    VSS_RETURN_IF_ERROR(Extrude());
    VSS_RETURN_IF_ERROR(Rests());
    VSS_RETURN_IF_ERROR(Stands());
    VSS_RETURN_IF_ERROR(Sizes());
    VSS_RETURN_IF_ERROR(Relations());
    return std::move(out_);
  }

 private:
  tl::unexpected<Error> Fail(SourcePosition at, const std::string& sentence) const {
    return ErrorAt(in_.file, at, sentence);
  }

  // --- names ---

  Status Declare(const Named& name, std::map<std::string, SourcePosition>& names) const {
    const auto [place, fresh] = names.emplace(name.name, name.at);
    if (fresh) return {};
    return Fail(name.at, fmt::format("the name '{}' is already used in line {}; choose another", name.name,
                                     place->second.line));
  }

  Status DeclareNames() {
    for (std::size_t i = 0; i < in_.dimensions.size(); ++i) {
      VSS_RETURN_IF_ERROR(Declare(in_.dimensions[i].name, names_));
      dimension_index_[in_.dimensions[i].name.name] = static_cast<int>(i);
    }
    for (std::size_t i = 0; i < in_.lets.size(); ++i) {
      VSS_RETURN_IF_ERROR(Declare(in_.lets[i].name, names_));
      let_index_[in_.lets[i].name.name] = static_cast<int>(i);
    }
    let_values_.resize(in_.lets.size());
    let_state_.assign(in_.lets.size(), kUntouched);
    if (in_.dimensions.empty())
      return Fail(in_.kind.at,
                  fmt::format("object '{}' has no dimension; declare one: dimension length: 100 mm .. 12 m",
                              in_.kind.name));
    if (in_.dimensions.size() > kMaxDimensions)
      return Fail(in_.dimensions[kMaxDimensions].name.at,
                  fmt::format("an object has at most {} dimensions; split it in two", kMaxDimensions));
    return {};
  }

  std::vector<std::string> KnownNames() const {
    std::vector<std::string> list;
    for (const auto& [name, at] : names_) list.push_back(name);
    return list;
  }

  std::vector<std::string> DimensionNames() const {
    std::vector<std::string> list;
    for (const auto& [name, index] : dimension_index_) list.push_back(name);
    return list;
  }

  // --- expressions ---

  int Append(Op op, int a, int b, double value) {
    out_.program.push_back({op, a, b, value});
    return static_cast<int>(out_.program.size()) - 1;
  }

  Result<Value> CompileName(const Expression& e, int depth) {
    if (const auto d = dimension_index_.find(e.name); d != dimension_index_.end()) {
      if (constants_only_)
        return Fail(e.at, fmt::format("'{}' is a dimension, and a range must not depend on one; write a "
                                      "constant here and the relation with require",
                                      e.name));
      used_.insert(d->second);
      return Value{d->second, {1, false, false}};  // the program begins with the dimensions
    }
    const auto l = let_index_.find(e.name);
    if (const auto absent = in_.absent_names.find(e.name);
        l == let_index_.end() && absent != in_.absent_names.end())
      return Fail(
          e.at,
          fmt::format("'{}' belongs to the feature '{}', which is not there in every variant; use it in "
                      "that feature, or inside: with {} {{ ... }}",
                      e.name, absent->second, absent->second));
    if (l == let_index_.end())
      return Fail(e.at,
                  fmt::format("the name '{}' is not known; {}", e.name, DidYouMean(e.name, KnownNames())));
    VSS_ASSIGN(const Value value, CompileLet(l->second, e.at, depth));
    if (constants_only_ && !let_uses_[l->second].empty())
      return Fail(
          e.at,
          fmt::format(
              "'{}' depends on a dimension, and a constant is needed here; write a number with its unit",
              e.name));
    return value;
  }

  Result<Value> CompileLet(int index, SourcePosition at, int depth) {
    const LetSyntax& let = in_.lets[index];
    if (let_state_[index] == kDone) {
      used_.insert(let_uses_[index].begin(), let_uses_[index].end());
      return let_values_[index];
    }
    if (let_state_[index] == kOpen) {
      std::string chain;
      for (auto i = std::find(open_.begin(), open_.end(), index); i != open_.end(); ++i)
        chain += in_.lets[*i].name.name + " -> ";
      return Fail(at,
                  fmt::format("the definitions run in a circle: {}{}; define one of them without the others",
                              chain, let.name.name));
    }
    let_state_[index] = kOpen;
    open_.push_back(index);
    std::set<int> outer;
    std::swap(outer, used_);
    VSS_ASSIGN(let_values_[index], CompileExpression(let.value, depth + 1));
    let_uses_[index] = used_;
    used_.insert(outer.begin(), outer.end());
    open_.pop_back();
    let_state_[index] = kDone;
    return let_values_[index];
  }

  Result<Value> CompileExpression(int index, int depth = 0) {
    const Expression& e = in_.expressions[index];
    if (depth > kMaxCompileDepth)
      return Fail(e.at,
                  fmt::format("the definitions build on each other more than {} deep; join some of them",
                              kMaxCompileDepth));
    if (e.op == Op::kConstant) return Value{Append(e.op, -1, -1, e.value), e.unit};
    if (e.op == Op::kName) return CompileName(e, depth);
    VSS_ASSIGN(const Value a, CompileExpression(e.a, depth + 1));
    Value b;
    if (e.b >= 0) {
      VSS_ASSIGN(b, CompileExpression(e.b, depth + 1));
    }
    VSS_ASSIGN(const Unit unit, ResultUnit(e, a.unit, b.unit));
    return Value{Append(e.op, a.place, b.place, 0), unit};
  }

  Result<Unit> ResultUnit(const Expression& e, Unit a, Unit b) const {
    switch (e.op) {
      case Op::kAdd:
      case Op::kSubtract:
      case Op::kMin:
      case Op::kMax:
        if (!Same(a, b))
          return Fail(e.at,
                      fmt::format("{} and {} do not go together here; give the number its unit, such as 3 mm",
                                  NameOf(a), NameOf(b)));
        return a.any ? b : a;
      case Op::kMultiply:
        if (a.angle || b.angle)
          return Fail(e.at, "an angle cannot be multiplied; write the angle as one number with deg");
        return CheckedPower(e, {a.length + b.length, false, a.any || b.any});
      case Op::kDivide:
        if (a.angle || b.angle)
          return Fail(e.at, "an angle cannot be divided; write the angle as one number with deg");
        if (b.any) return Fail(e.at, "this divides by zero; divide by something else");
        return CheckedPower(e, {a.length - b.length, false, a.any});
      case Op::kSqrt:
        if (a.angle || a.length % 2 != 0)
          return Fail(e.at, fmt::format("sqrt needs an area or a plain number, not {}", NameOf(a)));
        return Unit{a.length / 2, false, a.any};
      default:
        return a;
    }
  }
  Result<Unit> CheckedPower(const Expression& e, Unit unit) const {
    if (std::abs(unit.length) > 8)
      return Fail(e.at, "a length to a power beyond 8 has no meaning here; simplify the expression");
    return unit;
  }

  Result<int> Length(int index, const std::string& what) {
    VSS_ASSIGN(const Value v, CompileExpression(index));
    if (!Same(v.unit, {1, false, false}))
      return Fail(in_.expressions[index].at,
                  fmt::format("{} must be a length, but this is {}; {}", what, NameOf(v.unit),
                              v.unit.length == 0 ? "write a unit, such as 100 mm" : "check the formula"));
    return v.place;
  }

  // The value of an expression without dimensions.
  Result<double> Constant(int index, Unit unit, const std::string& what) {
    constants_only_ = true;
    const auto v = CompileExpression(index);
    constants_only_ = false;
    if (!v) return tl::unexpected(v.error());
    if (!Same(v->unit, unit))
      return Fail(in_.expressions[index].at,
                  fmt::format("{} must be {}, but this is {}; write it with its unit, such as {}", what,
                              NameOf(unit), NameOf(v->unit), unit.angle ? "90 deg" : "100 mm"));
    const double value = Evaluate(out_.program, std::vector<double>(in_.dimensions.size(), 1.0))[v->place];
    if (!std::isfinite(value))
      return Fail(in_.expressions[index].at,
                  fmt::format("{} has no finite value; check for a division by zero", what));
    return value;
  }

  // --- items ---

  Status Dimensions() {
    for (std::size_t i = 0; i < in_.dimensions.size(); ++i) Append(Op::kName, static_cast<int>(i), -1, 0);
    for (const DimensionSyntax& d : in_.dimensions) {
      DimensionDef def;
      def.name = d.name.name;
      def.help = d.help;
      VSS_ASSIGN(def.min_mm, Constant(d.min, {1, false, false}, "the lower end of the range"));
      VSS_ASSIGN(def.max_mm, Constant(d.max, {1, false, false}, "the upper end of the range"));
      if (!(def.min_mm < def.max_mm))
        return Fail(d.name.at,
                    fmt::format("the range of '{}' is empty: {:g} mm .. {:g} mm; write the smaller end first",
                                def.name, def.min_mm, def.max_mm));
      out_.dimensions.push_back(std::move(def));
      out_.dimension_at.push_back(d.name.at);
    }
    return {};
  }

  Status Lets() {
    for (std::size_t i = 0; i < in_.lets.size(); ++i) {
      if (let_state_[i] == kDone) continue;
      if (auto v = CompileLet(static_cast<int>(i), in_.lets[i].name.at, 0); !v)
        return tl::unexpected(v.error());
    }
    return {};
  }

  Status UsualValues() {
    for (std::size_t i = 0; i < in_.dimensions.size(); ++i) {
      DimensionDef& def = out_.dimensions[i];
      std::vector<Usual> list;
      for (int expression : in_.dimensions[i].usual) {
        used_.clear();
        Usual usual;
        VSS_ASSIGN(usual.value, Length(expression, "the usual value"));
        usual.needs.assign(used_.begin(), used_.end());
        if (usual.needs.empty() && !def.usual_mm) {
          def.usual_mm = Evaluate(out_.program, std::vector<double>(in_.dimensions.size(), 1.0))[usual.value];
          if (!(*def.usual_mm >= def.min_mm && *def.usual_mm <= def.max_mm))
            return Fail(
                in_.expressions[expression].at,
                fmt::format(
                    "the usual {} of {:g} mm lies outside its range {:g} mm .. {:g} mm; change one of them",
                    def.name, *def.usual_mm, def.min_mm, def.max_mm));
        }
        list.push_back(std::move(usual));
      }
      out_.usual.push_back(std::move(list));
    }
    return {};
  }

  Status Requires() {
    for (const RequireSyntax& r : in_.requires_) {
      VSS_ASSIGN(Constraint constraint, Comparison(r));
      out_.constraints.push_back(std::move(constraint));
    }
    return {};
  }

  Result<Constraint> Comparison(const RequireSyntax& r) {
    used_.clear();
    VSS_ASSIGN(Value left, CompileExpression(r.left));
    VSS_ASSIGN(Value right, CompileExpression(r.right));
    if (!Same(left.unit, right.unit))
      return Fail(r.at, fmt::format("this compares {} with {}; give the number its unit, such as 3 mm",
                                    NameOf(left.unit), NameOf(right.unit)));
    if (used_.empty())
      return Fail(r.at, "this constraint has no dimension in it; name the dimension that it limits");
    if (r.relation == Relation::kGreaterEqual) std::swap(left, right);
    return Constraint{left.place,
                      right.place,
                      r.relation == Relation::kEqual,
                      left.unit.any ? right.unit.length : left.unit.length,
                      r.reason,
                      r.at};
  }

  Status Relations() {
    for (const RelationSyntax& r : in_.relations) {
      ObjectRelation relation;
      relation.force = static_cast<ObjectRelation::Force>(r.force);
      relation.kind = static_cast<ObjectRelation::Kind>(r.kind);
      for (const Named& kind : r.kinds) relation.kinds.push_back(kind.name);
      for (const Named& kind : r.others) relation.others.push_back(kind.name);
      if (r.within >= 0) {
        VSS_ASSIGN(relation.within_mm, Constant(r.within, {1, false, false}, "the distance"));
        if (!(relation.within_mm >= 0))
          return Fail(r.at, fmt::format("the distance is {:g} mm; write 0 mm or more", relation.within_mm));
      }
      relation.weight = r.weight;
      relation.reason = r.reason;
      out_.relations.push_back(std::move(relation));
    }
    return {};
  }

  Status Sizes() {
    for (const SizesSyntax& s : in_.sizes) {
      SizesUse use;
      use.file = s.file;
      use.at = s.at;
      for (const auto& [column, dimension] : s.columns) {
        const auto d = dimension_index_.find(dimension.name);
        if (d == dimension_index_.end())
          return Fail(dimension.at, fmt::format("'{}' is no dimension of this object; {}", dimension.name,
                                                DidYouMean(dimension.name, DimensionNames())));
        use.named.emplace_back(column.name, d->second);
      }
      if (s.condition) {
        VSS_ASSIGN(use.condition, Comparison(*s.condition));
      }
      out_.sizes.push_back(std::move(use));
    }
    return {};
  }

  Status Extrude() {
    if (in_.extrusions.empty())
      return Fail(
          in_.kind.at,
          fmt::format(
              "object '{}' has no solid; write: extrude x from -length/2 to length/2 {{ outline {{ ... }} }}",
              in_.kind.name));
    if (in_.extrusions.size() > 1)
      return Fail(
          in_.extrusions[1].at,
          "an object has one extrusion; write the second as an object of its own that stands on the first");
    const ExtrudeSyntax& e = in_.extrusions[0];
    Extrusion& out = out_.extrusion;
    out.axis = e.axis;
    out.at = e.at;
    VSS_ASSIGN(out.from, Length(e.from, "the beginning of the extrusion"));
    VSS_ASSIGN(out.to, Length(e.to, "the end of the extrusion"));
    std::map<std::string, SourcePosition> names;
    for (const LoopSyntax& loop : e.loops) VSS_RETURN_IF_ERROR(AddLoop(loop, names));
    const auto is_outline = [](const ProfileLoop& l) { return l.is_outline; };
    const auto first = std::find_if(out.loops.begin(), out.loops.end(), is_outline);
    if (first == out.loops.end())
      return Fail(e.at,
                  "this extrusion has no outline; write: outline { a (0, 0) b (width, 0) c (0, height) }");
    if (const auto second = std::find_if(first + 1, out.loops.end(), is_outline); second != out.loops.end())
      return Fail(second->at, "a cross section has one outline; what is cut out of it is a cutout");
    std::rotate(out.loops.begin(), first, first + 1);
    for (const WeightSyntax& w : e.weights)
      for (const EdgeSyntax& edge : w.edges) VSS_RETURN_IF_ERROR(SetWeight(edge, w.weight));
    return {};
  }

  Status AddLoop(const LoopSyntax& loop, std::map<std::string, SourcePosition>& names) {
    ProfileLoop out;
    out.is_outline = loop.is_outline;
    out.is_circle = loop.is_circle;
    out.at = loop.at;
    if (loop.is_circle) {
      out.name = loop.name.name;
      if (!out.name.empty()) VSS_RETURN_IF_ERROR(Declare(loop.name, names));
      VSS_ASSIGN(out.u, Length(loop.u, "a coordinate"));
      VSS_ASSIGN(out.v, Length(loop.v, "a coordinate"));
      VSS_ASSIGN(out.radius, Length(loop.radius, "a radius"));
    } else {
      if (loop.corners.size() < 3)
        return Fail(
            loop.at,
            fmt::format(
                "a loop needs 3 corners and more, this one has {}; or write: circle at (0, 0) radius r",
                loop.corners.size()));
      if (loop.corners.size() > kMaxCorners)
        return Fail(loop.corners[kMaxCorners].name.at,
                    fmt::format("a loop has at most {} corners; use round for arcs", kMaxCorners));
      for (const CornerSyntax& c : loop.corners) {
        VSS_RETURN_IF_ERROR(Declare(c.name, names));
        Corner corner;
        corner.name = c.name.name;
        corner.at = c.name.at;
        VSS_ASSIGN(corner.u, Length(c.u, "a coordinate"));
        VSS_ASSIGN(corner.v, Length(c.v, "a coordinate"));
        if (c.round >= 0) {
          VSS_ASSIGN(corner.round, Length(c.round, "a radius"));
        }
        out.corners.push_back(std::move(corner));
      }
    }
    out_.extrusion.loops.push_back(std::move(out));
    return {};
  }

  Status SetWeight(const EdgeSyntax& edge, double weight) {
    // Which of {low, high} end the words from and to mean.
    const int from_end = out_.extrusion.axis == 1 ? 1 : 0;
    const bool ends[2] = {edge.end == End::kBoth || (edge.end == End::kFrom) == (from_end == 0),
                          edge.end == End::kBoth || (edge.end == End::kFrom) == (from_end == 1)};
    const auto set = [&](std::array<double, 2>& target) {
      for (int i = 0; i < 2; ++i)
        if (ends[i]) target[i] = weight;
    };
    std::vector<std::string> known;
    for (ProfileLoop& loop : out_.extrusion.loops) {
      if (loop.is_circle) {
        if (!loop.name.empty()) known.push_back(loop.name);
        if (loop.name != edge.first.name) continue;
        if (!edge.second.name.empty())
          return Fail(
              edge.second.at,
              fmt::format("'{}' is a circle, which has no edge to a corner; name it alone", loop.name));
        set(loop.rim_weight);
        return {};
      }
      for (std::size_t i = 0; i < loop.corners.size(); ++i) {
        Corner& corner = loop.corners[i];
        known.push_back(corner.name);
        const std::string& next = loop.corners[(i + 1) % loop.corners.size()].name;
        if (edge.second.name.empty()) {
          if (corner.name != edge.first.name) continue;
          if (corner.round >= 0)
            set(corner.arc_weight);
          else if (edge.end == End::kBoth)
            corner.length_weight = weight;
          else
            return Fail(edge.first.at, fmt::format("the edge at corner '{}' runs from end to end; leave out "
                                                   "'at', or name a rim: a-b at from",
                                                   corner.name));
          return {};
        }
        const bool fits = (corner.name == edge.first.name && next == edge.second.name) ||
                          (corner.name == edge.second.name && next == edge.first.name);
        if (!fits) continue;
        set(corner.rim_weight);
        return {};
      }
    }
    for (const Named* name : {&edge.first, &edge.second})
      if (!name->name.empty() && std::find(known.begin(), known.end(), name->name) == known.end())
        return Fail(name->at, fmt::format("no corner or circle is called '{}'; {}", name->name,
                                          DidYouMean(name->name, known)));
    return Fail(edge.first.at,
                fmt::format("there is no edge from '{}' to '{}'; name two corners that follow each other",
                            edge.first.name, edge.second.name));
  }

  Status Rests() {
    std::map<std::string, SourcePosition> names;
    if (in_.rests.empty()) {
      out_.resting_poses.push_back({"base", Eigen::Matrix3d::Identity()});
      out_.propped.push_back(false);
      out_.rest_at.push_back(in_.kind.at);
    }
    for (const RestSyntax& r : in_.rests) {
      VSS_RETURN_IF_ERROR(Declare(r.name, names));
      RestingPose pose{r.name.name, Eigen::Matrix3d::Identity()};
      for (const TurnSyntax& t : r.turns) {
        VSS_ASSIGN(const double angle_rad, Constant(t.angle, {0, true, false}, "a turn"));
        pose.rested_from_part =
            Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::Unit(t.axis)).toRotationMatrix() *
            pose.rested_from_part;
      }
      // Quarter turns are exact: the sine of a rounded pi is no zero.
      pose.rested_from_part = pose.rested_from_part.unaryExpr(
          [](double c) { return std::abs(c - std::round(c)) < 1e-12 ? std::round(c) : c; });
      out_.resting_poses.push_back(std::move(pose));
      out_.propped.push_back(r.propped);
      out_.rest_at.push_back(r.name.at);
    }
    if (!out_.resting_poses[0].rested_from_part.isIdentity())
      return Fail(out_.rest_at[0],
                  "the first resting pose is the base and has no turn; write first: rests base");
    return {};
  }

  Status Stands() {
    std::map<std::string, SourcePosition> names;
    for (const Named& s : in_.stands_on) {
      VSS_RETURN_IF_ERROR(Declare(s, names));
      out_.stands_on.push_back(s.name);
    }
    if (out_.stands_on.empty()) out_.stands_on.push_back("ground");
    return {};
  }

  enum State { kUntouched, kOpen, kDone };
  static constexpr std::size_t kMaxCorners = 256;
  const Syntax& in_;
  Definition out_;
  std::map<std::string, SourcePosition> names_;
  std::map<std::string, int> dimension_index_, let_index_;
  std::vector<Value> let_values_;
  std::vector<State> let_state_;
  std::map<int, std::set<int>> let_uses_;
  std::vector<int> open_;
  std::set<int> used_;  // dimensions that the expression in work depends on
  bool constants_only_ = false;
};

}  // namespace

Result<Definition> Compile(const Syntax& syntax) { return Compiler(syntax).Run(); }

}  // namespace vss
