// A workpiece as built against the workpiece as designed: what differs, by how much, and whether the pictures
// are sure of it.
#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "vss/base/parameters.h"
#include "vss/base/result.h"
#include "vss/knowledge/object_model.h"

namespace vss {

struct Product;

// A part as it was designed.
struct NominalPart {
  std::string id, kind;
  std::vector<std::pair<std::string, double>> dimensions_mm;  // may lack some
  std::optional<Eigen::Vector3d> position;                    // world, mm, of the part frame
  std::optional<double> yaw_rad;
};

struct NominalOptions {
  double gate_mm = 100;
  double significant_sigmas = 3;
};
std::span<const ParameterOf<NominalOptions>> NominalParameters();

// As built minus as designed, of one dimension, or of x, y, z (mm) or yaw (deg).
struct Deviation {
  std::string name;
  double built = 0, designed = 0;
  double sigma = 0;  // of what was built; NaN where it is not known
  bool observable = true;
  bool significant = false;  // more than `significant_sigmas` of its sigmas
  double difference() const { return built - designed; }
  double sigmas() const { return difference() / sigma; }
};

struct PartDeviation {
  std::string nominal, part, kind;  // ids
  std::string matched_by;           // "place", "id" or "size"
  std::vector<Deviation> deviations;
};

struct NominalComparison {
  std::string file;
  std::vector<PartDeviation> parts;
  std::vector<std::string> missing;  // designed, not found: ids of the design
  std::vector<std::string> extra;    // found, not designed: ids of the product
};

// A vss-product/1 file, or a list of parts (vss-nominal/1, TOML):
//   format = "vss-nominal/1"
//   [[part]]
//   id = "web 1"
//   kind = "tee"
//   position = [1200.0, 800.0, 0.0]               # optional
//   yaw = 30.0                                    # optional, degrees
//   dimensions = { length = 1200.0, web = 20.0 }  # those that are designed
// Errors name file, line and remedy: a kind or dimension that `knowledge` does not have, an id used twice.
Result<std::vector<NominalPart>> ReadNominal(const std::filesystem::path& path,
                                             const KnowledgeBase& knowledge);

// Parts of one kind belong together: those with a place by place (the pairs whose distances are least in sum,
// none beyond the gate), then those without one by id, then by size.
NominalComparison CompareWithNominal(std::span<const NominalPart> nominal, const Product& product,
                                     const NominalOptions& options);

// As `nominal` of a product.json has it.
std::string NominalToJson(const NominalComparison& comparison);
// For a terminal.
std::string DeviationTable(const NominalComparison& comparison);

}  // namespace vss
