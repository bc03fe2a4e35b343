#include "vss/knowledge/parser.h"

#include <string_view>

#include "vss/knowledge/profile_parser.h"

namespace vss {
namespace {

// In the order of ObjectRelation::Kind.
constexpr std::string_view kPredicates[] = {"touching", "near", "parallel", "perpendicular", "between"};

class Parser : public ProfileParser {
 public:
  Parser(std::vector<Token> tokens, const std::string& file) : ProfileParser(std::move(tokens), file) {}

  Result<Syntax> Run() {
    VSS_RETURN_IF_ERROR(ParseObject());
    if (Here().kind != TokenKind::kEnd)
      return Fail("the end of the file", "a file holds one object; give the next one a file of its own");
    return std::move(out_);
  }

 private:
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
      return Fail(sizes.at, fmt::format("the file \"{}\" does not end in .sizes; {}", sizes.file, form));
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

  int num_choices_ = 0;
};

}  // namespace

Result<Syntax> ParseSyntax(const std::string& text, const std::string& file) {
  VSS_ASSIGN(auto tokens, Tokenize(text, file));
  return Parser(std::move(tokens), file).Run();
}

}  // namespace vss
