#include "vss/product/compare.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "vss/base/files.h"

namespace vss {
namespace {

using Features = Eigen::MatrixXd;  // a row each

Features VerticesOf(const std::vector<Eigen::Vector3d>& vertices) {
  Features f(static_cast<Eigen::Index>(vertices.size()), 3);
  for (Eigen::Index i = 0; i < f.rows(); ++i) f.row(i) = vertices[static_cast<std::size_t>(i)].transpose();
  return f;
}

Features CirclesOf(const std::vector<ProductCircle>& circles) {
  Features f(static_cast<Eigen::Index>(circles.size()), 4);
  for (Eigen::Index i = 0; i < f.rows(); ++i) {
    const auto& c = circles[static_cast<std::size_t>(i)];
    f.row(i) << c.center.transpose(), c.radius_mm;
  }
  return f;
}

// Distances under the best assignment, appended to `errors`; false where the numbers of features differ.
bool AppendErrors(const Features& a, const Features& b, std::vector<double>& errors) {
  if (a.rows() != b.rows()) return false;
  Eigen::MatrixXd cost(a.rows(), b.rows());
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < b.rows(); ++j) cost(i, j) = (a.row(i) - b.row(j)).norm();
  const std::vector<int> columns = CheapestAssignment(cost);
  for (Eigen::Index i = 0; i < a.rows(); ++i) errors.push_back(cost(i, columns[static_cast<std::size_t>(i)]));
  return true;
}

// Empty where the two cannot be the same.
std::vector<double> ErrorsBetween(const TruePart& truth, const Part& part) {
  std::vector<double> errors;
  if (truth.kind != part.kind ||
      !AppendErrors(VerticesOf(truth.vertices), VerticesOf(part.vertices), errors) ||
      !AppendErrors(CirclesOf(truth.circles), CirclesOf(part.circles), errors))
    return {};
  return errors;
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// `length` is the longer horizontal side of boxes and plates: a truth that has it the other way round is
// turned.
std::vector<std::pair<std::string, double>> InContractOrder(const TruePart& truth) {
  auto dimensions = truth.dimensions_mm;
  const auto value = [&](const std::string& name) {
    const auto found =
        std::find_if(dimensions.begin(), dimensions.end(), [&](const auto& d) { return d.first == name; });
    return found == dimensions.end() ? std::nan("") : found->second;
  };
  if ((truth.kind != "box" && truth.kind != "holed_plate") || !(value("length") < value("width")))
    return dimensions;
  for (auto& [name, mm] : dimensions) {
    if (name == "length")
      name = "width";
    else if (name == "width")
      name = "length";
    else if (name == "hole_x")
      name = "hole_y";
    else if (name == "hole_y")
      name = "hole_x";
  }
  return dimensions;
}

std::vector<PartComparison::Dimension> CompareDimensions(const TruePart& truth, const Part& part) {
  std::vector<PartComparison::Dimension> out;
  for (const auto& [name, mm] : InContractOrder(truth))
    for (const auto& d : part.dimensions) {
      if (d.name != name || !d.observable) continue;
      const bool either_way = name == "hole_x" || name == "hole_y";  // half a turn is the same plate
      out.push_back({name, either_way ? std::abs(d.value_mm) - std::abs(mm) : d.value_mm - mm, d.sigma_mm});
    }
  return out;
}

}  // namespace

std::vector<int> CheapestAssignment(const Eigen::MatrixXd& cost) {
  // Shortest augmenting paths with potentials (Jonker, Volgenant 1987), rows and columns counted from 1; 0 is
  // nothing.
  const int rows = static_cast<int>(cost.rows()), columns = static_cast<int>(cost.cols());
  std::vector<double> row_potential(std::size_t(rows) + 1), column_potential(std::size_t(columns) + 1);
  std::vector<int> row_of(std::size_t(columns) + 1), previous(std::size_t(columns) + 1);
  for (int row = 1; row <= rows; ++row) {
    row_of[0] = row;
    int column = 0;
    std::vector<double> slack(std::size_t(columns) + 1, std::numeric_limits<double>::infinity());
    std::vector<bool> visited(std::size_t(columns) + 1);
    do {
      visited[std::size_t(column)] = true;
      const int at = row_of[std::size_t(column)];
      double delta = std::numeric_limits<double>::infinity();
      int next = 0;
      for (int j = 1; j <= columns; ++j) {
        if (visited[std::size_t(j)]) continue;
        const double reduced =
            cost(at - 1, j - 1) - row_potential[std::size_t(at)] - column_potential[std::size_t(j)];
        if (reduced < slack[std::size_t(j)]) {
          slack[std::size_t(j)] = reduced;
          previous[std::size_t(j)] = column;
        }
        if (slack[std::size_t(j)] < delta) {
          delta = slack[std::size_t(j)];
          next = j;
        }
      }
      for (int j = 0; j <= columns; ++j) {
        if (visited[std::size_t(j)]) {
          row_potential[std::size_t(row_of[std::size_t(j)])] += delta;
          column_potential[std::size_t(j)] -= delta;
        } else {
          slack[std::size_t(j)] -= delta;
        }
      }
      column = next;
    } while (row_of[std::size_t(column)] != 0);
    for (; column != 0; column = previous[std::size_t(column)])
      row_of[std::size_t(column)] = row_of[std::size_t(previous[std::size_t(column)])];
  }
  std::vector<int> column_of(static_cast<std::size_t>(rows));
  for (int j = 1; j <= columns; ++j)
    if (row_of[std::size_t(j)] > 0) column_of[std::size_t(row_of[std::size_t(j)]) - 1] = j - 1;
  return column_of;
}

Result<std::vector<TruePart>> ReadTruth(const std::filesystem::path& path) {
  VSS_ASSIGN(const std::string text, ReadTextFile(path));
  try {
    const auto json = nlohmann::json::parse(text);
    const auto point = [](const nlohmann::json& p) {
      return Eigen::Vector3d(p.at(0).get<double>(), p.at(1).get<double>(), p.at(2).get<double>());
    };
    std::vector<TruePart> truth;
    for (const auto& in : json.at("parts")) {
      TruePart part{in.at("id").get<std::string>(), in.at("kind").get<std::string>(), {}, {}, {}};
      for (const auto& [name, value] : in.at("dims").items())
        part.dimensions_mm.emplace_back(name, value.get<double>());
      for (const auto& v : in.at("vertices")) part.vertices.push_back(point(v));
      for (const auto& c : in.at("circles"))
        part.circles.push_back({point(c.at("center")), point(c.at("normal")), c.at("radius").get<double>()});
      truth.push_back(std::move(part));
    }
    return truth;
  } catch (const std::exception& e) {
    return InputError("{}: not the truth of a rendered survey ({}); name its truth.json", path.string(),
                      e.what());
  }
}

Comparison CompareWithTruth(const std::vector<TruePart>& truth, const Product& product, double gate_mm) {
  constexpr double kNever = 1e6;  // mm: the cost of pairing what cannot be a pair
  const std::size_t rows = truth.size(), columns = std::max(product.parts.size(), rows);
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(Eigen::Index(rows), Eigen::Index(columns), kNever);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < product.parts.size(); ++j)
      if (const auto errors = ErrorsBetween(truth[i], product.parts[j]); !errors.empty())
        cost(Eigen::Index(i), Eigen::Index(j)) = Mean(errors);
  const std::vector<int> assigned = CheapestAssignment(cost);
  Comparison out;
  std::vector<bool> taken(columns);
  for (std::size_t i = 0; i < rows; ++i) {
    PartComparison& part = out.parts.emplace_back();
    part.truth = static_cast<int>(i);
    const auto j = static_cast<std::size_t>(assigned[i]);
    if (cost(Eigen::Index(i), Eigen::Index(j)) >= gate_mm) continue;
    taken[j] = true;
    part.part = static_cast<int>(j);
    part.errors_mm = ErrorsBetween(truth[i], product.parts[j]);
    part.dimensions = CompareDimensions(truth[i], product.parts[j]);
  }
  for (std::size_t j = 0; j < product.parts.size(); ++j)
    if (!taken[j]) out.invented.push_back(static_cast<int>(j));
  return out;
}

}  // namespace vss
