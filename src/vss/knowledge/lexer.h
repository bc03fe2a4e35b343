// The words of a knowledge base file.
#pragma once
#include <string>
#include <vector>

#include "vss/knowledge/diagnostic.h"

namespace vss {

enum class TokenKind { kName, kNumber, kText, kSymbol, kEnd };

struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::string text;  // a text without its quotes
  double number = 0;
  SourcePosition at;
};

// Larger files are refused: an object is a page of text, not a data set.
inline constexpr std::size_t kMaxKnowledgeBytes = 1 << 20;

// Ends with a kEnd token. Errors: a byte that is not ASCII, a sign the language does not have, a text without
// its end, a number out of range, a file that is too large.
Result<std::vector<Token>> Tokenize(const std::string& text, const std::string& file);

// How an error names a token: "'width'", "the end of the file".
std::string Describe(const Token& token);

}  // namespace vss
