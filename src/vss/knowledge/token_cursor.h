// A place in the words of a file, and the errors of who reads them.
#pragma once
#include <algorithm>
#include <string_view>
#include <utility>

#include "vss/knowledge/lexer.h"

namespace vss {

class TokenCursor {
 public:
  TokenCursor(std::vector<Token> tokens, std::string file)
      : tokens_(std::move(tokens)), file_(std::move(file)) {}

 protected:
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
  // A text, or nothing.
  std::string ParseText() { return Here().kind == TokenKind::kText ? Take().text : std::string(); }

  tl::unexpected<Error> Fail(const std::string& expected, const std::string& remedy = "") const {
    return Fail(Here().at, fmt::format("expected {}, found {}{}{}", expected, Describe(Here()),
                                       remedy.empty() ? "" : "; ", remedy));
  }
  tl::unexpected<Error> Fail(SourcePosition at, const std::string& sentence) const {
    return ErrorAt(file_, at, sentence);
  }
  Status Expect(std::string_view text, const std::string& remedy = "") {
    if (!Accept(text)) return Fail(fmt::format("'{}'", text), remedy);
    return {};
  }

 private:
  std::vector<Token> tokens_;
  std::size_t i_ = 0;
  std::string file_;
};

}  // namespace vss
