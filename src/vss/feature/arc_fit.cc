// Gauss-Newton on an arc's centre, axes, angle, levels and blur.
#include "vss/feature/arc_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <bit>
#include <limits>
#include <optional>

#include "vss/feature/arc_curve.h"
#include "vss/feature/ellipse_fit.h"
#include "vss/feature/normal_equations.h"
#include "vss/feature/strip_fit.h"
#include "vss/feature/strip_sums.h"
#include "vss/geometry/rigid_transform.h"

namespace vss {
namespace {

using Eigen::Vector2d;
using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

constexpr double kReachPx = 6;     // of the strip on either side, where no other edge lies
constexpr double kMarginPx = 2.5;  // an edge of usual blur has reached its levels at this distance
constexpr double kMaxScale = 2;    // px (ideal) of one as taken: a lens that stretches more has no use there
constexpr double kPixelVariance = 1.0 / 12;

// What the sectors of the strip about the contour leave between other edges; t towards the bright side.
constexpr int kSectors = kArcSectors;
int SectorOf(double around) { return std::min(kSectors - 1, static_cast<int>(around * (kSectors / 4.0))); }

class ArcFit {
 public:
  ArcFit(const Scene& s, const EllipticalArc& arc, ArcBuffers& b)
      : s_(s),
        b_(b),
        sign_(arc.bright_inside ? -1 : 1),
        curve_(EllipseOf(arc)),
        whole_(IsWholeEllipse(arc)),
        first_(curve_.ellipse.PointAt(arc.ideal_from_rad)),
        last_(curve_.ellipse.PointAt(arc.ideal_to_rad)) {
    Trim();
    blur_ = std::clamp(std::sqrt(arc.blur_px * arc.blur_px + kPixelVariance), 0.5, 2.5);
    ClipSectors(arc);
  }

  // Lets `arc` go on as far as edge points lie on its ellipse, over gaps of a sector; whether it grew.
  bool Extend(EllipticalArc& arc) const {
    const double from = AroundEllipse(std::cos(arc.ideal_from_rad), std::sin(arc.ideal_from_rad)),
                 to = AroundEllipse(std::cos(arc.ideal_to_rad), std::sin(arc.ideal_to_rad));
    const int before = Supported(SectorOf(from), -1), behind = Supported(SectorOf(to), +1);
    if (before + behind == 0) return false;
    const double covered = to - from > 0 ? to - from : to - from + 4;
    if (covered * (kSectors / 4.0) + before + behind >= kSectors - 1 - MaxGap()) {
      arc.ideal_from_rad = 0, arc.ideal_to_rad = 2 * kPi;
      return true;
    }
    if (before > 0) arc.ideal_from_rad = AngleAt(SectorOf(from) - before);
    if (behind > 0) arc.ideal_to_rad = AngleAt(SectorOf(to) + behind + 1);
    arc.ideal_from_rad -= 2 * kPi * std::floor(arc.ideal_from_rad / (2 * kPi));
    while (arc.ideal_to_rad <= arc.ideal_from_rad) arc.ideal_to_rad += 2 * kPi;
    while (arc.ideal_to_rad > arc.ideal_from_rad + 2 * kPi) arc.ideal_to_rad -= 2 * kPi;
    return true;
  }

