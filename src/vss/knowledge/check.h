// Is an object of the knowledge base sound? More than loading it asks: all over its ranges, in all its poses.
#pragma once
#include <string>
#include <vector>

namespace vss {

struct KnowledgeFinding {
  bool is_error = true;  // an error makes the object useless; a warning is worth a look
  std::string message;   // FILE:LINE:COLUMN: one sentence
};

// Loads the object, then looks at it at the corners of its ranges (moved to the nearest dimensions that the
// constraints allow) and at some places between: is there a solid with its base on the ground and its middle
// on the origin; does it keep the predicates that its author expects of it; can both ends of every range be
// reached; does it rest in every pose without tipping over. Empty: sound.
std::vector<KnowledgeFinding> CheckKnowledge(const std::string& text, const std::string& file);

}  // namespace vss
