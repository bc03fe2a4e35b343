// Cross sections: loops, corners and the weights of edges, each with the features that it belongs to.
#pragma once
#include "vss/knowledge/expression_parser.h"

namespace vss {

class ProfileParser : public ExpressionParser {
 protected:
  using ExpressionParser::ExpressionParser;

  Status ParseExtrude();
  Result<int> ParseAxis(const std::string& remedy);

  static constexpr double kMaxWeight = 10;
  When when_;  // where the item that is read stands

 private:
  Status ParseProfileItem(ExtrudeSyntax& e);
  Status ParseLoop(ExtrudeSyntax& e);
  Status ParseCircle(LoopSyntax& loop);
  Status ParseCorner(LoopSyntax& loop);
  Status ParsePoint(int& u, int& v);
  Status ParseWeights(ExtrudeSyntax& e, double weight);
  template <class Item>
  Status ParseWith(const Item& item);
};

}  // namespace vss
