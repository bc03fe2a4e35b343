#include "vss/reconstruct/edge_profile.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace vss {
namespace {

using Eigen::Vector2d;

constexpr int kMaxUnknowns =
    4 + 2 * (1 + kMaxNeighbours);        // base, blur, two slopes; a contrast and an offset a step
constexpr int kMinPixels = 12;           // fewer cannot tell a step from noise
constexpr double kNeighbourPrior = 0.5;  // px: how far a neighbour may move against the edge itself
constexpr double kScanStep = 0.4;        // of the blur: Gauss-Newton converges from there
constexpr double kMinSignificance = 5;   // a contrast below that many of its sigmas is no edge
constexpr double kMaxSaturated = 0.25;  // share of pixels at the sensor's limit: left out, the rest tells all
constexpr double kMaxBlind = 0.75;      // and where the bright side is there as a whole
constexpr double kBrighterAtFirst = 1.5;
constexpr double kBrighterSigma = 2;  // how much brighter than the limit that may be, of the step seen

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxUnknowns, 1>;

// Phi and its density from a table: the fit calls them for every pixel of every strip.
struct NormalTable {
  static constexpr double kLimit = 5;
  static constexpr int kPerUnit = 256;
  std::array<double, 2 * static_cast<int>(kLimit) * kPerUnit + 2> phi{}, density{};
  NormalTable() {
    for (std::size_t i = 0; i < phi.size(); ++i) {
      const double x = static_cast<double>(i) / kPerUnit - kLimit;
      phi[i] = 0.5 * std::erfc(-x / std::sqrt(2.0));
      density[i] = std::exp(-x * x / 2) / std::sqrt(2 * 3.14159265358979323846);
    }
  }
  static const NormalTable& Get() {
    static const NormalTable table;
    return table;
  }
  double Look(const decltype(phi)& values, double x, double below, double above) const {
    if (!(x > -kLimit)) return below;  // not a number, too
    if (x >= kLimit) return above;
    const double at = (x + kLimit) * kPerUnit;
    const auto i = static_cast<std::size_t>(at);
    const double f = at - static_cast<double>(i);
    return values[i] + f * (values[i + 1] - values[i]);
  }
  double Phi(double x) const { return Look(phi, x, 0, 1); }
  double Density(double x) const { return Look(density, x, 0, 0); }
};

struct Strip {
  int steps = 1;
  std::size_t num_clear = 0;  // those after them are at the limit
  std::vector<double> grey;
  std::vector<std::array<double, 1 + kMaxNeighbours>> distance;
};

// The pixels of the strip; false where it leaves the picture by much or most of it is saturated.
bool Gather(const GreyView& image, const ProfileRequest& r, Strip& strip) {
  const Vector2d& c = r.curve.point;
  const Vector2d& n = r.curve.normal;
  const Vector2d t(-n.y(), n.x());
  const double reach = std::max(r.reach_minus_px, r.reach_plus_px);
  const double ru = std::abs(t.x()) * r.half_length_px + std::abs(n.x()) * reach;
  const double rv = std::abs(t.y()) * r.half_length_px + std::abs(n.y()) * reach;
  const int u0 = std::max(0, static_cast<int>(std::ceil(c.x() - ru)));
  const int u1 = std::min(image.width - 1, static_cast<int>(std::floor(c.x() + ru)));
  const int v0 = std::max(0, static_cast<int>(std::ceil(c.y() - rv)));
  const int v1 = std::min(image.height - 1, static_cast<int>(std::floor(c.y() + rv)));
  const int limit = static_cast<int>(image.MaxValue());
  std::vector<double> blind;  // distances of saturated pixels
  strip.grey.clear();
  strip.distance.clear();
  strip.steps = 1 + static_cast<int>(r.neighbours.size());
  for (int v = v0; v <= v1; ++v) {
    for (int u = u0; u <= u1; ++u) {
      const Vector2d p(u, v);
      if (std::abs((p - c).dot(t)) > r.half_length_px) continue;
      const double d = r.curve.Distance(p);
      if (d < -r.reach_minus_px || d > r.reach_plus_px) continue;
      const int g = image.At(u, v);
      if (g >= limit) {
        blind.push_back(d);
        continue;
      }
      strip.grey.push_back(g);
      strip.distance.push_back({d});
      for (std::size_t j = 0; j < r.neighbours.size(); ++j)
        strip.distance.back()[j + 1] = r.neighbours[j].Distance(p);
    }
  }
  strip.num_clear = strip.grey.size();
  const auto count = static_cast<int>(strip.grey.size());
  const double saturated = static_cast<double>(blind.size()), all = count + saturated;
  if (count < kMinPixels + 2 * strip.steps) return false;
  if (saturated <= kMaxSaturated * all) return true;
  if (saturated > kMaxBlind * all || strip.steps > 1) return false;
  for (double d : blind) {
    strip.grey.push_back(limit);
    strip.distance.push_back({d});
  }
  return true;
}

// Unknowns: base, contrast_0.., offset_0.., blur, slopes on the minus and the plus side of the edge itself.
struct Model {
  int steps;
  Vector x;
  int size() const { return 4 + 2 * steps; }
  double slope(int side) const { return x[2 + 2 * steps + side]; }
  double& base() { return x[0]; }
  double contrast(int j) const { return x[1 + j]; }
  double& contrast(int j) { return x[1 + j]; }
  double offset(int j) const { return x[1 + steps + j]; }
  double& offset(int j) { return x[1 + steps + j]; }
  double blur() const { return x[1 + 2 * steps]; }
  double& blur() { return x[1 + 2 * steps]; }
};

// Best base and contrasts with every step moved by `offset`; returns the sum of squares.
double LinearFit(const Strip& strip, double offset, double blur, Model& model) {
  const auto& table = NormalTable::Get();
  const int n = 1 + strip.steps;
  Matrix h = Matrix::Zero(n, n);
  Vector g = Vector::Zero(n), row(n);
  double sum = 0;
  for (std::size_t i = 0; i < strip.grey.size(); ++i) {
    row[0] = 1;
    for (int j = 0; j < strip.steps; ++j)
      row[1 + j] = table.Phi((strip.distance[i][static_cast<std::size_t>(j)] - offset) / blur);
    for (int a = 0; a < n; ++a) {
      g[a] += row[a] * strip.grey[i];
      for (int b = 0; b <= a; ++b) h(a, b) += row[a] * row[b];
    }
    sum += strip.grey[i] * strip.grey[i];
  }
  constexpr double kRidge = 1e-3;  // of a pixel's weight: a step outside the strip stays zero
  for (int a = 1; a < n; ++a) h(a, a) += kRidge;
  const Vector solution = h.selfadjointView<Eigen::Lower>().llt().solve(g);
  model.base() = solution[0];
  for (int j = 0; j < strip.steps; ++j) {
    model.contrast(j) = solution[1 + j];
    model.offset(j) = offset;
  }
  model.blur() = blur;
  return sum - solution.dot(g);
}

struct Normal {
  Matrix h;
  Vector g;
  double sum_squares = 0;  // of the pixels alone
};

// Of the first `count` pixels.
Normal Linearise(const Strip& strip, const Model& m, std::size_t count) {
  const auto& table = NormalTable::Get();
  const int n = m.size();
  Normal out{Matrix::Zero(n, n), Vector::Zero(n), 0};
  Vector row(n);
  const double blur = m.blur();
  for (std::size_t i = 0; i < count; ++i) {
    double value = m.x[0], by_blur = 0;
    row[0] = 1;
    for (int j = 0; j < m.steps; ++j) {
      const double z = (strip.distance[i][static_cast<std::size_t>(j)] - m.offset(j)) / blur;
      const double phi = table.Phi(z), slope = m.contrast(j) * table.Density(z) / blur;
      value += m.contrast(j) * phi;
      row[1 + j] = phi;
      row[1 + m.steps + j] = -slope;
      by_blur -= slope * z;
      if (j > 0) continue;
      const double d = z * blur;
      value += d * (m.slope(0) * (1 - phi) + m.slope(1) * phi);
      row[2 + 2 * m.steps] = d * (1 - phi);
      row[3 + 2 * m.steps] = d * phi;
      row[1 + m.steps] -=
          m.slope(0) * (1 - phi) + m.slope(1) * phi + (m.slope(1) - m.slope(0)) * z * table.Density(z);
    }
    row[1 + 2 * m.steps] = by_blur;
    // A saturated pixel says no more than that the light there reaches the limit (Tobin 1958).
    if (i >= strip.num_clear && value >= strip.grey[i]) continue;
    const double r = strip.grey[i] - value;
    out.sum_squares += r * r;
    for (int a = 0; a < n; ++a) {
      out.g[a] += row[a] * r;
      for (int b = 0; b <= a; ++b) out.h(a, b) += row[a] * row[b];
    }
  }
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < a; ++b) out.h(b, a) = out.h(a, b);
  return out;
}

