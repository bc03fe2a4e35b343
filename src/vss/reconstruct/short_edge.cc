#include "vss/reconstruct/short_edge.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace vss {
namespace {

using Eigen::AlignedBox2d;
using Eigen::AlignedBox2i;
using Eigen::ArrayXd;
using Eigen::ArrayXXd;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector2i;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kWindowBlurs = 2.5;    // around the edge: farther off it tells nothing of its place
constexpr double kSupportBlurs = 3;     // of what a pixel gathers
constexpr double kOthersSigmaPx = 0.3;  // how far the contours around may be off where they are predicted
constexpr double kFarthestPx = 1;       // beyond that the first order says nothing
constexpr double kMinSignificance = 5;  // a contrast below that many of its sigmas is no edge
constexpr double kBesidePx = 0.35;      // what lies on either side of a contour is asked there
constexpr double kGreySigma = 2;        // of a face: so many times the window's own scatter around its mean
constexpr int kMinRedundancy = 10;
// What the model leaves of the window beyond noise (a shadow's border, texture) pulls the edge as far as that
// grey is of the step's slope, and twice that: so it did in rendered pictures, starting from the truth.
constexpr double kMisfitPull = 2;

double Phi(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// Sixteen places in a pixel, no two in one row or column.
constexpr int kPerPixel = 16;
Vector2d InPixel(int i) {
  return {(i + 0.5) / kPerPixel - 0.5, ((i * 7) % kPerPixel + 0.5) / kPerPixel - 0.5};
}

// The faces seen along rays around a place in the picture: the lens is affine over so few pixels.
class FacesNear {
 public:
  FacesNear(const FacesSeen& faces, const View& view, const Vector2d& middle, double reach_px)
      : middle_(middle) {
    const auto& k = view.camera->intrinsics;
    Eigen::Matrix2d jacobian;
    const auto normalized = k.NormalizedFromImg(middle);
    if (!normalized || !k.ImgFromNormalized(*normalized, &jacobian)) return;
    normalized_ = *normalized;
    by_img_ = jacobian.inverse();
    AlignedBox2d box;
    for (const double x : {-reach_px, reach_px})
      for (const double y : {-reach_px, reach_px}) box.extend(Normalized(middle + Vector2d(x, y)));
    triangles_ = faces.In(box);
    is_valid_ = true;
  }
  bool IsValid() const { return is_valid_; }
  int At(const Vector2d& img) const { return FacesSeen::First(triangles_, Normalized(img)); }

 private:
  Vector2d Normalized(const Vector2d& img) const { return normalized_ + by_img_ * (img - middle_); }

  Vector2d middle_, normalized_ = Vector2d::Zero();
  Eigen::Matrix2d by_img_ = Eigen::Matrix2d::Identity();
  std::vector<FacesSeen::Triangle> triangles_;
  bool is_valid_ = false;
};

// What each pixel of a window gathers of each face, under the blur: rows along v, columns along u.
struct FaceAreas {
  std::vector<int> faces;
  std::vector<ArrayXXd> areas;
  std::size_t IndexOf(int face) const {
    return static_cast<std::size_t>(std::find(faces.begin(), faces.end(), face) - faces.begin());
  }
};

int PadOf(double blur_px) { return static_cast<int>(std::ceil(kSupportBlurs * blur_px)); }

FaceAreas AreasIn(const AlignedBox2i& window, const FacesNear& near, double blur_px) {
  const int pad = PadOf(blur_px);
  const Vector2i size = window.sizes() + Vector2i::Ones();
  const int rows = size.y() + 2 * pad, columns = size.x() + 2 * pad;
  const Vector2d origin = (window.min() - Vector2i::Constant(pad)).cast<double>();
  FaceAreas out;
  const auto add = [&](int face, int v, int u, double area) {
    const std::size_t at = out.IndexOf(face);
    if (at == out.faces.size()) {
      out.faces.push_back(face);
      out.areas.emplace_back(ArrayXXd::Zero(rows, columns));
    }
    out.areas[at](v, u) += area;
  };
  Eigen::ArrayXXi corner(rows + 1, columns + 1);
  for (int v = 0; v <= rows; ++v)
    for (int u = 0; u <= columns; ++u) corner(v, u) = near.At(origin + Vector2d(u - 0.5, v - 0.5));
  for (int v = 0; v < rows; ++v)
    for (int u = 0; u < columns; ++u) {
      const int face = near.At(origin + Vector2d(u, v));
      if ((corner.block<2, 2>(v, u) == face).all()) {
        add(face, v, u, 1);
        continue;
      }
      for (int i = 0; i < kPerPixel; ++i)
        add(near.At(origin + Vector2d(u, v) + InPixel(i)), v, u, 1.0 / kPerPixel);
    }
  // The blur holds the pixel's own width.
  constexpr double kPixelVariance = 1 / 12.0, kLeastVariance = 0.01;
  const double variance = std::max(blur_px * blur_px - kPixelVariance, kLeastVariance);
  ArrayXd kernel(2 * pad + 1);
  for (int k = -pad; k <= pad; ++k) kernel[k + pad] = std::exp(-k * k / (2 * variance));
  kernel /= kernel.sum();
  for (auto& area : out.areas) {
    ArrayXXd across = ArrayXXd::Zero(rows, size.x()), blurred = ArrayXXd::Zero(size.y(), size.x());
    for (int k = 0; k <= 2 * pad; ++k) across += kernel[k] * area.middleCols(k, size.x());
    for (int k = 0; k <= 2 * pad; ++k) blurred += kernel[k] * across.middleRows(k, size.y());
    area = std::move(blurred);
  }
  return out;
}

bool IsInWindow(const ShortEdge& edge, double blur_px, const Vector2d& p) {
  const auto& c = edge.piece.curve;
  const Vector2d q = p - c.point, t(c.normal.y(), -c.normal.x());
  return std::abs(q.dot(c.normal)) <= kWindowBlurs * blur_px &&
         std::abs(q.dot(t)) <= edge.piece.half_length_px + kWindowBlurs * blur_px;
}

// What a pixel sees of a straight piece of contour, per px that it moves along its normal.
double LengthSeen(const ProfileCurve& c, double half_length_px, double blur_px, const Vector2d& p) {
  const Vector2d q = p - c.point;
  const double d = q.dot(c.normal) / blur_px, s = q.x() * c.normal.y() - q.y() * c.normal.x();
  constexpr double kFar = 5;
  if (std::abs(d) > kFar) return 0;
  const double across = std::exp(-d * d / 2) / (blur_px * std::sqrt(2 * kPi));
  return across * (Phi((half_length_px - s) / blur_px) - Phi((-half_length_px - s) / blur_px));
}

// The least-squares fit of greys and offsets. Unknowns: the faces' greys, then offsets, the edge's own first.
class Fitter {
 public:
  Fitter(const ShortEdge& edge, const FacesNear& near, const FaceAreas& areas, double blur_px)
      : areas_(areas), blur_px_(blur_px), num_greys_(static_cast<int>(areas.faces.size())) {
    Add(edge.piece.curve, edge.piece.half_length_px, 0, near);
    if (pieces_.empty()) return;
    std::map<int, int> offset_of;  // by contour
    for (const auto& a : edge.around)
      Add(a.curve, a.half_length_px,
          offset_of.try_emplace(a.contour, 1 + static_cast<int>(offset_of.size())).first->second, near);
    num_offsets_ = 1 + static_cast<int>(offset_of.size());
  }

  // A step is expected where the edge is.
  bool IsStep() const { return !pieces_.empty(); }
  int NumGreys() const { return num_greys_; }

  void AddPixel(const Vector2d& at, Eigen::Index row, Eigen::Index column, double grey) {
    Pixel p{grey, VectorXd(num_greys_), {}};
    for (int i = 0; i < num_greys_; ++i) p.areas[i] = areas_.areas[static_cast<std::size_t>(i)](row, column);
    for (const auto& piece : pieces_)
      p.lengths.push_back(LengthSeen(piece.curve, piece.half_length_px, blur_px_, at));
    pixels_.push_back(std::move(p));
  }

  std::optional<ProfileFit> Fit(double noise) {
    const auto count = static_cast<double>(pixels_.size());
    if (count < num_greys_ + 1 + kMinRedundancy) return std::nullopt;
    double mean = 0, squares = 0;
    for (const auto& p : pixels_) mean += p.grey / count, squares += p.grey * p.grey / count;
    const double scatter = std::sqrt(std::max(1.0, squares - mean * mean));
    const int n = num_greys_ + num_offsets_;
    VectorXd x = VectorXd::Zero(n);
    x.head(num_greys_).setConstant(mean);
    MatrixXd h(n, n);
    VectorXd g(n);
    double var = scatter * scatter, sum_squares = 0;
    const double redundancy = count - num_greys_ - 1;
    constexpr int kIterations = 5;
    constexpr double kMostStepPx = 0.5;
    for (int it = 0; it < kIterations; ++it) {
      sum_squares = Linearise(x, h, g);
      if (it > 0) var = std::max({sum_squares / redundancy, noise * noise, 1e-6});
      AddPriors(x, var, mean, kGreySigma * scatter, h, g);
      VectorXd step = h.ldlt().solve(g);
      if (!step.allFinite()) return std::nullopt;
      if (it == 0) step.tail(num_offsets_).setZero();  // the greys first
      step.tail(num_offsets_) = step.tail(num_offsets_).cwiseMax(-kMostStepPx).cwiseMin(kMostStepPx);
      x += step;
    }
    const MatrixXd covariance = h.ldlt().solve(MatrixXd::Identity(n, n)) * var;
    const Piece& own = pieces_.front();
    ProfileFit fit;
    fit.offset_px = x[num_greys_];
    fit.contrast = x[own.plus] - x[own.minus];
    fit.blur_px = blur_px_;
    fit.rms = std::sqrt(sum_squares / redundancy);
    fit.num_pixels = static_cast<int>(count);
    const double misfit = std::sqrt(std::max(0.0, fit.rms * fit.rms - noise * noise));
    const double pull = kMisfitPull * misfit * blur_px_ * std::sqrt(2 * kPi) / std::abs(fit.contrast);
    fit.sigma_px = std::hypot(std::sqrt(std::max(0.0, covariance(num_greys_, num_greys_))), pull);
    const double contrast_variance = covariance(own.plus, own.plus) + covariance(own.minus, own.minus) -
                                     2 * covariance(own.plus, own.minus);
    if (std::abs(fit.contrast) < kMinSignificance * std::sqrt(std::max(0.0, contrast_variance)))
      return std::nullopt;
    return fit;
  }

 private:
  struct Piece {
    ProfileCurve curve;
    double half_length_px;
    int offset, minus, plus;  // of the offsets and of the greys
  };
  struct Pixel {
    double grey;
    VectorXd areas;               // by face
    std::vector<double> lengths;  // by piece
  };

  void Add(const ProfileCurve& curve, double half_length_px, int offset, const FacesNear& near) {
    const auto grey_at = [&](double side) {
      return static_cast<int>(areas_.IndexOf(near.At(curve.point + side * kBesidePx * curve.normal)));
    };
    const int minus = grey_at(-1), plus = grey_at(1);
    // Beyond the window there may be faces of which it shows nothing.
    if (minus != plus && std::max(minus, plus) < num_greys_)
      pieces_.push_back({curve, half_length_px, offset, minus, plus});
  }

  // Fills the normal equations; returns the sum of squares.
  double Linearise(const VectorXd& x, MatrixXd& h, VectorXd& g) const {
    h.setZero();
    g.setZero();
    double sum = 0;
    VectorXd row(x.size());
    for (const auto& p : pixels_) {
      row.setZero();
      row.head(num_greys_) = p.areas;
      double value = p.areas.dot(x.head(num_greys_));
      for (std::size_t i = 0; i < pieces_.size(); ++i) {
        const double length = p.lengths[i];
        if (length == 0) continue;
        const Piece& piece = pieces_[i];
        const double offset = x[num_greys_ + piece.offset], step = x[piece.minus] - x[piece.plus];
        value += offset * step * length;
        row[piece.minus] += offset * length;
        row[piece.plus] -= offset * length;
        row[num_greys_ + piece.offset] += step * length;
      }
      const double r = p.grey - value;
      sum += r * r;
      g += row * r;
      h += row * row.transpose();
    }
    return sum;
  }

  // What is known beforehand, as observations of variance in units of the pixels' `var`.
  void AddPriors(const VectorXd& x, double var, double mean, double grey_sigma, MatrixXd& h,
                 VectorXd& g) const {
    for (int i = 0; i < num_greys_; ++i) {
      const double w = var / (grey_sigma * grey_sigma);
      h(i, i) += w;
      g[i] += w * (mean - x[i]);
    }
    for (int j = num_greys_ + 1; j < x.size(); ++j) {
      const double w = var / (kOthersSigmaPx * kOthersSigmaPx);
      h(j, j) += w;
      g[j] -= w * x[j];
    }
    h(num_greys_, num_greys_) += 1e-6;  // where no pixel sees it
  }

  const FaceAreas& areas_;
  double blur_px_;
  int num_greys_, num_offsets_ = 1;
  std::vector<Piece> pieces_;
  std::vector<Pixel> pixels_;
};

}  // namespace

FacesSeen::FacesSeen(std::span<const WorldSolid> solids, const View& view) {
  constexpr double kMinDepthMm = 1;
  int face = 0;
  for (const auto& solid : solids)
    for (const auto& f : solid.faces) {
      ++face;
      for (const auto& t : f.triangles) {
        std::array<Vector3d, 3> p;
        for (std::size_t i = 0; i < 3; ++i) p[i] = view.cam_from_world * t[i];
        Triangle triangle{p[0], p[1] - p[0], p[2] - p[0], {}, face};
        if (triangle.ab.cross(triangle.ac).dot(p[0]) >= 0) continue;  // turned away
        int before = 0;
        for (const auto& q : p)
          if (q.z() > kMinDepthMm)
            triangle.in_normalized.extend(Vector2d(q.x() / q.z(), q.y() / q.z())), ++before;
        if (before == 0) continue;
        constexpr double kAnywhere = 1e9;
        if (before < 3)
          triangle.in_normalized = {Vector2d::Constant(-kAnywhere), Vector2d::Constant(kAnywhere)};
        triangles_.push_back(triangle);
      }
    }
}

std::vector<FacesSeen::Triangle> FacesSeen::In(const AlignedBox2d& normalized) const {
  std::vector<Triangle> out;
  for (const auto& t : triangles_)
    if (t.in_normalized.intersects(normalized)) out.push_back(t);
  return out;
}

int FacesSeen::First(std::span<const Triangle> triangles, const Vector2d& normalized) {
  const Vector3d d(normalized.x(), normalized.y(), 1);
  double nearest = INFINITY;
  int face = 0;
  // Moeller and Trumbore 1997.
  for (const auto& t : triangles) {
    if (!t.in_normalized.contains(normalized)) continue;
    const Vector3d h = d.cross(t.ac);
    const double det = t.ab.dot(h);
    if (det == 0) continue;
    const double u = -t.a.dot(h) / det;
    if (u < 0 || u > 1) continue;
    const Vector3d q = -t.a.cross(t.ab);
    const double v = d.dot(q) / det;
    if (v < 0 || u + v > 1) continue;
    const double depth = t.ac.dot(q) / det;
    if (depth > 0 && depth < nearest) nearest = depth, face = t.face;
  }
  return face;
}

std::optional<ProfileFit> FitShortEdge(const GreyView& image, const View& view, const FacesSeen& faces,
                                       const ShortEdge& edge, double blur_px, double noise,
                                       double search_px) {
  const Vector2d& middle = edge.piece.curve.point;
  const Vector2d reach = Vector2d::Constant(edge.piece.half_length_px + kWindowBlurs * blur_px + 1);
  const Vector2d first = middle - reach, last = middle + reach;
  if (!(first.minCoeff() >= 0) || !(last.x() < image.width - 1) || !(last.y() < image.height - 1))
    return std::nullopt;
  const AlignedBox2i window(first.cast<int>(), last.array().ceil().matrix().cast<int>());
  const FacesNear near(faces, view, middle, reach.x() + PadOf(blur_px) + 1);
  if (!near.IsValid()) return std::nullopt;
  const FaceAreas areas = AreasIn(window, near, blur_px);
  Fitter fitter(edge, near, areas, blur_px);
  if (!fitter.IsStep()) return std::nullopt;
  const int limit = static_cast<int>(image.MaxValue());
  for (int v = window.min().y(); v <= window.max().y(); ++v)
    for (int u = window.min().x(); u <= window.max().x(); ++u) {
      if (!IsInWindow(edge, blur_px, Vector2d(u, v))) continue;
      const int grey = image.At(u, v);
      if (grey >= limit) return std::nullopt;
      fitter.AddPixel(Vector2d(u, v), v - window.min().y(), u - window.min().x(), grey);
    }
  const auto fit = fitter.Fit(noise);
  if (!fit || !(std::abs(fit->offset_px) <= std::min(search_px, kFarthestPx))) return std::nullopt;
  return fit;
}

GreyMisfit MisfitOfGreys(const GreyView& image, const View& view, const FacesSeen& faces,
                         const AlignedBox2i& window, double blur_px) {
  const Vector2d middle = (window.min() + window.max()).cast<double>() / 2;
  const Vector2i size = window.sizes() + Vector2i::Ones();
  const FacesNear near(faces, view, middle, size.maxCoeff() / 2.0 + PadOf(blur_px) + 1);
  GreyMisfit out;
  if (!near.IsValid()) return out;
  const FaceAreas areas = AreasIn(window, near, blur_px);
  const auto n = static_cast<Eigen::Index>(areas.faces.size());
  MatrixXd basis(Eigen::Index(size.x()) * size.y(), n);
  for (Eigen::Index i = 0; i < n; ++i)
    basis.col(i) = areas.areas[static_cast<std::size_t>(i)].reshaped().matrix();
  VectorXd greys(basis.rows());
  for (int u = 0; u < size.x(); ++u)
    for (int v = 0; v < size.y(); ++v)
      greys[u * size.y() + v] = image.At(window.min().x() + u, window.min().y() + v);
  greys.array() -= greys.mean();
  const MatrixXd h = basis.transpose() * basis + MatrixXd::Identity(n, n) / (kGreySigma * kGreySigma);
  const VectorXd levels = h.ldlt().solve(basis.transpose() * greys);
  out.sum_squares = (greys - basis * levels).squaredNorm();
  out.num_pixels = static_cast<int>(greys.size());
  return out;
}

}  // namespace vss
