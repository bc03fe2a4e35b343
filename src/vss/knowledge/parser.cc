#include "vss/knowledge/parser.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <string_view>

#include "vss/knowledge/lexer.h"

namespace vss {
namespace {

constexpr int kMaxDepth = 100;  // of an expression: deeper is a mistake or an attack
constexpr std::size_t kMaxExpressions = 20000;
constexpr std::size_t kMaxWith = 16;     // features in features
constexpr std::size_t kMaxItems = 1000;  // of one sort in an object

constexpr std::string_view kWords[] = {
    "object",  "dimension", "usual",   "or",     "let",    "require", "extrude", "from",   "to",
    "outline", "cutout",    "circle",  "at",     "radius", "round",   "weak",    "strong", "weight",
    "rests",   "turn",      "propped", "stands", "on",     "min",     "max",     "abs",    "sqrt",
    "x",       "y",         "z",       "mm",     "cm",     "m",       "deg",     "ground"};

class Parser {
 public:
  Parser(std::vector<Token> tokens, const std::string& file) : tokens_(std::move(tokens)) {
    out_.file = file;
  }

  Result<Syntax> Run() {
    VSS_RETURN_IF_ERROR(ParseObject());
    if (Here().kind != TokenKind::kEnd)
      return Fail("the end of the file", "a file holds one object; give the next one a file of its own");
    return std::move(out_);
  }

 private:
  const Token& Here() const { return tokens_[i_]; }
  const Token& Next() const { return tokens_[std::min(i_ + 1, tokens_.size() - 1)]; }
  Token Take() { return i_ + 1 < tokens_.size() ? tokens_[i_++] : tokens_[i_]; }
  bool Is(std::string_view text) const {
    return (Here().kind == TokenKind::kName || Here().kind == TokenKind::kSymbol) && Here().text == text;
  }
  bool Accept(std::string_view text) {
    if (!Is(text)) return false;
    Take();
    return true;
  }

  tl::unexpected<Error> Fail(const std::string& expected, const std::string& remedy = "") const {
    return ErrorAt(out_.file, Here().at,
                   fmt::format("expected {}, found {}{}{}", expected, Describe(Here()),
                               remedy.empty() ? "" : "; ", remedy));
  }
  Status Expect(std::string_view text, const std::string& remedy = "") {
    if (!Accept(text)) return Fail(fmt::format("'{}'", text), remedy);
    return {};
  }

  Result<Named> ParseName(const std::string& what) {
    if (Here().kind != TokenKind::kName) return Fail(what);
    if (IsWord(Here().text))
      return Fail(what, fmt::format("'{}' is a word of the language and can be no name", Here().text));
    const Token token = Take();
    return Named{token.text, token.at};
  }
  // A text, or nothing.
  std::string ParseText() { return Here().kind == TokenKind::kText ? Take().text : std::string(); }

  template <class T>
  Status CheckCount(const std::vector<T>& list, const char* what) const {
    if (list.size() < kMaxItems) return {};
    return ErrorAt(out_.file, Here().at,
                   fmt::format("more than {} {}; split the object in two", kMaxItems, what));
  }

  Status ParseObject() {
    VSS_RETURN_IF_ERROR(Expect("object", "a file begins with: object NAME \"what it is\" { ... }"));
    VSS_ASSIGN(out_.kind, ParseName("the object's name"));
    out_.title = ParseText();
    VSS_RETURN_IF_ERROR(Expect("{", "the object's items stand between { and }"));
    while (!Accept("}")) VSS_RETURN_IF_ERROR(ParseItem());
    return {};
  }

  Status ParseItem() {
    if (Accept("dimension")) return ParseDimension();
    if (Accept("let")) return ParseLet();
    if (Is("require")) return ParseRequire();
    if (Is("extrude")) return ParseExtrude();
    if (Accept("rests")) return ParseRest();
    if (Accept("stands")) return ParseStands();
    if (Is("sizes")) return ParseSizes();
    if (Accept("optional")) return ParseFeature(-1);
    for (const auto& [word, force] : {std::pair{"expects", 0}, {"prefers", 1}, {"avoids", 2}})
      if (Is(word)) return ParseRelation(force);
    if (Accept("either")) return ParseEither();
    return Fail(
        "dimension, let, require, extrude, rests, stands, sizes, optional, either, expects, prefers, avoids "
        "or '}'",
        "each item of an object begins with one of these words");
  }