// Prior knowledge as observations of variance in units of the pixel variance `var`.
// `clipped`: of a saturated strip the step as the sensor shows it; 0: of others.
void AddPriors(const ProfileRequest& r, const Model& m, double var, double clipped, Normal& normal) {
  if (clipped != 0) {
    const double w = var / std::pow(kBrighterSigma * clipped, 2);
    normal.h(1, 1) += w;
    normal.g[1] += w * (clipped - m.contrast(0));
  }
  const int blur = 1 + 2 * m.steps, first = 1 + m.steps;
  const double wb = var / (r.blur_sigma_px * r.blur_sigma_px);
  normal.h(blur, blur) += wb;
  normal.g[blur] += wb * (r.blur_px - m.blur());
  const double steepest = std::max(r.slope_sigma * std::abs(m.contrast(0)), 1e-3);
  for (int side = 0; side < 2; ++side) {
    const int i = 2 + 2 * m.steps + side;
    normal.h(i, i) += var / (steepest * steepest);
    normal.g[i] -= var / (steepest * steepest) * m.slope(side);
  }
  const double wn = var / (kNeighbourPrior * kNeighbourPrior);
  for (int j = 1; j < m.steps; ++j) {
    const double gap = m.offset(0) - m.offset(j);
    normal.h(first + j, first + j) += wn;
    normal.h(first, first) += wn;
    normal.h(first, first + j) -= wn;
    normal.h(first + j, first) -= wn;
    normal.g[first + j] += wn * gap;
    normal.g[first] -= wn * gap;
    normal.h(1 + j, 1 + j) += 1e-3;  // as LinearFit's ridge
  }
}

}  // namespace

