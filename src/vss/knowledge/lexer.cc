#include "vss/knowledge/lexer.h"

#include <charconv>
#include <cmath>

namespace vss {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsNameStart(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsName(char c) { return IsNameStart(c) || IsDigit(c); }

class Scanner {
 public:
  Scanner(const std::string& text, const std::string& file) : text_(text), file_(file) {}

  Result<std::vector<Token>> Run() {
    while (true) {
      VSS_RETURN_IF_ERROR(SkipBlanks());
      Token token;
      token.at = at_;
      if (Done()) {
        tokens_.push_back(std::move(token));
        return std::move(tokens_);
      }
      VSS_RETURN_IF_ERROR(Read(token));
      tokens_.push_back(std::move(token));
    }
  }

 private:
  bool Done() const { return i_ >= text_.size(); }
  char Here() const { return text_[i_]; }
  char Next() const { return i_ + 1 < text_.size() ? text_[i_ + 1] : '\0'; }
  void Advance() {
    if (text_[i_++] == '\n') {
      ++at_.line;
      at_.column = 1;
    } else {
      ++at_.column;
    }
  }

  Status CheckByte() const {
    const unsigned char c = static_cast<unsigned char>(Here());
    if ((c >= 0x20 && c < 0x7f) || c == '\n' || c == '\t' || c == '\r') return {};
    return ErrorAt(file_, at_,
                   fmt::format("byte 0x{:02x} is not printable ASCII; write the file in plain ASCII", c));
  }

  Status SkipBlanks() {
    bool comment = false;
    for (; !Done(); Advance()) {
      VSS_RETURN_IF_ERROR(CheckByte());
      if (Here() == '\n')
        comment = false;
      else if (Here() == '#')
        comment = true;
      if (comment || Here() == ' ' || Here() == '\n' || Here() == '\t' || Here() == '\r') continue;
      break;
    }
    return {};
  }

  Status Read(Token& token) {
    if (IsNameStart(Here())) return ReadName(token);
    if (IsDigit(Here())) return ReadNumber(token);
    if (Here() == '"') return ReadText(token);
    return ReadSymbol(token);
  }

  Status ReadName(Token& token) {
    token.kind = TokenKind::kName;
    for (; !Done() && IsName(Here()); Advance()) token.text += Here();
    if (token.text.size() > kMaxNameLength)
      return ErrorAt(
          file_, token.at,
          fmt::format("this name has {} letters; at most {} are allowed", token.text.size(), kMaxNameLength));
    return {};
  }

  // digits [ "." digits ]; the two dots of a range do not belong to it.
  Status ReadNumber(Token& token) {
    token.kind = TokenKind::kNumber;
    for (; !Done() && IsDigit(Here()); Advance()) token.text += Here();
    if (!Done() && Here() == '.' && IsDigit(Next())) {
      token.text += '.';
      for (Advance(); !Done() && IsDigit(Here()); Advance()) token.text += Here();
    }
    const auto [end, code] =
        std::from_chars(token.text.data(), token.text.data() + token.text.size(), token.number);
    if (code != std::errc() || end != token.text.data() + token.text.size() || token.number > kMaxNumber)
      return ErrorAt(file_, token.at,
                     fmt::format("the number {} is larger than {:g}; write a smaller one",
                                 token.text.substr(0, 20), kMaxNumber));
    return {};
  }

  Status ReadText(Token& token) {
    token.kind = TokenKind::kText;
    for (Advance(); !Done() && Here() != '"' && Here() != '\n'; Advance()) {
      VSS_RETURN_IF_ERROR(CheckByte());
      token.text += Here();
    }
    if (Done() || Here() == '\n')
      return ErrorAt(file_, token.at, "this text has no end; close it with \" on the same line");
    Advance();
    return {};
  }

  Status ReadSymbol(Token& token) {
    token.kind = TokenKind::kSymbol;
    for (const std::string_view pair : {"..", "<=", ">=", "=="}) {
      if (Here() != pair[0] || Next() != pair[1]) continue;
      token.text = text_.substr(i_, 2);
      Advance();
      Advance();
      return {};
    }
    if (std::string("{}(),:=<>+-*/").find(Here()) == std::string::npos)
      return ErrorAt(file_, at_,
                     fmt::format("the sign '{}' has no meaning here; the language knows names, numbers, "
                                 "\"texts\" and {{ }} ( ) , : .. = == < <= > >= + - * / #",
                                 Here()));
    token.text = text_.substr(i_, 1);
    Advance();
    return {};
  }

  static constexpr std::size_t kMaxNameLength = 64;
  static constexpr double kMaxNumber = 1e9;  // in mm: a thousand kilometres; a slip of the hand
  const std::string& text_;
  const std::string& file_;
  std::size_t i_ = 0;
  SourcePosition at_;
  std::vector<Token> tokens_;
};

}  // namespace

Result<std::vector<Token>> Tokenize(const std::string& text, const std::string& file) {
  if (text.size() > kMaxKnowledgeBytes)
    return InputError(
        "{}: {} bytes are more than the {} a knowledge base file may have; give each object a file of its "
        "own",
        file, text.size(), kMaxKnowledgeBytes);
  return Scanner(text, file).Run();
}

std::string Describe(const Token& token) {
  switch (token.kind) {
    case TokenKind::kEnd:
      return "the end of the file";
    case TokenKind::kText:
      return "a text in quotes";
    default:
      return fmt::format("'{}'", token.text);
  }
}

}  // namespace vss