  Status ParseEither() {
    const std::string form = "a choice reads: either straight { ... } or tapered { dimension slope: ... }";
    const int choice = num_choices_++;
    VSS_RETURN_IF_ERROR(ParseFeature(choice));
    if (!Is("or")) return Fail("'or'", form);
    while (Accept("or")) VSS_RETURN_IF_ERROR(ParseFeature(choice));
    return {};
  }

  // What belongs to a feature: its dimensions, definitions, constraints and catalogues.
  Status ParseFeature(int choice) {
    VSS_RETURN_IF_ERROR(CheckCount(out_.features, "features"));
    FeatureSyntax feature;
    VSS_ASSIGN(feature.name, ParseName("the feature's name"));
    feature.title = ParseText();
    feature.choice = choice;
    VSS_RETURN_IF_ERROR(
        Expect("{", "a feature reads: optional hole \"a round hole\" { dimension hole_diameter: ... }"));
    when_.push_back({feature.name, true});
    while (!Accept("}")) VSS_RETURN_IF_ERROR(ParseFeatureItem());
    when_.pop_back();
    out_.features.push_back(std::move(feature));
    return {};
  }

  Status ParseFeatureItem() {
    if (Accept("dimension")) return ParseDimension();
    if (Accept("let")) return ParseLet();
    if (Is("require")) return ParseRequire();
    if (Is("sizes")) return ParseSizes();
    return Fail(
        "dimension, let, require, sizes or '}'",
        "a feature holds these; its corners and cutouts stand in the cross section: with NAME { ... }");
  }

  // with NAME { items } [ else { items } ], `item` reading one of them.
  template <class Item>
  Status ParseWith(const Item& item) {
    const std::string form = "what a feature brings reads: with hole { ... } else { ... }";
    if (when_.size() >= kMaxWith)
      return Fail("no further with", fmt::format("{} in each other are the most", kMaxWith));
    VSS_RETURN_IF_ERROR(CheckCount(out_.mentions, "features' places"));
    Presence presence;
    VSS_ASSIGN(presence.feature, ParseName("a feature's name"));
    out_.mentions.push_back(presence);
    VSS_RETURN_IF_ERROR(Expect("{", form));
    when_.push_back(presence);
    while (!Accept("}")) VSS_RETURN_IF_ERROR(item());
    if (Is("else") && Next().text == "{") {
      Take();
      Take();
      when_.back().present = false;
      while (!Accept("}")) VSS_RETURN_IF_ERROR(item());
    }
    when_.pop_back();
    return {};
  }

