// Where an object's catalogues of standard sizes are read from.
#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "vss/knowledge/definition.h"

namespace vss {

struct Catalogues {
  std::optional<std::filesystem::path> folder;  // looked into first; left out for shipped objects
  struct Text {
    std::string file, text;
  };
  std::map<std::string, Text> in_place;  // of the shipped catalogues of that file name
};

// Reads the catalogues that `definition` names and says which column is which dimension. Errors: a file that
// is not there or not sound, a column that is no dimension.
Status ReadCatalogues(const Catalogues& catalogues, Definition& definition);

// The catalogues that the knowledge base file `file` names and that lie beside it: what goes with it where it
// is copied. Empty where `text` is not sound.
std::vector<std::string> CataloguesBeside(const std::string& text, const std::filesystem::path& file);

}  // namespace vss
