// What the adjustment learns from its residuals: robust weights, how far shading pulls each class of edge and
// each contour, and how far the priors of cameras and stops are believed.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vss/base/median.h"
#include "vss/reconstruct/adjustment.h"

namespace vss {
namespace {

using Eigen::MatrixXd;

constexpr double kTukey = 4.5;   // observations further than that many sigmas from their group do not count
constexpr double kHuber = 2.5;   // groups further than that count less,
constexpr double kGroupCut = 8;  // and beyond that not at all
constexpr double kMinScatterPx = 0.02;  // robust scale of a group never below
constexpr double kScatterBelief = 10;   // so many observations' worth of belief in their own sigmas
constexpr double kMinSystematicPx = 0.004, kMaxSystematicPx = 8;
constexpr double kDefaultGroups = 5;  // so many groups' worth of belief in the systematic sigma at the start
constexpr double kContourGroups = 3;  // and so many in a contour's being like its class
// Half of what pulls a contour in single pictures pulls it in all: lamps and cameras travel together.
constexpr double kPulledAlike = 0.5;
constexpr double kQuantile = 0.75, kChiSquareAtQuantile = 1.3233;  // of one degree of freedom

double TukeyWeight(double z) {
  const double q = z / kTukey;
  return std::abs(q) >= 1 ? 0 : (1 - q * q) * (1 - q * q);
}

double GroupWeight(double z) {
  z = std::abs(z);
  return z <= kHuber ? 1 : z < kGroupCut ? kHuber / z : 0;
}

// A group's squared mean, and its variance by noise.
using SquaredMean = std::pair<double, double>;

// The sigma at which three quarters of the groups' means, set against it and their own noise, are as small as
// three quarters of normal numbers are; `share`: of the groups that no unknown was fitted to.
double SystematicOf(const std::vector<SquaredMean>& means, double share) {
  const auto quantile = [&](double s) {
    std::vector<double> z;
    for (const auto& [m, v] : means) z.push_back(m / (s * s + v));
    const auto at =
        z.begin() + static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(means.size() - 1));
    std::nth_element(z.begin(), at, z.end());
    return *at;
  };
  double low = kMinSystematicPx, high = kMaxSystematicPx;
  for (int it = 0; it < 40; ++it) {
    const double middle = std::sqrt(low * high);
    (quantile(middle) > kChiSquareAtQuantile * share ? low : high) = middle;
  }
  return low;
}

double Believed(double estimate, double n, double before, double belief) {
  return std::exp((n * std::log(estimate) + belief * std::log(before)) / (n + belief));
}

}  // namespace

void Adjustment::PrepareBiases() {
  std::map<std::pair<int, int>, std::vector<double>> lengths;
  std::map<std::pair<int, int>, ContourClass> classes;
  std::map<std::pair<int, int>, std::vector<double>> mm_per_px, neighbours;
  std::map<std::pair<int, int>, bool> is_rim;
  std::map<std::pair<int, int>, double> saturated, bright_behind;
  for (const auto& g : groups) {
    const std::pair key(g.part, g.BiasKey());
    const auto& view = views_[static_cast<std::size_t>(g.view)];
    for (const auto& o : g.observations) {
      lengths[key].push_back(o.half_length_px);
      neighbours[key].push_back(o.neighbour_blurs);
      saturated[key] += o.saturated;
      bright_behind[key] += o.bright_behind;
      is_rim[key] = o.sample.source == ContourSample::Source::kCircle;
      mm_per_px[key].push_back((view.cam_from_world * o.sample.point_in_world).z() /
                               view.camera->intrinsics.fx_px);
    }
    classes[key] = g.edge_class;
  }
  for (auto& part : parts) part.bias_prior_px.clear(), part.bias_sigma_px.clear(), part.rim_mm_per_px.clear();
  for (const auto& [key, half] : lengths) {
    const double length = Median(half);
    auto& part = parts[static_cast<std::size_t>(key.first)];
    if (is_rim[key]) part.rim_mm_per_px[key.second] = Median(mm_per_px[key]);
    const auto of_class = static_cast<std::size_t>(classes[key]);
    const bool near = Median(neighbours[key]) < options.near_blurs;
    part.bias_px.insert({key.second, 0.0});
    const double own = options.bias_px[of_class] * (near ? options.near_factor : 1);
    const double blind = saturated[key] / static_cast<double>(half.size());
    const double before_bright =
        bright_behind[key] / static_cast<double>(half.size()) * options.bright_behind_bias_px;
    part.bias_prior_px[key.second] =
        std::hypot(std::hypot(own, before_bright), options.short_edge_bias / (length * length),
                   blind * options.saturated_bias_px);
  }
  for (auto& part : parts)
    std::erase_if(part.bias_px, [&](const auto& b) { return !part.bias_prior_px.contains(b.first); });
}