  Status ParseDimension() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.dimensions, "dimensions"));
    DimensionSyntax d;
    VSS_ASSIGN(d.name, ParseName("the dimension's name"));
    VSS_RETURN_IF_ERROR(Expect(":", "a dimension reads: dimension NAME: 10 mm .. 2 m"));
    VSS_ASSIGN(d.min, ParseSum());
    VSS_RETURN_IF_ERROR(Expect("..", "a range reads: 10 mm .. 2 m"));
    VSS_ASSIGN(d.max, ParseSum());
    if (Accept("usual")) {
      do {
        VSS_RETURN_IF_ERROR(CheckCount(d.usual, "usual values"));
        VSS_ASSIGN(const int usual, ParseSum());
        d.usual.push_back(usual);
      } while (Accept("or"));
    }
    d.help = ParseText();
    d.when = when_;
    out_.dimensions.push_back(std::move(d));
    return {};
  }

  Status ParseLet() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.lets, "definitions"));
    LetSyntax l;
    VSS_ASSIGN(l.name, ParseName("the name that is defined"));
    VSS_RETURN_IF_ERROR(Expect("=", "a definition reads: let NAME = EXPRESSION"));
    VSS_ASSIGN(l.value, ParseSum());
    l.when = when_;
    out_.lets.push_back(std::move(l));
    return {};
  }

  Status ParseRequire() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.requires_, "constraints"));
    const SourcePosition at = Take().at;
    VSS_ASSIGN(RequireSyntax r,
               ParseComparison("a constraint compares two expressions: require width <= length"));
    r.at = at;
    r.reason = ParseText();
    r.when = when_;
    out_.requires_.push_back(std::move(r));
    return {};
  }

  Result<RequireSyntax> ParseComparison(const std::string& form) {
    RequireSyntax r;
    r.at = Here().at;
    VSS_ASSIGN(r.left, ParseSum());
    if (Accept("<=") || Accept("<"))
      r.relation = Relation::kLessEqual;
    else if (Accept(">=") || Accept(">"))
      r.relation = Relation::kGreaterEqual;
    else if (Accept("=="))
      r.relation = Relation::kEqual;
    else
      return Fail("<=, >= or ==", form);
    VSS_ASSIGN(r.right, ParseSum());
    return r;
  }

  Status ParseSizes() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.sizes, "catalogues"));
    const std::string form =
        "a catalogue reads: sizes \"plates.sizes\" with thickness = height if height <= width/5";
    SizesSyntax sizes;
    sizes.at = Take().at;
    if (Here().kind != TokenKind::kText) return Fail("the catalogue's file in quotes", form);
    sizes.file = Take().text;
    if (!sizes.file.ends_with(".sizes"))
      return ErrorAt(out_.file, sizes.at,
                     fmt::format("the file \"{}\" does not end in .sizes; {}", sizes.file, form));
    if (Accept("with")) {
      do {
        VSS_RETURN_IF_ERROR(CheckCount(sizes.columns, "columns"));
        Named column, dimension;
        VSS_ASSIGN(column, ParseName("a column of the catalogue"));
        VSS_RETURN_IF_ERROR(Expect("=", form));
        VSS_ASSIGN(dimension, ParseName("a dimension"));
        sizes.columns.emplace_back(std::move(column), std::move(dimension));
      } while (Accept(","));
    }
    if (Accept("if")) {
      VSS_ASSIGN(sizes.condition, ParseComparison(form));
    }
    sizes.when = when_;
    out_.sizes.push_back(std::move(sizes));
    return {};
  }

  Result<int> ParseAxis(const std::string& remedy) {
    for (int axis = 0; axis < 3; ++axis)
      if (Accept(std::string_view("xyz").substr(axis, 1))) return axis;
    return Fail("x, y or z", remedy);
  }

  Status ParseExtrude() {
    ExtrudeSyntax e;
    e.at = Take().at;
    const std::string form = "an extrusion reads: extrude x from -length/2 to length/2 { outline { ... } }";
    VSS_ASSIGN(e.axis, ParseAxis(form));
    VSS_RETURN_IF_ERROR(Expect("from", form));
    VSS_ASSIGN(e.from, ParseSum());
    VSS_RETURN_IF_ERROR(Expect("to", form));
    VSS_ASSIGN(e.to, ParseSum());
    VSS_RETURN_IF_ERROR(Expect("{", form));
    while (!Accept("}")) VSS_RETURN_IF_ERROR(ParseProfileItem(e));
    out_.extrusions.push_back(std::move(e));
    return {};
  }

  Status ParseProfileItem(ExtrudeSyntax& e) {
    VSS_RETURN_IF_ERROR(CheckCount(e.loops, "loops"));
    VSS_RETURN_IF_ERROR(CheckCount(e.weights, "weights"));
    if (Is("outline") || Is("cutout")) return ParseLoop(e);
    if (Accept("weak")) return ParseWeights(e, kWeak);
    if (Accept("strong")) return ParseWeights(e, kStrong);
    if (Accept("with")) return ParseWith([&] { return ParseProfileItem(e); });
    if (Is("weight")) {
      Take();
      if (Here().kind != TokenKind::kNumber || Here().number > kMaxWeight)
        return Fail(fmt::format("a number from 0 to {}", kMaxWeight),
                    "a weight reads: weight 0.5 a, b-c at to");
      return ParseWeights(e, Take().number);
    }
    return Fail("outline, cutout, weak, strong, weight, with or '}'", "a cross section is made of these");
  }

  Status ParseLoop(ExtrudeSyntax& e) {
    LoopSyntax loop;
    loop.at = Here().at;
    loop.is_outline = Take().text == "outline";
    loop.when = when_;
    if (Accept("circle")) {
      loop.is_circle = true;
      VSS_RETURN_IF_ERROR(ParseCircle(loop));
    } else {
      VSS_RETURN_IF_ERROR(Expect("{",
                                 "a loop reads: outline { a (0, 0) b (width, 0) c (0, height) }, or: outline "
                                 "circle at (0, 0) radius r"));
      while (!Accept("}")) VSS_RETURN_IF_ERROR(ParseCorner(loop));
    }
    e.loops.push_back(std::move(loop));
    return {};
  }

  Status ParseCircle(LoopSyntax& loop) {
    const std::string form = "a circle reads: circle bore at (0, 0) radius diameter/2";
    if (!Is("at")) {
      VSS_ASSIGN(loop.name, ParseName("the circle's name or 'at'"));
    }
    VSS_RETURN_IF_ERROR(Expect("at", form));
    VSS_RETURN_IF_ERROR(ParsePoint(loop.u, loop.v));
    VSS_RETURN_IF_ERROR(Expect("radius", form));
    VSS_ASSIGN(loop.radius, ParseSum());
    return {};
  }

  Status ParseCorner(LoopSyntax& loop) {
    VSS_RETURN_IF_ERROR(CheckCount(loop.corners, "corners"));
    if (Is("with") && Next().kind == TokenKind::kName) {
      Take();
      return ParseWith([&] { return ParseCorner(loop); });
    }
    CornerSyntax corner;
    VSS_ASSIGN(corner.name, ParseName("a corner's name or '}'"));
    VSS_RETURN_IF_ERROR(ParsePoint(corner.u, corner.v));
    if (Accept("round")) {
      VSS_ASSIGN(corner.round, ParseSum());
    }
    corner.when = when_;
    loop.corners.push_back(std::move(corner));
    return {};
  }

  Status ParsePoint(int& u, int& v) {
    const std::string form = "a point reads: (width/2, height)";
    VSS_RETURN_IF_ERROR(Expect("(", form));
    VSS_ASSIGN(u, ParseSum());
    VSS_RETURN_IF_ERROR(Expect(",", form));
    VSS_ASSIGN(v, ParseSum());
    return Expect(")", form);
  }

  Status ParseWeights(ExtrudeSyntax& e, double weight) {
    WeightSyntax w;
    w.weight = weight;
    w.when = when_;
    do {
      VSS_RETURN_IF_ERROR(CheckCount(w.edges, "edges"));
      EdgeSyntax edge;
      VSS_ASSIGN(edge.first, ParseName("a corner or circle"));
      if (Accept("-")) {
        VSS_ASSIGN(edge.second, ParseName("the corner at the edge's other end"));
      }
      if (Accept("at")) {
        if (Accept("from"))
          edge.end = End::kFrom;
        else if (Accept("to"))
          edge.end = End::kTo;
        else
          return Fail("from or to", "these are the two ends of the extrusion: a-b at from");
      }
      w.edges.push_back(std::move(edge));
    } while (Accept(","));
    e.weights.push_back(std::move(w));
    return {};
  }

  Status ParseRest() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.rests, "resting poses"));
    RestSyntax rest;
    VSS_ASSIGN(rest.name, ParseName("the resting pose's name"));
    while (Accept("turn")) {
      VSS_RETURN_IF_ERROR(CheckCount(rest.turns, "turns"));
      TurnSyntax turn;
      VSS_ASSIGN(turn.axis, ParseAxis("a turn reads: turn x 90 deg"));
      VSS_ASSIGN(turn.angle, ParseSum());
      rest.turns.push_back(turn);
    }
    rest.propped = Accept("propped");
    rest.help = ParseText();
    out_.rests.push_back(std::move(rest));
    return {};
  }

  Status ParseStands() {
    VSS_RETURN_IF_ERROR(Expect("on", "supports read: stands on ground, box"));
    do {
      VSS_RETURN_IF_ERROR(CheckCount(out_.stands_on, "supports"));
      if (Is("ground")) {
        out_.stands_on.push_back({"ground", Here().at});
        Take();
        continue;
      }
      VSS_ASSIGN(Named support, ParseName("ground or the name of an object"));
      out_.stands_on.push_back(std::move(support));
    } while (Accept(","));
    return {};
  }

  // In the order of ObjectRelation::Kind.
  static constexpr std::string_view kPredicates[] = {"touching", "near", "parallel", "perpendicular",
                                                     "between"};

  Status ParseRelation(int force) {
    VSS_RETURN_IF_ERROR(CheckCount(out_.relations, "relations"));
    const std::string form =
        "a relation reads: prefers touching tee or box weight 2, or near, parallel to, perpendicular to, "
        "between ... and";
    RelationSyntax r;
    r.force = force;
    r.at = Take().at;
    r.kind = -1;
    for (int k = 0; k < 5 && r.kind < 0; ++k)
      if (Accept(kPredicates[k])) r.kind = k;
    if (r.kind < 0) return Fail("touching, near, parallel, perpendicular or between", form);
    if (kPredicates[r.kind].starts_with("p")) VSS_RETURN_IF_ERROR(Expect("to", form));
    VSS_RETURN_IF_ERROR(ParseKinds(r.kinds));
    if (kPredicates[r.kind] == "between") {
      VSS_RETURN_IF_ERROR(Expect("and", form));
      VSS_RETURN_IF_ERROR(ParseKinds(r.others));
    }
    if (Accept("within")) {
      VSS_ASSIGN(r.within, ParseSum());
    } else if (kPredicates[r.kind] == "near") {
      return Fail("within", "say how near: near box within 200 mm");
    }
    if (Accept("weight")) {
      if (Here().kind != TokenKind::kNumber || Here().number > kMaxWeight)
        return Fail(fmt::format("a number from 0 to {}", kMaxWeight), form);
      r.weight = Take().number;
    }
    r.reason = ParseText();
    out_.relations.push_back(std::move(r));
    return {};
  }

  Status ParseKinds(std::vector<Named>& kinds) {
    do {
      VSS_RETURN_IF_ERROR(CheckCount(kinds, "objects"));
      VSS_ASSIGN(Named kind, ParseName("the name of an object"));
      kinds.push_back(std::move(kind));
    } while (Accept("or"));
    return {};
  }

  // --- expressions ---

  Result<int> Add(Expression e) {
    if (out_.expressions.size() >= kMaxExpressions)
      return ErrorAt(out_.file, e.at,
                     fmt::format("more than {} terms in one file; split the object in two", kMaxExpressions));
    for (int child : {e.a, e.b})
      if (child >= 0) e.depth = std::max(e.depth, out_.expressions[child].depth + 1);
    if (e.depth > kMaxDepth) return TooDeep(e.at);
    out_.expressions.push_back(std::move(e));
    return static_cast<int>(out_.expressions.size()) - 1;
  }
  tl::unexpected<Error> TooDeep(SourcePosition at) const {
    return ErrorAt(
        out_.file, at,
        fmt::format("this expression is nested more than {} deep; name its parts with let", kMaxDepth));
  }
  Result<int> Binary(Op op, int a, int b, SourcePosition at) {
    Expression e;
    e.op = op;
    e.a = a;
    e.b = b;
    e.at = at;
    return Add(std::move(e));
  }

  Result<int> ParseSum() {
    VSS_ASSIGN(int left, ParseProduct());
    while (Is("+") || Is("-")) {
      const Token sign = Take();
      VSS_ASSIGN(const int right, ParseProduct());
      VSS_ASSIGN(left, Binary(sign.text == "+" ? Op::kAdd : Op::kSubtract, left, right, sign.at));
    }
    return left;
  }

  Result<int> ParseProduct() {
    VSS_ASSIGN(int left, ParseFactor());
    while (Is("*") || Is("/")) {
      const Token sign = Take();
      VSS_ASSIGN(const int right, ParseFactor());
      VSS_ASSIGN(left, Binary(sign.text == "*" ? Op::kMultiply : Op::kDivide, left, right, sign.at));
    }
    return left;
  }

  Result<int> ParseFactor() {
    if (++nesting_ > kMaxDepth) return TooDeep(Here().at);
    auto factor = ParseFactorInner();
    --nesting_;
    return factor;
  }

  Result<int> ParseFactorInner() {
    const SourcePosition at = Here().at;
    if (Accept("-")) {
      VSS_ASSIGN(const int a, ParseFactor());
      return Binary(Op::kNegate, a, -1, at);
    }
    if (Accept("(")) {
      VSS_ASSIGN(const int inner, ParseSum());
      VSS_RETURN_IF_ERROR(Expect(")", "close the parenthesis, or put an operator + - * / between the terms"));
      return inner;
    }
    for (const auto& [word, op] :
         {std::pair{"min", Op::kMin}, {"max", Op::kMax}, {"abs", Op::kAbs}, {"sqrt", Op::kSqrt}})
      if (Accept(word)) return ParseFunction(word, op, at);
    if (Here().kind == TokenKind::kNumber) return ParseNumber();
    VSS_ASSIGN(const Named name, ParseName("a number, a name, '(' or '-'"));
    Expression e;
    e.op = Op::kName;
    e.name = name.name;
    e.at = name.at;
    return Add(std::move(e));
  }

  // min and max take two arguments and more, abs and sqrt one.
  Result<int> ParseFunction(const std::string& word, Op op, SourcePosition at) {
    const bool many = op == Op::kMin || op == Op::kMax;
    const std::string form = fmt::format("it reads: {}", word + (many ? "(a, b)" : "(a)"));
    VSS_RETURN_IF_ERROR(Expect("(", form));
    VSS_ASSIGN(int value, ParseSum());
    if (!many) {
      VSS_ASSIGN(value, Binary(op, value, -1, at));
    } else {
      VSS_RETURN_IF_ERROR(Expect(",", form));
      do {
        VSS_ASSIGN(const int next, ParseSum());
        VSS_ASSIGN(value, Binary(op, value, next, at));
      } while (Accept(","));
    }
    VSS_RETURN_IF_ERROR(Expect(")", form));
    return value;
  }

  Result<int> ParseNumber() {
    const Token number = Take();
    Expression e;
    e.at = number.at;
    e.value = number.number;
    if (Accept("mm"))
      e.unit.length = 1;
    else if (Accept("cm"))
      e.unit.length = 1, e.value *= 10;
    else if (Accept("m"))
      e.unit.length = 1, e.value *= 1000;
    else if (Accept("deg"))
      e.unit.angle = true, e.value *= std::numbers::pi / 180;
    else if (e.value == 0)
      e.unit.any = true;
    return Add(std::move(e));
  }

  static constexpr double kWeak = 0.5, kStrong = 2, kMaxWeight = 10;
  std::vector<Token> tokens_;
  std::size_t i_ = 0;
  int nesting_ = 0;
  int num_choices_ = 0;
  When when_;  // where the item that is read stands
  Syntax out_;
};

}  // namespace

bool IsWord(const std::string& name) {
  return std::find(std::begin(kWords), std::end(kWords), name) != std::end(kWords);
}

Result<Syntax> ParseSyntax(const std::string& text, const std::string& file) {
  VSS_ASSIGN(auto tokens, Tokenize(text, file));
  return Parser(std::move(tokens), file).Run();
}

}  // namespace vss
