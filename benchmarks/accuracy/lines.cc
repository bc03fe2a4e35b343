// Straight lines on synthetic pictures: recall, precision, error over the Cramer-Rao bound, honesty of the
// covariance. accuracy_lines [PICTURES A CONDITION]
#include <fmt/format.h>

#include <cstdlib>

#include "accuracy/line_scenes.h"

using namespace vss::bench;

namespace {

struct Tally {
  int edges = 0, recalled = 0, whole = 0, found = 0, right = 0;
  double offset2 = 0, angle2 = 0, rms2 = 0, offset = 0, place2_px = 0;  // over the bound; px
  double nees_offset = 0, nees_angle = 0;
  int measured = 0;
  std::vector<double> ends;
};

struct Match {
  double from, to, middle_offset, angle;
};

// How a found edge lies on a true one; false where it is another.
bool Matches(const TrueEdge& t, const FoundEdge& f, Match& m) {
  constexpr double kMaxAngle = 0.1, kMaxOffsetPx = 1.5;
  const Vector2d d = (t.end - t.start).normalized(), g = f.end - f.start;
  const double turn = std::atan2(d.x() * g.y() - d.y() * g.x(), d.dot(g));
  m.angle = std::abs(turn) > M_PI / 2 ? turn - std::copysign(M_PI, turn) : turn;
  const double length = (t.end - t.start).norm();
  m.from = std::min(d.dot(f.start - t.start), d.dot(f.end - t.start));
  m.to = std::max(d.dot(f.start - t.start), d.dot(f.end - t.start));
  auto across = [&](const Vector2d& p) {
    return d.y() * (p.x() - t.start.x()) - d.x() * (p.y() - t.start.y());
  };
  const double a = across(f.start), b = across(f.end), middle = 0.5 * length;
  const double at_start = d.dot(f.start - t.start), at_end = d.dot(f.end - t.start);
  if (std::abs(at_end - at_start) < 1e-9) return false;
  m.middle_offset = a + (b - a) * (middle - at_start) / (at_end - at_start);
  return std::abs(m.angle) < kMaxAngle && std::max(std::abs(a), std::abs(b)) < kMaxOffsetPx && m.to > 0 &&
         m.from < length;
}

void Judge(const LineScene& scene, const std::vector<FoundEdge>& found, double per_pixel, Tally& tally) {
  std::vector<char> right(found.size(), 0);
  for (const auto& t : scene.edges) {
    ++tally.edges;
    const double length = (t.end - t.start).norm();
    double covered = 0, best_cover = 0;
    Match best{};
    const FoundEdge* best_edge = nullptr;
    for (std::size_t i = 0; i < found.size(); ++i) {
      Match m;
      if (!Matches(t, found[i], m)) continue;
      right[i] = 1;
      const double cover = (std::min(m.to, length) - std::max(m.from, 0.0)) / length;
      covered += cover;
      if (cover > best_cover) best_cover = cover, best = m, best_edge = &found[i];
    }
    tally.recalled += covered > 0.5;
    if (best_cover < 0.8) continue;
    ++tally.whole;
    ++tally.measured;
    const double s_offset = per_pixel / std::sqrt(length),
                 s_angle = std::sqrt(12.0) * per_pixel / std::pow(length, 1.5);
    const double rms2 = best.middle_offset * best.middle_offset +
                        std::tan(best.angle) * std::tan(best.angle) * length * length / 12;
    tally.offset2 += std::pow(best.middle_offset / s_offset, 2),
        tally.angle2 += std::pow(best.angle / s_angle, 2);
    tally.rms2 += rms2 / (2 * s_offset * s_offset);
    tally.place2_px += rms2, tally.offset += best.middle_offset;
    if (best_edge->sigma_offset > 0) {
      tally.nees_offset += std::pow(best.middle_offset / best_edge->sigma_offset, 2);
      tally.nees_angle += std::pow(best.angle / best_edge->sigma_angle, 2);
    }
    for (const Vector2d& p : {t.start, t.end})
      tally.ends.push_back(std::min((best_edge->start - p).norm(), (best_edge->end - p).norm()));
  }
  tally.found += static_cast<int>(found.size());
  for (const char r : right) tally.right += r;
}

double Median(std::vector<double> v) {
  if (v.empty()) return 0;
  std::nth_element(v.begin(), v.begin() + std::ptrdiff_t(v.size() / 2), v.end());
  return v[v.size() / 2];
}

struct Summary {
  double log_place = 0, log_rms = 0, log_angle = 0;
  int conditions = 0;
  Tally all;
};

}  // namespace