  // Moves `arc` to its place; false where the fit fails, and `arc` is as it was.
  bool Apply(EllipticalArc& arc) {
    if (!Fit()) return false;
    Ellipse e = curve_.ellipse;
    if (!IsNear(arc, e)) return false;
    if (e.axes.x() < e.axes.y()) {
      std::swap(e.axes.x(), e.axes.y());
      e.angle_rad += kPi / 2;
      covariance_.row(2).swap(covariance_.row(3)), covariance_.col(2).swap(covariance_.col(3));
    }
    e.angle_rad = std::remainder(e.angle_rad, kPi);
    if (!whole_) {
      const double length = arc.ideal_to_rad - arc.ideal_from_rad;
      arc.ideal_from_rad = e.ParameterOf(first_), arc.ideal_to_rad = e.ParameterOf(last_);
      arc.ideal_from_rad -= 2 * kPi * std::floor(arc.ideal_from_rad / (2 * kPi));
      const double turns = std::round((arc.ideal_from_rad + length - arc.ideal_to_rad) / (2 * kPi));
      arc.ideal_to_rad += 2 * kPi * turns;
      if (!(arc.ideal_to_rad > arc.ideal_from_rad)) arc.ideal_to_rad += 2 * kPi;
    }
    arc.ideal_center = e.center, arc.ideal_axes = e.axes, arc.ideal_angle_rad = e.angle_rad;
    arc.covariance = covariance_;
    arc.contrast = model_.contrast[0],
    arc.blur_px = std::sqrt(std::max(0.0, double{model_.blur} * model_.blur - kPixelVariance));
    arc.rms_distance_px = rms_px_;
    arc.num_points = static_cast<int>(weight_ / (2 * kReachPx));
    return true;
  }

  // Whether the last fit left no more than noise, its levels being constant.
  bool Explained() const { return !linear_; }

 private:
  struct Window {
    double low, high;
  };

  // How many sectors may lie between edge points of one contour: chains step over a hole of one pixel.
  int MaxGap() const {
    constexpr double kGapPx = 3;
    const double sector_px = 2 * kPi * std::sqrt(0.5 * (curve_.a2 + curve_.b2)) / kSectors;
    return std::max(1, static_cast<int>(std::ceil(kGapPx / sector_px)));
  }

  // How many sectors beyond `k` in direction `step` have points on the contour.
  int Supported(int k, int step) const {
    const int max_gap = MaxGap();
    int reached = 0;
    for (int i = 1; i < kSectors; ++i) {
      if (on_[(k + step * i + kSectors) % kSectors])
        reached = i;
      else if (i > reached + max_gap)
        break;
    }
    return reached;
  }

  // The parameter's angle where sector k begins.
  static double AngleAt(int k) {
    const double a = (k + kSectors) % kSectors * (4.0 / kSectors), quarter = std::floor(a), f = a - quarter;
    return quarter * kPi / 2 + std::atan2(f, 1 - f);
  }

  // The fit stays near what the arc was before, as far as that is known: an arc that has grown knows little
  // of where it goes on.
  bool IsNear(const EllipticalArc& before, const Ellipse& e) const {
    constexpr double kMaxMovePx = 1, kSigmas = 3, kMostPx = 3, kMinContrastShare = 0.3, kMaxContrastShare = 3;
    if (!(e.axes.minCoeff() > 1) || !(model_.contrast[0] > kMinContrastShare * before.contrast) ||
        !(model_.contrast[0] < kMaxContrastShare * before.contrast))
      return false;
    const ArcCurve curve(EllipseOf(before));
    for (int i = 0; i < kSectors; ++i) {
      const Vector2d p = e.PointAt(2 * kPi * i / kSectors);
      const auto place = curve.At(p, kMostPx);
      if (!range_.Has(place.around)) continue;
      const double variance = place.by_ellipse.dot(before.covariance * place.by_ellipse);
      if (!(std::abs(place.distance) < std::clamp(kSigmas * std::sqrt(variance), kMaxMovePx, kMostPx)))
        return false;
    }
    return true;
  }

  // A part of the plane (ideal).
  struct Box {
    Vector2d low, high;
  };

  // Where the part of the contour lies that takes part, and what lies between it and the centre.
  Box SeenBox() const {
    const Ellipse& e = curve_.ellipse;
    if (whole_) return EllipseBox();
    constexpr int kPlaces = 24;
    const double from = e.ParameterOf(first_);
    double length = e.ParameterOf(last_) - from;
    if (length <= 0) length += 2 * kPi;
    Box box{e.center, e.center};
    for (int i = 0; i <= kPlaces; ++i) {
      const Vector2d p = e.PointAt(from + length * i / kPlaces);
      box.low = box.low.cwiseMin(p), box.high = box.high.cwiseMax(p);
    }
    const double beyond = e.axes.x() * (1 - std::cos(0.5 * length / kPlaces));  // of their chords
    return {box.low.array() - beyond, box.high.array() + beyond};
  }

