// Hostile pictures, lenses, options and picture files, drawn by a seed: lines_fuzz [SEED] [ROUNDS]. Exits
// with 1 and the seed of the round where something is wrong that the program itself can see; built with
// VSS_SANITIZE it also sees accesses outside of the picture and undefined arithmetic.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "vss/feature/line_image.h"

using namespace vss;

namespace {

struct Draw {
  std::mt19937 random;

  int Int(int low, int high) { return low + int(random() % unsigned(high - low + 1)); }
  double Real(double low, double high) { return low + (high - low) * double(random()) / 4294967295.0; }
  bool Chance(double share) { return Real(0, 1) < share; }
};

// A view whose pixels end where its memory ends, its rows as far apart as drawn (backwards, too).
struct Picture {
  std::vector<std::uint8_t> bytes;
  GreyView view;
};

void Fill(Draw& d, GreyView& view, std::uint8_t* first) {
  const int kind = d.Int(0, 7), most = int(view.MaxValue()), cell = d.Int(1, 30), low = d.Int(0, most),
            high = d.Int(0, most), noise = d.Chance(0.5) ? d.Int(0, most / 4) : 0;
  const double cu = d.Real(0, view.width), cv = d.Real(0, view.height), r = d.Real(0, 60),
               turn = d.Real(0, 6.3);
  for (int v = 0; v < view.height; ++v)
    for (int u = 0; u < view.width; ++u) {
      const double across = std::cos(turn) * (u - cu) + std::sin(turn) * (v - cv);
      bool bright = false;
      switch (kind) {
        case 0:
          bright = (u / cell + v / cell) % 2 == 0;
          break;
        case 1:
          bright = std::hypot(u - cu, v - cv) < r;
          break;
        case 2:
          bright = across > 0;
          break;
        case 3:
          bright = std::abs(across) < 0.1 * cell;
          break;
        case 4:
          bright = d.Chance(0.5);
          break;
        case 5:
          bright = std::fmod(std::hypot(u - cu, (v - cv) * 3), cell) < 0.5 * cell;
          break;
        case 6:
          bright = std::sin(0.01 * cell * (u - cu) * (v - cv)) > 0;
          break;
        default:
          break;
      }
      const int value = std::clamp((bright ? high : low) + (noise > 0 ? d.Int(-noise, noise) : 0), 0, most);
      std::uint8_t* at = first + v * view.stride_bytes + u * (view.bits / 8);
      const auto wide = static_cast<std::uint16_t>(value);
      if (view.bits == 8)
        *at = static_cast<std::uint8_t>(value);
      else
        std::memcpy(at, &wide, 2);
    }
}

Picture DrawPicture(Draw& d) {
  Picture out;
  GreyView& v = out.view;
  const int longest = d.Chance(0.1) ? 700 : 90;
  v.bits = d.Chance(0.5) ? 8 : 16;
  v.width = d.Int(1, longest), v.height = d.Int(1, longest);
  const std::ptrdiff_t row = std::ptrdiff_t(v.width) * (v.bits / 8), gap = d.Int(0, 3) * 2;
  out.bytes.resize(std::size_t((row + gap) * (v.height - 1) + row));
  const bool backwards = d.Chance(0.2);
  std::uint8_t* first = out.bytes.data() + (backwards ? (row + gap) * (v.height - 1) : 0);
  v.stride_bytes = backwards ? -(row + gap) : row + gap;
  v.data = first;
  Fill(d, v, first);
  return out;
}

Intrinsics DrawLens(Draw& d, const GreyView& v) {
  Intrinsics lens;
  const int model = d.Int(0, 2);
  lens.model = model == 0 ? LensModel::kPinhole : model == 1 ? LensModel::kOpenCv : LensModel::kWeng;
  lens.fx_px = d.Real(1, 2000), lens.fy_px = lens.fx_px * d.Real(0.5, 2);
  lens.cx_px = d.Real(-v.width, 2 * v.width), lens.cy_px = d.Real(-v.height, 2 * v.height);
  lens.num_distortion = model == 0 ? 0 : 6;
  const double size = std::pow(10.0, d.Real(-4, 1));
  for (int i = 0; i < lens.num_distortion; ++i) lens.distortion[std::size_t(i)] = d.Real(-size, size);
  lens.pixel_pitch_v_mm = 0.005;
  return lens;
}

LineOptions DrawOptions(Draw& d) {
  LineOptions options;
  for (const auto& p : LineParameters())
    if (d.Chance(0.3))
      (void)SetParameter(LineParameters(), p.name, std::round(d.Real(p.min, std::min(p.max, 40.0))), options);
  return options;
}

bool IsSound(const LineImage& lines) {
  for (const auto& s : lines.segments) {
    if (!s.start.allFinite() || !s.end.allFinite() || !s.ideal_start.allFinite() || !s.ideal_end.allFinite())
      return false;
    if (!(s.sigma_offset_px >= 0) || !(s.sigma_angle_rad >= 0) || !std::isfinite(s.contrast + s.blur_px))
      return false;
    const int count = int(lines.segments.size());
    if (s.start_junction >= count || s.end_junction >= count) return false;
  }
  for (const auto& a : lines.arcs)
    if (!a.center.allFinite() || !a.axes.allFinite() || !a.covariance.allFinite() || !(a.from_rad < a.to_rad))
      return false;
  return true;
}

// A file of a picture, with bytes changed, left out or repeated: reading it gives a picture or an error.
void ReadSpoiled(Draw& d, const std::filesystem::path& file) {
  GreyImage image(d.Int(1, 60), d.Int(1, 60), 8);
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u) image.Row8(v)[u] = static_cast<std::uint8_t>(d.Int(0, 255));
  std::vector<std::uint8_t> bytes;
  const int kind = d.Int(0, 2);
  if (kind == 0) {
    bytes = EncodePng(image.view());
  } else if (kind == 1) {
    bytes = EncodeJpeg(image.view(), d.Int(1, 100));
  } else {
    const std::string header =
        fmt::format("P5\n{} {}\n{}\n", image.width(), image.height(), d.Chance(0.5) ? 255 : 65535);
    bytes.assign(header.begin(), header.end());
    for (int v = 0; v < image.height(); ++v)
      bytes.insert(bytes.end(), image.Row8(v), image.Row8(v) + image.width());
  }
  for (int i = d.Int(0, 4); i > 0; --i)
    bytes[std::size_t(d.Int(0, int(bytes.size()) - 1))] = static_cast<std::uint8_t>(d.Int(0, 255));
  if (d.Chance(0.5)) bytes.resize(std::size_t(d.Int(0, int(bytes.size()))));
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  (void)ReadImageSize(file);
  if (const auto read = ReadImage(file)) DetectLines(read->view(), nullptr, {});
}

}  // namespace