void Adjustment::UpdateWeights() {
  for (auto& group : groups) {
    std::vector<double> r;
    std::vector<double> sigmas;
    for (const auto& o : group.observations) r.push_back(o.residual_px), sigmas.push_back(o.sigma_px);
    const double median = Median(r);
    for (double& x : r) x = std::abs(x - median);
    // Larger than the observations' own sigmas say as far as the group is large enough to tell.
    const double n = static_cast<double>(r.size()), spread = 1.4826 * Median(r);
    const double own = Median(sigmas);
    const double scatter = std::max(
        std::sqrt((n * spread * spread + kScatterBelief * own * own) / (n + kScatterBelief)), kMinScatterPx);
    const double stretch = std::max(1.0, scatter / own);
    double sum = 0, weighted = 0;
    for (auto& o : group.observations) {
      const double sigma = std::max(stretch * o.sigma_px, kMinScatterPx);
      o.weight = TukeyWeight((o.residual_px - median) / sigma) / (sigma * sigma);
      sum += o.weight;
      weighted += o.weight * o.residual_px;
    }
    group.mean_px = sum > 0 ? weighted / sum : 0;
    group.sigma_mean_px = sum > 0 ? 1 / std::sqrt(sum) : 1e3;
    // By the same sigma as the group weighs with: judged by its class's, an edge in uneven light that lost
    // one picture to a pull is pulled farther, loses the next, and so goes away from round to round.
    const double s = std::max(systematic_px[static_cast<std::size_t>(group.edge_class)], group.systematic_px);
    group.weight = GroupWeight(group.mean_px / std::hypot(s, group.sigma_mean_px));
  }
}

void Adjustment::UpdateSystematics() {
  double unknowns = 0;
  for (const auto& p : parts) unknowns += static_cast<double>(std::count(p.free.begin(), p.free.end(), true));
  const double defaults[] = {options.free_systematic_px, options.contact_systematic_px,
                             options.round_systematic_px, options.limb_systematic_px,
                             options.shadowed_systematic_px};
  const double share = std::max(0.3, 1 - unknowns / std::max<double>(1, static_cast<double>(groups.size())));
  std::array<std::vector<SquaredMean>, kNumContourClasses> by_class;
  std::map<std::pair<int, int>, std::vector<SquaredMean>> by_contour;
  for (const auto& g : groups) {
    const SquaredMean mean(g.mean_px * g.mean_px, g.sigma_mean_px * g.sigma_mean_px);
    by_class[static_cast<std::size_t>(g.edge_class)].push_back(mean);
    by_contour[{g.part, g.BiasKey()}].push_back(mean);
  }
  for (std::size_t c = 0; c < by_class.size(); ++c)
    if (!by_class[c].empty())
      systematic_px[c] = Believed(SystematicOf(by_class[c], share), static_cast<double>(by_class[c].size()),
                                  defaults[c], kDefaultGroups);
  // A contour whose pictures disagree more than those of its class do is known worse.
  for (auto& g : groups) {
    const double of_class = systematic_px[static_cast<std::size_t>(g.edge_class)];
    const auto& means = by_contour[{g.part, g.BiasKey()}];
    const double own =
        Believed(SystematicOf(means, share), static_cast<double>(means.size()), of_class, kContourGroups);
    g.systematic_px = std::max(of_class, own);
    auto& part = parts[static_cast<std::size_t>(g.part)];
    const double least = means.size() == 1 ? options.single_view_bias_px : 0;
    part.bias_sigma_px[g.BiasKey()] =
        std::hypot(std::max(part.bias_prior_px[g.BiasKey()], least), kPulledAlike * g.systematic_px);
  }
}

void Adjustment::EstimatePriorScales() {
  if (!options.adjust_cameras) return;
  // The declared sigma counts as much as what two stops tell: a few corrections that happen to be small do
  // not make a rig precise.
  constexpr double kMinScale = 0.02, kMaxScale = 10, kBelief = 6;
  const auto scale_of = [&](double squares, double degrees) {
    return std::clamp(std::sqrt((squares + kBelief) / (degrees + kBelief)), kMinScale, kMaxScale);
  };
  ComputeCovariance();
  double sum = 0, redundancy = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (cameras[c].prior_from_calibration || cameras[c].loosened) continue;
    const MatrixXd w = cameras[c].prior_covariance.inverse();
    sum += cameras[c].value.dot(w * cameras[c].value);
    redundancy += static_cast<double>(cameras[c].value.size()) -
                  (w * CameraCovariance(static_cast<int>(c))).trace() / (camera_scale * camera_scale);
  }
  camera_scale = scale_of(sum, std::max(0.0, redundancy));
  sum = redundancy = 0;
  const double w = 1 / (options.stop_sigma_mm * options.stop_sigma_mm);
  for (std::size_t s = 0; s < stops.size(); ++s) {
    sum += w * stops[s].value.squaredNorm();
    redundancy += 3 - w * StopCovariance(static_cast<int>(s)).trace() / (stop_scale * stop_scale);
  }
  stop_scale = scale_of(sum, std::max(0.0, redundancy));
}

}  // namespace vss