  Box EllipseBox() const {
    const double c2 = curve_.cs * curve_.cs, s2 = curve_.sn * curve_.sn;
    const Vector2d reach(std::sqrt(curve_.a2 * c2 + curve_.b2 * s2),
                         std::sqrt(curve_.a2 * s2 + curve_.b2 * c2));
    return {curve_.ellipse.center - reach, curve_.ellipse.center + reach};
  }

  // Calls visit(u, first, last) for each row's pixels in the ring of the contour, as taken, where it lies in
  // `box`.
  template <class Visit>
  void ForRing(const Box& box, const Visit& visit) const {
    const Ellipse& e = curve_.ellipse;
    // A distorting lens moves the ring: rows and columns of the shifted places, with room for what the shift
    // changes.
    const double spare = s_.lens ? 3 : 1;
    const Vector2d shift = s_.lens ? Vector2d(s_.Img(e.center) - e.center) : Vector2d(0, 0);
    const double bend = s_.lens ? Bend(shift) : 0;
    const double grow = kReachPx + spare + bend;
    const Vector2d center = e.center + shift;
    const Vector2d low = (box.low + shift).array() - grow, high = (box.high + shift).array() + grow;
    const double width = s_.image.width, height = s_.image.height;
    const int u0 = int(std::floor(std::clamp(low.x(), 0.0, width))),
              v0 = int(std::floor(std::clamp(low.y(), 0.0, height))),
              u1 = int(std::ceil(std::clamp(high.x(), -1.0, width - 1))),
              v1 = int(std::ceil(std::clamp(high.y(), -1.0, height - 1)));
    const Ellipse outer{center, e.axes + Vector2d::Constant(grow), e.angle_rad},
        inner{center, e.axes - Vector2d::Constant(grow), e.angle_rad};
    for (int v = v0; v <= v1; v += row_step_) {
      const auto wide = Row(outer, v);
      if (!wide) continue;
      const int first = std::max(u0, int(std::ceil(wide->x()))),
                last = std::min(u1, int(std::floor(wide->y())));
      const auto hole = inner.axes.minCoeff() > 1 ? Row(inner, v) : std::nullopt;
      if (!hole) {
        visit(v, first, last);
        continue;
      }
      visit(v, first, std::min(last, int(std::ceil(hole->x()))));
      visit(v, std::max(first, std::max(int(std::floor(hole->y())), int(std::ceil(hole->x())) + 1)), last);
    }
  }

  // How far (px) the lens moves the contour beside the shift of its centre.
  double Bend(const Vector2d& shift) const {
    double most = 0;
    for (int i = 0; i < 16; ++i) {
      const Vector2d p = curve_.ellipse.PointAt(2 * kPi * i / 16);
      most = std::max(most, (s_.Img(p) - p - shift).norm());
    }
    return std::min(most, 50.0);
  }

  // Where row v crosses the ellipse, which is turned like the contour.
  std::optional<Vector2d> Row(const Ellipse& e, int v) const {
    const double cs = curve_.cs, sn = curve_.sn, ia = 1 / (e.axes.x() * e.axes.x()),
                 ib = 1 / (e.axes.y() * e.axes.y());
    const double y = v - e.center.y();
    const double qa = cs * cs * ia + sn * sn * ib, qb = cs * sn * (ia - ib) * y,
                 qc = (sn * sn * ia + cs * cs * ib) * y * y - 1;
    const double root = qb * qb - qa * qc;
    if (!(root > 0)) return std::nullopt;
    return Vector2d(e.center.x() + (-qb - std::sqrt(root)) / qa, e.center.x() + (-qb + std::sqrt(root)) / qa);
  }

  Vector2d Ideal(double u, double v) const { return s_.lens ? s_.b.grid.Ideal(u, v) : Vector2d(u, v); }

  // Px as taken for each px (ideal) across the contour.
  double Scale(int u, int v, const Vector2d& ideal, const Vector2d& normal) const {
    if (!s_.lens) return 1;
    const double by_u = normal.dot(s_.b.grid.Ideal(u + 1, v) - ideal),
                 by_v = normal.dot(s_.b.grid.Ideal(u, v + 1) - ideal);
    return 1 / std::max(1e-3, std::hypot(by_u, by_v));
  }

