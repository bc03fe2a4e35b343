#include "vss/product/nominal.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vss/product/compare.h"
#include "vss/product/product.h"

namespace vss {
namespace {

constexpr double kNever = 1e9;  // mm: the cost of pairing what cannot be a pair
constexpr std::size_t kNone = static_cast<std::size_t>(-1);

bool IsHolePlace(const std::string& name) { return name == "hole_x" || name == "hole_y"; }

std::optional<double> DesignedValue(const NominalPart& part, const std::string& name) {
  for (const auto& [n, value] : part.dimensions_mm)
    if (n == name) return value;
  return std::nullopt;
}

// `length` is the longer horizontal side of boxes and plates in a product; a design may have it the other way
// round. It is turned by a quarter then.
NominalPart InProductOrder(NominalPart part) {
  if (part.kind != "box" && part.kind != "holed_plate") return part;
  const auto length = DesignedValue(part, "length"), width = DesignedValue(part, "width");
  if (!length || !width || *length >= *width) return part;
  for (auto& [name, value] : part.dimensions_mm) {
    if (name == "length")
      name = "width";
    else if (name == "width")
      name = "length";
    else if (name == "hole_x")
      name = "hole_y", value = -value;
    else if (name == "hole_y")
      name = "hole_x";
  }
  if (part.yaw_rad) *part.yaw_rad += kPi / 2;
  return part;
}

// Root mean square difference of the dimensions that both give.
double SizeDistance(const NominalPart& nominal, const Part& part) {
  double sum = 0, n = 0;
  for (const auto& d : part.dimensions) {
    const auto designed = DesignedValue(nominal, d.name);
    if (!designed || !d.observable || IsHolePlace(d.name)) continue;
    sum += std::pow(d.value_mm - *designed, 2), ++n;
  }
  return n > 0 ? std::sqrt(sum / n) : 0;
}

// Pairs `nominals` with `parts` (indices) so that the costs are least in sum; pairs of cost kNever are none.
template <class Cost>
void Pair(const std::vector<std::size_t>& nominals, const std::vector<std::size_t>& parts, const Cost& cost,
          std::vector<std::size_t>& part_of) {
  if (nominals.empty() || parts.empty()) return;
  Eigen::MatrixXd c =
      Eigen::MatrixXd::Constant(static_cast<Eigen::Index>(nominals.size()),
                                static_cast<Eigen::Index>(parts.size() + nominals.size()), kNever);
  for (std::size_t i = 0; i < nominals.size(); ++i)
    for (std::size_t k = 0; k < parts.size(); ++k)
      c(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = cost(nominals[i], parts[k]);
  const auto columns = CheapestAssignment(c);
  for (std::size_t i = 0; i < nominals.size(); ++i) {
    const auto k = static_cast<std::size_t>(columns[i]);
    if (k < parts.size() && c(static_cast<Eigen::Index>(i), columns[i]) < kNever)
      part_of[nominals[i]] = parts[k];
  }
}

std::vector<std::size_t> MatchParts(std::span<const NominalPart> nominal, const Product& product,
                                    const NominalOptions& options, std::vector<std::string>& matched_by) {
  std::vector<std::size_t> part_of(nominal.size(), kNone);
  matched_by.assign(nominal.size(), "");
  const auto rest = [&](bool with_place) {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < nominal.size(); ++i)
      if (part_of[i] == kNone && nominal[i].position.has_value() == with_place) out.push_back(i);
    return out;
  };
  const auto free = [&] {
    std::vector<std::size_t> out;
    for (std::size_t k = 0; k < product.parts.size(); ++k)
      if (std::find(part_of.begin(), part_of.end(), k) == part_of.end()) out.push_back(k);
    return out;
  };
  const auto same_kind = [&](std::size_t i, std::size_t k) {
    return nominal[i].kind == product.parts[k].kind;
  };
  const auto note = [&](const char* how) {
    for (std::size_t i = 0; i < nominal.size(); ++i)
      if (part_of[i] != kNone && matched_by[i].empty()) matched_by[i] = how;
  };
  Pair(
      rest(true), free(),
      [&](std::size_t i, std::size_t k) {
        const double apart = (*nominal[i].position - product.parts[k].world_from_part.translation).norm();
        return same_kind(i, k) && apart <= options.gate_mm ? apart : kNever;
      },
      part_of);
  note("place");
  Pair(
      rest(false), free(),
      [&](std::size_t i, std::size_t k) {
        return same_kind(i, k) && nominal[i].id == product.parts[k].id ? 0 : kNever;
      },
      part_of);
  note("id");
  Pair(
      rest(false), free(),
      [&](std::size_t i, std::size_t k) {
        return same_kind(i, k) ? SizeDistance(nominal[i], product.parts[k]) : kNever;
      },
      part_of);
  note("size");
  return part_of;
}

// Whether half a turn about its upright axis leaves the part as it is.
bool SameTurnedByHalf(const Part& part) {
  constexpr double kSameMm = 0.5;
  const RigidTransform part_from_world = part.world_from_part.Inverse();
  const auto turned = [&](const Eigen::Vector3d& p) {
    Eigen::Vector3d q = part_from_world * p;
    q.head<2>() *= -1;
    return part.world_from_part * q;
  };
  const bool vertices = std::all_of(part.vertices.begin(), part.vertices.end(), [&](const auto& v) {
    return std::any_of(part.vertices.begin(), part.vertices.end(),
                       [&](const auto& w) { return (turned(v) - w).norm() < kSameMm; });
  });
  return vertices && std::all_of(part.circles.begin(), part.circles.end(), [&](const auto& c) {
           return std::any_of(part.circles.begin(), part.circles.end(), [&](const auto& d) {
             return (turned(c.center) - d.center).norm() < kSameMm &&
                    std::abs(c.radius_mm - d.radius_mm) < kSameMm;
           });
         });
}

bool IsRound(const Part& part) { return part.vertices.empty() && !part.circles.empty(); }

double SigmaAt(const Part& part, Eigen::Index i) {
  if (part.covariance.rows() <= i) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(std::max(0.0, part.covariance(i, i)));
}

// A plate with a hole is the same after half a turn with its hole on the other side.
bool HoleOnTheOtherSide(const NominalPart& nominal, const Part& part) {
  double as_given = 0, turned = 0;
  for (const auto& d : part.dimensions) {
    const auto designed = DesignedValue(nominal, d.name);
    if (!designed || !IsHolePlace(d.name)) continue;
    as_given += std::abs(d.value_mm - *designed);
    turned += std::abs(d.value_mm + *designed);
  }
  return turned < as_given;
}

void AddPlace(const NominalPart& nominal, const Part& part, bool half_turn, std::vector<Deviation>& out) {
  if (nominal.position) {
    const char* const names[] = {"x", "y", "z"};
    for (Eigen::Index i = 0; i < 3; ++i)
      out.push_back(
          {names[i], part.world_from_part.translation[i], (*nominal.position)[i], SigmaAt(part, i)});
  }
  if (!nominal.yaw_rad || IsRound(part)) return;
  const bool either = half_turn || SameTurnedByHalf(part);
  const double turn = either ? kPi : 2 * kPi;
  const double difference = std::remainder(part.yaw_rad - *nominal.yaw_rad, turn);
  out.push_back({"yaw", DegFromRad(*nominal.yaw_rad + difference), DegFromRad(*nominal.yaw_rad),
                 DegFromRad(SigmaAt(part, 5))});
}

std::vector<Deviation> Deviations(const NominalPart& given, const Part& part, const NominalOptions& options) {
  const NominalPart nominal = InProductOrder(given);
  const bool half_turn = HoleOnTheOtherSide(nominal, part);
  std::vector<Deviation> out;
  AddPlace(nominal, part, half_turn, out);
  for (const auto& d : part.dimensions) {
    auto designed = DesignedValue(nominal, d.name);
    if (!designed) continue;
    if (half_turn && IsHolePlace(d.name)) *designed = -*designed;
    out.push_back({d.name, d.value_mm, *designed, d.sigma_mm, d.observable});
  }
  for (auto& d : out)
    d.significant =
        d.observable && d.sigma > 0 && std::abs(d.difference()) > options.significant_sigmas * d.sigma;
  return out;
}

}  // namespace

std::span<const ParameterOf<NominalOptions>> NominalParameters() {
  static const ParameterOf<NominalOptions> rows[] = {
      {"nominal.gate_mm", &NominalOptions::gate_mm, 1, 1e5, "mm",
       "A part that lies farther than this from its designed place is not that part (--nominal)."},
      {"nominal.significant_sigmas", &NominalOptions::significant_sigmas, 1, 10, "",
       "A deviation from the design is significant from so many of its standard deviations on."},
  };
  return rows;
}

NominalComparison CompareWithNominal(std::span<const NominalPart> nominal, const Product& product,
                                     const NominalOptions& options) {
  NominalComparison out;
  std::vector<std::string> matched_by;
  const auto part_of = MatchParts(nominal, product, options, matched_by);
  for (std::size_t i = 0; i < nominal.size(); ++i) {
    if (part_of[i] == kNone) {
      out.missing.push_back(nominal[i].id);
      continue;
    }
    const Part& part = product.parts[part_of[i]];
    out.parts.push_back(
        {nominal[i].id, part.id, part.kind, matched_by[i], Deviations(nominal[i], part, options)});
  }
  for (std::size_t k = 0; k < product.parts.size(); ++k)
    if (std::find(part_of.begin(), part_of.end(), k) == part_of.end())
      out.extra.push_back(product.parts[k].id);
  return out;
}

std::string DeviationTable(const NominalComparison& comparison) {
  std::string out =
      fmt::format("{:<12} {:<10} {:<12} {:<14} {:>11} {:>11} {:>10} {:>8} {:>7}\n", "DESIGNED", "BUILT",
                  "KIND", "WHAT", "AS BUILT", "DESIGNED", "DIFFERENCE", "SIGMA", "SIGMAS");
  const auto number = [](double value, int digits) {
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : std::string("-");
  };
  int significant = 0;
  for (const auto& part : comparison.parts)
    for (const auto& d : part.deviations) {
      significant += d.significant;
      out += fmt::format(
          "{:<12} {:<10} {:<12} {:<14} {:>11} {:>11} {:>10} {:>8} {:>7}{}\n", part.nominal, part.part,
          part.kind, d.name + (d.name == "yaw" ? " deg" : " mm"), number(d.built, 2), number(d.designed, 2),
          d.observable ? fmt::format("{:+.2f}", d.difference()) : "-",
          d.observable ? number(d.sigma, 2) : "-", d.observable ? number(std::abs(d.sigmas()), 1) : "-",
          !d.observable   ? "  not observable"
          : d.significant ? "  SIGNIFICANT"
                          : "");
    }
  for (const auto& id : comparison.missing) out += fmt::format("{:<12} NOT FOUND\n", id);
  for (const auto& id : comparison.extra) out += fmt::format("{:<12} {:<10} NOT DESIGNED\n", "-", id);
  return out + fmt::format("{} parts compared, {} significant deviations, {} not found, {} not designed\n",
                           comparison.parts.size(), significant, comparison.missing.size(),
                           comparison.extra.size());
}

}  // namespace vss
