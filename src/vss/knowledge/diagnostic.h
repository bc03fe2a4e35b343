// Where in a knowledge base file something stands, and the one form of its errors: FILE:LINE:COLUMN:
// sentence.
#pragma once
#include <string>

#include "vss/base/result.h"

namespace vss {

struct SourcePosition {
  int line = 1, column = 1;  // from 1; every byte is a column, the files being ASCII
};

inline tl::unexpected<Error> ErrorAt(const std::string& file, SourcePosition at,
                                     const std::string& sentence) {
  return InputError("{}:{}:{}: {}", file, at.line, at.column, sentence);
}

// FILE:LINE:COLUMN: in the variant with ...: sentence.
inline std::string InVariant(const std::string& message, const std::string& variant) {
  const std::size_t sentence = message.find(": ");
  if (variant.empty() || sentence == std::string::npos) return message;
  return message.substr(0, sentence + 2) + "in the variant " + variant + ": " + message.substr(sentence + 2);
}

}  // namespace vss