  // What the edge points in the ring tell: which sectors have some on the contour, and how far each is free.
  void ClipSectors(const EllipticalArc& arc) {
    for (auto& w : window_) w = {-kReachPx, kReachPx};
    constexpr double kMinShare = 0.2;               // of the contrast: what is weaker hardly moves a level
    constexpr double kOnPx = 1, kSameSide = 0.8;    // of a point on the contour; cosine to its normal
    const double own = std::max(1.5, 1.5 * blur_);  // px: nearer points are the contour's own
    const PointMap& map = s_.b.chains.map;
    ForRing(EllipseBox(), [&](int v, int first, int last) {
      for (int u = first; u <= last;) {
        const PointMap::Word& w = map.word[std::size_t(v) * map.words + (std::size_t(u) >> 6)];
        const std::uint64_t rest = w.all >> (u & 63);
        if (rest == 0) {
          u = (u | 63) + 1;
          continue;
        }
        u += std::countr_zero(rest);
        if (u > last) break;
        const EdgePoint& p = s_.b.points[w.first + CountBits(w.all & ((std::uint64_t{1} << (u & 63)) - 1))];
        ++u;
        if (ContrastOf(p) < kMinShare * arc.contrast) continue;
        const Vector2d ideal = Ideal(p.u, p.v);
        if (!ideal.allFinite()) continue;
        const auto place = curve_.At(ideal, 0);
        const double t = sign_ * place.distance;
        const int middle = SectorOf(place.around);
        if (std::abs(t) < kOnPx && sign_ * place.normal.dot(Vector2d(p.nu, p.nv)) > kSameSide)
          on_[middle] = true;
        if (std::abs(t) < own || std::abs(t) > kReachPx + kMarginPx) continue;
        for (const int k : {middle + kSectors - 1, middle, middle + 1}) {
          Window& window = window_[k % kSectors];
          if (t > 0)
            window.high = std::min(window.high, std::max(t - kMarginPx, 0.0));
          else
            window.low = std::max(window.low, std::min(t + kMarginPx, 0.0));
        }
      }
    });
    const double side = 1.5 * blur_;  // a side that is shorter cannot show its level
    for (auto& w : window_)
      if (w.high < side || w.low > -side) w = {1, -1};
  }

  // The strip's pixels at the ellipse as it stands.
  void TakePixels() {
    constexpr double kFlatBlurs = 4;  // farther from the contour the edge's profile is flat
    const auto sloped = static_cast<float>(kFlatBlurs * std::max(blur_, double{model_.blur}));
    const Ellipse& e = curve_.ellipse;
    const ArcShape shape{static_cast<float>(curve_.cs), static_cast<float>(curve_.sn),
                         static_cast<float>(e.axes.x()), static_cast<float>(e.axes.y())};
    const ArcWindows windows = Windows();
    b_.Clear();
    ArcPlaces places;
    alignas(64) float du[kStripLanes], dv[kStripLanes], scale[kStripLanes];
    std::fill_n(scale, kStripLanes, static_cast<float>(sign_));
    ForRing(SeenBox(), [&](int v, int first, int last) {
      for (int u = first; u <= last; u += kStripLanes) {
        const int lanes = std::min(kStripLanes, last - u + 1);
        PlaceFromCenter(u, v, lanes, du, dv);
        PlaceOnArc(du, dv, shape, sloped, s_.b.edges.simd, places);
        if (s_.lens) FillScale(u, v, lanes, du, dv, places, scale);
        TakeLot(u, v, lanes, du, dv, places, scale, windows);
      }
    });
  }

  // From the ellipse's centre (ideal); the lanes that are left lie nowhere.
  void PlaceFromCenter(int u, int v, int lanes, float* du, float* dv) const {
    const Vector2d& c = curve_.ellipse.center;
    const auto u0 = static_cast<float>(u - c.x()), v0 = static_cast<float>(v - c.y());
    for (int i = 0; i < kStripLanes; ++i) du[i] = u0 + static_cast<float>(i), dv[i] = v0;
    for (int i = 0; s_.lens && i < lanes; ++i) {
      const Vector2d d = s_.b.grid.Ideal(u + i, v) - c;
      du[i] = static_cast<float>(d.x()), dv[i] = static_cast<float>(d.y());
    }
    for (int i = lanes; i < kStripLanes; ++i) du[i] = std::numeric_limits<float>::quiet_NaN();
  }

