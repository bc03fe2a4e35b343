#include "vss/knowledge/repair.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

constexpr double kKept_mm = 1e-7;
constexpr int kMaxRounds = 500;

// The gap of left <= right. In mm where both sides are lengths; else divided by the gradient, which makes it
// mm to first order.
ConstraintGap GapOf(const Constraint& c, int index, const std::vector<Dual>& values) {
  Dual off = values[c.left] - values[c.right];
  if (c.equal) off = Abs(off);
  ConstraintGap gap{index, off.value, off.by_dimension};
  if (c.power == 1 || !(off.value > 0)) return gap;
  const double slope = off.by_dimension.norm();
  if (slope > 0) gap.distance_mm /= slope, gap.by_dimension /= slope;
  return gap;
}

double MiddleOf(const DimensionDef& d) {
  // Sizes spread by ratios: between 100 mm and 10 m the middle is 1 m.
  return d.min_mm > 0 ? std::sqrt(d.min_mm * d.max_mm) : (d.min_mm + d.max_mm) / 2;
}

double Clamp(double x, const DimensionDef& d) { return std::clamp(x, d.min_mm, d.max_mm); }

// Projects onto the broken constraints one after the other, within the ranges (the method of Kaczmarz for
// inequalities: Agmon 1954). Converges where the constraints are linear and can be kept together.
void Repair(const Definition& definition, const std::vector<bool>& fixed, std::vector<double>& x) {
  std::vector<double> values = Evaluate(definition.program, x);
  for (int round = 0; round < kMaxRounds; ++round) {
    bool all_kept = true;
    const std::vector<double> before = x;
    for (std::size_t c = 0; c < definition.constraints.size(); ++c) {
      // Derivatives are dear, and most constraints are kept.
      const double off = values[std::size_t(definition.constraints[c].left)] -
                         values[std::size_t(definition.constraints[c].right)];
      if (!(off > 0) && !(definition.constraints[c].equal && off < 0)) continue;
      const ConstraintGap gap =
          GapOf(definition.constraints[c], static_cast<int>(c), EvaluateDual(definition.program, x));
      if (!(gap.distance_mm > kKept_mm)) continue;
      all_kept = false;
      double norm2 = 0;
      std::vector<double> step(x.size(), 0.0);
      for (std::size_t i = 0; i < x.size(); ++i) {
        const DimensionDef& d = definition.dimensions[i];
        const double g = gap.by_dimension[i];
        if (fixed[i] || (g > 0 && x[i] <= d.min_mm) || (g < 0 && x[i] >= d.max_mm)) continue;
        step[i] = g;
        norm2 += g * g;
      }
      if (!(norm2 > 0)) continue;
      // A hair beyond the border, so that rounding does not leave it broken.
      const double length = (gap.distance_mm + kKept_mm) / norm2;
      for (std::size_t i = 0; i < x.size(); ++i)
        x[i] = Clamp(x[i] - length * step[i], definition.dimensions[i]);
      values = Evaluate(definition.program, x);
    }
    if (all_kept || x == before) return;  // what moved nothing moves nothing again
  }
}

// The next dimension to settle and the place of its value: the first whose first usual value follows from
// what is settled; where there is none, a second usual value, and so on. {-1, -1}: none follows.
struct Settled {
  int dimension = -1, value = -1;
};
Settled NextToSettle(const Definition& definition, const std::vector<bool>& done) {
  std::size_t most = 0;
  for (const auto& list : definition.usual) most = std::max(most, list.size());
  for (std::size_t rank = 0; rank < most; ++rank) {
    for (std::size_t i = 0; i < done.size(); ++i) {
      if (done[i] || rank >= definition.usual[i].size()) continue;
      const Usual& u = definition.usual[i][rank];
      if (std::all_of(u.needs.begin(), u.needs.end(), [&](int j) { return done[j]; }))
        return {static_cast<int>(i), u.value};
    }
  }
  return {};
}

// Usual values, each after those that it follows from.
std::vector<double> StartingValues(const Definition& definition,
                                   std::span<const std::optional<double>> known) {
  const std::size_t n = definition.dimensions.size();
  std::vector<double> x(n);
  std::vector<bool> done(n);
  for (std::size_t i = 0; i < n; ++i) {
    done[i] = known[i].has_value();
    x[i] = known[i].value_or(MiddleOf(definition.dimensions[i]));
  }
  while (std::find(done.begin(), done.end(), false) != done.end()) {
    const Settled next = NextToSettle(definition, done);
    if (next.dimension < 0) {  // the middle of its range, then others may follow from it
      done[std::find(done.begin(), done.end(), false) - done.begin()] = true;
      continue;
    }
    const double value = Evaluate(definition.program, x)[next.value];
    if (std::isfinite(value)) x[next.dimension] = Clamp(value, definition.dimensions[next.dimension]);
    done[next.dimension] = true;
  }
  return x;
}