std::optional<ProfileFit> FitProfile(const GreyView& image, const ProfileRequest& r, double noise) {
  thread_local Strip strip;
  if (!Gather(image, r, strip)) return std::nullopt;
  const auto count = static_cast<double>(strip.num_clear);
  const bool blind = strip.num_clear < strip.grey.size();
  Model model{strip.steps, Vector::Zero(4 + 2 * strip.steps)}, trial = model;
  double best = INFINITY;
  const int scan = static_cast<int>(std::ceil(r.search_px / (kScanStep * r.blur_px)));
  for (int k = -scan; k <= scan; ++k) {
    const double sum = LinearFit(strip, scan > 0 ? r.search_px * k / scan : 0, r.blur_px, trial);
    if (sum < best) best = sum, model = trial;
  }
  const double redundancy = std::max(1.0, count - model.size());
  if (!std::isfinite(best)) return std::nullopt;
  double var = std::max(best / redundancy, noise * noise);
  const double clipped = blind ? model.contrast(0) : 0;
  if (blind) model.contrast(0) *= kBrighterAtFirst;
  constexpr int kIterations = 8;
  Normal normal;
  for (int it = 0; it < kIterations; ++it) {
    normal = Linearise(strip, model, strip.grey.size());
    var = std::max({normal.sum_squares / redundancy, noise * noise, 1e-6});
    AddPriors(r, model, var, clipped, normal);
    Vector step = normal.h.ldlt().solve(normal.g);
    if (!step.allFinite()) return std::nullopt;
    for (int j = 0; j < model.steps; ++j) {
      double& move = step[1 + model.steps + j];
      move = std::clamp(move, -r.blur_px, r.blur_px);
    }
    model.x += step;
    if (!model.x.allFinite()) return std::nullopt;
    model.blur() = std::clamp(model.blur(), 0.4 * r.blur_px, 2.5 * r.blur_px);
    if (std::abs(step[1 + model.steps]) < 1e-3) break;
    if (std::abs(model.offset(0)) > r.search_px + r.blur_px) return std::nullopt;
  }
  // Pixels that just reach the limit must not seem to say that it is no brighter there.
  if (blind) {
    normal = Linearise(strip, model, strip.num_clear);
    AddPriors(r, model, var, clipped, normal);
  }
  const Matrix covariance = normal.h.ldlt().solve(Matrix::Identity(model.size(), model.size())) * var;
  ProfileFit fit;
  fit.offset_px = model.offset(0);
  fit.sigma_px = std::sqrt(std::max(covariance(1 + model.steps, 1 + model.steps), 0.0));
  fit.contrast = model.contrast(0);
  fit.blur_px = model.blur();
  for (int side = 0; side < 2; ++side) {
    // Without what was known beforehand.
    const int i = 2 + 2 * model.steps + side;
    const double prior = r.slope_sigma * std::abs(fit.contrast), variance = covariance(i, i);
    const double information = std::max(1 / variance - 1 / (prior * prior), 1e-9 / variance);
    fit.slope[std::size_t(side)] = model.slope(side) / (variance * information) / std::abs(fit.contrast);
    fit.slope_sigma[std::size_t(side)] = 1 / std::sqrt(information) / std::abs(fit.contrast);
  }
  fit.rms = std::sqrt(normal.sum_squares / redundancy);
  fit.num_pixels = static_cast<int>(count);
  fit.saturated = blind;
  const double sigma_contrast = std::sqrt(std::max(covariance(1, 1), 0.0));
  const bool is_step =
      blind ? std::abs(clipped) > kMinSignificance * std::sqrt(var) && fit.contrast * clipped > 0
            : std::abs(fit.contrast) > kMinSignificance * sigma_contrast;
  if (!(std::abs(fit.offset_px) <= r.search_px) || !is_step) return std::nullopt;
  return fit;
}

}  // namespace vss
