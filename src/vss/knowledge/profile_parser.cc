#include "vss/knowledge/profile_parser.h"

#include <string_view>

namespace vss {
namespace {

constexpr std::size_t kMaxWith = 16;  // features in features
constexpr double kWeak = 0.5, kStrong = 2;

}  // namespace

// with NAME { items } [ else { items } ], `item` reading one of them.
template <class Item>
Status ProfileParser::ParseWith(const Item& item) {
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

Result<int> ProfileParser::ParseAxis(const std::string& remedy) {
  for (int axis = 0; axis < 3; ++axis)
    if (Accept(std::string_view("xyz").substr(axis, 1))) return axis;
  return Fail("x, y or z", remedy);
}

Status ProfileParser::ParseExtrude() {
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

Status ProfileParser::ParseProfileItem(ExtrudeSyntax& e) {
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

Status ProfileParser::ParseLoop(ExtrudeSyntax& e) {
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

Status ProfileParser::ParseCircle(LoopSyntax& loop) {
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

Status ProfileParser::ParseCorner(LoopSyntax& loop) {
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

Status ProfileParser::ParsePoint(int& u, int& v) {
  const std::string form = "a point reads: (width/2, height)";
  VSS_RETURN_IF_ERROR(Expect("(", form));
  VSS_ASSIGN(u, ParseSum());
  VSS_RETURN_IF_ERROR(Expect(",", form));
  VSS_ASSIGN(v, ParseSum());
  return Expect(")", form);
}

Status ProfileParser::ParseWeights(ExtrudeSyntax& e, double weight) {
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

}  // namespace vss
