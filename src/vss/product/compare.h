// A product against the truth of a scene, where somebody knows it: what was found, what was invented, the
// errors.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "vss/product/product.h"

namespace vss {

// A part as the truth gives it.
struct TruePart {
  std::string id, kind;
  std::vector<std::pair<std::string, double>> dimensions_mm;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<ProductCircle> circles;
};

struct PartComparison {
  int truth = 0;
  int part = -1;                  // index into the product's parts; -1: missed
  std::vector<double> errors_mm;  // of every vertex, and of every circle (centre and radius together)
  struct Dimension {
    std::string name;
    double error_mm = 0, sigma_mm = 0;
  };
  std::vector<Dimension> dimensions;  // those that the product calls observable
};

struct Comparison {
  std::vector<PartComparison> parts;  // one a true part
  std::vector<int> invented;          // parts of the product that are none
};

// truth.json of a rendered survey.
Result<std::vector<TruePart>> ReadTruth(const std::filesystem::path& path);

// Pairs parts of one kind whose mean vertex distance, under the best one-to-one assignment, is below
// `gate_mm`, so that the sum of distances is least.
Comparison CompareWithTruth(const std::vector<TruePart>& truth, const Product& product, double gate_mm = 25);

// The columns of the cheapest one-to-one assignment of rows to columns (rows <= columns; Kuhn, Munkres).
std::vector<int> CheapestAssignment(const Eigen::MatrixXd& cost);

}  // namespace vss