  void FillScale(int u, int v, int lanes, const float* du, const float* dv, const ArcPlaces& places,
                 float* scale) const {
    for (int i = 0; i < lanes; ++i) {
      if (!(std::abs(places.distance[i]) <= kMaxScale * kReachPx)) continue;
      const Vector2d ideal = curve_.ellipse.center + Vector2d(du[i], dv[i]);
      scale[i] = static_cast<float>(sign_ * Scale(u + i, v, ideal, {places.normal_u[i], places.normal_v[i]}));
    }
  }

  // What of the pixels lies in its sector's window.
  void TakeLot(int u, int v, int lanes, const float* du, const float* dv, const ArcPlaces& places,
               const float* scale, const ArcWindows& windows) {
    b_.Grow();
    const std::size_t n = b_.size;
    const int kept = KeepOnArc(places, scale, windows, s_.b.edges.simd,
                               {&b_.t[n],
                                {&b_.by[0][n], &b_.by[1][n], &b_.by[2][n], &b_.by[3][n], &b_.by[4][n]},
                                &b_.bend[n],
                                &b_.weight[n],
                                &b_.sector[n]});
    if (kept == 0) return;
    const auto size = static_cast<float>(1 / curve_.ellipse.axes.x());
    for (int i = 0; i < kStripLanes; ++i) {
      const bool there = i < lanes;
      b_.u[n + i] = there ? du[i] * size : 0.0f, b_.v[n + i] = there ? dv[i] * size : 0.0f;
      b_.grey[n + i] = there ? static_cast<float>(s_.image.At(u + i, v)) : 0.0f;
    }
    b_.size += kStripLanes, b_.count += std::size_t(kept);
  }

  // What takes part, in the numbers of the sums.
  ArcWindows Windows() const {
    constexpr float kAll = 5;  // more than AroundEllipse goes round
    ArcWindows w;
    w.from = static_cast<float>(range_.from), w.length = range_.whole ? kAll : float(range_.length);
    w.reach = static_cast<float>(kReachPx);
    for (int k = 0; k < kSectors; ++k) {
      w.low[k] = dropped_[k] ? 1.0f : static_cast<float>(window_[k].low);
      w.high[k] = dropped_[k] ? -1.0f : static_cast<float>(window_[k].high);
    }
    return w;
  }

  void StartModel() {
    double dark = 0, bright = 0, num_dark = 0, num_bright = 0;
    for (std::size_t i = 0; i < b_.size; ++i) {
      if (b_.t[i] > blur_)
        bright += b_.grey[i], ++num_bright;
      else if (b_.t[i] < -blur_)
        dark += b_.grey[i], ++num_dark;
    }
    model_ = {};
    model_.level[0] = static_cast<float>(dark / std::max(1.0, num_dark));
    model_.contrast[0] = static_cast<float>(bright / std::max(1.0, num_bright)) - model_.level[0];
    model_.blur = static_cast<float>(blur_);
  }

  ArcSamples Samples() {
    return {b_.t.data(),
            {b_.by[0].data(), b_.by[1].data(), b_.by[2].data(), b_.by[3].data(), b_.by[4].data()},
            b_.bend.data(),
            b_.u.data(),
            b_.v.data(),
            b_.grey.data(),
            b_.weight.data(),
            b_.residual.data(),
            b_.by_place.data(),
            b_.size,
            static_cast<float>(s_.image.MaxValue())};
  }

