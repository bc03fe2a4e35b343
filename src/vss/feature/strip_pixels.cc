#include "vss/feature/strip_pixels.h"

#include <algorithm>
#include <cmath>

namespace vss {
namespace {

using Eigen::Vector2d;

// A neighbour as the columns ask for it.
StripObstacle ObstacleOf(const StripNeighbour& n, double margin) {
  const Vector2d d = n.to - n.from;
  const double length = d.norm();
  StripObstacle o{n.from, n.to, 0, 0, length, 0, 1, 0};
  if (!(length > 0)) return o;  // stands nowhere
  o.along = d.x() / length, o.across = d.y() / length;
  o.reach = margin / std::max(std::abs(o.along), 1e-3);
  o.first = std::min(n.from.x(), n.to.x()) - margin, o.last = std::max(n.from.x(), n.to.x()) + margin;
  return o;
}

// Takes from the window at place `a` what an obstacle there spoils: empty (low
// > high) where it crosses.
void Clip(double a, const StripObstacle& n, double margin, StripWindow& window) {
  constexpr double kUpright = 1e-3, kSteep = 0.2;
  const double position = std::abs(n.along) > kUpright ? (a - n.from.x()) / n.along : 0;
  if (std::abs(n.along) > kUpright && (position < -margin || position > n.length + margin)) {
    // The neighbour has ended before this column: only its end's surroundings
    // count.
    const Vector2d end = position < 0 ? n.from : n.to;
    if (std::abs(a - end.x()) > margin) return;
    if (end.y() > 0)
      window.high = std::min(window.high, end.y() - margin);
    else
      window.low = std::max(window.low, end.y() + margin);
    return;
  }
  if (std::abs(n.along) <= kSteep) {  // it crosses the column's whole height nearby
    const double low = std::min(n.from.y(), n.to.y()) - margin,
                 high = std::max(n.from.y(), n.to.y()) + margin;
    if (low < 0 && high > 0)
      window = {1, -1};
    else if (low >= 0)
      window.high = std::min(window.high, low);
    else
      window.low = std::max(window.low, high);
    return;
  }
  const double t = n.from.y() + position * n.across;
  if (t > 0)
    window.high = std::min(window.high, t - n.reach);
  else
    window.low = std::max(window.low, t + n.reach);
}

struct StripGeometry {
  bool steep, bent;  // columns are rows of the picture; the lens bends the edge
  double along_major, along_minor, across_major, across_minor, middle_major, middle_minor;
};

StripGeometry GeometryOf(const StripFrame& f) {
  const bool steep = std::abs(f.along.y()) > std::abs(f.along.x());
  const int major = steep ? 1 : 0, minor = 1 - major;
  return {steep,           f.Bent(),        f.along[major],  f.along[minor],
          f.across[major], f.across[minor], f.middle[major], f.middle[minor]};
}

// Whole pixels of a distance that may be beyond any picture: a wild lens makes columns along which t hardly
// changes.
constexpr double kBeyondPictures = 1e8;
int PixelsAbove(double x) {
  return static_cast<int>(std::ceil(std::clamp(x, -kBeyondPictures, kBeyondPictures)));
}
int PixelsBelow(double x) {
  return static_cast<int>(std::floor(std::clamp(x, -kBeyondPictures, kBeyondPictures)));
}

// The pixels of a column from `begin` to `end`, `at` being the first of the picture's.
template <class Pixel>
void AddToWing(const std::uint8_t* column, std::ptrdiff_t stride, int begin, int end, double along,
               double drift, double saturated, StripWing& wing) {
  if (end < begin) return;
  std::int64_t grey = 0, grey_by_place = 0, grey2 = 0, most = 0;
  const std::uint8_t* at = column + begin * stride;
  for (std::int64_t i = 0; i <= end - begin; ++i, at += stride) {
    const std::int64_t y = *reinterpret_cast<const Pixel*>(at);
    grey += y, grey_by_place += i * y, grey2 += y * y, most = std::max(most, y);
  }
  const double n = end - begin + 1, first = along + drift * begin, places = n * (n - 1) / 2,
               places2 = places * (2 * n - 1) / 3;
  wing.n += n, wing.along += n * first + drift * places;
  wing.along2 += n * first * first + 2 * first * drift * places + drift * drift * places2;
  wing.grey += double(grey), wing.grey2 += double(grey2);
  wing.grey_along += first * double(grey) + drift * double(grey_by_place);
  wing.saturated = wing.saturated || double(most) >= saturated;
}

// Where a corner's line is far enough behind that nothing of it shows: the part of the pixels `begin` to
// `end` of a column along which the depth (px) is `depth` + `rate` i.
void ClipAtCorner(double depth, double rate, double blur_px, int& begin, int& end) {
  constexpr double kFarBlurs = 3.5;
  const double at = (kFarBlurs * blur_px - depth) / rate;
  if (std::abs(rate) < 1e-6) {
    if (depth < kFarBlurs * blur_px) end = begin - 1;
  } else if (rate > 0) {
    begin = std::max(begin, PixelsAbove(at));
  } else {
    end = std::min(end, PixelsBelow(at));
  }
}

template <class Pixel>
void TakeColumn(const GreyView& image, const StripFrame& f, const StripGeometry& g, int major,
                const StripSettings& settings, double side_px, StripWindow core, StripBuffers& b,
                std::size_t& count) {
  // On the column (a row for steep edges) t runs linearly with the pixel;
  // `rate`: of t, `drift`: of a.
  double a = (major - g.middle_major) / g.along_major;
  double sag = 0, slope = 0;
  if (g.bent) a = (major - g.middle_major - f.Sag(a) * g.across_major) / g.along_major, sag = f.Sag(a);
  if (a < f.from || a > f.to) return;
  const double place = g.middle_minor + a * g.along_minor + sag * g.across_minor;
  if (!(std::abs(place) < kBeyondPictures)) return;
  const int centre = static_cast<int>(std::floor(place + 0.5));
  const double d_major = major - g.middle_major, d_minor = centre - g.middle_minor;
  const double a0 = g.along_major * d_major + g.along_minor * d_minor;
  if (g.bent) sag = f.Sag(a0), slope = f.SagSlope(a0);
  const double t0 = g.across_major * d_major + g.across_minor * d_minor - sag;
  const double rate = g.across_minor - slope * g.along_minor, drift = g.along_minor;
  constexpr double kMinRate = 1e-3;  // of a lens that bends the edge into the column, which is none
  if (!(std::abs(rate) > kMinRate)) return;
  const double beyond = settings.wide_px - settings.reach_px;
  StripWindow window = {core.low - beyond, core.high + beyond};
  for (const auto& o : b.obstacles)
    if (a >= o.first && a <= o.last) Clip(a, o, settings.margin_px, window);
  core = {std::max(core.low, window.low), std::min(core.high, window.high)};
  if (core.high < side_px || core.low > -side_px) return;
  double first = (core.low - t0) / rate, last = (core.high - t0) / rate;
  if (first > last) std::swap(first, last);
  const int size = g.steep ? image.width : image.height;
  const int begin = std::max(centre + PixelsAbove(first), 0),
            end = std::min(centre + PixelsBelow(last), size - 1);
  if (end - begin < 2) return;
  const std::size_t n = std::size_t(end - begin) + 1;
  if (count + n + StripBuffers::kSpare > b.grey.size()) b.Grow(2 * (count + n + StripBuffers::kSpare));
  const auto* base = static_cast<const std::uint8_t*>(image.data);
  const std::ptrdiff_t stride = g.steep ? std::ptrdiff_t(sizeof(Pixel)) : image.stride_bytes;
  const std::uint8_t* at = base + (g.steep ? major * image.stride_bytes + begin * stride
                                           : begin * stride + major * std::ptrdiff_t(sizeof(Pixel)));
  float* __restrict along = &b.along[count], * __restrict across = &b.across[count], * __restrict grey = &b.grey[count];
  const float along0 = static_cast<float>(a0 + drift * (begin - centre)), along1 = static_cast<float>(drift);
  const float across0 = static_cast<float>(t0 + rate * (begin - centre)), across1 = static_cast<float>(rate);
  // Whole lots, some of it beyond the column's end into the spare room.
  constexpr int kLot = 16;
  static_assert(kLot <= StripBuffers::kSpare);
  for (int first = 0; first < static_cast<int>(n); first += kLot)
    for (int i = first; i < first + kLot; ++i) {
      along[i] = along0 + along1 * static_cast<float>(i);
      across[i] = across0 + across1 * static_cast<float>(i);
    }
  for (std::size_t i = 0; i < n; ++i, at += stride)
    grey[i] = static_cast<float>(*reinterpret_cast<const Pixel*>(at));
  if (beyond > 0) {
    const std::uint8_t* column =
        base + (g.steep ? major * image.stride_bytes : major * std::ptrdiff_t(sizeof(Pixel)));
    double far_first = (window.low - t0) / rate, far_last = (window.high - t0) / rate;
    if (far_first > far_last) std::swap(far_first, far_last);
    const int range[2][2] = {{std::max(centre + PixelsAbove(far_first), 0), begin - 1},
                             {end + 1, std::min(centre + PixelsBelow(far_last), size - 1)}};
    for (const int side : {0, 1}) {
      int from = range[side][0], to = range[side][1];
      for (const auto& c : settings.corners) {
        const Vector2d inward = settings.dark_corners ? Vector2d(-c.bright) : c.bright;
        const double by_major = inward[g.steep ? 1 : 0], by_minor = inward[g.steep ? 0 : 1],
                     depth =
                         by_major * (major - c.point[g.steep ? 1 : 0]) - by_minor * c.point[g.steep ? 0 : 1];
        ClipAtCorner(depth, by_minor, settings.start_blur_px, from, to);
      }
      AddToWing<Pixel>(column, stride, from, to, a0 - drift * centre, drift, image.MaxValue(),
                       b.wing[(side == 0) == (rate > 0) ? 0 : 1]);
    }
  }
  count += n;
  b.column_start.push_back(static_cast<std::uint32_t>(count));
  b.column_along.push_back(static_cast<float>(a));
}

}  // namespace

std::size_t TakePixels(const GreyView& image, const StripFrame& f, std::span<const StripNeighbour> neighbours,
                       const StripSettings& settings, double side_px, StripWindow window, StripBuffers& b) {
  b.column_along.clear(), b.obstacles.clear();
  b.column_start.assign(1, 0);
  b.wing[0] = b.wing[1] = {};
  for (const auto& n : neighbours) b.obstacles.push_back(ObstacleOf(n, settings.margin_px));
  const StripGeometry g = GeometryOf(f);
  const int major = g.steep ? 1 : 0;
  const Vector2d p = f.middle + f.from * f.along, q = f.middle + f.to * f.along;
  const double low = std::min(p[major], q[major]), high = std::max(p[major], q[major]);
  const double spare = 2 + (g.bent ? std::max(std::abs(f.Sag(f.from)), std::abs(f.Sag(f.to))) : 0);
  const int size = g.steep ? image.height : image.width;
  const int begin = std::max(0, static_cast<int>(std::floor(low - spare))),
            end = std::min(size - 1, static_cast<int>(std::ceil(high + spare)));
  std::size_t count = 0;
  for (int m = begin; m <= end; m += settings.column_step) {
    if (image.bits == 8)
      TakeColumn<std::uint8_t>(image, f, g, m, settings, side_px, window, b, count);
    else
      TakeColumn<std::uint16_t>(image, f, g, m, settings, side_px, window, b, count);
  }
  return count;
}

}  // namespace vss
