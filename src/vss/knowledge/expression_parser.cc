#include "vss/knowledge/expression_parser.h"

#include <algorithm>
#include <numbers>

namespace vss {
namespace {

constexpr int kMaxDepth = 100;  // of an expression: deeper is a mistake or an attack
constexpr std::size_t kMaxExpressions = 20000;

constexpr std::string_view kWords[] = {
    "object",  "dimension", "usual",   "or",     "let",    "require", "extrude", "from",   "to",
    "outline", "cutout",    "circle",  "at",     "radius", "round",   "weak",    "strong", "weight",
    "rests",   "turn",      "propped", "stands", "on",     "min",     "max",     "abs",    "sqrt",
    "x",       "y",         "z",       "mm",     "cm",     "m",       "deg",     "ground"};

}  // namespace

bool IsWord(const std::string& name) {
  return std::find(std::begin(kWords), std::end(kWords), name) != std::end(kWords);
}

Result<Named> ExpressionParser::ParseName(const std::string& what) {
  if (Here().kind != TokenKind::kName) return Fail(what);
  if (IsWord(Here().text))
    return Fail(what, fmt::format("'{}' is a word of the language and can be no name", Here().text));
  const Token token = Take();
  return Named{token.text, token.at};
}

Result<int> ExpressionParser::Add(Expression e) {
  if (out_.expressions.size() >= kMaxExpressions)
    return Fail(e.at,
                fmt::format("more than {} terms in one file; split the object in two", kMaxExpressions));
  for (int child : {e.a, e.b})
    if (child >= 0) e.depth = std::max(e.depth, out_.expressions[child].depth + 1);
  if (e.depth > kMaxDepth) return TooDeep(e.at);
  out_.expressions.push_back(std::move(e));
  return static_cast<int>(out_.expressions.size()) - 1;
}

tl::unexpected<Error> ExpressionParser::TooDeep(SourcePosition at) const {
  return Fail(at,
              fmt::format("this expression is nested more than {} deep; name its parts with let", kMaxDepth));
}

Result<int> ExpressionParser::Binary(Op op, int a, int b, SourcePosition at) {
  Expression e;
  e.op = op;
  e.a = a;
  e.b = b;
  e.at = at;
  return Add(std::move(e));
}

Result<int> ExpressionParser::ParseSum() {
  VSS_ASSIGN(int left, ParseProduct());
  while (Is("+") || Is("-")) {
    const Token sign = Take();
    VSS_ASSIGN(const int right, ParseProduct());
    VSS_ASSIGN(left, Binary(sign.text == "+" ? Op::kAdd : Op::kSubtract, left, right, sign.at));
  }
  return left;
}

Result<int> ExpressionParser::ParseProduct() {
  VSS_ASSIGN(int left, ParseFactor());
  while (Is("*") || Is("/")) {
    const Token sign = Take();
    VSS_ASSIGN(const int right, ParseFactor());
    VSS_ASSIGN(left, Binary(sign.text == "*" ? Op::kMultiply : Op::kDivide, left, right, sign.at));
  }
  return left;
}

Result<int> ExpressionParser::ParseFactor() {
  if (++nesting_ > kMaxDepth) return TooDeep(Here().at);
  auto factor = ParseFactorInner();
  --nesting_;
  return factor;
}

Result<int> ExpressionParser::ParseFactorInner() {
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
Result<int> ExpressionParser::ParseFunction(const std::string& word, Op op, SourcePosition at) {
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

Result<int> ExpressionParser::ParseNumber() {
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

}  // namespace vss