int main(int argc, char** argv) {
  const int pictures = argc > 1 ? std::max(1, std::atoi(argv[1])) : 3;
  const bool verbose = argc > 2;
  const auto detectors = Detectors();
  std::vector<Summary> high(detectors.size()), clean(detectors.size()), low(detectors.size());
  unsigned seed = 1;
  for (const double contrast : {10.0, 20.0, 40.0, 80.0})
    for (const double noise : {0.0, 1.0, 2.5, 5.0, 10.0})
      for (const double blur : {0.7, 1.0, 1.5}) {
        if (noise > 0 && contrast / noise < 4) continue;
        const Condition c{contrast, noise, blur};
        std::vector<Tally> tally(detectors.size());
        for (int i = 0; i < pictures; ++i) {
          const LineScene scene = MakeScene(512, c, seed++);
          for (std::size_t d = 0; d < detectors.size(); ++d)
            Judge(scene, detectors[d].find(scene.image), BoundPerPixel(c), tally[d]);
        }
        for (std::size_t d = 0; d < detectors.size(); ++d) {
          const Tally& t = tally[d];
          Summary& s = noise == 0 ? clean[d] : contrast / noise >= 8 ? high[d] : low[d];
          const double n = std::max(1, t.measured);
          if (t.measured > 0) {
            ++s.conditions;
            s.log_place += std::log(std::sqrt(t.offset2 / n) + 1e-9),
                s.log_angle += std::log(std::sqrt(t.angle2 / n) + 1e-9);
            s.log_rms += std::log(std::sqrt(t.rms2 / n) + 1e-9);
          }
          s.all.edges += t.edges, s.all.recalled += t.recalled, s.all.whole += t.whole,
              s.all.found += t.found, s.all.right += t.right;
          s.all.measured += t.measured, s.all.place2_px += t.place2_px, s.all.offset += t.offset;
          s.all.nees_offset += t.nees_offset, s.all.nees_angle += t.nees_angle;
          s.all.ends.insert(s.all.ends.end(), t.ends.begin(), t.ends.end());
          if (verbose && d < 2)
            fmt::print(
                "{:8} C {:3.0f} noise {:4.1f} blur {:.1f}: recall {:.3f} precision {:.3f} whole {:.3f} "
                "midpoint/CR {:5.2f} angle/CR {:5.2f} ends {:.3f} nees {:.2f} {:.2f} bias {:+.4f}\n",
                detectors[d].name, contrast, noise, blur, double(t.recalled) / t.edges,
                double(t.right) / std::max(1, t.found), double(t.whole) / t.edges, std::sqrt(t.offset2 / n),
                std::sqrt(t.angle2 / n), Median(t.ends), t.nees_offset / n, t.nees_angle / n, t.offset / n);
        }
      }
  for (const auto* group : {&high, &clean, &low}) {
    fmt::print("\n{}\n", group == &high    ? "C/sigma >= 8"
                         : group == &clean ? "no noise (8 bit rounding alone)"
                                           : "C/sigma 4");
    fmt::print("{:10}{:>8}{:>10}{:>8}{:>12}{:>10}{:>10}{:>10}{:>12}{:>12}{:>14}\n", "", "recall", "precision",
               "whole", "midpoint/CR", "RMS/CR", "angle/CR", "ends px", "RMS px", "bias px", "error/sigma^2");
    for (std::size_t d = 0; d < detectors.size(); ++d) {
      const Summary& s = (*group)[d];
      const Tally& t = s.all;
      const double n = std::max(1, t.measured), k = std::max(1, s.conditions);
      fmt::print(
          "{:10}{:8.3f}{:10.3f}{:8.3f}{:12.2f}{:10.2f}{:10.2f}{:10.3f}{:12.4f}{:+12.4f}{:7.2f}{:7.2f}\n",
          detectors[d].name, double(t.recalled) / t.edges, double(t.right) / std::max(1, t.found),
          double(t.whole) / t.edges, std::exp(s.log_place / k), std::exp(s.log_rms / k),
          std::exp(s.log_angle / k), Median(t.ends), std::sqrt(t.place2_px / n), t.offset / n,
          t.nees_offset / n, t.nees_angle / n);
    }
  }
}