int main(int argc, char** argv) {
  const unsigned seed = argc > 1 ? unsigned(std::strtoul(argv[1], nullptr, 10)) : 1;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 1000;
  const auto file = std::filesystem::temp_directory_path() / fmt::format("vss-lines-fuzz-{}", seed);
  LineWorkspace workspace;
  std::size_t segments = 0, arcs = 0;
  for (int i = 0; i < rounds; ++i) {
    Draw d{std::mt19937(seed + unsigned(i))};
    const Picture picture = DrawPicture(d);
    const Intrinsics lens = DrawLens(d, picture.view);
    const Intrinsics* known = d.Chance(0.5) ? &lens : nullptr;
    const LineOptions options = DrawOptions(d);
    const LineImage kept = DetectLines(picture.view, known, options, &workspace);
    if (!IsSound(kept)) {
      fmt::print("round of seed {}: a line is not finite, or meets one that is not there\n",
                 seed + unsigned(i));
      return 1;
    }
    if (LineImageToJson(DetectLines(picture.view, known, options)) != LineImageToJson(kept)) {
      fmt::print("round of seed {}: a used workspace gives other lines than a new one\n", seed + unsigned(i));
      return 1;
    }
    segments += kept.segments.size(), arcs += kept.arcs.size();
    ReadSpoiled(d, file);
  }
  std::filesystem::remove(file);
  fmt::print("{} rounds, {} segments, {} arcs\n", rounds, segments, arcs);
  return segments > std::size_t(rounds) && arcs > 0 ? 0 : 1;  // else the pictures show nothing
}
