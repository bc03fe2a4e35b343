// Names and expressions of the language, into a syntax tree.
#pragma once
#include "vss/knowledge/syntax.h"
#include "vss/knowledge/token_cursor.h"

namespace vss {

// Words of the language, which can be no names.
bool IsWord(const std::string& name);

class ExpressionParser : public TokenCursor {
 protected:
  ExpressionParser(std::vector<Token> tokens, const std::string& file)
      : TokenCursor(std::move(tokens), file) {
    out_.file = file;
  }

  Result<Named> ParseName(const std::string& what);
  // The index of what was read in out_.expressions.
  Result<int> ParseSum();

  // A list that takes one more.
  template <class T>
  Status CheckCount(const std::vector<T>& list, const char* what) const {
    constexpr std::size_t kMaxItems = 1000;  // of one sort in an object
    if (list.size() < kMaxItems) return {};
    return Fail(Here().at, fmt::format("more than {} {}; split the object in two", kMaxItems, what));
  }

  Syntax out_;

 private:
  Result<int> Add(Expression e);
  tl::unexpected<Error> TooDeep(SourcePosition at) const;
  Result<int> Binary(Op op, int a, int b, SourcePosition at);
  Result<int> ParseProduct();
  Result<int> ParseFactor();
  Result<int> ParseFactorInner();
  Result<int> ParseFunction(const std::string& word, Op op, SourcePosition at);
  Result<int> ParseNumber();

  int nesting_ = 0;
};

}  // namespace vss