double WorstGap(const Definition& definition, std::span<const double> x, int* constraint) {
  double worst = 0;
  for (const ConstraintGap& gap : ConstraintGaps(definition, x)) {
    if (std::isfinite(gap.distance_mm) && gap.distance_mm <= worst) continue;
    worst = std::isfinite(gap.distance_mm) ? gap.distance_mm : INFINITY;
    *constraint = gap.constraint;
  }
  return worst;
}

std::string ReasonOf(const Constraint& c) { return c.reason.empty() ? "" : fmt::format(" ({})", c.reason); }

}  // namespace

std::vector<ConstraintGap> ConstraintGaps(const Definition& definition,
                                          std::span<const double> dimensions_mm) {
  const std::vector<Dual> values = EvaluateDual(definition.program, dimensions_mm);
  std::vector<ConstraintGap> gaps;
  for (std::size_t c = 0; c < definition.constraints.size(); ++c)
    gaps.push_back(GapOf(definition.constraints[c], static_cast<int>(c), values));
  return gaps;
}

bool KeepsAllConstraints(const Definition& definition, std::span<const double> dimensions_mm) {
  const std::vector<double> values = Evaluate(definition.program, dimensions_mm);
  return std::all_of(definition.constraints.begin(), definition.constraints.end(), [&](const Constraint& c) {
    const double off = values[std::size_t(c.left)] - values[std::size_t(c.right)];
    return off <= 0 && (!c.equal || off >= 0);
  });
}

std::vector<double> UsualDimensions(const Definition& definition,
                                    std::span<const std::optional<double>> known) {
  std::vector<double> x = StartingValues(definition, known);
  std::vector<bool> fixed;
  for (const auto& k : known) fixed.push_back(k.has_value());
  Repair(definition, fixed, x);
  return x;
}

std::vector<double> NearestAllowed(const Definition& definition, std::vector<double> dimensions_mm) {
  Repair(definition, std::vector<bool>(dimensions_mm.size(), false), dimensions_mm);
  return dimensions_mm;
}

Status CheckConstraintsCanHold(const Definition& definition) {
  std::vector<Interval> ranges;
  for (const DimensionDef& d : definition.dimensions) ranges.push_back({d.min_mm, d.max_mm});
  const std::vector<Interval> values = EvaluateInterval(definition.program, ranges);
  for (const Constraint& c : definition.constraints) {
    const double least =
        c.equal ? std::max(values[c.left].min - values[c.right].max, values[c.right].min - values[c.left].max)
                : values[c.left].min - values[c.right].max;
    if (least > kKept_mm)
      return ErrorAt(definition.file, c.at,
                     fmt::format("this constraint{} contradicts the ranges: at best it misses by {:.3g}{}; "
                                 "widen a range or drop it",
                                 ReasonOf(c), least, c.power == 1 ? " mm" : ""));
  }
  // Together: from the usual values, the middles and both ends of the ranges.
  const std::size_t n = definition.dimensions.size();
  const std::vector<bool> free(n, false);
  const std::vector<std::optional<double>> unknown(n);
  std::vector<std::vector<double>> starts(4, StartingValues(definition, unknown));
  for (std::size_t i = 0; i < n; ++i) {
    starts[1][i] = MiddleOf(definition.dimensions[i]);
    starts[2][i] = definition.dimensions[i].min_mm;
    starts[3][i] = definition.dimensions[i].max_mm;
  }
  double best = INFINITY;
  int blocked = 0;
  for (std::vector<double>& x : starts) {
    Repair(definition, free, x);
    int constraint = 0;
    const double worst = WorstGap(definition, x, &constraint);
    if (worst < best) best = worst, blocked = constraint;
    if (best <= 1e-6) return {};
  }
  const Constraint& c = definition.constraints[blocked];
  return ErrorAt(definition.file, c.at,
                 fmt::format("this constraint{} cannot be kept together with the others: at best it misses "
                             "by {:.3g} mm; loosen one of them",
                             ReasonOf(c), best));
}

}  // namespace vss
