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
    return Fail("dimension, let, require, extrude, rests, stands or '}'",
                "each item of an object begins with one of these words");
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
    out_.dimensions.push_back(std::move(d));
    return {};
  }

  Status ParseLet() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.lets, "definitions"));
    LetSyntax l;
    VSS_ASSIGN(l.name, ParseName("the name that is defined"));
    VSS_RETURN_IF_ERROR(Expect("=", "a definition reads: let NAME = EXPRESSION"));
    VSS_ASSIGN(l.value, ParseSum());
    out_.lets.push_back(std::move(l));
    return {};
  }

  Status ParseRequire() {
    VSS_RETURN_IF_ERROR(CheckCount(out_.requires_, "constraints"));
    RequireSyntax r;
    r.at = Take().at;
    VSS_ASSIGN(r.left, ParseSum());
    if (Accept("<=") || Accept("<"))
      r.relation = Relation::kLessEqual;
    else if (Accept(">=") || Accept(">"))
      r.relation = Relation::kGreaterEqual;
    else if (Accept("=="))
      r.relation = Relation::kEqual;
    else
      return Fail("<=, >= or ==", "a constraint compares two expressions: require width <= length");
    VSS_ASSIGN(r.right, ParseSum());
    r.reason = ParseText();
    out_.requires_.push_back(std::move(r));
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
    if (Is("weight")) {
      Take();
      if (Here().kind != TokenKind::kNumber || Here().number > kMaxWeight)
        return Fail(fmt::format("a number from 0 to {}", kMaxWeight),
                    "a weight reads: weight 0.5 a, b-c at to");
      return ParseWeights(e, Take().number);
    }
    return Fail("outline, cutout, weak, strong, weight or '}'", "a cross section is made of these");
  }

  Status ParseLoop(ExtrudeSyntax& e) {
    LoopSyntax loop;
    loop.at = Here().at;
    loop.is_outline = Take().text == "outline";
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
    CornerSyntax corner;
    VSS_ASSIGN(corner.name, ParseName("a corner's name or '}'"));
    VSS_RETURN_IF_ERROR(ParsePoint(corner.u, corner.v));
    if (Accept("round")) {
      VSS_ASSIGN(corner.round, ParseSum());
    }
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