  template <bool kLinear>
  bool Step() {
    constexpr int P = NumArcParameters<kLinear>();
    StripSums<P> sums;
    AccumulateArc<kLinear>(Samples(), model_, s_.b.edges.simd, sums);
    Eigen::Matrix<double, P, P> h;
    Eigen::Matrix<double, P, 1> g;
    for (int i = 0; i < P; ++i) {
      g[i] = sums.g[i];
      for (int j = 0; j < P; ++j) h(i, j) = sums.h[i][j];
      h(i, i) *= 1 + 1e-9;
    }
    residual2_ = sums.residual2, weight_ = sums.weight;
    const Cholesky<P> solver(h);
    if (!solver.ok()) return false;
    const Eigen::Matrix<double, P, 1> step = solver.Solve(g);
    if (!step.allFinite()) return false;
    information_ =
        h.template topLeftCorner<5, 5>() -
        h.template topRightCorner<5, P - 5>() * h.template bottomRightCorner<P - 5, P - 5>().ldlt().solve(
                                                    h.template bottomLeftCorner<P - 5, 5>());
    // A short arc hardly tells its axes: no step goes farther than the derivatives hold.
    constexpr double kMaxShare = 0.15;
    const double share = kMaxShare * curve_.ellipse.axes.y() /
                         std::max(1e-9, step.template head<4>().cwiseAbs().maxCoeff() +
                                            std::abs(step[4]) * curve_.ellipse.axes.x());
    for (int i = 0; i < 5; ++i) model_.moved[i] += static_cast<float>(std::min(1.0, share) * step[i]);
    model_.level[0] += static_cast<float>(step[5]), model_.contrast[0] += static_cast<float>(step[6]);
    model_.blur = std::clamp(model_.blur + static_cast<float>(std::clamp(step[7], -0.3, 0.3)), 0.3f, 5.0f);
    if constexpr (kLinear)
      for (int i = 0; i < 2; ++i)
        model_.level[1 + i] += static_cast<float>(step[8 + i]),
            model_.contrast[1 + i] += static_cast<float>(step[10 + i]);
    return true;
  }

  bool AnyStep() { return linear_ ? Step<true>() : Step<false>(); }

  // The ends of an arc are corners, and not sure: their surroundings do not take part.
  void Trim() {
    constexpr double kEndPx = 2;
    range_ = whole_ ? ArcRange{true, 0, 4} : ArcRangeBetween(curve_.ellipse, first_, last_, kEndPx);
  }

  // The ellipse takes up what the steps moved.
  bool Take() {
    Ellipse e = curve_.ellipse;
    e.center += Vector2d(model_.moved[0], model_.moved[1]),
        e.axes += Vector2d(model_.moved[2], model_.moved[3]);
    e.angle_rad += model_.moved[4];
    std::fill(std::begin(model_.moved), std::end(model_.moved), 0.0f);
    if (!(e.axes.minCoeff() > 1) || !e.center.allFinite() || !std::isfinite(e.angle_rad) ||
        !(e.axes.maxCoeff() < 4 * curve_.ellipse.axes.maxCoeff()))
      return false;
    curve_ = ArcCurve(e);
    Trim();
    return true;
  }
  bool Move() {
    if (!Take()) return false;
    TakePixels();
    return b_.count >= kMinPixels;
  }

  // Sectors whose own place lies off the ellipse (something is in front of it) count no more; how the rest
  // scatter.
  bool DropSectors() {
    const double sigma = Sigma();
    constexpr double kSigmas = 4;
    double numerator[kSectors] = {}, denominator[kSectors] = {};
    for (std::size_t i = 0; i < b_.size; ++i) {
      numerator[b_.sector[i]] += double{b_.by_place[i]} * b_.residual[i];
      denominator[b_.sector[i]] += double{b_.by_place[i]} * b_.by_place[i];
    }
    bool any = false;
    double squares = 0, rms = 0;
    b_.sorted.clear();
    for (int k = 0; k < kSectors; ++k)
      if (denominator[k] > 0)
        b_.sorted.push_back(static_cast<float>(std::abs(numerator[k]) / std::sqrt(denominator[k])));
    if (b_.sorted.size() < 6) return false;
    const auto middle = b_.sorted.begin() + std::ptrdiff_t(b_.sorted.size() / 2);
    std::nth_element(b_.sorted.begin(), middle, b_.sorted.end());
    const double limit = kSigmas * std::max(sigma, 1.4826 * *middle);
    int kept = 0;
    for (int k = 0; k < kSectors; ++k) {
      if (!(denominator[k] > 0)) continue;
      const double z = numerator[k] / std::sqrt(denominator[k]);
      if (std::abs(z) > limit) {
        dropped_[k] = any = true;
        continue;
      }
      ++kept, squares += z * z, rms += numerator[k] * numerator[k] / (denominator[k] * denominator[k]);
    }
    // Texture makes a sector's pixels err together.
    correlation_ = kept > 6 ? std::max(1.0, squares / (sigma * sigma) / (kept - 5)) : 1.0;
    rms_px_ = std::sqrt(rms / std::max(1, kept));
    return any;
  }

  double Sigma() const {
    return std::sqrt(std::max(residual2_ / std::max(1.0, weight_ - (linear_ ? 12 : 8)), kPixelVariance));
  }

  // How far (px) the steps since the pixels were taken moved the contour where it is seen: no more than this.
  double Moved() const {
    const auto& m = model_.moved;
    return std::hypot(m[0], m[1]) + std::max(std::abs(m[2]), std::abs(m[3])) +
           std::abs(m[4]) * (curve_.ellipse.axes.x() - curve_.ellipse.axes.y());
  }

  // Every so many rows come near enough: so many pixels know the place better than kNear.
  int RoughStep() const {
    constexpr double kEnoughPixels = 1024;
    const double pixels = 2 * kPi * std::sqrt(0.5 * (curve_.a2 + curve_.b2)) * 2 * kReachPx;
    return std::clamp(static_cast<int>(pixels / kEnoughPixels), 2, 4);
  }

  bool Fit() {
    constexpr double kNear = 0.3;  // px: so small a move leaves the derivatives as they are
    constexpr int kRounds = 6;
    row_step_ = RoughStep();
    TakePixels();
    if (b_.count < kMinPixels) return false;
    StartModel();
    if (!(model_.contrast[0] > 0)) return false;
    for (int i = 0; i < kRounds; ++i) {
      if (!Step<false>() || !Step<false>()) return false;
      const bool near = Moved() < kNear;
      if (near || i + 1 == kRounds) row_step_ = 1;
      if (!Move()) return false;
      if (near) break;
    }
    if (!Step<false>()) return false;
    const Vector2d& c = curve_.ellipse.center;
    const double noise = s_.b.noise.At(std::clamp(int(c.x()), 0, s_.image.width - 1),
                                       std::clamp(int(c.y()), 0, s_.image.height - 1));
    linear_ = Sigma() > kExplainedShare * noise;
    if (!AnyStep()) return false;
    if (DropSectors() && (!Move() || !AnyStep())) return false;
    DropSectors();
    covariance_ = information_.ldlt().solve(Matrix5d::Identity()) * (std::pow(Sigma(), 2) * correlation_);
    return Take() && covariance_.allFinite() && model_.blur < 4.9f;
  }

  static constexpr std::size_t kMinPixels = 60;

  const Scene& s_;
  ArcBuffers& b_;
  double sign_;  // of the bright side, outward
  ArcCurve curve_;
  bool whole_;
  Vector2d first_, last_;  // the arc's ends
  ArcRange range_{};
  double blur_;
  int row_step_ = 1;  // of the rows that ForRing visits
  bool linear_ = false;
  Window window_[kSectors];
  bool dropped_[kSectors] = {}, on_[kSectors] = {};
  ArcModel model_{};
  Matrix5d information_ = Matrix5d::Zero(), covariance_ = Matrix5d::Zero();
  double residual2_ = 0, weight_ = 0, correlation_ = 1, rms_px_ = 0;
};

}  // namespace

bool ExtendArc(const Scene& s, EllipticalArc& arc) { return ArcFit(s, arc, s.b.arc_fit).Extend(arc); }

ArcMove MoveArc(const Scene& s, EllipticalArc& arc) {
  ArcFit fit(s, arc, s.b.arc_fit);
  const bool moved = fit.Apply(arc);
  return {moved, moved && fit.Explained()};
}

}  // namespace vss
